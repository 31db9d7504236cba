"""New results of a video replace the old ones: all or none, however the program ends.

New results are written into a hidden draft inside the video's results folder. Renaming the
finished draft to READY is the one moment at which they become the video's results; their files
then move over the old ones. A program that ends before that moment leaves the old results; if it
ends later, `settle` completes the moves at the next start. corrections.csv is never touched, and
what a person has changed is kept under another name.
"""

import contextlib
import os
import shutil
import tempfile
from pathlib import Path

from pipeline.errors import renamed
from pipeline.runtime.folder_lock import locked
from pipeline.tables.own_files import copies, keep_changed
from pipeline.tables.run_record import STATE_FILE
from pipeline.tables.whole_files import read_json, remove_unfinished, sha256, to_disk, write_json

DRAFT = ".whiskerforce-draft-"  # and random letters: two processes never share a draft
READY = ".whiskerforce-ready"
OVERLAYS = ("overlay.mp4", "overlay.avi", "overlay.png")


@contextlib.contextmanager
def draft(folder):
    """Yield an empty folder for a video's new results; they are ready when the block succeeds.

    `settle` then puts them in place. If the block fails, the draft goes and old results stay; an
    OSError names the file's place among the results.
    """
    folder.mkdir(exist_ok=True)
    new = Path(tempfile.mkdtemp(prefix=DRAFT, dir=folder))
    try:
        yield new
        to_disk(new)
        new.rename(folder / READY)
        to_disk(folder)
    except BaseException as error:
        _remove(new, folder)
        path = Path(str(getattr(error, "filename", None)))
        if isinstance(error, OSError) and path.is_relative_to(new):
            raise renamed(error, folder / path.relative_to(new)) from error
        raise


def is_settled(folder) -> bool:
    """Whether all files of a results folder are of the same run."""
    return not (folder / READY).exists()


def settle(folder) -> list[str]:
    """Put results that are ready in their place; remove drafts, and the folder if that empties it.

    Returns a sentence on each file that a person had changed, and which is kept. OSError where the
    folder cannot be written; calling it again goes on from there.
    """
    kept = put_in_place(folder)
    remove_unfinished(folder)
    for left in folder.glob(f"{DRAFT}*"):
        _remove(left, folder)
    return kept


def put_in_place(folder) -> list[str]:
    """As `settle`, but what another thread is writing there stays."""
    return [] if is_settled(folder) else _move_in(folder / READY, folder)


def overlays_in(folder) -> list[Path]:
    """The drawn videos or pictures in a video's results folder."""
    return [path for name in OVERLAYS if (path := folder / name).exists()]


@contextlib.contextmanager
def settled(out):
    """Keep others out of a results folder while the block lasts; its results are whole then.

    Yields what `settle_all` returns. A folder that holds no results stays as it is.
    """
    with contextlib.ExitStack() as held:
        kept = []
        if (Path(out) / "videos.csv").is_file():
            held.enter_context(locked(out))
            kept = settle_all(out)
        yield kept


def settle_all(out) -> list[str]:
    """Settle every results folder in `out`; one that cannot be written is left as it is.

    Returns what `settle` does, of all of them.
    """
    kept = []
    for unfinished in (out, *Path(out).glob("figures/*/")):
        remove_unfinished(unfinished)
    for folder in [each for each in Path(out).iterdir() if each.is_dir()]:
        with contextlib.suppress(OSError):
            kept += settle(folder)
    return kept


def _move_in(ready, folder) -> list[str]:
    """Move tables, then what calls them whole, then drawings: so the next call knows how far."""
    new = {path.name: sha256(path) for path in _files(ready) if path.name != STATE_FILE}
    shows_others = (ready / STATE_FILE).exists() and (ready / "centrelines.parquet").exists()
    gone = {path.name: "" for path in overlays_in(folder)} if shows_others else {}
    kept = keep_changed(folder, gone | new)
    state = read_json(ready / STATE_FILE)
    if state is not None:
        write_json(ready / STATE_FILE, state | copies(folder))
    if (ready / STATE_FILE).exists():
        for name in gone:  # what shows other lines
            (folder / name).unlink(missing_ok=True)
        drawn = set(overlays_in(ready))
        for path in sorted(set(_files(ready)) - drawn, key=lambda p: p.name == STATE_FILE):
            os.replace(path, folder / path.name)
    for path in _files(ready):
        os.replace(path, folder / path.name)
    shutil.rmtree(ready)
    return kept


def _files(folder):
    return [path for path in folder.iterdir() if not path.name.startswith(".")]


def _remove(new, folder):
    shutil.rmtree(new, ignore_errors=True)
    with contextlib.suppress(OSError):  # it holds results, or a person's work
        folder.rmdir()
