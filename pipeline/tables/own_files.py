"""Files that whiskerforce replaces only as it wrote them: what somebody else wrote stays.

A hidden list in the folder says what whiskerforce has written there. A file that is not on it, or
has been changed since, is a person's or another program's. In a folder of the user's choice it
stays as it is; in a results folder it is kept under another name. There run.json has a copy of the
list, for folders that are copied without their hidden files.
"""

import contextlib
import os
import shutil
import threading
from pathlib import Path

from pipeline.errors import InputError, renamed, why
from pipeline.runtime.folder_lock import locked
from pipeline.tables.run_record import STATE_FILE
from pipeline.tables.whole_files import (
    PART,
    read_json,
    set_aside,
    sha256,
    to_disk,
    whole_file,
    write_json,
)

DRAFT = f"{PART}new"  # holds what is being written
RECORD = f"{PART}written"  # the list: a file's name → SHA-256 of what may be there by us
COPY = "written"  # in run.json: a folder → its list
DEEPEST = 2  # folders below the one of run.json
MADE_OF = "/made of"  # in it: a file's name → what it was made of; no file can be called so
ADVICE = {  # on a person's changes of a file of results
    "contacts.csv": "contacts that you change in `whiskerforce curate` stay changed",
    "session.toml": "settings that you change in the session.toml beside the videos hold",
}
_LISTING = threading.Lock()  # of the threads of `curate`; other programs keep out of the folder


def make_folder(folder, option="") -> None:
    """Make a folder where it is missing; InputError, with the `option`, where that cannot be."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{option}{folder}: cannot write there ({why(error)}); choose another folder"
        ) from None


@contextlib.contextmanager
def new_files(folder, made_of=()):
    """Yield an empty folder, whose files move into `folder` when the block succeeds.

    made_of : hashes, or other names, of what the files are made of

    Raises
    ------
    InputError
        Where that would replace a file which whiskerforce did not write, which was changed since,
        or which was made of other things only. Nothing has changed then, as after any other error
        in the block.
    """
    folder = Path(folder)
    make_folder(folder)
    with locked(folder), _named_after(folder / DRAFT, folder):
        shutil.rmtree(folder / DRAFT, ignore_errors=True)  # of a program that was killed
        (folder / DRAFT).mkdir()
        try:
            yield folder / DRAFT
            _move_in(sorted((folder / DRAFT).iterdir()), folder, made_of)
        finally:
            shutil.rmtree(folder / DRAFT, ignore_errors=True)


def write_new(folder, write, made_of=()) -> list[Path]:
    """Let `write`, a function of an empty folder, write files there; move them into `folder`.

    Returns the paths that they have then, in the order of those that `write` returns.

    Raises
    ------
    InputError
        As `new_files`.
    """
    with new_files(folder, made_of) as new:
        written = write(new)
    return [Path(folder) / path.name for path in written]


def replace_own(path, write) -> list[str]:
    """Let `write`, a function of a path, make a file of a results folder anew.

    One that was changed since whiskerforce wrote it is kept; returns what `keep_changed` does.
    """
    path = Path(path)
    with whole_file(path) as new:
        write(new)
        return keep_changed(path.parent, {path.name: sha256(new)})


def keep_changed(folder, new) -> list[str]:
    """Rename the files of a results folder that were changed since whiskerforce wrote them.

    `new` are names of files that are about to be replaced, with the SHA-256 of what replaces them.
    Returns a sentence on each that is kept.
    """
    folder = Path(folder)
    with _LISTING:
        record = written_in(folder)
        ours, others = _compared(folder, new, record)
        write_json(folder / RECORD, record | ours)
    kept = []
    for path in filter(Path.is_file, others):
        changed = "was changed since whiskerforce wrote it"
        unknown = "is on no list of what whiskerforce wrote there"
        kept.append(
            f"{path} {changed if path.name in record else unknown}: it is kept as "
            f"{set_aside(path)}; {ADVICE.get(path.name, 'take from there what you need')}"
        )
    return kept


def written_in(folder) -> dict:
    """The list of what whiskerforce has written in a folder; {} where none can be read."""
    folder = Path(folder)
    above = (folder, *folder.parents)[: 1 + DEEPEST]
    copied = (_copy_in(each, folder) for each in above)
    return read_json(folder / RECORD) or next(filter(None, copied), {})


def copies(results, folders=(".",)) -> dict:
    """Copies of the lists of these folders in a results folder, for its run.json."""
    return {COPY: {each: written_in(Path(results) / each) for each in folders}}


def _copy_in(results, folder) -> dict:
    """The copy of a folder's list in the run.json of results that it is part of."""
    lists = read_json(results / STATE_FILE, {}).get(COPY)
    copy = lists.get(folder.relative_to(results).as_posix()) if isinstance(lists, dict) else None
    return copy if isinstance(copy, dict) else {}


