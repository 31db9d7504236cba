"""New results in place of old ones, with the program ended at every single step on the way."""

import errno
import itertools
import json
import os
import pathlib
import shutil

import pytest

from pipeline.errors import InputError, with_advice
from pipeline.tables import result_exchange
from pipeline.tables.own_files import RECORD
from pipeline.tables.result_exchange import draft, is_settled, settle, settle_all, settled

STEPS = (os, "replace"), (pathlib.Path, "unlink"), (pathlib.Path, "rename"), (shutil, "rmtree")
PERSON = {"corrections.csv": "a day's work"}


class Killed(BaseException):
    """As SIGKILL: nothing that the program does afterwards happens."""


def results(generation, overlay=False):
    tables = "centrelines.parquet", "frames.parquet", "contacts.csv", "run.json"
    names = *tables, *(["overlay.mp4"] if overlay else [])
    return {name: f"{name} {generation}" for name in names}


def write(folder, files):
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)


def visible(folder):
    return {p.name: p.read_text() for p in folder.iterdir() if not p.name.startswith(".")}


def renew(folder, files):
    with draft(folder) as new:
        write(new, files)
    settle(folder)


def killed_at(monkeypatch, step, action):
    """Do the action; from its `step`-th change of the disk on nothing happens. True if reached."""
    count = 0

    def counted(original):
        def call(*args, **kwargs):
            nonlocal count
            count += 1
            if count >= step:
                raise Killed
            return original(*args, **kwargs)

        return call

    with monkeypatch.context() as patch:
        for owner, name in STEPS:
            patch.setattr(owner, name, counted(getattr(owner, name)))
        try:
            action()
        except Killed:
            return True
    return False


@pytest.mark.parametrize("overlays", [(False, False), (True, False), (False, True), (True, True)])
def test_all_old_or_all_new_wherever_it_ends(tmp_path, monkeypatch, overlays):
    old, new = (results(g, o) for g, o in zip(("old", "new"), overlays, strict=True))
    seen = []
    for step in range(1, 30):
        folder = tmp_path / f"{step}"
        renew(folder, old)
        write(folder, PERSON)
        reached = killed_at(monkeypatch, step, lambda f=folder: renew(f, new))
        for again in (1, 2, 30):  # the repair may be killed too
            killed_at(monkeypatch, again, lambda f=folder: settle(f))
        left = visible(folder)
        assert left in ({**old, **PERSON}, {**new, **PERSON})
        assert {p.name for p in folder.iterdir()} - {RECORD} == set(left)
        seen.append(left["run.json"])
        if not reached:
            break
    assert not reached
    assert seen == sorted(seen, reverse=True)  # old up to one step, new from there on
    assert len(set(seen)) == 2
    assert len(seen) > 5


@pytest.mark.parametrize("name", ["contacts.csv", "frames.parquet", "overlay.mp4"])
def test_what_a_person_has_changed_is_kept_wherever_it_ends(tmp_path, monkeypatch, name):
    for overlay, step in itertools.product((False, True), range(1, 30)):
        folder = tmp_path / f"{overlay}{step}"
        renew(folder, results("old", overlay=True))
        write(folder, {name: "a day's work", **PERSON})
        reached = killed_at(
            monkeypatch, step, lambda f=folder, o=overlay: renew(f, results("new", o))
        )
        settle(folder)
        left = visible(folder)
        if left["run.json"] == "run.json old":
            assert left == {**results("old", overlay=True), name: "a day's work", **PERSON}
        else:
            assert left == {**results("new", overlay), f"{name}.old": "a day's work", **PERSON}
        if not reached:
            break
        assert step < 29


@pytest.mark.parametrize("known", [True, False])
def test_of_a_folder_copied_without_hidden_files_only_edited_files_are_kept(tmp_path, known):
    """All are kept, once, where run.json has no copy of the list: of an earlier version."""
    folder, states = tmp_path / "a", [json.dumps({"version": k}) for k in range(3)]
    renew(folder, {**results("old", overlay=True), "run.json": states[0]})
    (folder / RECORD).unlink()
    if not known:
        write(folder, {"run.json": states[0]})
    write(folder, {"contacts.csv": "a day's work"})
    for generation in (1, 2):
        renew(folder, {**results(f"{generation}"), "run.json": states[generation]})
    left = visible(folder)
    assert json.loads(left.pop("run.json"))["version"] == 2
    kept = {f"{k}.old": v for k, v in results("old", overlay=True).items() if k != "run.json"}
    expected = {k: v for k, v in results("2").items() if k != "run.json"}
    expected |= {} if known else kept
    assert left == expected | {"contacts.csv.old": "a day's work"}


