"""A results folder belongs to one program at a time: a lock that ends with the program."""

import contextlib
import os
import socket
from pathlib import Path

from pipeline.errors import ADVICE, InputError, in_words

LOCK_FILE = ".whiskerforce-lock"
EVERYBODY = 0o666  # a colleague may go on with the folder
SHOWN = 200  # characters of the lock file


@contextlib.contextmanager
def locked(folder, patience_s=0):
    """Keep other runs and curations out of a results folder during the block.

    patience_s : how long to wait for another program to end

    Raises
    ------
    InputError
        If another program is using the folder, or it cannot be locked.
    """
    from filelock import FileLock, Timeout

    path = Path(folder) / LOCK_FILE
    holder = _holder(path)
    lock = FileLock(path, mode=EVERYBODY)
    try:
        lock.acquire(timeout=patience_s)
    except Timeout:
        raise InputError(
            f"{folder}: another whiskerforce is using it{holder}; wait until it has ended, "
            "or choose another folder"
        ) from None
    except (OSError, NotImplementedError) as error:
        raise InputError(
            f"{folder}: {_refusal(error)}; copy it to where you may write, or choose another "
            "folder"
        ) from None
    try:
        with contextlib.suppress(OSError):  # for the other one's message only
            path.write_text(f"process {os.getpid()} on {socket.gethostname()}\n", "utf-8")
        yield
    finally:
        lock.release()


def _refusal(error) -> str:
    """Why a folder cannot be locked: mostly since nothing can be written there."""
    if getattr(error, "errno", None) in ADVICE:
        return f"cannot write there ({os.strerror(error.errno)})"
    return f"cannot lock it ({in_words(error)})"


def _holder(path) -> str:
    """The process that holds a lock, in brackets; '' where that is not known."""
    try:
        text = " ".join(path.read_text("utf-8", errors="replace").split())
    except OSError:
        return ""
    return f" ({text[:SHOWN]})" if text else ""
