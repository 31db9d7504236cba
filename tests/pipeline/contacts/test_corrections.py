"""Corrections as data: applied to contacts, kept in a file, edited with undo and redo."""

import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contacts import corrections
from pipeline.contacts.corrections import (
    CONFIRMED,
    CONTACT,
    FREE,
    Verdict,
    applicable,
    apply,
    table_of,
    verdicts,
)
from pipeline.curate.review import EditError, Review, Span
from pipeline.errors import CorrectionsError

N_FRAMES = 120


def detected(*spans, whisker="C2"):
    """Table of detected contacts, as contacts/analysis makes it, with columns of its own."""
    return pd.DataFrame(
        {
            "whisker": pd.Series([whisker] * len(spans), dtype="object"),
            "onset_frame": np.array([a for a, _ in spans], np.int64),
            "offset_frame": np.array([b for _, b in spans], np.int64),
            "probability": np.linspace(0.9, 0.99, len(spans)),
            "slip": np.ones(len(spans), bool),
            "flags": [f"flag{i}" for i in range(len(spans))],
        }
    )


def verdict(kind, span, cover=None, whisker="C2"):
    return Verdict(whisker, kind, *span, *(cover or span), "2024-01-01T00:00:00+00:00")


def spans(table):
    return list(zip(table["onset_frame"], table["offset_frame"], strict=True))


def review(*found, corrections=None):
    saved = []
    empty = table_of([])
    made = Review(detected(*found), empty if corrections is None else corrections, N_FRAMES,
                  saved.append)  # fmt: skip
    return made, saved


# ---- applying ------------------------------------------------------------------------------


def test_nothing_said_changes_nothing():
    found = detected((10, 20), (30, 45))
    out = apply(found, table_of([]))
    pd.testing.assert_frame_equal(out.drop(columns="curated"), found)
    assert not out["curated"].any()


def test_added_contact_has_no_other_columns():
    out = apply(detected((10, 20)), table_of([verdict(CONTACT, (50, 60))]))
    assert spans(out) == [(10, 20), (50, 60)]
    added = out.iloc[1]
    assert added["curated"]
    assert np.isnan(added["probability"])
    assert added["flags"] == ""
    assert not added["slip"]


def test_moved_contact_keeps_what_is_known_of_it():
    out = apply(detected((10, 20)), table_of([verdict(CONTACT, (8, 25), (8, 25))]))
    assert spans(out) == [(8, 25)]
    assert out["flags"].tolist() == ["flag0"]
    assert out["curated"].tolist() == [True]


def test_confirmed_contact_is_the_programs_own():
    rows = table_of([verdict(CONFIRMED, (10, 20))])
    assert apply(detected((10, 20)), rows)["curated"].tolist() == [False]
    moved_since = apply(detected((9, 21)), rows)
    assert spans(moved_since) == [(10, 20)]
    assert moved_since["curated"].tolist() == [True]


def test_a_later_detection_that_joins_two_gives_way_only_where_a_person_spoke():
    out = apply(detected((10, 32)), table_of([verdict(CONTACT, (10, 22))]))
    assert spans(out) == [(10, 22)]  # 12 of its 22 frames are spoken of: it gives way whole
    out = apply(detected((10, 40)), table_of([verdict(CONTACT, (10, 22))]))
    assert spans(out) == [(10, 22), (22, 40)]
    assert out["curated"].tolist() == [True, True]


def test_no_sliver_is_left_of_a_contact_that_is_detected_a_little_wider_later():
    assert spans(apply(detected((8, 21)), table_of([verdict(CONTACT, (10, 20))]))) == [(10, 20)]
    assert spans(apply(detected((8, 21)), table_of([verdict(FREE, (10, 20))]))) == []


def test_other_whiskers_are_left_alone():
    both = pd.concat([detected((10, 20)), detected((10, 20), whisker="C1")])
    out = apply(both, table_of([verdict(FREE, (10, 20), whisker="C1")]))
    assert out["whisker"].tolist() == ["C2"]


stretch = st.tuples(st.integers(0, 40), st.integers(1, 15)).map(lambda p: (p[0], p[0] + p[1]))


@settings(deadline=None)
@given(st.lists(stretch, max_size=4), st.lists(st.tuples(stretch, st.booleans()), max_size=4))
def test_frames_a_verdict_speaks_of_are_as_it_says(found, said):
    """Whatever was detected: stated contacts are there, and in free stretches nothing else."""
    rows = [verdict(CONTACT if touch else FREE, span) for span, touch in said]
    out = spans(apply(detected(*found), table_of(rows)))
    for row in rows:
        if row.verdict == CONTACT:
            assert row.span in out
    stated = {row.span for row in rows if row.verdict == CONTACT}
    for onset, offset in (span for span in out if span not in stated):
        assert not any(corrections.overlap((onset, offset), row.cover) for row in rows)
        assert any(a <= onset and offset <= b for a, b in found)


