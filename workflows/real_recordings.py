"""How whiskerforce does on real recordings, of which no truth is known.

    python workflows/real_recordings.py VIDEO:left VIDEO:top --scales 12,16,25

Each video is processed as `whiskerforce run` does, with only the frame rate, the face's side
(after the colon) and the scale given. Printed for every video and scale:

- *base*, *visible*, *first 40 px*: jitter [degrees] of `base_angle_deg`, of `visible_angle_deg`
  and of the slope of the first 40 px of the same centrelines. It is the median size of second
  differences over frames that follow each other, all known by name (confidence ≥ 0.5), pooled
  over whiskers; *of one frame*: as the SD of one frame's error, 1.4826/√6 of it. What a whisker
  really does within three frames is in it; *slow*: in the half of the frames in which the visible
  part turns least.
- *steps*: of more than 10° from one frame to the next, per 1000; *smooth*: those where the
  centreline itself does not jump (its first 40 px turn by less than 10°).
- *resting*: part of the neighbouring frames, in the slow half, whose difference lies within 1.96
  standard errors of the difference; 0.95 at least is wanted.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import measuring
import numpy as np
import pages
import pandas as pd

from pipeline.numerics.angles import second_differences
from pipeline.run import analyse
from pipeline.session.session_file import read_session

KNOWN = 0.5  # confidence from which on a name counts
SLOPE_PX = 40  # of the centreline whose slope stands beside the base angle
STEP_DEG = 10.0
SIDES = ("left", "right", "top", "bottom")
HEADER = [
    "video", "px/mm", "frames", "base", "base, slow", "base, of one frame", "visible",
    "first 40 px", "steps / 1000", "smooth", "resting",
]  # fmt: skip


def processed(video: Path, face: str, pixels_per_mm: float, frames_per_second: float):
    """The frames table of a video, with `slope_deg` of every centreline."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "session.toml"
        path.write_text(
            f"[recording]\nframes_per_second = {frames_per_second}\n"
            f'pixels_per_mm = {pixels_per_mm}\nface = "{face}"\n'
        )
        settings = read_session(path)
    slopes = []
    frames = analyse(video, settings, keep=lambda lines: slopes.append(first_slopes(lines))).frames
    if not slopes:
        return frames.assign(slope_deg=np.nan)
    return frames.merge(pd.concat(slopes), on=["frame", "whisker"], how="left")


def first_slopes(lines) -> pd.DataFrame:
    """Direction [degrees] of a straight line through the first SLOPE_PX of every centreline."""
    slope = np.full(len(lines), np.nan)
    for row in range(len(lines)):
        points = lines.row(row)[:SLOPE_PX].astype(float)
        if len(points) == SLOPE_PX:
            along = np.linalg.svd(points - points.mean(axis=0))[2][0]
            along *= np.sign(along @ (points[-1] - points[0]))
            slope[row] = np.degrees(np.arctan2(-along[1], along[0]))
    names = np.asarray(lines.names, object)[lines.whisker]
    return pd.DataFrame({"frame": lines.frame, "whisker": names, "slope_deg": slope})


def angle_figures(frames: pd.DataFrame) -> dict:
    """Jitter, steps and coverage of the base angles in a frames table with `slope_deg`."""
    known = frames[frames["tracked"] & (frames["confidence"] >= KNOWN)]
    whiskers = [_of_whisker(part.sort_values("frame")) for _, part in known.groupby("whisker")]
    pooled = {key: np.concatenate([w[key] for w in whiskers]) for key in _of_whisker(known[:0])}
    with np.errstate(invalid="ignore"):
        stepped = np.abs(pooled["step"]) > STEP_DEG
        smooth = stepped & (np.abs(pooled["slope_step"]) < STEP_DEG)
    slow = pooled["speed"] <= np.median(pooled["speed"]) if len(pooled["speed"]) else []
    within = np.abs(pooled["step"]) < 1.96 * pooled["step_se"]
    out = {key: _median(pooled[key]) for key in ("base", "visible", "slope", "slow")}
    out |= {"frames": len(known), "one_frame": 1.4826 / np.sqrt(6) * out["base"]}
    out |= {"steps": 1e3 * _mean(stepped), "smooth": 1e3 * _mean(smooth)}
    return out | {"resting": _mean(within[slow])}


def _of_whisker(part) -> dict:
    """Second differences and steps of one whisker's known rows, in order of their frames."""
    frame = part["frame"].to_numpy()
    turned = {name: _unwrapped(part[f"{name}_deg"]) for name in ("base_angle", "visible_angle")}
    base, visible, slope = *turned.values(), _unwrapped(part["slope_deg"])
    following = np.flatnonzero(np.diff(frame) == 1)
    step, seen = (np.diff(each)[following] for each in (base, visible))
    error = part["base_angle_se_deg"].to_numpy()
    valid = np.isfinite(step)
    second = np.abs(second_differences(base, frame))
    quiet = np.abs(_central(visible, frame))
    return {
        "base": second,
        "visible": np.abs(second_differences(visible, frame)),
        "slope": np.abs(second_differences(slope, frame)),
        "slow": second[quiet <= np.median(quiet)] if len(quiet) == len(second) > 0 else second[:0],
        "step": step[valid],
        "slope_step": np.diff(slope)[following][valid],
        "speed": np.abs(seen)[valid],
        "step_se": np.hypot(error[1:], error[:-1])[following][valid],
    }


def _unwrapped(angle):
    """Angles without wraps, NaN where they are not known."""
    angle = angle.to_numpy(float).copy()
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known], period=360)
    return angle


def _central(angle, frame):
    """Half the change over two frames, where `second_differences` has a value."""
    following = (np.diff(frame[:-1]) == 1) & (np.diff(frame[1:]) == 1)
    change = (angle[2:] - angle[:-2]) / 2
    return change[following & np.isfinite(change + angle[1:-1])]


def _median(values):
    return float(np.median(values)) if len(values) else np.nan


def _mean(values):
    return float(np.mean(values)) if len(values) else np.nan


def angle_row(video, scale, frames) -> list[str]:
    """One row of the table."""
    figures = angle_figures(frames)
    sizes = ("base", "slow", "one_frame", "visible", "slope")
    return [
        video.name, f"{scale:g}", str(figures["frames"]),
        *(pages.cell("{:.2f}°", figures[key]) for key in sizes),
        *(pages.cell("{:.1f}", figures[key]) for key in ("steps", "smooth")),
        pages.cell("{:.1%}", figures["resting"]),
    ]  # fmt: skip


def video_and_face(text: str) -> tuple[Path, str]:
    """A video and the side with the face, of VIDEO:SIDE."""
    path, _, face = text.rpartition(":")
    if face not in SIDES or not path:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected VIDEO:SIDE, with the face's side {', '.join(SIDES)}"
        )
    return Path(path), face


def main(argv=None) -> int:
    """Print the table of all videos and scales."""
    measuring.limit_threads()
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("videos", type=video_and_face, nargs="+", metavar="VIDEO:SIDE")
    parser.add_argument("--scales", default="12,16,25", help="pixels per mm, one after the other")
    parser.add_argument("--frames-per-second", type=float, default=1000.0)
    args = parser.parse_args(argv)
    rows = []
    for video, face in args.videos:
        for scale in map(float, args.scales.split(",")):
            frames = processed(video, face, scale, args.frames_per_second)
            rows.append(angle_row(video, scale, frames))
            print(" ".join(rows[-1]), file=sys.stderr, flush=True)
    print(pages.table(HEADER, rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
