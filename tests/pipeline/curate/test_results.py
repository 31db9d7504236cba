"""Tables kept in step with corrections."""

import errno
import shutil

import numpy as np
import pandas as pd
import pytest
from curated import FRAMES, contacts_of, edges, opened, process

from pipeline.contacts.corrections import Verdict, table_of, write_corrections
from pipeline.curate.corrected import bring_up_to_date
from pipeline.curate.desk import Desk
from pipeline.curate.panels import cover, panels
from pipeline.curate.results import Results
from pipeline.curate.review import Span
from pipeline.errors import InputError
from pipeline.runtime.folder_lock import locked
from pipeline.session.session_file import read_session
from pipeline.tables import files, result_exchange, whole_files
from pipeline.tables.columns import CONTACT_COLUMNS, CORRECTION_COLUMNS

pytestmark = pytest.mark.e2e


def test_results_are_of_the_kind_that_run_makes(session):
    """What the other tests stand on: contacts were found in both videos, and doubts are few."""
    settings = read_session(session[1] / "session.toml")
    assert settings.recording.frames_per_second == 1000
    assert contacts_of(session[1]).groupby("video").size().min() >= 2


def test_a_video_without_whiskers_can_be_looked_at(results, monkeypatch):
    name = sorted(path.parent.name for path in results.glob("*/frames.parquet"))[0]
    for file in ("frames.parquet", "evidence.parquet"):
        pd.read_parquet(results / name / file)[:0].to_parquet(results / name / file)
    with opened(results) as folder:
        desk = Desk(folder)
        desk.open_video(name)
        desk.do("last_frame")
        assert (desk.video.name, desk.frame) == (name, FRAMES - 1)
        assert desk.video.reader.frame(desk.frame) is not None
        assert name in panels(desk)["video"]
        assert panels(desk)["closeup_of"] == "close-up of the pole"
        monkeypatch.setattr(type(desk.video), "pole", lambda video, frame: None)
        assert panels(desk)["closeup_of"] == "no pole seen: close-up of the middle"


def test_lines_that_could_not_be_identified_have_no_lane(results):
    folder = min(path.parent for path in results.glob("*/evidence.parquet"))
    for file in ("frames.parquet", "evidence.parquet"):
        own = pd.read_parquet(folder / file).assign(whisker="w1")
        other = own.assign(whisker="w2", confidence=0.4, in_contact=False)[list(own)]
        pd.concat([own, other]).to_parquet(folder / file)
    with opened(results) as session:
        desk = Desk(session)
        desk.open_video(folder.name)
        assert desk.video.whiskers == ("w1",)
        assert set(desk.video.traces()) == {item.span.whisker for item in desk.items} == {"w1"}
        desk.select(desk.items[0].span)
        assert "(not included)" in panels(desk)["readout"]


def test_corrections_reach_the_tables_with_forces_made_anew(results):
    with opened(results) as folder:
        desk = Desk(folder)
        name, before = desk.video.name, contacts_of(results)
        own = before[before["video"] == name]
        longest = (own["offset_frame"] - own["onset_frame"]).idxmax()
        onset, offset = edges(own.loc[[longest]])[0]
        desk.select(Span(own.loc[longest, "whisker"], onset, offset))
        desk.go(onset + 2)
        desk.do("onset")
        folder.settle()
        after = contacts_of(results)
    row = after[(after["video"] == name) & (after["onset_frame"] == onset + 2)].squeeze()
    assert row["curated"]
    assert row["offset_frame"] == offset
    assert row["impulse_uN_ms"] < own.loc[longest, "impulse_uN_ms"]
    assert np.isfinite(row["pulse_duration_ms"])
    frames = files.read_frames(results / name / "frames.parquet")
    part = frames[frames["whisker"] == row["whisker"]].set_index("frame")
    touching = part["in_contact"].loc[onset : offset - 1].tolist()
    assert touching == [False] * 2 + [True] * (offset - onset - 2)
    assert (part["contact_force_uN"].loc[onset : onset + 1] == 0).all()
    own_after, rest_after, rest_before = (
        table.reset_index(drop=True)
        for table in (
            after[after["video"] == name],
            after[after["video"] != name],
            before[before["video"] != name],
        )
    )
    pd.testing.assert_frame_equal(rest_after, rest_before)
    pd.testing.assert_frame_equal(contacts_of(results, name), own_after)


