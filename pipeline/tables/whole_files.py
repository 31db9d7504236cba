"""Files on disk, each whole or not at all, and what they hold as text, JSON or a hash."""

import contextlib
import hashlib
import json
import os
import tempfile
from pathlib import Path

from pipeline.errors import renamed

PART, PART_END = ".whiskerforce-", ".part"  # around random letters: names of unfinished files
LONG_S = 24 * 3600  # after which nobody is writing a file that did not change


@contextlib.contextmanager
def whole_file(path):
    """Yield a temporary path beside `path` that replaces it when the block succeeds.

    Readers see the old file or the new one, never a part; if the block fails, the temporary
    file goes and `path` stays as it was. Who may read and write it stays as it was, too. An error
    of the system names `path`.
    """
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(PART_END + path.suffix, PART, path.parent)
    except OSError as error:
        raise renamed(error, path) from error
    os.close(handle)
    temporary = Path(name)
    try:
        _remove_long_left(temporary)
        yield temporary
        temporary.chmod(path.stat().st_mode & 0o777 if path.is_file() else 0o666 & ~_umask())
        to_disk(temporary)
        os.replace(temporary, path)
    except OSError as error:
        if error.filename is None or str(error.filename) == name:
            raise renamed(error, path) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def try_writing(folder) -> None:
    """Write a file into a folder, and remove it; OSError, which names no file, where it fails."""
    tried = Path(folder) / f"{PART}try{PART_END}"
    try:
        with whole_file(tried) as temporary:
            temporary.write_text("")
        tried.unlink()
    except OSError as error:
        raise OSError(error.errno, error.strerror) from error


def set_aside(path) -> Path:
    """Rename a file that a person may have written, before it is replaced; return its new path."""
    path, number = Path(path), 1
    while (old := path.with_name(f"{path.name}.old{number if number > 1 else ''}")).exists():
        number += 1
    os.replace(path, old)
    return old


def remove_unfinished(folder) -> None:
    """Remove what a program that was killed has left of files that it was writing."""
    for left in Path(folder).glob(f"{PART}*{PART_END}*"):
        with contextlib.suppress(OSError):
            left.unlink()


def _remove_long_left(new) -> None:
    """Remove what killed programs left beside a new file, by the clock of that disk.

    Where no lock tells that nobody is writing there, as beside a person's files.
    """
    now = new.stat().st_mtime
    for left in new.parent.glob(f"{PART}*{PART_END}*"):
        with contextlib.suppress(OSError):
            if left.stat().st_mtime < now - LONG_S:
                left.unlink()


@contextlib.contextmanager
def temporary_room():
    """Let the system's errors in the block name the folder for temporary files."""
    try:
        yield
    except OSError as error:
        raise renamed(error, tempfile.gettempdir()) from error


def to_disk(path) -> None:
    """Wait until a file, or a folder's list of files, is on the disk: power may fail."""
    if os.name == "nt" and Path(path).is_dir():
        return  # Windows opens no folder, and keeps their lists by itself
    handle = os.open(path, os.O_RDONLY if os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sha256(path) -> str:
    """SHA-256 of a file's content."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _umask() -> int:
    """The process's file-mode mask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def write_text(path, text: str, line_end: str | None = None) -> None:
    """Write a text file, whole or not at all, with the system's line ends or those given."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline=line_end)


def replace_text(path, text: str, keep=True) -> Path | None:
    """Write a text file in place of one that, if `keep`, a person has written.

    That one stays where the new one cannot be written; else it is kept under another name, which
    is returned. None: there was none.
    """
    path = Path(path)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
        return set_aside(path) if keep and path.exists() else None


def write_json(path, value) -> None:
    """Write a JSON file, whole or not at all."""
    write_text(path, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def read_json(path, default=None):
    """Read a JSON object from a file; `default` where there is none that can be read."""
    try:
        value = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return default
    return value if isinstance(value, dict) else default
