"""What a person at the page does: keys and commands."""

from pathlib import Path

import pytest
from curated import opened

from pipeline.contacts.corrections import read_corrections
from pipeline.curate.desk import Desk
from pipeline.curate.keys import COMMANDS, KEYS, shown

pytestmark = pytest.mark.e2e


def test_every_key_has_its_command():
    by_page = {"play"}  # which the browser does, by stepping
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


def test_commands_without_sense_are_told_and_change_nothing(results):
    with opened(results) as folder:
        desk = Desk(folder)
        desk.do("escape")
        for command in ("delete", "onset", "offset", "accept", "undo", "redo", "other_edge"):
            desk.do(command)
            assert desk.is_error, command
            assert desk.message, command
        assert read_corrections(results / desk.video.name).empty
