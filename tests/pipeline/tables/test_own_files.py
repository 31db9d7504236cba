"""Files are replaced as whiskerforce wrote them; nobody else's is lost."""

import contextlib
import errno
import itertools
import os
import tempfile
from concurrent.futures import ThreadPoolExecutor

import pytest

from pipeline.errors import InputError
from pipeline.tables import own_files
from pipeline.tables.own_files import new_files, replace_own

N = range(30)


def write(folder, **texts):
    with new_files(folder) as new:
        for name, text in texts.items():
            (new / name).write_text(text)


def visible(folder):
    return {p.name: p.read_text() for p in folder.iterdir() if not p.name.startswith(".")}


def test_own_files_are_replaced_time_and_again(tmp_path):
    for text in ("first", "second", "second", "third"):
        write(tmp_path / "à b", one=text, two="same")
        assert visible(tmp_path / "à b") == {"one": text, "two": "same"}


def test_a_file_of_somebody_else_stays_and_so_does_all_beside_it(tmp_path):
    write(tmp_path, one="ours")
    (tmp_path / "two").write_text("a day's work")
    with pytest.raises(InputError, match=r"two: would be replaced.*choose another folder"):
        write(tmp_path, one="newer", two="ours")
    assert visible(tmp_path) == {"one": "ours", "two": "a day's work"}


def test_a_file_that_was_edited_stays(tmp_path):
    write(tmp_path, one="ours")
    (tmp_path / "one").write_text("edited")
    with pytest.raises(InputError, match="one: would be replaced"):
        write(tmp_path, one="ours")
    assert visible(tmp_path) == {"one": "edited"}


def test_a_file_that_was_made_of_other_things_stays(tmp_path):
    def made_of(*things, text="the newest"):
        with new_files(tmp_path, things) as new:
            (new / "table").write_text(text)

    made_of("monday 1", text="of monday")
    with pytest.raises(InputError, match="table: would be replaced, but was made of something el"):
        made_of("friday 1")
    assert visible(tmp_path) == {"table": "of monday"}
    made_of("monday 1", "monday 2")  # a video was added
    made_of("monday 2")  # and one removed
    with pytest.raises(InputError, match="made of something else"):
        made_of("monday 1")
    (tmp_path / "table").unlink()
    made_of("friday 1")
    write(tmp_path, table="of nothing that is known")
    made_of("monday 1")
    record = tmp_path / own_files.RECORD
    record.write_text(record.read_text().replace('["monday 1"]', "5").replace("monday 1", "5"))
    made_of("5")
    assert visible(tmp_path) == {"table": "the newest"}


def test_a_file_of_a_results_folder_that_was_edited_is_kept_under_another_name(tmp_path):
    path, said = tmp_path / "one", []

    def replaced(text):
        said.append(replace_own(path, lambda new: new.write_text(text)))

    for text in ("first", "second", "second"):
        replaced(text)
    path.write_text("a day's work")
    replaced("third")
    path.unlink()
    replaced("fourth")
    path.write_text("fifth")  # as it is to be
    replaced("fifth")
    path.write_text("another day's")
    replaced("fifth")
    assert [len(sentences) for sentences in said] == [0, 0, 0, 1, 0, 0, 1]
    assert said[-1][0].startswith(f"{path} was changed since whiskerforce wrote it: it is kept")
    assert visible(tmp_path) == {
        "one": "fifth", "one.old": "a day's work", "one.old2": "another day's",
    }  # fmt: skip


def test_a_file_that_no_list_is_there_of_is_kept_once(tmp_path):
    """As in a folder that was copied without its hidden files."""
    path = tmp_path / "one"
    replace_own(path, lambda new: new.write_text("ours"))
    (tmp_path / own_files.RECORD).unlink()
    path.write_text("a day's work")
    assert not own_files.is_changed(path)  # nobody knows
    (said,) = replace_own(path, lambda new: new.write_text("ours"))
    assert said.startswith(f"{path} is on no list of what whiskerforce wrote there: it is kept as")
    for text in ("second", "third"):
        assert not replace_own(path, lambda new, text=text: new.write_text(text))
    assert visible(tmp_path) == {"one": "third", "one.old": "a day's work"}


