"""Which videos to process."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError, VideoError
from pipeline.video.open import entries, find_videos, is_result_folder, open_video


@dataclass(frozen=True)
class Input:
    """One video to process: a file or a folder of images; `fault` says why it cannot be.

    `root` is the path the user named: the input itself or a folder above it.
    """

    path: Path
    root: Path
    fault: str = ""


def find_inputs(paths, out=None) -> list[Input]:
    """Return the videos among `paths` (files, folders of images, folders of videos), in order.

    A folder is searched with its subfolders, without hidden ones and results (`out` may be the
    folder itself). A folder with nothing in it is an `Input` with a fault. InputError where a
    path does not exist.
    """
    paths = [Path(path) for path in paths]
    absent = [str(path) for path in paths if not path.exists()]
    if absent:
        raise InputError(f"no such file or folder: {', '.join(absent)}; check the spelling")
    out = None if out is None else Path(out).resolve()
    found = {}
    for root in paths:
        for path in _videos_in(root, out) if root.is_dir() else [root]:
            found.setdefault(path.resolve(), Input(path, root, _fault(path)))
    return list(found.values())


def _videos_in(folder, out, above=()) -> list[Path]:
    """Videos in a folder and in the subfolders that are no videos themselves.

    Links that lead to one of the folders `above` are not followed.
    """
    here = [path for path in find_videos([folder]) if path.resolve() != out] or [folder]
    below, above = [], (*above, folder.resolve())
    for entry in sorted(entries(folder)):
        if entry.is_dir() and entry not in here and not _is_result(entry, out):
            if entry.resolve() in above:
                continue
            inside = _videos_in(entry, out, above)
            below += [path for path in inside if path != entry or not _fault(path)]
    if below and here == [folder] and _fault(folder):
        return below
    return here + below


def _is_result(folder, out) -> bool:
    """Hidden, or written by `whiskerforce`, or by Python."""
    return folder.name.startswith(".") or folder.resolve() == out or is_result_folder(folder)


def _fault(path) -> str:
    """Why a folder or a name is no input; files are only opened when their turn comes."""
    if readable(path.resolve()) != str(path.resolve()):
        return "has a name that is not text (a wrong character set?): rename it"
    if path.is_file():
        return ""
    try:
        open_video(path).close()
    except VideoError as error:
        return error.problem
    return ""


def readable(path) -> str:
    """A path as text that any file can hold; "?" for what is no character."""
    return str(path).encode("utf-8", "replace").decode("utf-8")
