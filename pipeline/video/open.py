"""Finds inputs and opens them as streams of grey frames: videos, TIFF stacks, image folders."""

import os
import re
from collections import Counter
from pathlib import Path

from pipeline.errors import VideoError
from pipeline.video.base import Video

__all__ = ["Video", "VideoError", "find_videos", "open_video"]

VIDEO_SUFFIXES = frozenset((
    ".avi", ".mp4", ".m4v", ".mov", ".mkv", ".webm", ".mpg", ".mpeg", ".mjpg", ".mjpeg",
    ".wmv", ".asf", ".flv", ".ts", ".mts", ".m2ts", ".h264", ".264", ".h265", ".hevc",
    ".mj2", ".mxf", ".ogv", ".y4m", ".nut", ".gif", ".seq", ".cine",
))  # fmt: skip
TIFF_SUFFIXES = frozenset((".tif", ".tiff"))
IMAGE_SUFFIXES = TIFF_SUFFIXES | frozenset(
    [".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pnm", ".webp", ".jp2"]
)
SAME_KIND = {".tiff": ".tif", ".jpeg": ".jpg"}
# Videos and folders that this or other programs made of a video: never input.
RESULT_MARKS = ("run.json", "videos.csv", "centrelines.parquet")  # files of a results folder
RESULT_FOLDERS = ("truth", "figures", "__pycache__")
RESULT_VIDEO = re.compile(r"DLC_.*_labeled$|_overlay$|^overlay$")
PREVIEW = re.compile(r"preview")  # what `init` draws


def open_video(path, threads: int = 1) -> Video:
    """Open a video file, a StreamPix sequence, a TIFF stack, an image or a folder of images.

    Parameters
    ----------
    path : str or Path; or an array of frames (n, height, width); or an open `Video`, as it is
    threads : int
        For decoding; 1 keeps to one core, 0 takes what the codec thinks best.

    Raises
    ------
    VideoError
        If it does not exist, cannot be read, or has no frame; the message says what to do.
    """
    if isinstance(path, Video):
        return path
    if hasattr(path, "shape") or isinstance(path, (list, tuple)):
        from pipeline.video.arrays import ArrayVideo

        return ArrayVideo(path)
    if not isinstance(path, (str, os.PathLike)):
        kind = type(path).__name__
        raise VideoError(path, f"expected the path of a video, or an array of frames, got {kind}")
    path = Path(path)
    if path.is_dir():
        from pipeline.video.image_stacks import ImageFolderVideo

        return ImageFolderVideo(path, *_images_by_kind(path))
    if path.is_symlink() and not path.exists():
        raise VideoError(path, "is a link to a file that is not there; is a disk missing?")
    if not path.exists():
        raise VideoError(path, "does not exist; check the name")
    if not path.is_file():
        raise VideoError(path, "is a pipe or a device, not a file; save the video first")
    if not path.stat().st_size:
        raise VideoError(
            path, "cannot be read as a video: the file is empty; copy or record it again"
        )
    suffix = path.suffix.lower()
    if suffix in TIFF_SUFFIXES:
        from pipeline.video.image_stacks import TiffVideo

        return TiffVideo(path)
    if suffix in IMAGE_SUFFIXES:
        from pipeline.video.image_stacks import ImageFolderVideo

        return ImageFolderVideo(path, [path])
    if suffix == ".seq":
        from pipeline.video.streampix import StreamPixVideo

        return StreamPixVideo(path)
    return _open_container(path, threads)


def _open_container(path, threads) -> Video:
    """Open a video file through PyAV, else through OpenCV."""
    import av

    from pipeline.video.containers import ContainerVideo, check_memory, reason_of
    from pipeline.video.opencv import OpenCvVideo

    try:
        return ContainerVideo(path, threads)
    except av.FFmpegError as error:
        check_memory(error)
        reason = reason_of(error)
    try:
        return OpenCvVideo(path)
    except VideoError:
        raise VideoError(path, f"cannot be read as a video: {_looks(path, reason)}") from None


def _looks(path, reason):
    """Describe a file that is not a video, and say what to do; `reason`: the decoder's."""
    with open(path, "rb") as file:
        head = file.read(512)
    if _is_text(head):
        line = head.decode("utf-8", "replace").splitlines()[0].strip()[:40]
        return f"it is a text file beginning {line!r}; remove it, or name a video"
    if _has_video_stream(path):
        return (
            f"none of its frames can be decoded ({reason}): the file is damaged; copy it again "
            "from the recording computer"
        )
    return (
        f"{reason}; it is damaged or cut off (an MP4 whose recording did not finish has no "
        "index), or no video; copy it again, or repair it with FFmpeg"
    )


def _has_video_stream(path) -> bool:
    """Whether the container is sound, and says how large its pictures are."""
    import av

    try:
        with av.open(str(path), metadata_errors="replace") as container:
            streams = container.streams.video
            return bool(streams) and bool(streams[0].codec_context and streams[0].width)
    except (av.FFmpegError, OSError):
        return False


