"""Damaged videos of every container, decoded to their end; and odd ones, wholly analysed."""

import functools
import resource
import shutil
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np
import tifffile

from pipeline.errors import VideoError
from pipeline.run import analyse
from pipeline.session.session_file import settings_from
from pipeline.video.open import open_video
from promises.children import each_in_child, last_line
from promises.trial import Effort, Tried

SHAPE, FRAMES = (48, 64), 12
DAMAGES = 1020  # of every container
LONGEST_S = 20  # of one case
MOST_MEMORY = 2**30  # bytes, above what the process has before
ABSURD = (0, 1, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)
SETTINGS = settings_from(
    {
        "recording": {"frames_per_second": 1000, "pixels_per_mm": 5, "face": "left"},
        "whisker": [
            {"name": "C2", "length_mm": 18, "cone_length_mm": 18.947, "base_radius_um": 37}
        ],
    }
)


class Case(NamedTuple):
    """A damaged input: the name of what is done to it (of DAMAGED_BY), and where, by a seed."""

    what: str
    seed: int


def picture(i) -> np.ndarray:
    """A dark line that swings, and noise."""
    rng = np.random.default_rng(i)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    line = 90 * np.exp(-((y - 24 - 8 * np.sin(i / 3) - 0.1 * x) ** 2) / 6)
    return (200 - line + rng.normal(0, 2, SHAPE)).clip(0, 255).astype(np.uint8)


# Whole inputs ---------------------------------------------------------------------------------


def write_container(path, codec="mjpeg", pixels="yuvj420p", images=None) -> None:
    """Write a video file."""
    images = [picture(i) for i in range(FRAMES)] if images is None else images
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=25, options={"g": "6"} if "264" in codec else {})
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = pixels
        for image in images:
            frame = av.VideoFrame.from_ndarray(image, format="gray").reformat(format=pixels)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


def write_tiff(path, images=None, **options) -> None:
    """Write a TIFF stack, page by page."""
    images = np.stack([picture(i) for i in range(FRAMES)]) if images is None else images
    with tifffile.TiffWriter(path) as writer:
        for image in images:
            writer.write(image, photometric="minisblack", **options)


