"""Videos of cameras and other programs: StreamPix sequences and TIFF stacks, in."""

import hashlib
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
from peer_tracker import NoPeerError

from exchanges.others import octave, printed_by
from pipeline.video import open_video

PIMS = """
import hashlib, json, sys
import numpy, pims
frames = pims.NorpixSeq(sys.argv[1])
data = numpy.stack([numpy.asarray(frame) for frame in frames])
print(json.dumps([len(data), hashlib.sha256(data.tobytes()).hexdigest()]))
"""
TOOLBOX = """
addpath(fullfile(argument{1}, 'videos'), fullfile(argument{1}, 'matlab'));
info = struct('width', str2num(argument{4}), 'height', str2num(argument{5}), 'fps', 500, ...
    'codec', 'imageFormat100');
file = fopen(argument{2});
sequence = seqWriterPlugin('open', 0, argument{3}, info);
while true
    frame = fread(file, [info.width, info.height], 'uint8=>uint8')';
    if numel(frame) < info.width * info.height, break; end
    seqWriterPlugin('addframe', sequence, frame);
end
seqWriterPlugin('close', sequence);
disp('0');
"""
SHAPE = 7, 48, 64  # frames, height, width


def streampix(video, folder, others):
    """A reader of StreamPix sequences finds the frames that we find in one."""
    sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "helpers"))
    from camera_files import streampix as sequence

    path = folder / "a.seq"
    path.write_bytes(sequence(_pixels(8).astype(np.uint8)))
    count, digest = printed_by(others.peer_python, PIMS, path)
    same = hashlib.sha256(_frames(path).tobytes()).hexdigest() == digest
    yield "StreamPix .seq", "in", "pims reads the same file", f"{count} frames; {_verdict(same)}"


def toolbox(video, folder, others):
    """A sequence that Piotr's toolbox writes, in Octave."""
    pixels = _pixels(8).astype(np.uint8)
    (folder / "raw").write_bytes(pixels.tobytes())
    _, height, width = SHAPE
    if not (others.toolbox / "videos").is_dir():
        raise NoPeerError(f"{others.toolbox} is not Piotr's Computer Vision Matlab Toolbox")
    files = others.toolbox, folder / "raw", folder / "b.seq"
    octave(others.octave, TOOLBOX, *files, width, height)
    found = _frames(folder / "b.seq")
    yield "StreamPix .seq", "in", "written by Piotr's toolbox", (
        f"{len(found)} frames; {_verdict(np.array_equal(found, pixels))}"
    )  # fmt: skip


def tiff(video, folder, others):
    """Stacks of 8, 12 and 16 bits that ImageMagick writes, as we and as it read them."""
    for bits in (8, 12, 16):
        names = [str(folder / f"{bits}_{i}.png") for i in range(SHAPE[0])]
        for name, frame in zip(names, _pixels(16), strict=True):
            cv2.imwrite(name, frame)
        stack, raw = folder / f"stack{bits}.tif", folder / f"stack{bits}.gray"
        _run(others.imagemagick, *names, "-depth", bits, "-compress", "none", stack)
        _run(others.imagemagick, stack, "-depth", 16, "-endian", "LSB", raw)
        whole = np.fromfile(raw, "<u2").reshape(SHAPE).astype(float) * ((1 << bits) - 1) / 65535
        expected = (np.round(whole).astype(int) >> (bits - 8)).astype(np.uint8)
        found = _frames(stack)
        yield f"TIFF, {bits} bits", "in", "written and read by ImageMagick", (
            f"{len(found)} frames; {_verdict(np.array_equal(found, expected))}"
        )  # fmt: skip


def _run(*command):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode:
        raise NoPeerError(done.stderr.strip().splitlines()[-1])


def _pixels(bits):
    """Random pixels that use all bits, uint16 (frames, height, width)."""
    return np.random.default_rng(0).integers(0, 1 << bits, SHAPE).astype(np.uint16)


def _frames(path):
    with open_video(path) as video:
        return np.stack(list(video.frames()))


def _verdict(same) -> str:
    return "the same" if same else "OTHER PIXELS"