def test_a_file_is_known_however_its_replacement_ends(tmp_path, monkeypatch):
    path = tmp_path / "one"
    replace_own(path, lambda new: new.write_text("first"))
    with monkeypatch.context() as patched:
        patched.setattr(own_files, "write_json", lambda *_: os.mkdir("/nowhere/at/all"))
        with pytest.raises(OSError, match="nowhere"):
            replace_own(path, lambda new: new.write_text("second"))
    assert visible(tmp_path) == {"one": "first"}
    assert not replace_own(path, lambda new: new.write_text("second"))


def test_a_file_that_a_person_put_beside_those_of_a_results_folder_is_kept(tmp_path):
    replace_own(tmp_path / "one", lambda new: new.write_text("ours"))
    (tmp_path / "two").write_text("a person's")
    (said,) = replace_own(tmp_path / "two", lambda new: new.write_text("ours"))
    assert f"kept as {tmp_path / 'two.old'}" in said
    assert visible(tmp_path) == {"one": "ours", "two": "ours", "two.old": "a person's"}


def test_two_threads_leave_one_list_of_all_files(tmp_path):
    """As the page and the tables of `curate`."""

    def write_often(name):
        return [replace_own(tmp_path / name, lambda new, k=k: new.write_text(f"{k}")) for k in N]

    with ThreadPoolExecutor(2) as threads:
        assert not any(itertools.chain(*threads.map(write_often, ("one", "two"))))
    for name in ("one", "two"):
        assert not replace_own(tmp_path / name, lambda new: new.write_text("last"))


@pytest.mark.parametrize("make", [os.mkdir, lambda path: os.symlink("/nowhere", path)])
def test_a_folder_or_a_link_of_that_name_stays(tmp_path, make):
    make(tmp_path / "one")
    with pytest.raises(InputError, match="one: would be replaced"):
        write(tmp_path, one="ours")


def test_nothing_changes_where_writing_fails(tmp_path):
    write(tmp_path, one="old")

    def run_out_of_space():
        with new_files(tmp_path) as new:
            (new / "one").write_text("half")
            raise OSError(errno.ENOSPC, "No space left on device", str(new / "two"))

    with pytest.raises(OSError) as raised:
        run_out_of_space()
    assert raised.value.filename == str(tmp_path / "two")
    assert visible(tmp_path) == {"one": "old"}
    assert not (tmp_path / own_files.DRAFT).exists()


def test_what_is_unfinished_lies_in_the_draft(tmp_path, monkeypatch):
    """So the next program removes what one that was killed has left."""
    places = []

    def mkstemp(suffix, prefix, folder, really=tempfile.mkstemp):
        places.append(folder)
        return really(suffix, prefix, folder)

    monkeypatch.setattr(tempfile, "mkstemp", mkstemp)
    write(tmp_path, one="new")
    assert set(places) == {tmp_path / own_files.DRAFT}


@pytest.mark.parametrize("after", range(5))
def test_a_program_killed_between_two_files_may_try_again(tmp_path, monkeypatch, after):
    write(tmp_path, one="old", two="old")
    moves = []

    def replace(old, new, really=os.replace):
        if len(moves) == after:
            raise KeyboardInterrupt
        moves.append(new)
        really(old, new)

    with monkeypatch.context() as patch, contextlib.suppress(KeyboardInterrupt):
        patch.setattr(os, "replace", replace)
        write(tmp_path, one="new", two="new")
    assert set(visible(tmp_path).values()) <= {"old", "new"}
    write(tmp_path, one="newer", two="newer")
    assert visible(tmp_path) == {"one": "newer", "two": "newer"}


def test_a_folder_that_is_a_file_is_named(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="out: cannot write there"):
        write(tmp_path / "out", one="ours")


def test_what_is_there_already_in_the_same_words_may_be_written(tmp_path):
    (tmp_path / "one").write_text("the same")
    write(tmp_path, one="the same")
    write(tmp_path, one="newer")
    assert visible(tmp_path) == {"one": "newer"}


@pytest.mark.parametrize("text", ["", "[]", '{"one": 5}', "\x00"])
def test_where_the_list_is_damaged_all_files_are_somebody_elses(tmp_path, text):
    write(tmp_path, one="ours")
    (tmp_path / own_files.RECORD).write_text(text)
    with pytest.raises(InputError, match="one: would be replaced"):
        write(tmp_path, one="newer")