def write_seq(path) -> None:
    """Write a StreamPix sequence."""
    height, width = SHAPE
    size = height * width
    stride = -(-(size + 8) // 512) * 512
    head = struct.pack("<I24siI512s", 0xFEED, "Norpix seq\n".encode("utf-16-le"), 3, 1024, b"")
    head += struct.pack("<8IId", width, height, 8, 8, size, 100, FRAMES, 0, stride, 1000.0)
    frames = [picture(i).tobytes().ljust(stride, b"\0") for i in range(FRAMES)]
    path.write_bytes((head + bytes(32)).ljust(1024, b"\0") + b"".join(frames))


def write_folder(path) -> None:
    """Write a folder of PNG images."""
    path.mkdir()
    for i in range(FRAMES):
        cv2.imwrite(str(path / f"frame{i:03}.png"), picture(i))


WRITERS = {
    "AVI": ("video.avi", write_container),
    "AVI, H.264": ("video.avi", functools.partial(write_container, codec="libx264",
                                                   pixels="yuv420p")),
    "MP4": ("video.mp4", functools.partial(write_container, codec="libx264", pixels="yuv420p")),
    "TIFF": ("video.tif", write_tiff),
    "SEQ": ("video.seq", write_seq),
    "PNG folder": ("video", write_folder),
}  # fmt: skip


# Damages --------------------------------------------------------------------------------------


def cut(data, rng):
    """Lose the end, at any byte."""
    return data[: rng.integers(len(data))]


def flip(data, rng):
    """Change single bits."""
    for at in rng.integers(len(data), size=1 + rng.integers(8)):
        data[at] ^= 1 << rng.integers(8)
    return data


def overwrite(data, rng):
    """Lose a stretch to zeros or to noise."""
    at, length = rng.integers(len(data)), 1 + rng.integers(400)
    noise = rng.integers(0, 256, length, np.uint8) * rng.integers(2, dtype=np.uint8)
    return data[:at] + noise.tobytes() + data[at + length :]


def lose(data, rng):
    """Lose a stretch from the middle."""
    at = rng.integers(len(data))
    return data[:at] + data[at + 1 + rng.integers(400) :]


def absurd(data, rng):
    """Put an absurd number into the first kilobyte, where sizes and counts are."""
    at = rng.integers(min(len(data), 1024))
    number = int(rng.choice(ABSURD)).to_bytes(4, "little" if rng.integers(2) else "big")
    return data[:at] + number + data[at + 4 :]


def repeat(data, rng):
    """Write a stretch twice."""
    at = rng.integers(len(data))
    return data[:at] + data[at : at + 1 + rng.integers(400)] + data[at:]


DAMAGED_BY = (cut, flip, overwrite, lose, absurd, repeat)


def damage(path, case: Case) -> None:
    """Do to a file, or to one file of a folder, what a case says."""
    rng = np.random.default_rng([case.seed, 17])
    if path.is_dir():
        path = sorted(path.iterdir())[rng.integers(FRAMES)]
    by = {each.__name__: each for each in DAMAGED_BY}[case.what]
    path.write_bytes(by(bytearray(path.read_bytes()), rng))


# What comes of it -----------------------------------------------------------------------------


def look(path) -> tuple[int, str, str]:
    """Frames that can be read, the error that ends them, and what is said of them."""
    count, said = 0, ""
    try:
        with open_video(path) as video:
            for image in video.watched():
                count += image.shape == video.shape and image.dtype == np.uint8
            said = "; ".join(video.problems())
    except VideoError as error:
        return count, error.problem, ""
    return count, "", said


def try_container(kind, folder, effort: Effort) -> Tried:
    """Decode damaged files of one container."""
    tried = Tried()
    name, write = WRITERS[kind]
    (folder / "whole").mkdir()
    write(folder / "whole" / name)
    whole_frames, error, said = look(folder / "whole" / name)
    if (whole_frames, error, said) != (FRAMES, "", ""):
        raise RuntimeError(f"{kind}: {whole_frames} frames, {error or said}")
    seeds = range(effort.seed, effort.seed + effort.cases(DAMAGES, len(DAMAGED_BY)))
    cases = [Case(DAMAGED_BY[seed % len(DAMAGED_BY)].__name__, seed) for seed in seeds]
    ending_of = functools.partial(_damaged, folder / "whole" / name, folder)
    silent, most, failed, warned = 0, 0, 0, 0
    for case, ending in zip(
        cases, each_in_child(ending_of, cases, LONGEST_S, _bound_memory), strict=True
    ):
        tried.cases += 1
        most = max(most, ending.added)
        if ending.fault:
            tried.check(False, f"{kind}, {case}: {last_line(ending.fault)}")
            continue
        count, error, said = ending.value
        failed += bool(error)
        warned += bool(said)
        tried.check("\n" not in error + said, f"{kind}, {case}: many lines: {error + said}")
        if case.what == "cut" and not error and not said and count < FRAMES:
            silent += 1
            tried.check(False, f"{kind}, {case}: {FRAMES - count} frames are missing, unsaid")
    whole = tried.cases - failed - warned
    tried.said = (
        f"{failed} end in an error, {warned} are read with a warning, {whole} as if whole; "
        f"{most / 2**20:.0f} MB at most"
    )
    return tried


def _bound_memory() -> None:
    """Let this process take no more memory than is promised."""
    with open("/proc/self/statm") as file:
        taken = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MOST_MEMORY,) * 2)


def _damaged(whole, folder, case: Case):
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / whole.name
        (shutil.copytree if whole.is_dir() else shutil.copy)(whole, path)
        damage(path, case)
        return look(path)


# Odd ones -------------------------------------------------------------------------------------


def _noise(*shape, dtype=np.uint8):
    return np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)


def _changing_size(path):
    path.mkdir()
    for i in range(6):
        cv2.imwrite(str(path / f"f{i}.png"), picture(i)[: 48 - 2 * i])


def _renamed(kind, suffix):
    """Write a video of one kind under the suffix of another."""

    def write(path):
        name, by = WRITERS[kind]
        by(path.with_name(name))
        path.with_name(name).rename(path)

    return suffix, write


