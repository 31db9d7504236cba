"""Files whole or not at all, and JSON that may not be there."""

import errno
import os
from pathlib import Path

import av
import pytest

from pipeline.errors import with_advice
from pipeline.tables import whole_files


@pytest.mark.parametrize("fails", ["mkstemp", "block", "replace"])
def test_a_file_that_cannot_be_written_is_named(tmp_path, monkeypatch, fails):
    def full(*names, **_):
        raise OSError(errno.ENOSPC, "no room", *names[:1])

    owners = {"mkstemp": whole_files.tempfile, "replace": whole_files.os}
    if fails in owners:
        monkeypatch.setattr(owners[fails], fails, full)

    def write():
        with whole_files.whole_file(tmp_path / "a.csv"):
            if fails == "block":
                full()

    with pytest.raises(OSError, match="no room") as caught:
        write()
    expected = f"{tmp_path / 'a.csv'}: No space left on device; make room on that disk"
    assert with_advice(caught.value).startswith(expected)
    monkeypatch.undo()
    assert fails == "mkstemp" or not list(tmp_path.iterdir())


def test_a_video_that_cannot_be_written_is_named(tmp_path):
    """PyAV's errors keep the path that they were made with."""

    def write():
        with whole_files.whole_file(tmp_path / "film.mp4") as temporary:
            raise av.error.OSError(errno.ENOSPC, "no room", str(temporary))

    with pytest.raises(OSError, match="no room") as caught:
        write()
    expected = f"{tmp_path / 'film.mp4'}: No space left on device; make room on that disk"
    assert with_advice(caught.value).startswith(expected)


def test_what_killed_programs_left_goes_with_the_next_file_a_day_later(tmp_path):
    old, new = (tmp_path / f".whiskerforce-{word}.part.toml" for word in ("old", "new"))
    for left in (old, new, tmp_path / ".whiskerforce-written", tmp_path / "old.part"):
        left.touch()
        os.utime(left, (0, 0))
    new.touch()  # somebody may be writing it
    whole_files.write_text(tmp_path / "session.toml", "")
    there = {path.name for path in tmp_path.iterdir()}
    assert there == {new.name, ".whiskerforce-written", "old.part", "session.toml"}


def test_a_file_that_could_not_be_finished_leaves_the_old_one(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")

    def write_half():
        with whole_files.whole_file(path) as temporary:
            temporary.write_text("half of the new o")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write_half()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_persons_file_is_set_aside_only_when_the_new_one_is_written(tmp_path, monkeypatch):
    def full(*arguments, **options):
        raise OSError(errno.ENOSPC, "no room")

    path = tmp_path / "session.toml"
    assert whole_files.replace_text(path, "mine") is None
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", full)
        with pytest.raises(OSError, match="no room"):
            whole_files.replace_text(path, "new")
    assert list(tmp_path.iterdir()) == [path]
    old = whole_files.replace_text(path, "new")
    assert (old.read_text(), path.read_text()) == ("mine", "new")


def test_the_file_is_not_there_before_it_is_whole(tmp_path):
    path = tmp_path / "a.csv"
    with whole_files.whole_file(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
        assert temporary.parent == tmp_path
    assert path.read_text() == "new"


def test_a_file_is_on_the_disk_before_it_takes_the_old_ones_place(tmp_path, monkeypatch):
    """Else a power failure leaves an empty file with the good one's name."""
    steps = []
    for name in ("fsync", "replace"):
        original = getattr(os, name)
        monkeypatch.setattr(
            os, name, lambda *a, name=name, do=original: (steps.append(name), do(*a))
        )
    whole_files.write_text(tmp_path / "a.txt", "whole")
    assert steps == ["fsync", "replace"]


def test_json_that_is_not_there_or_broken_is_the_default(tmp_path):
    assert whole_files.read_json(tmp_path / "no.json", {}) == {}
    for text in ("{half", "[1, 2]"):
        (tmp_path / "no.json").write_text(text)
        assert whole_files.read_json(tmp_path / "no.json", 5) == 5
    whole_files.write_json(tmp_path / "no.json", {"µ": 1})
    assert whole_files.read_json(tmp_path / "no.json") == {"µ": 1}
