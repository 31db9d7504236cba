"""How steady base angles are on real recordings, of which no truth is known."""

import numpy as np
import pages
import pandas as pd

from pipeline.numerics.robust import MAD_TO_SD
from pipeline.numerics.runs import differences

KNOWN = 0.5  # confidence from which on a name counts
SLOPE_PX = 40  # of the centreline whose slope stands beside the base angle
STEP_DEG = 10.0
TURNS_ALONG = 0.5  # of a step: where the visible part turns less, the step is the base's alone
HEADER = [
    "video", "px/mm", "known", "base", "base, slow", "base, of one frame", "visible",
    "first 40 px", "steps / 1000", "smooth", "alone", "resting",
]  # fmt: skip


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
    none = _of_whisker(known[:0])
    whiskers = [_of_whisker(part.sort_values("frame")) for _, part in known.groupby("whisker")]
    pooled = {key: np.concatenate([w[key] for w in (none, *whiskers)]) for key in none}
    step, seen = pooled["step"], pooled["seen_step"]
    speed = np.abs(seen)
    with np.errstate(invalid="ignore"):
        stepped = np.abs(step) > STEP_DEG
        smooth = stepped & (np.abs(pooled["slope_step"]) < STEP_DEG)
        alone = stepped & ~(seen * np.sign(step) >= TURNS_ALONG * np.abs(step))
    slow = speed <= np.median(speed) if len(speed) else []
    within = np.abs(step) < 1.96 * pooled["step_se"]
    out = {key: _median(pooled[key]) for key in ("base", "visible", "slope", "slow")}
    out |= {"frames": len(known), "one_frame": MAD_TO_SD / np.sqrt(70) * _median(pooled["fourth"])}
    counted = {"steps": stepped, "smooth": smooth, "alone": alone}
    out |= {key: 1e3 * _mean(each) for key, each in counted.items()}
    return out | {"resting": _mean(within[slow])}


def _of_whisker(part) -> dict:
    """Differences and steps of one whisker's known rows, in order of their frames."""
    frame = part["frame"].to_numpy()
    turned = {name: _unwrapped(part[f"{name}_deg"]) for name in ("base_angle", "visible_angle")}
    base, visible, slope = *turned.values(), _unwrapped(part["slope_deg"])
    following = np.flatnonzero(np.diff(frame) == 1)
    step, seen = (np.diff(each)[following] for each in (base, visible))
    error = part["base_angle_se_deg"].to_numpy()
    valid = np.isfinite(step)
    second = np.abs(differences(base, frame, 2))
    quiet = np.abs(_central(visible, frame))
    return {
        "base": second,
        "fourth": np.abs(differences(base, frame, 4)),
        "visible": np.abs(differences(visible, frame, 2)),
        "slope": np.abs(differences(slope, frame, 2)),
        "slow": second[quiet <= np.median(quiet)] if len(quiet) == len(second) > 0 else second[:0],
        "step": step[valid],
        "seen_step": seen[valid],
        "slope_step": np.diff(slope)[following][valid],
        "step_se": np.hypot(error[1:], error[:-1])[following][valid],
    }


def _unwrapped(angle):
    """Angles without wraps, NaN where they are not known."""
    angle = angle.to_numpy(float).copy()
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known], period=360)
    return angle


def _central(angle, frame):
    """Half the change over two frames, where the second difference has a value."""
    following = (np.diff(frame[:-1]) == 1) & (np.diff(frame[1:]) == 1)
    change = (angle[2:] - angle[:-2]) / 2
    return change[following & np.isfinite(change + angle[1:-1])]


def _median(values):
    return float(np.median(values)) if len(values) else np.nan


def _mean(values):
    return float(np.mean(values)) if len(values) else np.nan


def angle_row(name, scale, frames, lines) -> list[str]:
    """One row of the table: of a video's frames table and its centrelines."""
    frames = frames.merge(first_slopes(lines), on=["frame", "whisker"], how="left")
    figures = angle_figures(frames)
    sizes = ("base", "slow", "one_frame", "visible", "slope")
    return [
        name, scale, str(figures["frames"]),
        *(pages.cell("{:.2f}°", figures[key]) for key in sizes),
        *(pages.cell("{:.1f}", figures[key]) for key in ("steps", "smooth", "alone")),
        pages.cell("{:.1%}", figures["resting"]),
    ]  # fmt: skip