def test_tables_follow_as_soon_as_a_full_disk_has_room_again(results, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "", "contacts.csv")

    with opened(results) as folder:
        desk, before = Desk(folder), contacts_of(results)
        with monkeypatch.context() as patched:
            patched.setattr(result_exchange, "keep_changed", full)  # when tables take their places
            desk.do("delete")
            folder.settle()
        assert "contacts.csv: No space left" in panels(desk)["saved"]
        assert "contacts.csv: No space left" in cover("finished", folder)
        folder.settle()
        assert "All corrections are in the tables" in cover("finished", folder)
    assert len(contacts_of(results)) == len(before) - 1


def test_undone_corrections_leave_the_tables_as_they_were(results):
    with opened(results) as folder:
        desk = Desk(folder)
        before = contacts_of(results)
        frames = files.read_frames(results / desk.video.name / "frames.parquet")
        desk.do("delete")
        folder.settle()
        assert len(contacts_of(results)) == len(before) - 1
        desk.do("undo")
        folder.settle()
        pd.testing.assert_frame_equal(contacts_of(results), before)
        again = files.read_frames(results / desk.video.name / "frames.parquet")
        pd.testing.assert_frame_equal(again, frames)


def test_whoever_reads_results_gets_the_tables_that_follow_from_the_corrections(results):
    with opened(results) as folder:
        video = folder.video(folder.names[0])
        video._changed = None  # as if the program died after saving corrections.csv
        video.review.delete(video.review.spans[0])
        n = len(contacts_of(results, video.name))
    assert len(contacts_of(results, video.name)) == n
    before = len(contacts_of(results))
    bring_up_to_date(results)
    assert len(contacts_of(results, video.name)) == n - 1
    assert len(contacts_of(results)) == before - 1
    with locked(results):
        bring_up_to_date(results)  # nothing is left to do
    (results / video.name / "corrections.csv").unlink()
    bring_up_to_date(results)
    assert len(contacts_of(results)) == before


def test_an_edited_table_that_is_made_anew_is_kept_and_said_to_be(results):
    with opened(results) as folder:
        desk = Desk(folder)
        tables = [results / desk.video.name / "contacts.csv", results / "contacts.csv"]
        for path in tables:
            path.write_text("a person's")
        desk.do("delete")
        folder.settle()
        for path, said in zip(tables, folder.kept, strict=True):
            assert f"{path} was changed since whiskerforce wrote it: it is kept as" in said
            assert path.with_name("contacts.csv.old").read_text() == "a person's"
    files.write_csv(tables[1], contacts_of(results).assign(curated=True), CONTACT_COLUMNS)
    (said,) = bring_up_to_date(results)
    assert f"it is kept as {tables[1]}.old2" in said
    assert not bring_up_to_date(results)


def test_an_edited_table_is_said_to_be_kept_where_corrections_are_followed(results):
    first = min(path.parent for path in results.glob("*/evidence.parquet"))
    before = contacts_of(results, first.name)
    (first / "contacts.csv").write_text("a person's")
    onset, offset = edges(before)[0]
    verdict = Verdict(before["whisker"][0], "free", onset, offset, onset, offset)
    write_corrections(first, table_of([verdict]))
    (said,) = bring_up_to_date(results)
    assert f"it is kept as {first / 'contacts.csv.old'}" in said