# ---- the file ------------------------------------------------------------------------------


def test_corrections_survive_the_file(tmp_path):
    rows = table_of([verdict(CONTACT, (8, 25), (5, 30)), verdict(FREE, (40, 50), whisker="ü, 1")])
    corrections.write_corrections(tmp_path, rows)
    pd.testing.assert_frame_equal(corrections.read_corrections(tmp_path), rows)
    assert [p.name for p in tmp_path.glob("[!.]*")] == ["corrections.csv"]


def test_a_file_edited_by_hand_is_kept_when_it_is_written_anew(tmp_path):
    corrections.write_corrections(tmp_path, table_of([verdict(CONTACT, (8, 25), (5, 30))]))
    path = tmp_path / "corrections.csv"
    edited = path.read_text() + "C2,free,40,50,40,50,,me\n"
    path.write_text(edited)
    corrections.write_corrections(tmp_path, table_of([verdict(FREE, (40, 50))]))
    assert (tmp_path / "corrections.csv.old").read_text() == edited


def test_no_file_is_no_corrections(tmp_path):
    assert corrections.read_corrections(tmp_path).empty


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (verdict("perhaps", (10, 20)), "expected one of contact, confirmed, free"),
        (verdict(CONTACT, (20, 20)), "expected 0 <= onset_frame < offset_frame"),
        (verdict(CONTACT, (10, 20), (12, 20)), "must contain onset and offset"),
    ],
)
def test_a_broken_file_is_named_with_its_line(tmp_path, row, message):
    corrections.write_corrections(tmp_path, table_of([verdict(FREE, (1, 2)), row]))
    with pytest.raises(CorrectionsError, match=f"corrections.csv: line 3: .*{message}"):
        corrections.read_corrections(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("40", "soon", 1), "line 3: onset_frame is 'soon', expected a whole number"),
        (("40,", "40,41,", 1), "line 3"),
        (("covers_to", "covers", 1), "expected column covers_to"),
        ((",", ";", -1), "separated by semicolons.* expected commas"),
    ],
)
def test_a_file_edited_by_hand_is_named_with_its_line(tmp_path, change, message):
    rows = table_of([verdict(FREE, (1, 2)), verdict(FREE, (40, 50), (39, 51))])
    corrections.write_corrections(tmp_path, rows)
    path = tmp_path / "corrections.csv"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(
        CorrectionsError, match=f"corrections.csv: .*{message}.*; correct"
    ) as caught:
        corrections.read_corrections(tmp_path)
    assert "run" not in str(caught.value).replace(str(tmp_path), "")


def test_two_contacts_at_once_are_refused_with_their_lines(tmp_path):
    """A row that was copied would count a contact, and its force, twice."""
    first, other = verdict(CONTACT, (10, 20)), verdict(CONTACT, (10, 20))._replace(whisker="C3")
    for again in (first, verdict(CONFIRMED, (19, 25)), verdict(CONTACT, (5, 11))):
        rows = table_of([first, verdict(FREE, (0, 40)), other, again])
        corrections.write_corrections(tmp_path, rows)
        with pytest.raises(CorrectionsError, match=r"line \d: contact .* of 'C2' .* in line \d"):
            corrections.read_corrections(tmp_path)
    rows = table_of([first, verdict(FREE, (0, 40)), other, verdict(CONTACT, (20, 25))])
    corrections.write_corrections(tmp_path, rows)
    assert len(corrections.read_corrections(tmp_path)) == 4


@pytest.mark.parametrize("denied", [(10, 20), (12, 15)])
def test_a_contact_that_another_row_denies_is_refused_with_both_lines(tmp_path, denied):
    stated, other = verdict(CONTACT, (10, 20)), verdict(FREE, (30, 40))
    corrections.write_corrections(tmp_path, table_of([other, stated, verdict(FREE, denied)]))
    with pytest.raises(CorrectionsError) as caught:
        corrections.read_corrections(tmp_path)
    assert "corrections.csv: line 4: no contact of 'C2' in" in str(caught.value)
    assert "but line 3 has contact (10, 20) there: delete one of the two" in str(caught.value)
    fits = [stated, verdict(FREE, denied, whisker="C3"), verdict(FREE, (20, 25))]
    corrections.write_corrections(tmp_path, table_of(fits))
    assert len(corrections.read_corrections(tmp_path)) == 3


