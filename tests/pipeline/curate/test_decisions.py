"""What was decided, by whom and when, of all videos of a session."""

import pytest
from results_folder import contact, make_results

from pipeline.contacts.corrections import (
    Verdict,
    decisions_in_words,
    read_corrections,
    table_of,
    write_corrections,
)
from pipeline.curate.corrected import write_session_tables
from pipeline.curate.decisions import LONGEST_NAME, name_of, write_decisions
from pipeline.tables import files
from pipeline.tables.columns import DECISION_COLUMNS

WHEN = "2024-11-22T10:30:00+00:00"


@pytest.fixture
def folder(tmp_path):
    """Results of three videos, two of which were curated: one now, one by an earlier version."""
    names = ("one", "two", "three")
    folder = make_results(tmp_path / "results", [contact("one", 1, 30, 10, 4.0)], names)
    rows = [
        Verdict("C2", "contact", 60, 80, 58, 80, WHEN, "Ada"),
        Verdict("C2", "confirmed", 30, 40, 30, 40, WHEN, "Ada"),
        Verdict("C2", "free", 90, 95, 90, 95, WHEN, "Grace"),
    ]
    write_corrections(folder / "one", table_of(rows))
    (folder / "three" / "corrections.csv").write_text(
        "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
        f"C2,confirmed,30,40,30,40,{WHEN}\n"
    )
    return folder


def decisions(folder, *names):
    return write_decisions(folder, {name: read_corrections(folder / name) for name in names})


def test_all_decisions_are_listed(folder):
    path, count, _ = decisions(folder, "one", "two", "three")
    table = files.read_csv(path, DECISION_COLUMNS)
    assert count == len(table) == 4
    names = ["video", "decision", "onset_frame", "offset_frame", "decided_by", "decided_at"]
    assert table[names].values.tolist() == [
        ["one", "confirmed", 30, 40, "Ada", WHEN],
        ["one", "added or moved", 60, 80, "Ada", WHEN],
        ["one", "no contact", 90, 95, "Grace", WHEN],
        ["three", "confirmed", 30, 40, "", WHEN],
    ]
    assert table["onset_s"].tolist() == pytest.approx([0.03, 0.06, 0.09, 0.03])  # 1000 frames/s
    assert table["duration_ms"].tolist() == pytest.approx([10, 20, 5, 10])


def test_decisions_are_listed_also_where_the_settings_are_damaged(folder):
    (folder / "one" / "session.toml").write_text("[recording")
    path, count, _ = decisions(folder, "one", "three")
    table = files.read_csv(path, DECISION_COLUMNS)
    assert count == len(table) == 4
    assert table["onset_s"].isna().tolist() == [True, True, True, False]


def test_without_decisions_there_is_an_empty_table(folder):
    path, count, _ = decisions(folder, "two")
    assert count == 0
    assert files.read_csv(path, DECISION_COLUMNS).empty


def test_a_table_that_a_person_has_annotated_is_kept(folder):
    path, _, said = decisions(folder, "one")
    assert not said
    path.write_text("my notes")
    _, _, said = decisions(folder, "one")
    assert "decisions.csv.old" in said[0]
    assert path.with_name("decisions.csv.old").read_text() == "my notes"


def test_a_session_reads_corrections_once_and_does_without_broken_ones(folder, monkeypatch):
    read = []

    def noted(of):
        read.append(of.name)
        return read_corrections(of)

    (folder / "three" / "corrections.csv").write_text("whisker\nC2\n")
    monkeypatch.setattr("pipeline.curate.corrected.read_corrections", noted)
    monkeypatch.setattr("pipeline.curate.decisions.read_corrections", noted, raising=False)
    write_session_tables(folder)
    assert read == ["one", "three"]
    table = files.read_csv(folder / "decisions.csv", DECISION_COLUMNS)
    assert table["video"].tolist() == ["one", "one", "one"]


def test_decisions_are_counted_where_they_are_listed(folder):
    assert decisions_in_words(folder) == ""
    decisions(folder, "one", "two")
    assert decisions_in_words(folder) == "3 decisions in one"
    decisions(folder, "one", "three")
    assert decisions_in_words(folder) == "4 decisions in 2 videos"
    (folder / "decisions.csv").write_text("my notes")
    assert decisions_in_words(folder) == ""


def test_names_are_words_in_a_cell():
    assert name_of("Ada, Countess of Lovelace") == "Ada, Countess of Lovelace"
    assert name_of("=1+1") == "1+1"
    assert name_of("a\r\nb") == "a b"
    assert len(name_of("x" * 500)) == LONGEST_NAME