def test_a_row_that_is_deleted_by_hand_is_said_to_be_missing_and_to_come_back(results):
    first = min(path.parent for path in results.glob("*/evidence.parquet"))
    rows, n = (first / "contacts.csv").read_text().splitlines(), len(contacts_of(results))
    (first / "contacts.csv").write_text("\n".join([*rows[:-1], ""]))
    (said,) = bring_up_to_date(results)
    assert str(first / "contacts.csv") in said
    assert "its rows count as they are now" in said
    assert len(contacts_of(results)) == n - 1
    assert not bring_up_to_date(results)


def test_contacts_are_not_corrected_with_other_settings_than_those_of_the_results(results):
    first = min(path.parent for path in results.glob("*/evidence.parquet"))
    before = contacts_of(results, first.name)
    text = (first / "session.toml").read_text()
    (first / "session.toml").write_text(text.replace("pixels_per_mm = ", "pixels_per_mm = 1"))
    with opened(results) as folder, pytest.raises(ValueError, match="not the settings of these"):
        folder.video(first.name)
    onset, offset = edges(before)[0]
    verdict = Verdict(before["whisker"][0], "free", onset, offset, onset, offset)
    write_corrections(first, table_of([verdict]))
    with pytest.raises(InputError, match="not the settings of these results; change the session"):
        bring_up_to_date(results)
    pd.testing.assert_frame_equal(contacts_of(results, first.name), before)


def test_corrections_that_cannot_be_followed_are_said(results):
    first, second = sorted(p.parent for p in results.glob("*/evidence.parquet"))
    for folder in (first, second):
        shutil.copy(folder / "contacts.csv", folder / "before.csv")
        onset, offset = edges(contacts_of(results, folder.name))[0]
        whisker = contacts_of(results, folder.name)["whisker"][0]
        verdict = Verdict(whisker, "free", onset, offset, onset, offset)
        write_corrections(folder, table_of([verdict]))
    (first / "evidence.parquet").write_bytes(b"")
    with pytest.raises(InputError, match=f"{first.name}: corrections are not in .*run the video"):
        bring_up_to_date(results)
    assert (first / "contacts.csv").read_bytes() == (first / "before.csv").read_bytes()
    assert (second / "contacts.csv").read_bytes() != (second / "before.csv").read_bytes()


def test_corrections_of_an_unknown_whisker_are_said_where_others_are_followed(results):
    first = min(path.parent for path in results.glob("*/evidence.parquet"))
    before = contacts_of(results, first.name)
    onset, offset = edges(before)[0]
    rows = [Verdict(w, "free", onset, offset, onset, offset) for w in (before["whisker"][0], "Z9")]
    write_corrections(first, table_of(rows))
    (said,) = bring_up_to_date(results)
    assert said.startswith(f"{first}: corrections.csv: 1 of 'Z9', which is not a whisker of this")
    assert len(contacts_of(results, first.name)) == len(before) - 1


def test_folders_with_nothing_to_curate_are_reported(results, tmp_path):
    with pytest.raises(InputError, match=rf"no results in it.*did you mean {results}\?"):
        Results(results.parent)
    (tmp_path / "of a person").mkdir()
    (tmp_path / "of a person" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"no results in it.*--out folder"):
        Results(tmp_path / "of a person")
    (results / "videos.csv").rename(tmp_path / "videos.csv")
    with pytest.raises(InputError, match=r"without videos\.csv; .*run` again writes what is miss"):
        Results(results)
    (tmp_path / "videos.csv").rename(results / "videos.csv")
    for file in results.glob("*/evidence.parquet"):
        file.unlink()
    with pytest.raises(InputError, match="whiskerforce run"):
        Results(results)


def test_a_video_that_is_gone_leaves_the_time_courses(results):
    name = sorted(p.parent.name for p in results.glob("*/evidence.parquet"))[0]
    state = whole_files.read_json(results / name / "run.json")
    whole_files.write_json(results / name / "run.json", {**state, "path": "/nowhere/video.mp4"})
    with opened(results) as folder:
        video = folder.video(name)
        assert video.reader is None
        assert "/nowhere/video.mp4" in video.no_picture
        assert len(video.traces()["C2"].force_uN) == FRAMES


