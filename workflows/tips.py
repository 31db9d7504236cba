"""How far the tip of a whisker is beyond its traces' ends, and what shows it, in rendered videos.

    python workflows/tips.py                # a few videos
    python workflows/tips.py --seed 1118104893 --videos 20 --write tips.csv

The second makes tests/data/tips_of_varied_videos.csv.

A row per whisker whose tip is seen, with what `pipeline/forces/arc_length_offset.py` has to place
it by, all in pixels: `tip_px` is the truth, on average over the frames; `ends_sd_px` the scatter
of the ends; `fading_px` and `fading_sd_px` how far the tip is by how the lines fade, and its
scatter, in `frames` frames; `base_noise_px` the noise. At the end it prints how large the errors
of the tip's place are beside those that are stated.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import measuring
import numpy as np
import pandas as pd

from pipeline.forces import arc_length_offset, station_noise
from pipeline.forces.arc_length_offset import TipEvidence
from pipeline.forces.forces import far_from_pole
from pipeline.run import find_whiskers, follow, look_at
from pipeline.runtime import Clock
from pipeline.session.parameters import DEFAULTS
from pipeline.tables.centrelines import read_centrelines
from pipeline.video import open_video
from synthetic.session import render_session

VIDEOS, FRAMES = 4, 250
TIP_POINTS = 10  # of the true line, that have the direction of its tip
DIGITS = {"px_per_mm": 2, "base_noise_px": 4}


def kinematics_of(path, settings):
    """The whiskers of a video as `run` has them before forces, and the traced lines."""
    chunks = []
    with open_video(path) as video:
        seen = find_whiskers(*look_at(video, settings), settings)
        found = follow(seen, settings, Clock(), chunks.append)
    return found, measuring.join_chunks(chunks)


def tips_of(video: measuring.RenderedVideo) -> list[dict]:
    """A row per whisker of a rendered video whose tip is seen."""
    settings, rows = video.settings, []
    found, lines = kinematics_of(video.path, settings)
    truth = read_centrelines(video.folder / "centrelines.parquet")
    for name in found.places.names:
        places, whisker = found.places.of(name), found.whisker_set.whiskers[name]
        free = far_from_pole(places, settings.advanced.forces)
        at = settings.analysis.curvature_at
        places, excess = station_noise.as_they_scatter(places, whisker, at, free)
        end, _ = arc_length_offset.trace_ends(places, settings.advanced.forces)
        places = places.rows(np.isfinite(end))
        if len(places) and np.isfinite(places.to_tip).any():
            ends = arc_length_offset.tip_evidence(places, whisker, excess)
            beyond = beyond_ends_px(lines, truth, name, places.frame)
            rows.append({"video": video.path.stem, "whisker": name, **row_of(ends, beyond)})
    return rows


def row_of(ends: TipEvidence, beyond_px) -> dict:
    """A row of the table: what is known of the tip, and how far it truly is."""
    row = {
        "px_per_mm": 1e-3 / ends.pixel,
        "tip_px": beyond_px,
        "ends_sd_px": np.sqrt(ends.end_variance) / ends.pixel,
        "fading_px": ends.to_tip / ends.pixel,
        "fading_sd_px": ends.to_tip_sd / ends.pixel,
        "frames": ends.frames,
        "base_noise_px": ends.base_noise,
    }
    return {name: round(value, DIGITS.get(name, 2)) for name, value in row.items()}


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


def scaled_errors(table: pd.DataFrame, tip_sd_mm=DEFAULTS.forces.tip_sd_mm) -> np.ndarray:
    """Errors of the tip's place in a table of tips, in the standard errors that are stated.

    tip_sd_mm : standard error of the whisker's length
    """
    errors = []
    for tip in table.itertuples():
        ends = TipEvidence(
            0.0, tip.ends_sd_px**2, tip.fading_px, tip.fading_sd_px, int(tip.frames),
            tip.base_noise_px, 1.0,
        )  # fmt: skip
        beyond, error = ends.place()
        errors.append((beyond - tip.tip_px) / np.hypot(error, tip_sd_mm * tip.px_per_mm))
    return np.array(errors)


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
    rms = np.sqrt(np.mean(scaled_errors(table) ** 2)) if rows else np.nan
    print(f"seed {args.seed}: errors are {rms:.2f} times as large as stated")
    if args.write:
        table.to_csv(args.write, index=False, lineterminator="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