def _header_lies(path, count):
    """A .seq whose header says another number of frames."""
    write_seq(path)
    data = bytearray(path.read_bytes())
    data[572:576] = struct.pack("<I", count)
    path.write_bytes(data)


ODD: dict[str, tuple[str, Callable]] = {
    "zero bytes AVI": (".avi", lambda p: p.touch()),
    "zero bytes MP4": (".mp4", lambda p: p.touch()),
    "zero bytes TIFF": (".tif", lambda p: p.touch()),
    "zero bytes SEQ": (".seq", lambda p: p.touch()),
    "zero bytes PNG": (".png", lambda p: p.touch()),
    "text as AVI": (".avi", lambda p: p.write_text("these are my notes\n" * 50)),
    "noise as AVI": (".avi", lambda p: p.write_bytes(_noise(9999).tobytes())),
    "AVI as MP4": _renamed("AVI", ".mp4"),
    "MP4 as AVI": _renamed("MP4", ".avi"),
    "TIFF as AVI": _renamed("TIFF", ".avi"),
    "AVI as TIFF": _renamed("AVI", ".tif"),
    "SEQ as MP4": _renamed("SEQ", ".mp4"),
    "MP4 as SEQ": _renamed("MP4", ".seq"),
    "1×1": (".tif", lambda p: write_tiff(p, _noise(9, 1, 1))),
    "10,000×1": (".tif", lambda p: write_tiff(p, _noise(9, 1, 10_000))),
    "1×10,000": (".tif", lambda p: write_tiff(p, _noise(9, 10_000, 1))),
    "2×48": (".tif", lambda p: write_tiff(p, _noise(9, 48, 2))),
    "10,000×16": (".tif", lambda p: write_tiff(p, _noise(3, 16, 10_000))),
    "16 bits": (".tif", lambda p: write_tiff(p, _noise(9, 48, 64, dtype=np.uint16))),
    "16 bits, black": (".tif", lambda p: write_tiff(p, np.zeros((9, 48, 64), np.uint16))),
    "floats": (".tif", lambda p: write_tiff(p, np.full((9, 48, 64), np.nan, np.float32))),
    "colour": (".tif", lambda p: tifffile.imwrite(p, _noise(9, 48, 64, 3), photometric="rgb")),
    "one frame": (".avi", lambda p: write_container(p, images=[picture(0)])),
    "two frames": (".avi", lambda p: write_container(p, images=[picture(0), picture(1)])),
    "sizes that change": ("", _changing_size),
    "SEQ that counts none": (".seq", lambda p: _header_lies(p, 0)),
    "SEQ that counts too few": (".seq", lambda p: _header_lies(p, 5)),
    "SEQ that counts too many": (".seq", lambda p: _header_lies(p, 4_000_000_000)),
    "a folder without files": ("", lambda p: p.mkdir()),
}


def try_odd(folder, effort: Effort) -> Tried:
    """Analyse videos that are odd as a whole, and every tenth of the damaged kinds."""
    tried = Tried()
    names = list(ODD)[:: max(round(1 / effort.share), 1)]
    failed = 0
    endings = each_in_child(functools.partial(_odd, folder), names, 120)
    for name, ending in zip(names, endings, strict=True):
        tried.cases += 1
        tried.check(not ending.fault, f"{name}: {last_line(ending.fault)}")
        failed += bool(ending.value)
        tried.check("\n" not in (ending.value or ""), f"{name}: many lines: {ending.value}")
    tried.said = f"{failed} end in an error of one line, {len(names) - failed} in tables"
    return tried


def _odd(folder, name) -> str:
    """Analyse one of the odd videos; the error, '' if there is none."""
    suffix, write = ODD[name]
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / f"odd{suffix}"
        write(path)
        try:
            analysis = analyse(path, SETTINGS)
        except VideoError as error:
            return str(error)
        numbers = analysis.contacts.select_dtypes("number").to_numpy(float)
        if len(numbers) or np.isinf(analysis.frames.select_dtypes("number").to_numpy(float)).any():
            raise RuntimeError("contacts or infinite numbers in a video without a touch")
    return ""