def test_no_contact_is_judged_by_another_video(results, tmp_path):
    name = sorted(p.parent.name for p in results.glob("*/evidence.parquet"))[0]
    state = whole_files.read_json(results / name / "run.json")
    path = shutil.copy(state["path"], tmp_path)
    with open(path, "ab") as file:
        file.write(b" ")
    whole_files.write_json(results / name / "run.json", {**state, "path": path})
    with opened(results) as folder:
        video = folder.video(name)
        assert video.reader is None
        assert "is not the video of these results" in video.no_picture


def test_corrections_edited_while_the_page_is_open_are_kept_and_named(results):
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("confirm")
        path = desk.video.folder / "corrections.csv"
        mine = path.read_text() + "C2,free,1,3,1,3,,colleague\n"
        path.write_text(mine)
        desk.do("confirm")
        folder.settle()
    old = path.with_name("corrections.csv.old")
    assert old.read_text() == mine
    assert len(files.read_csv(path, CORRECTION_COLUMNS)) == 2
    assert any(f"it is kept as {old}" in said for said in folder.kept)


def test_a_second_run_keeps_corrections(session, tmp_path):
    videos, finished = session
    results = tmp_path / "results"
    shutil.copytree(finished, results)
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("delete")
        desk.do("next_contact")
        desk.go(desk.selected.offset + 1)
        desk.do("offset")
    curated = contacts_of(results)
    frames = files.read_frames(results / desk.video.name / "frames.parquet")
    assert curated["curated"].sum() == 1
    process(videos, results)
    pd.testing.assert_frame_equal(contacts_of(results), curated)
    process(videos, results, overwrite=True)
    pd.testing.assert_frame_equal(contacts_of(results), curated)
    again = files.read_frames(results / desk.video.name / "frames.parquet")
    pd.testing.assert_frame_equal(again, frames)


def test_a_whisker_renamed_after_curation_hides_its_corrections_and_keeps_them(results):
    name = sorted(p.parent.name for p in results.glob("*/evidence.parquet"))[0]
    text = (
        "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
        "old_name,contact,20,40,20,40,\n"
    )
    (results / name / "corrections.csv").write_text(text)
    with opened(results) as session:
        desk = Desk(session)
        desk.open_video(name)
        session.settle()
        assert not session.faults
        assert "old_name" not in {span.whisker for span in desk.video.review.spans}
        whisker = desk.video.whiskers[0]
        added = desk.video.review.add(whisker, 0, 2)
        session.settle()
        assert added in desk.video.review.spans
    lines = (results / name / "corrections.csv").read_text().splitlines()
    assert lines[1].startswith("old_name,contact,20,40")
    assert len(lines) == 3


@pytest.mark.parametrize("table", ["centrelines.parquet", "frames.parquet", "evidence.parquet"])
def test_damaged_tables_are_said_and_the_page_goes_on(results, table):
    first, second = sorted(p.parent.name for p in results.glob("*/evidence.parquet"))
    content = (results / first / table).read_bytes()
    (results / first / table).write_bytes(content[: len(content) // 2])
    with opened(results) as session:
        desk = Desk(session)
        if table == "centrelines.parquet":
            assert desk.video.centrelines(5) == {}
            assert "centrelines.parquet: damaged" in panels(desk)["saved"]
        else:
            assert f"{first} cannot be opened" in desk.message
            assert f"{table}: damaged" in desk.message
            assert desk.video.name == second


def test_where_no_video_can_be_opened_the_reason_is_given(results):
    for path in results.glob("*/frames.parquet"):
        path.write_bytes(b"")
    with opened(results) as session, pytest.raises(InputError, match=r"frames\.parquet: damaged"):
        Desk(session)
