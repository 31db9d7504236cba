"""How many contacts are found where there are none: free frames, rendered and processed.

    python workflows/false_contacts.py --frames 100000 --jobs 2

Free whisking beside a pole, near-misses (down to 0.02 mm), and a whisker that passes over the
pole take turns, on both sides of the pole. Prints a table in Markdown; the exit status is 1 where
a contact was found. A session's videos are deleted once they have been processed.
"""

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

import measuring
import pages
import pandas as pd

from pipeline.run import analyse
from synthetic.session import render_session

PRESETS = ("free", "near_miss", "passing")
FRAMES = 1000  # of a video
SIDES = 2  # videos of a session: the pole on one side, and on the other


def look_at(preset: str, seed: int, folder: Path, frames: int) -> dict:
    """Render and process a session of videos of so many frames; contacts found, seconds."""
    started = time.perf_counter()
    paths = render_session(folder, preset, seed, SIDES, frames=frames)
    rendered = time.perf_counter()
    row = {"preset": preset, "frames": 0, "found": 0, "touching": 0}
    for path in paths:
        video = measuring.RenderedVideo.of(path, folder)
        if len(video.contacts()):
            raise ValueError(f"{path}: preset {preset} must have no contact, got some")
        analysis = analyse(path, video.settings)
        row["frames"] += analysis.n_frames
        row["found"] += len(analysis.contacts)
        row["touching"] += int(analysis.frames["in_contact"].sum())
    processed = time.perf_counter()
    shutil.rmtree(folder)
    return row | {"rendering": rendered - started, "processing": processed - rendered}


def sessions(frames: int, seed: int) -> list[tuple[str, int]]:
    """Presets and seeds of as many sessions as hold at least so many frames."""
    count = -(-frames // (FRAMES * SIDES))
    return [(PRESETS[k % len(PRESETS)], seed + k) for k in range(count)]


def table_of(rows: list[dict], seconds: float) -> str:
    """False contacts by preset and of all, as Markdown."""
    table = pd.DataFrame(rows).groupby("preset", sort=False).sum()
    table.loc["all"] = table.sum()
    rows = []
    for name, row in table.iterrows():
        speed = [f"{row['frames'] / row[s]:.0f} frames/s" for s in ("rendering", "processing")]
        counts = [f"{row[c]:.0f}" for c in ("frames", "found", "touching")]
        rows.append([name, *counts, *speed])
    header = ["free frames of", "frames", "contacts found", "frames in them"]
    frames = table.loc["all", "frames"]
    said = f"{frames:.0f} frames in {seconds:.0f} s; speeds are those of one process."
    return f"{pages.table([*header, 'rendering', 'processing'], rows)}\n\n{said}"


def main(argv=None) -> int:
    """Count the contacts found in free frames; 1 where there is one."""
    measuring.limit_threads()
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--frames", type=int, default=100_000, help="at least so many")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=0, help="of the first session")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    started = time.monotonic()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        asked = [
            (preset, seed, Path(folder) / f"{preset}_{seed}", FRAMES)
            for preset, seed in sessions(args.frames, args.seed)
        ]
        for row in measuring.of_each(look_at, args.jobs, *zip(*asked, strict=True)):
            rows.append(row)
            print(row, file=sys.stderr)
    text = table_of(rows, time.monotonic() - started)
    pages.publish(text, args.write, "false contacts")
    return int(any(row["found"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