def is_changed(path) -> bool:
    """Whether a file of a results folder was changed since whiskerforce wrote it.

    Where the folder has no list, that is not known.
    """
    record = written_in(path.parent)
    return bool(record and _compared(path.parent, {path.name: ""}, record)[1])


def check_own(folder, new) -> dict[str, list[str]]:
    """Raise InputError where a file is there that whiskerforce has not written so.

    `new` are the files' names with the SHA-256 of what is to replace them; the same may. Returns
    what the list will hold of these files: by name, hashes of what is there and of what will be.
    """
    ours, others = _compared(Path(folder), new, written_in(folder))
    for path in others:
        raise InputError(
            f"{path}: would be replaced, but was not written by whiskerforce, or was "
            "changed since; move it away or rename it, or choose another folder"
        )
    return ours


def _compared(folder, new, record) -> tuple[dict, list[Path]]:
    """What the list will hold of `new` files, and the files there that are not on the `record`."""
    ours, others = {}, []
    for name, digest in new.items():
        path, known = folder / name, record.get(name)
        ours[name] = [digest]
        if os.path.lexists(path):
            now = sha256(path) if path.is_file() else None
            if now in (digest, *(known if isinstance(known, list) else ())):
                ours[name] = [now, digest]
            else:
                others.append(path)
    return ours, others


def _move_in(paths, folder, made_of):
    """Move files into a folder; the list knows of old and new ones, whenever the program ends."""
    ours = check_own(folder, {path.name: sha256(path) for path in paths})
    made = origins(folder, ours, made_of)
    for path in paths:
        to_disk(path)
    draft = folder / DRAFT / RECORD  # what a program that is killed leaves there is removed
    write_json(draft, written_in(folder) | ours | {MADE_OF: made})
    os.replace(draft, folder / RECORD)
    for path in paths:
        os.replace(path, folder / path.name)
    to_disk(folder)


def origins(folder, names, made_of) -> dict:
    """What all files on the list are made of, these `names` of `made_of`.

    InputError where a file is there that was made of other things only: of another session. Long
    work asks so before it begins.
    """
    folder, made_of = Path(folder), set(made_of)
    before = written_in(folder).get(MADE_OF)
    before = before if isinstance(before, dict) else {}
    for name in names:
        known = before.get(name)
        known = set(map(str, known)) if isinstance(known, list) else set()
        if made_of and known and not made_of & known and (folder / name).exists():
            raise InputError(
                f"{folder / name}: would be replaced, but was made of something else (of another "
                "session, or another whisker); move it away or rename it, or choose another folder"
            )
    return before | dict.fromkeys(names, sorted(made_of))


@contextlib.contextmanager
def _named_after(draft, folder):
    """Let the system's errors with a file in `draft` name the file that it was to be."""
    try:
        yield
    except OSError as error:
        path = Path(str(error.filename or folder))
        path = folder / path.name if draft in path.parents else path
        raise renamed(error, path) from error
