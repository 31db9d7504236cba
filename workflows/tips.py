"""How far the tip of a whisker is beyond its traces' ends, and how well it is found, in videos.

    python workflows/tips.py                # a few rendered videos
    python workflows/tips.py --preset h264 --videos 20 --write tips.csv

A row per whisker whose tip is seen (`pipeline/kinematics/tip.py`), in pixels: `tip_px` is the
truth, on average over the `frames`; `found_px` and `se_px` what was found, and its standard
error. At the end it prints how large the errors are, and how large beside the stated ones.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import measuring
import numpy as np
import pandas as pd

from pipeline.forces.arc_length_offset import trace_ends
from pipeline.kinematics import StationStore
from pipeline.kinematics.tip import Tip, tip_beyond
from pipeline.run import find_whiskers, follow, look_at, without_whiskers
from pipeline.runtime import Clock
from pipeline.tables.centrelines import read_centrelines
from pipeline.video import open_video
from synthetic.session import render_session

VIDEOS, FRAMES = 4, 250
TIP_POINTS = 10  # of the true line, that have the direction of its tip


def kinematics_of(path, settings, store: StationStore):
    """The whiskers of a video as `run` has them before forces, and the traced lines.

    store : takes their places
    """
    chunks = []
    with open_video(path) as video:
        seen = without_whiskers(find_whiskers(*look_at(video, settings), settings), settings)
        found = follow(seen, settings, Clock(), store, chunks.append)
    return found, measuring.join_chunks(chunks)


def tips_of(video: measuring.RenderedVideo) -> list[dict]:
    """A row per whisker of a rendered video whose tip is seen."""
    settings, rows = video.settings, []
    truth = read_centrelines(video.folder / "centrelines.parquet")
    with StationStore() as store:
        found, lines = kinematics_of(video.path, settings, store)
        places_of = {name: found.places.of(name) for name in found.places.names}
    for name, places in places_of.items():
        end, _ = trace_ends(places, settings.advanced.forces)
        places = places.rows(np.isfinite(end))
        tip = tip_beyond(places, found.whisker_set.whiskers[name]) if len(places) else None
        if tip is not None:
            beyond = beyond_ends_px(lines, truth, name, places.frame)
            rows.append({"video": video.path.stem, "whisker": name, **row_of(tip, places, beyond)})
    return rows


def row_of(tip: Tip, places, beyond_px) -> dict:
    """A row of the table: where the tip is found, and how far it truly is."""
    row = {
        "px_per_mm": 1e-3 / places.pixel,
        "frames": len(places),
        "tip_px": beyond_px,
        "found_px": tip.beyond / places.pixel,
        "se_px": tip.se / places.pixel,
    }
    return {name: round(value, 2) for name, value in row.items()}


def beyond_ends_px(lines, truth, name, frames) -> float:
    """How far the true tip is beyond a whisker's traces [px], on average over `frames`."""
    traces, true = lines_of(lines, name), lines_of(truth, name)
    return float(np.mean([beyond_px(traces[f][-1], true[f]) for f in frames]))


def beyond_px(end, true) -> float:
    """How far a line's last point is beyond `end`, in the line's direction there [px].

    end : (2,); true : (points, 2)
    """
    along = true[-1] - true[-TIP_POINTS]
    return float((true[-1] - end) @ along / np.hypot(*along))


def lines_of(lines, name) -> dict:
    """The line (points, 2) [px] of one whisker in each frame."""
    rows = np.flatnonzero(lines.whisker == lines.names.index(name))
    points = np.stack([lines.x_px, lines.y_px], axis=1).astype(float)
    return {int(lines.frame[k]): points[slice(*lines.offsets[[k, k + 1]])] for k in rows}


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--preset", default="varied")
    parser.add_argument("--videos", type=int, default=VIDEOS)
    parser.add_argument("--frames", type=int, default=FRAMES, help="of each video")
    measuring.add_seed(parser, "of all videos")
    parser.add_argument("--write", type=Path, help="a CSV file for the table")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Render videos, one at a time, and measure the tips in them."""
    measuring.limit_threads()
    args, rows = arguments(argv), []
    for number, seed in enumerate(measuring.video_seeds(args.preset, args.seed, args.videos)):
        with tempfile.TemporaryDirectory() as folder:
            (path,) = render_session(
                folder, args.preset, seed, 1, frames=args.frames, first=number
            )
            rows += tips_of(measuring.RenderedVideo.of(path, folder))
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    if rows:
        error = table["found_px"] - table["tip_px"]
        size, ratio = (np.sqrt(np.mean(each**2)) for each in (error, error / table["se_px"]))
        print(f"seed {args.seed}: errors of {size:.2f} px (RMS), {ratio:.2f} times what is stated")
    if args.write:
        table.to_csv(args.write, index=False, lineterminator="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