def test_what_is_said_of_a_file_that_is_kept(tmp_path):
    renew(tmp_path / "a", results("old"))
    (tmp_path / "a" / "contacts.csv").write_text("a day's work")
    with draft(tmp_path / "a") as new:
        write(new, results("new"))
    (said,) = settle(tmp_path / "a")
    assert str(tmp_path / "a" / "contacts.csv.old") in said
    assert not settle(tmp_path / "a")


def test_what_is_kept_is_said_to_who_reads_the_whole_folder(tmp_path):
    """As where a run was killed before it moved new results in."""
    for name in "ab":
        renew(tmp_path / name, results("old"))
        (tmp_path / name / "contacts.csv").write_text("a day's work")
        with draft(tmp_path / name) as new:
            write(new, results("new"))
    (tmp_path / "videos.csv").touch()
    with settled(tmp_path) as kept:
        pass
    for name, said in zip("ab", sorted(kept), strict=True):
        assert str(tmp_path / name / "contacts.csv.old") in said


def test_a_persons_file_is_no_overlay(tmp_path):
    renew(tmp_path / "a", results("old", overlay=True))
    write(tmp_path / "a", {"overlay.pptx": "a day's work"})
    renew(tmp_path / "a", results("new"))
    assert visible(tmp_path / "a") == {**results("new"), "overlay.pptx": "a day's work"}


def test_a_failed_draft_leaves_old_results_or_no_folder(tmp_path):
    def fail(folder):
        with draft(folder) as new:
            write(new, results("new"))
            raise OSError("disk full")

    write(tmp_path / "a", {**results("old"), **PERSON})
    for name in "ab":
        with pytest.raises(OSError, match="disk full"):
            fail(tmp_path / name)
    assert visible(tmp_path / "a") == {**results("old"), **PERSON}
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize("name", ["frames.parquet", None])
def test_an_error_in_a_draft_names_the_results(tmp_path, name):
    folder = tmp_path / "video"
    with pytest.raises(OSError, match="large") as caught, draft(folder) as new:
        raise OSError(errno.EFBIG, "File too large", name and str(new / name))
    place = f"{folder / name}: " if name else ""
    assert with_advice(caught.value) == (
        f"{place}File too large; that disk, or the system, takes no file so large: choose another "
        "place"
    )


def test_what_is_not_ours_stays(tmp_path):
    write(tmp_path / "empty", {})
    write(tmp_path / "theirs", {".hidden.part1.rar": "x", "run.json": json.dumps({})})
    settle_all(tmp_path)
    assert (tmp_path / "empty").is_dir()
    assert (tmp_path / "theirs" / ".hidden.part1.rar").exists()


def test_who_reads_a_results_folder_finds_it_settled_and_its_own(tmp_path):
    """As `figures` does after a run was killed while it moved new results in."""
    renew(tmp_path / "a", results("old"))
    with draft(tmp_path / "a") as new:
        write(new, results("new"))
    with settled(tmp_path):
        assert not is_settled(tmp_path / "a")  # not known to be a results folder
    (tmp_path / "videos.csv").touch()
    with settled(tmp_path):
        assert visible(tmp_path / "a") == results("new")
        with pytest.raises(InputError, match="another whiskerforce"), settled(tmp_path):
            pass


def test_a_folder_that_cannot_be_written_waits(tmp_path, monkeypatch):
    folder = tmp_path / "a"
    renew(folder, results("old"))
    with draft(folder) as new:
        write(new, results("new"))
    assert not is_settled(folder)
    with monkeypatch.context() as patch:
        patch.setattr(result_exchange.os, "replace", lambda *_: (_ for _ in ()).throw(OSError()))
        settle_all(tmp_path)
        with pytest.raises(OSError):
            settle(folder)
    settle_all(tmp_path)
    assert is_settled(folder)
    assert visible(folder) == results("new")
