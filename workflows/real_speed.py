"""Speed on real recordings, beside the Janelia Whisker Tracker, in one run.

    python workflows/real_speed.py VIDEO:left VIDEO:top --peer-python peer/bin/python

Both see the same files, H.264 copies without loss, one after the other, on one core. Figures are
processor time per frame [ms], the least of several runs, with start-up taken off: of ours scene,
whiskers and compilation (as in `real_recordings.py`), of the peer what two frames take. Ours
holds decoding, following, naming, and measuring angles and curvature; the peer's only its `trace`,
which decodes and finds lines without names. An optimised build of the peer is taken to be 3.3
times as fast as its wheel (`peer_tracker.OPTIMISED`).
"""

import argparse
import sys
import tempfile
from itertools import islice
from pathlib import Path

import measuring
import numpy as np
import pages
from peer_tracker import OPTIMISED, NoPeerError, find_peer
from real_recordings import processed, settings_for, video_and_face

from pipeline.video import open_video
from synthetic.encode import video_suffix, write_video
from synthetic.scene import Codec

REPEATS = 3
BRIEF = 2  # frames of the video that measures the peer's start-up
LOSSLESS = Codec("h264", crf=0)  # the peer cannot open every container
TARGETS = 5.0, 3.0  # times as fast as the peer's wheel, and as an optimised build
HEADER = [
    "video", "size", "lines / frame", "ours", "frames/s", "peer: lines / frame", "peer's wheel",
    "times as fast", "an optimised peer", "times as fast",
]  # fmt: skip


def our_time(video: Path, settings) -> tuple[float, float, int]:
    """Lines and processor time [s] per frame of ours, and the number of frames."""
    runs = [processed(video, settings) for _ in range(REPEATS)]
    return len(runs[0].lines) / runs[0].n_frames, min(r.cpu for r in runs), runs[0].n_frames


def copy_of(video: Path, folder, n_frames=None) -> Path:
    """A copy of all frames of a video, or of the first ones."""
    path = Path(folder) / f"{video.stem}_{n_frames or 'all'}{video_suffix(LOSSLESS)}"
    with open_video(video) as source:
        write_video(path, islice(source.frames(), n_frames), LOSSLESS)
    return path


def peer_time(peer, video: Path, n_frames: int) -> tuple[float, float]:
    """Lines and processor time [s] per frame of the peer's wheel, start-up taken off."""
    brief = copy_of(video, video.parent, BRIEF)
    start = min(peer.trace(brief)[2] for _ in range(REPEATS))
    runs = [peer.trace(video) for _ in range(REPEATS)]
    cpu = min(used for _, _, used in runs)
    return len(runs[0][0]) / n_frames, (cpu - start) / (n_frames - BRIEF)


def row_of(video: Path, face: str, peer, args) -> list[str]:
    """One row of the table; without the peer its columns stay empty."""
    with open_video(video) as source:
        size = f"{source.width} × {source.height}"
    settings = settings_for(video, face, args.scale, args.frames_per_second)
    theirs, peer_lines = np.nan, np.nan
    with tempfile.TemporaryDirectory() as folder:
        copy = copy_of(video, folder)
        lines, ours, n_frames = our_time(copy, settings)
        if peer is not None:
            peer_lines, theirs = peer_time(peer, copy, n_frames)
    times = theirs / ours, theirs / OPTIMISED / ours
    return [
        video.stem, size, f"{lines:.1f}", f"{1e3 * ours:.1f}", f"{1 / ours:.0f}",
        pages.cell("{:.1f}", peer_lines), pages.cell("{:.0f}", 1e3 * theirs),
        _held(times[0], TARGETS[0]), pages.cell("{:.0f}", 1e3 * theirs / OPTIMISED),
        _held(times[1], TARGETS[1]),
    ]  # fmt: skip


def _held(times, target) -> str:
    """How many times as fast, with the target where it is missed."""
    missed = f" (MISSED: {target:g})" if times < target else ""
    return pages.cell("{:.1f}", times) + missed


def arguments(argv=None):
    """The command line's arguments."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("videos", type=video_and_face, nargs="+", metavar="VIDEO:SIDE")
    parser.add_argument("--scale", default="16", help="pixels per mm")
    parser.add_argument("--frames-per-second", type=float, default=1000.0)
    parser.add_argument("--peer-python", help="python that has the peer; see peer_tracker.py")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Print the table."""
    measuring.limit_threads()
    args = arguments(argv)
    try:
        peer = find_peer(args.peer_python, args.videos[0][0].resolve())
    except NoPeerError as error:
        print(error, file=sys.stderr)
        peer = None
    rows = [row_of(video, face, peer, args) for video, face in args.videos]
    pages.publish(pages.table(HEADER, rows), args.write, "real speed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
