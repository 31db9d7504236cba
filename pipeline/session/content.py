"""What a video consists of on disk, and whether that is what results were made of.

A folder of images is its images: settings, previews and what file browsers leave there may change.
"""

import functools
import hashlib
from pathlib import Path, PureWindowsPath

from pipeline.errors import VideoError
from pipeline.tables import whole_files
from pipeline.tables.run_record import read_state
from pipeline.video.open import images_of

BESIDE = {".whiskers": (".measurements", ".bar")}  # of the Janelia tracker


def files_of(path) -> list[Path]:
    """The files that make up a video, or what another program has tracked."""
    if path.is_dir():
        try:
            return images_of(path)
        except VideoError:
            return []
    beside = (path.with_suffix(suffix) for suffix in BESIDE.get(path.suffix, ()))
    return [path, *(file for file in beside if file.is_file())]


def sha256(path) -> str:
    """SHA-256 of the content of a file, or of the names and contents of several."""
    files = files_of(Path(path))
    if files == [Path(path)]:
        return whole_files.sha256(path)
    whole = hashlib.sha256()
    for file in sorted(files):
        whole.update(f"{file.name} {whole_files.sha256(file)}\n".encode())
    return whole.hexdigest()


@functools.cache
def _sha256_at(path, *stamp) -> str:
    """The same, read once for as long as size and times stay as they are."""
    return sha256(path)


def stamp(path) -> dict:
    """Size and times of these files: changes with the content."""
    stats = [file.stat() for file in files_of(path)]
    return {
        "bytes": sum(s.st_size for s in stats),
        "modified_ns": max((s.st_mtime_ns for s in stats), default=0),
        "changed_ns": max((s.st_ctime_ns for s in stats), default=0),
    }


def same_input(state, path) -> bool:
    """Whether a video's content is that of its record; read only where size or times differ."""
    try:
        now, before = stamp(path), state.get("input")
        if before == now:
            return True
        if before is not None and before.get("bytes") != now["bytes"]:
            return False
        return bool(state.get("sha256")) and state["sha256"] == _sha256_at(path, *now.values())
    except OSError:
        return False  # it has gone, or cannot be read


def check_video(folder, path) -> None:
    """VideoError where there is another video than that of which the results in a folder are.

    It has the name that was recorded: of lines that another program tracked, a person may have put
    the video into videos.csv.
    """
    path, state = Path(path), read_state(folder)
    if not state or PureWindowsPath(state["path"]).name != path.name:
        return
    if path.exists() and not same_input(state, path):
        raise VideoError(
            path,
            "is not the video of these results, or has changed since: put that one there, or run "
            "this one",
        )