def test_what_spreadsheets_leave_is_read_and_lines_are_counted_as_they_show_them(tmp_path):
    rows = table_of([verdict(FREE, (1, 2)), verdict(FREE, (40, 50))])
    corrections.write_corrections(tmp_path, rows)
    path = tmp_path / "corrections.csv"
    header, first, second = path.read_text().splitlines()
    emptied = "," * header.count(",")
    text = "\r\n".join([header, emptied, first, "", second, emptied, ""])
    path.write_text(text, encoding="utf-8-sig", newline="")
    assert corrections.read_corrections(tmp_path).equals(rows)
    path.write_text(text.replace("40", "40.0"), newline="")  # of pandas, where one is missing
    assert corrections.read_corrections(tmp_path).equals(rows)
    path.write_text(text.replace("40", "soon"), newline="")
    with pytest.raises(CorrectionsError, match="line 5: onset_frame is 'soon'"):
        corrections.read_corrections(tmp_path)
    path.write_text(text.replace("free,40", "none,40"), newline="")
    with pytest.raises(CorrectionsError, match="line 5: verdict is 'none'"):
        corrections.read_corrections(tmp_path)


def test_letters_of_another_encoding_are_told_how_to_be_saved(tmp_path):
    rows = table_of([verdict(FREE, (1, 2))._replace(saved_by="Jörg")])
    corrections.write_corrections(tmp_path, rows)
    path = tmp_path / "corrections.csv"
    path.write_bytes(path.read_bytes().decode().encode("cp1252"))
    with pytest.raises(CorrectionsError, match="not UTF-8; save it as `CSV UTF-8`"):
        corrections.read_corrections(tmp_path)


# ---- editing -------------------------------------------------------------------------------


def test_a_contact_beyond_the_videos_end_is_confirmed_without_another():
    stated = verdict(CONTACT, (90, 120))
    edited = Review(detected(), table_of([stated]), 100, lambda table: None, ["C2"])
    assert edited.spans == [Span("C2", 90, 100)]
    edited.confirm(edited.spans[0])
    assert edited.verdicts == (stated,)
    edited.move(edited.spans[0], onset=95)
    assert [v.span for v in edited.verdicts] == [(95, 100)]


def test_every_edit_is_saved_and_can_be_undone_and_redone():
    edited, saved = review((10, 20), (30, 45))
    edited.delete(Span("C2", 10, 20))
    edited.add("C2", 50, 60)
    edited.move(Span("C2", 30, 45), offset=40)
    after = edited.spans
    assert [s[1:] for s in after] == [(30, 40), (50, 60)]
    assert len(saved) == 3
    while edited.undo():
        pass
    assert [s[1:] for s in edited.spans] == [(10, 20), (30, 45)]
    assert saved[-1].empty
    while edited.redo():
        pass
    assert edited.spans == after
    assert len(saved) == 9
    again, _ = review((10, 20), (30, 45), corrections=saved[-1])
    assert again.spans == after


def test_an_edit_that_cannot_be_saved_changes_nothing_and_is_said():
    edited, saved = review((10, 20), (30, 45))
    edited.delete(Span("C2", 10, 20))
    edited.delete(Span("C2", 30, 45))
    edited.undo()
    before, save = edited.spans, edited._save

    def refuse(corrections):
        raise OSError(28, "No space left on device")

    edited._save = refuse
    for edit in (edited.undo, edited.redo, lambda: edited.add("C2", 50, 60)):
        with pytest.raises(EditError, match=r"cannot be saved \(No space left on device\)"):
            edit()
        assert edited.spans == before
    edited._save = save
    assert edited.redo()
    assert not edited.spans
    assert edited.undo()
    assert edited.undo()
    assert not edited.undo()
    assert [s[1:] for s in edited.spans] == [(10, 20), (30, 45)]
    assert saved[-1].empty


def test_a_new_edit_forgets_what_was_undone():
    edited, _ = review((10, 20))
    edited.delete(Span("C2", 10, 20))
    edited.undo()
    edited.add("C2", 30, 40)
    assert not edited.redo()


def test_added_then_deleted_leaves_no_verdict():
    edited, _ = review((10, 20))
    edited.delete(edited.add("C2", 30, 40))
    assert edited.corrections.empty


def test_deleting_a_moved_contact_deletes_what_was_detected_there():
    edited, _ = review((10, 20))
    moved = edited.move(Span("C2", 10, 20), onset=15, offset=30)
    edited.delete(moved)
    assert edited.spans == []
    assert edited.dismissed(Span("C2", 10, 20))


def test_deleting_a_confirmed_contact_deletes_it():
    edited, _ = review((10, 20))
    edited.confirm(Span("C2", 10, 20))
    edited.delete(Span("C2", 10, 20))
    assert edited.spans == []


