"""What a person at the page does: keys and commands."""

from pathlib import Path

import pytest
from curated import opened

from pipeline.contacts.corrections import read_corrections
from pipeline.curate.desk import Desk
from pipeline.curate.keys import COMMANDS, KEYS, shown
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS

pytestmark = pytest.mark.e2e


def test_every_key_has_its_command():
    by_page = {"play", "go_to_frame"}  # which the browser does
    assert all(hasattr(Desk, key.command) for key in KEYS if key.command not in by_page)
    assert len(COMMANDS) == sum(len(key.keys) for key in KEYS)


def test_the_manual_names_every_key():
    manual = (Path(__file__).parents[3] / "docs" / "curate.md").read_text(encoding="utf-8")
    for key in KEYS:
        names = " ".join(f"`{shown(k)}`" for k in key.keys)
        assert f"| {names} | {key.meaning} |" in manual


def test_the_window_follows_the_frame(results):
    with opened(results) as folder:
        desk = Desk(folder)
        for command in [*["zoom_in"] * 3, "last_frame", "back", "first_frame", "page_forward",
                        *["next_frame"] * 60, "zoom_out"]:  # fmt: skip
            desk.do(command)
            assert desk.start <= desk.frame < desk.stop
            assert 0 <= desk.start <= desk.video.n_frames


def test_confirming_goes_through_all_contacts_the_doubtful_first(results):
    with opened(results) as folder:
        desk = Desk(folder)
        todo = len(desk.items)
        doubts = []
        for _ in range(todo):
            doubts.append(desk.current.is_doubtful)
            desk.do("confirm")
        assert doubts == sorted(doubts, reverse=True)
        assert not any(item.is_open for item in desk.items)
        assert "all contacts of this video are looked at" in desk.message
        verdicts = read_corrections(results / desk.video.name)["verdict"]
        assert len(verdicts) == todo


def test_commands_without_sense_are_reported_and_change_nothing(results):
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("escape")
        for command in ("delete", "onset", "offset", "accept", "undo", "redo", "other_edge"):
            desk.do(command)
            assert desk.is_error, command
            assert desk.message, command
        assert read_corrections(results / desk.video.name).empty


def test_a_refusal_names_what_it_is_about_and_what_to_do(results):
    def refused(command):
        desk.do(command)
        assert desk.is_error, command
        return desk.message

    with opened(results) as folder:
        desk = Desk(folder)
        name, last = desk.video.name, folder.names[-1]
        assert refused("undo") == f"no change of {name} is left to undo; x, i and o make changes"
        assert refused("redo") == f"nothing of {name} to do again: u comes first"
        contact = next(item.span for item in desk.items if item.is_contact)
        desk.select(contact)
        assert f"contact {contact} is one already; Enter says that" in refused("accept")
        assert f"has contact {contact} in frame {contact.onset} already" in refused("add")
        said = f"{name} has no contact before frame {contact.onset}; n goes the other way"
        assert said in refused("previous_contact")
        possible = next((item.span for item in desk.items if not item.is_contact), None)
        if possible is not None:
            desk.select(possible)
            assert f"possible contact {possible} cannot be merged; c makes" in refused("merge")
            assert f"possible contact {possible} has no edges to move yet; c" in refused("onset")
        assert f"{name} is the first video of {len(folder.names)}; v" in refused("previous_video")
        desk.open_video(last)
        assert f"{last} is the last video of {len(folder.names)}; ⇧ v" in refused("next_video")


def test_search_by_force_and_length_goes_through_all_in_order(results):
    with opened(results) as folder:
        desk = Desk(folder)
        count = sum(item.is_contact for item in desk.items)
        for command, column, sign in (("strongest", "peak_force_uN", -1),
                                      ("shortest", "duration_ms", 1)):  # fmt: skip
            found = []
            for _ in range(count):
                desk.do(command)
                found.append(sign * desk.current.values[column])
                assert desk.frame == desk.selected.onset
            assert found == sorted(found)
            assert f"{count} of {count}" in desk.message
            desk.do(command)
            assert desk.is_error
            desk.do(command)
            assert f"1 of {count}" in desk.message


def test_search_for_slips(results):
    name = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)["video"].iloc[0]
    contacts = files.read_csv(results / name / "contacts.csv", CONTACT_COLUMNS)
    slips = [0, len(contacts) - 1]
    contacts["slip"] = contacts.index.isin(slips)
    files.write_csv(results / name / "contacts.csv", contacts, CONTACT_COLUMNS)
    with opened(results) as folder:
        desk = Desk(folder)
        desk.go(0)
        desk.do("escape")
        for row in slips:
            desk.do("next_slip")
            assert desk.selected.onset == contacts["onset_frame"][row]
        desk.do("next_slip")
        assert desk.is_error


def test_corrections_bear_the_name_of_who_made_them(results):
    with opened(results) as folder:
        desk = Desk(folder, "Ada")
        desk.do("confirm")
        desk.be("Grace")
        desk.do("confirm")
        saved = read_corrections(results / desk.video.name)["saved_by"]
        assert saved.tolist() == ["Ada", "Grace"]
        desk.do("export")
        assert f"2 decisions written to {results.resolve() / 'decisions.csv'}" in desk.message


def test_decisions_that_cannot_be_written_are_said_in_words(results):
    (results / "decisions.csv").mkdir()
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("export")
        assert desk.is_error
        assert "decisions.csv cannot be written" in desk.message
        assert "Errno" not in desk.message


def test_a_frame_is_reached_by_its_number(results):
    with opened(results) as folder:
        desk = Desk(folder)
        desk.go_to("17")
        assert (desk.frame, desk.is_error) == (17, False)
        for text in (str(desk.video.n_frames), "-1", "1.5", ""):
            desk.go_to(text)
            assert (desk.frame, desk.is_error) == (17, True)
            assert f"frames 0 to {desk.video.n_frames - 1}" in desk.message