def _is_text(head: bytes) -> bool:
    try:
        text = head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:  # not just a character cut at the end
            return False
        text = head[: error.start].decode("utf-8")
    return all(c.isprintable() or c.isspace() for c in text)


def find_videos(paths) -> list[Path]:
    """Return the inputs that `paths`, one or several, stand for: each once, in the order given.

    A file stands for itself. A folder of images stands for itself, as one video. Any other
    folder stands for the videos and TIFF stacks directly in it, in natural order, and for its
    subfolders that are folders of images or empty (so that an empty one is reported); results,
    truth, previews and hidden files are left out. A folder without any input stands for itself,
    and `open_video` will say what is wrong with it.

    Raises
    ------
    VideoError
        If a path does not exist.
    """
    found = {}
    for path in map(Path, [paths] if isinstance(paths, (str, Path)) else paths):
        if not path.exists():
            raise VideoError(path, "does not exist; check the name")
        for item in _inputs_in(path) if path.is_dir() else [path]:
            found.setdefault(item.resolve(), item)
    return list(found.values())


def is_result_folder(folder) -> bool:
    """Whether a folder holds results, by its name or its contents."""
    marks = (os.path.exists(folder / name) for name in RESULT_MARKS)
    return folder.name in RESULT_FOLDERS or any(marks)


def _inputs_in(folder):
    if _is_image_folder(folder):
        return [folder]
    found = [item for item in _listing(folder) if _is_input(item)]
    return found or [folder]


def _is_input(item):
    """Whether something in a folder is an input of its own."""
    if item.is_dir():
        return _is_image_folder(item) or not entries(item)
    leads_nowhere = item.is_symlink() and not item.exists()
    if RESULT_VIDEO.search(item.stem) or not (item.is_file() or leads_nowhere):
        return False
    suffix = item.suffix.lower()
    return suffix in VIDEO_SUFFIXES or (suffix in TIFF_SUFFIXES and _is_stack(item))


def _is_image_folder(folder):
    """Whether a folder's images are one input: some images, no video, no TIFF stack."""
    if is_result_folder(folder):
        return False
    items = _listing(folder)
    if any(item.suffix.lower() in VIDEO_SUFFIXES for item in items):
        return False
    images = _images(items)
    if not images:
        return False
    # One look at the first TIFF is enough: a folder holds stacks or single pages, not both.
    tiffs = [item for item in images if item.suffix.lower() in TIFF_SUFFIXES]
    return not (tiffs and _is_stack(tiffs[0]))


def _is_stack(path):
    from pipeline.video.image_stacks import is_stack

    return is_stack(path) is not False  # an unreadable TIFF is an input: it fails with a message


def entries(folder) -> list[Path]:
    """What is in a folder; nothing where it may not be read."""
    try:
        return list(folder.iterdir())
    except PermissionError:
        return []


def _listing(folder):
    return sorted(
        (item for item in entries(folder) if not item.name.startswith(".")), key=natural_key
    )


def natural_key(path: Path):
    """Sort key that puts frame10 behind frame9."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], path.name


def images_of(folder):
    """Return the image files in `folder` that are a video's frames, in natural order."""
    return _images_by_kind(folder)[0]


def _images_by_kind(folder) -> tuple[list[Path], list[Path], list[Path]]:
    """Image files that are frames, those of another kind, and those named otherwise, in order.

    Frames' names differ in their numbers alone, where there are two such names.
    """
    images = _images(_listing(folder))
    if images:
        same, others = _commonest(images, _kind)
        frames, strangers = _commonest(same, lambda item: re.sub(r"\d+", "#", item.stem.lower()))
        return (frames, others, strangers) if len(frames) > 1 else (same, others, [])
    names = [item.name for item in _listing(folder)]
    videos = [name for name in names if Path(name).suffix.lower() in VIDEO_SUFFIXES]
    if videos:
        raise VideoError(folder, f"is a folder of videos: name one, such as {videos[0]}", 0)
    if not names and not os.access(folder, os.R_OK | os.X_OK):
        raise VideoError(folder, "may not be read: change its permissions, or move it away", 0)
    if not names:
        raise VideoError(folder, "is an empty folder: expected videos or images in it", 0)
    if is_result_folder(folder):
        raise VideoError(folder, "holds results, not videos: name the folder of the videos", 0)
    some = ", ".join(names[:4]) + (", …" if len(names) > 4 else "")
    raise VideoError(
        folder, f"holds neither videos nor images (only {some}): name a folder of videos", 0
    )


def _kind(item) -> str:
    """An image's suffix; one for all that mean the same."""
    return SAME_KIND.get(item.suffix.lower(), item.suffix.lower())


def _commonest(items, key) -> tuple[list, list]:
    """The items whose key is the commonest one, and the others."""
    keys = [key(item) for item in items]
    commonest = Counter(keys).most_common(1)[0][0]
    pairs = list(zip(items, keys, strict=True))
    return [i for i, k in pairs if k == commonest], [i for i, k in pairs if k != commonest]


def _images(items):
    return [
        item
        for item in items
        if item.suffix.lower() in IMAGE_SUFFIXES
        and item.is_file()
        and not PREVIEW.search(item.stem.lower())
    ]