def test_moving_an_edge_back_confirms():
    edited, _ = review((10, 20))
    moved = edited.move(Span("C2", 10, 20), offset=25)
    assert edited.intervals["curated"].tolist() == [True]
    edited.move(moved, offset=20)
    assert edited.spans == [Span("C2", 10, 20)]
    assert edited.intervals["curated"].tolist() == [False]
    assert edited.corrections["verdict"].tolist() == [CONFIRMED]


def test_confirming_keeps_the_contact_the_programs_own():
    edited, saved = review((10, 20))
    edited.confirm(Span("C2", 10, 20))
    assert edited.intervals["curated"].tolist() == [False]
    assert saved[-1]["verdict"].tolist() == [CONFIRMED]
    edited.confirm(Span("C2", 10, 20))
    assert len(saved) == 1


def test_a_contact_that_reaches_over_a_deleted_one_takes_its_place():
    for extend in (lambda e: e.move(Span("C2", 30, 45), onset=8), lambda e: e.merge(e.spans[0])):
        edited, saved = review((5, 8), (10, 20), (30, 45))
        edited.delete(Span("C2", 10, 20))
        extend(edited)
        assert [each.verdict for each in edited.verdicts] == [CONTACT]
        corrections.corrections_given(saved[-1])  # raises where rows contradict each other


def test_merging_two_contacts():
    edited, _ = review((10, 20), (23, 45), (60, 70))
    assert edited.merge(Span("C2", 10, 20)) == Span("C2", 10, 45)
    assert [s[1:] for s in edited.spans] == [(10, 45), (60, 70)]
    with pytest.raises(EditError, match="C2 has no contact after 60–70 to merge with"):
        edited.merge(Span("C2", 60, 70))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda r: r.add("C2", 15, 25), "15–25 would run into contact 10–20 of C2"),
        (lambda r: r.add("C2", 25, 25), "must come behind"),
        (lambda r: r.add("C2", 110, 121), "frames 0 to 119"),
        (lambda r: r.move(Span("C2", 10, 20), offset=31), "10–31 would run into contact 30–45 of"),
        (lambda r: r.move(Span("C2", 10, 20), onset=20), "must come behind"),
    ],
)
def test_edits_that_make_no_sense_are_refused_and_change_nothing(edit, message):
    edited, saved = review((10, 20), (30, 45))
    with pytest.raises(EditError, match=message):
        edit(edited)
    assert not saved
    assert [s[1:] for s in edited.spans] == [(10, 20), (30, 45)]


@pytest.mark.slow
@settings(deadline=None)
@given(
    st.lists(stretch, max_size=3),
    st.lists(st.tuples(st.sampled_from("amdc"), st.integers(0, 5), stretch), max_size=8),
)
def test_whatever_is_edited_contacts_never_overlap_and_the_file_says_it_all(found, edits):
    """Random edits in a row, against the two things a table of contacts must hold to."""
    found = [
        s for i, s in enumerate(found) if not any(corrections.overlap(s, t) for t in found[:i])
    ]
    edited, saved = review(*found)
    for kind, index, (onset, offset) in edits:
        _try(edited, kind, index, onset, offset)
        ordered = sorted(s[1:] for s in edited.spans)
        assert all(a[1] <= b[0] for a, b in itertools.pairwise(ordered))
    if saved:
        again, _ = review(*found, corrections=corrections.corrections_given(saved[-1]))
        assert again.spans == edited.spans


def _try(edited, kind, index, onset, offset):
    """One edit, on a contact picked by number; the state it must lead to is checked."""
    span = edited.spans[index % len(edited.spans)] if edited.spans else None
    try:
        if kind == "a":
            assert edited.add("C2", onset, offset) in edited.spans
        elif span and kind == "m":
            assert edited.move(span, onset, offset) in edited.spans
        elif span and kind == "d":
            before = set(edited.spans)
            edited.delete(span)
            assert set(edited.spans) == before - {span}
        elif span:
            edited.confirm(span)
            assert span in edited.spans
    except EditError:
        pass


def test_corrections_of_no_whisker_of_the_video_wait_and_late_ones_end_with_it():
    rows = [
        Verdict("C2", CONTACT, 5, 50, 0, 60),
        Verdict("B1", FREE, 5, 50, 0, 60),
        Verdict("C2", FREE, 30, 40, 30, 2**62),
    ]
    kept = applicable(table_of(rows), {"C2", "C1"}, 30)
    assert verdicts(kept) == (Verdict("C2", CONTACT, 5, 30, 0, 30),)
