"""The Janelia Whisker Tracker: lines, measurements and poles, out and in."""

import tempfile
from pathlib import Path

import numpy as np
from peer_tracker import find_peer

from exchanges.others import largest, printed_by
from pipeline.convert import janelia_files
from pipeline.convert.janelia import read_tracked, write_tracked
from pipeline.run import analyse_lines
from pipeline.video import open_video

# Its `trace` no longer looks for the bar (that part is commented out), but its library still does.
BARS = """
import ctypes, json, os, sys
import numpy
class Image(ctypes.Structure):
    _fields_ = [("kind", ctypes.c_int), ("width", ctypes.c_int), ("height", ctypes.c_int),
                ("text", ctypes.c_char_p), ("array", ctypes.c_void_p)]
class Bar(ctypes.Structure):
    _fields_ = [("time", ctypes.c_int), ("x", ctypes.c_float), ("y", ctypes.c_float)]
folder, ours, theirs, frames, radius = sys.argv[1:]
library = ctypes.CDLL(os.path.join(folder, "libwhiskio.so"))
library.Load_Bars_From_Filename.restype = ctypes.POINTER(Bar)
count = ctypes.c_int()
read = library.Load_Bars_From_Filename(ours.encode(), ctypes.byref(count))
frames, radius, double = 255 - numpy.load(frames), float(radius), ctypes.c_double
found = (Bar * len(frames))()
for i, frame in enumerate(frames):
    height, width = frame.shape
    image, x, y = Image(1, width, height, b"", frame.ctypes.data), double(), double()
    library.Compute_Bar_Location(
        ctypes.byref(image), ctypes.byref(x), ctypes.byref(y), round(0.75 * radius), 15, 0, 255,
        double(0.5 * radius), double(1.5 * radius))
    found[i] = Bar(i, x.value, y.value)
library.Save_Bars_To_Filename(theirs.encode(), found, len(frames))
print(json.dumps([[read[i].time, read[i].x, read[i].y] for i in range(count.value)]))
"""


def rows(video, folder, others):
    """What its programs read from our files, and we from theirs."""
    peer = find_peer(others.peer_python)
    yield from _out(video, folder, peer)
    yield from _bars(video, folder, peer, others.peer_python)
    yield from _in(video, folder, peer)


def _out(video, folder, peer):
    lines_path, table_path, *_ = write_tracked(folder, video)
    ours = janelia_files.read_whiskers(lines_path)
    peer.run("whisker_convert", lines_path, folder / "text.whisk1", "whisk1")
    peer.run("whisker_convert", folder / "text.whisk1", folder / "back.whiskers", "whiskbin1")
    back = janelia_files.read_whiskers(folder / "back.whiskers")
    off = max(largest([a.x, a.y], [b.x, b.y]) for a, b in zip(ours, back, strict=True))
    yield ".whiskers", "out, and back in", "whisker_convert", (
        f"{len(back)} of {len(ours)} lines; points differ by {off:.2g} px at most"
    )  # fmt: skip
    peer.run("measure", "--face", "left", lines_path, folder / "peer.measurements")
    found = janelia_files.read_measurements(folder / "peer.measurements")
    table = janelia_files.read_measurements(table_path)
    yield ".whiskers", "out", "measure", compared(table, found)
    for version in ("v1", "v2", "v3"):
        peer.run("measurements_convert", table_path, folder / version, version)
        same = janelia_files.read_measurements(folder / version)
        off = largest(same.values, table.values)
        yield ".measurements", "out, and back in", f"measurements_convert {version}", (
            f"{len(same.frame)} of {len(table.frame)} rows; values differ by {off:.2g} at most"
        )  # fmt: skip


def compared(table, found) -> str:
    """Our measurements of the same lines compared with the tracker's."""
    ours, theirs = (in_order(each) for each in (table, found))
    length, angle = (np.median(np.abs(ours[:, k] - theirs[:, k])) for k in (0, 2))
    return (
        f"{len(theirs)} of {len(ours)} lines measured; median differences from ours: length "
        f"{length:.2g} px, angle {angle:.2g}°"
    )


def in_order(table):
    """Values by frame and segment."""
    return table.values[np.lexsort([table.segment, table.frame])]


def _bars(video, folder, peer, python):
    """Its library reads our poles and writes its own; `measure` takes the distance to ours."""
    lines_path, table_path, bar_path = write_tracked(folder, video)
    ours, radius = janelia_files.read_bar(bar_path), video.pole().radius_px
    with open_video(video.path) as source:
        np.save(folder / "frames.npy", np.stack(list(source.frames())))
    files = bar_path, folder / "peer.bar", folder / "frames.npy"
    read = printed_by(python, BARS, peer.folder, *files, radius, environment=peer.environment)
    yield ".bar", "out", "Load_Bars_From_Filename", (
        f"{len(read)} of {len(ours)} rows; places differ by {largest(read, ours):.2g} px at most"
    )  # fmt: skip
    out = folder / "bar.measurements"
    peer.run("measure", "--face", "left", lines_path, bar_path, out)
    found, table = map(janelia_files.read_measurements, (out, table_path))
    off = largest(in_order(found)[:, 8], in_order(table)[:, 8])
    yield ".bar", "out", "measure", (
        f"{len(found)} distances to the pole; they differ from ours by {off:.2g} px at most"
    )  # fmt: skip
    theirs = janelia_files.read_bar(folder / "peer.bar")
    same = largest(theirs[:, 0], ours[:, 0]) == 0
    off = np.median(np.hypot(*(theirs - ours)[:, 1:].T)) if same else np.inf
    yield ".bar", "in", "Compute_Bar_Location, Save_Bars_To_Filename", (
        f"{len(theirs)} rows; its pole is {off:.2g} px from that of `run` in the median frame"
    )  # fmt: skip


def _in(video, folder, peer):
    """Our results from the tracker's lines, measurements and labels of the same video."""
    peer.run("trace", video.path, folder / "t.whiskers")
    peer.run("measure", "--face", "left", folder / "t.whiskers", folder / "t.measurements")
    scale = video.settings.recording.pixels_per_mm
    table = folder / "t.measurements"
    peer.run("classify", table, table, "left", "--px2mm", 1 / scale, "-n", 1)
    (folder / "peer.bar").replace(folder / "t.bar")
    lines, pole, n_frames = read_tracked(folder / "t.whiskers", video.settings)
    found = analyse_lines(lines, video.settings, pole, n_frames).contacts
    ours = video.contacts
    ratio = np.median(found["peak_force_uN"]) / np.median(ours["peak_force_uN"])
    yield ".whiskers, .measurements, .bar", "in", "trace, measure, classify, its pole", (
        f"{len(lines)} lines in {n_frames} frames; {len(found)} contacts ({len(ours)} by `run`), "
        f"median peak force {ratio:.2f} of that of `run`"
    )  # fmt: skip


def recorded(path):
    """Someone's own .measurements, read and written again."""
    table = janelia_files.read_measurements(path)
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / "again.measurements"
        janelia_files.write_measurements(again, table)
        same = again.read_bytes() == Path(path).read_bytes()
    yield ".measurements", "in, and back out", "a recorded file", (
        f"{len(table.frame)} rows; {'the same bytes' if same else 'OTHER BYTES'}"
    )  # fmt: skip
