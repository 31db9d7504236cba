"""How exact lines and curvature are in the videos of `benchmark_tracking`: ours and the peer's."""

from dataclasses import replace

import measuring
import numpy as np
import pandas as pd
from benchmark_clips import CURVATURE_AT, Clip, trace

from pipeline.kinematics import curvature
from synthetic.scoring import line_scoring, table_scoring

WINDOW_M = 2e-3  # half of the peer's quadratic
LONG_FALSE_MM = 3.0


def our_lines(clip: Clip):
    """Our centrelines of the frames with a truth, and their kinematics."""
    chunks = list(trace(clip))
    lines = first_frames(measuring.join_chunks(chunks), clip.scored)
    hidden = {w.name: w.hidden_length for w in clip.settings.whisker}
    recording, params = clip.settings.recording.si(), clip.settings.advanced.kinematics
    measured = [
        curvature.measure(c, recording, [hidden[n] for n in c.names], CURVATURE_AT, params)
        for c in chunks
        if len(c)
    ]
    table = pd.concat(measured, ignore_index=True)
    table["whisker"] = np.array(lines.names, object)[table["whisker"].to_numpy(int)]
    return lines, table[table["frame"] < clip.scored].assign(tracked=True)


def first_frames(lines, n):
    """The rows of frames below n."""
    rows = int(np.searchsorted(lines.frame, n))
    points = lines.offsets[rows]
    return replace(
        lines,
        frame=lines.frame[:rows],
        whisker=lines.whisker[:rows],
        offsets=lines.offsets[: rows + 1],
        confidence=lines.confidence[:rows],
        x_px=lines.x_px[:points],
        y_px=lines.y_px[:points],
        se_px=lines.se_px[:points],
    )


def first_truth(truth: line_scoring.Truth, n) -> line_scoring.Truth:
    """The truth of frames below n."""
    lines = first_frames(truth.lines, n)
    return line_scoring.Truth(lines, truth.seen[: len(lines.x_px)])


def quadratic_curvature(clip: Clip, lines, truth: line_scoring.Truth) -> np.ndarray:
    """Errors [1/m] of a quadratic over ±2 mm about 5.5 mm, for each line that spans it.

    The place along the whisker is taken from the truth, so it costs the peer nothing that it
    does not know where the follicle is.
    """
    scale = clip.trial.scene.camera.pixels_per_m
    true = clip.true_frames.set_index(["frame", "whisker"])["curvature_per_m"]
    scores = line_scoring.score_lines(lines, truth)
    errors = []
    for i, (frame, name) in enumerate(zip(lines.frame, scores.rows["nearest"], strict=True)):
        if not name:
            continue
        row = next(
            r for r in truth.rows_of(frame) if truth.lines.names[truth.lines.whisker[r]] == name
        )
        curve = truth.lines.row(row).astype(float)
        points = lines.row(i).astype(float)
        distance, node, along = (
            np.empty(len(points)),
            np.empty(len(points), int),
            np.empty(len(points)),
        )
        line_scoring.project(*points.T.copy(), *curve.T.copy(), distance, node, along)
        u = node + along - CURVATURE_AT * scale
        inside = np.abs(u) <= WINDOW_M * scale
        if inside.sum() < 10 or np.ptp(u[inside]) < 1.8 * WINDOW_M * scale:
            continue
        errors.append(_fitted_curvature(points[inside]) * scale - true[frame, name])
    return np.array(errors)


def _fitted_curvature(points) -> float:
    """Curvature [1/px] of a quadratic through points, in the frame of their chord."""
    chord = points[-1] - points[0]
    t = chord / np.hypot(*chord)
    d = points - points.mean(0)
    u, v = d @ t, d @ np.array([t[1], -t[0]])
    second, slope, _ = np.polyfit(u, v, 2)
    bend = 2 * second / (1 + slope**2) ** 1.5
    return float(bend if points[0] @ t < points[-1] @ t else -bend)


def exactness(clip: Clip, peer) -> dict[str, dict]:
    """Line and curvature figures, ours and the peer's."""
    long_px = LONG_FALSE_MM * clip.trial.scene.camera.pixels_per_mm
    lines, kinematics = our_lines(clip)
    truth = first_truth(clip.truth, clip.scored)
    ours = line_scoring.line_figures(line_scoring.score_lines(lines, truth), clip.scored, long_px)
    true = clip.true_frames[clip.true_frames["frame"] < clip.scored]
    joined = table_scoring.join_frames(kinematics, true)
    bend = table_scoring.error_figures(joined, "curvature_per_m")
    ours |= {"frames": clip.scored, "curvature_bias": bend["bias"], "curvature_sd": bend["sd"]}
    found = {"whiskerforce": ours}
    if peer is not None:
        lines = peer.trace(clip.short)[0]
        truth = first_truth(clip.truth, clip.short_frames)
        theirs = line_scoring.line_figures(
            line_scoring.score_lines(lines, truth), clip.short_frames, long_px
        )
        errors = quadratic_curvature(clip, lines, truth)
        theirs |= {
            "frames": clip.short_frames,
            "identity_errors": np.nan,  # its lines bear no names
            "curvature_bias": errors.mean() if len(errors) else np.nan,
            "curvature_sd": errors.std() if len(errors) else np.nan,
        }
        found["Janelia"] = theirs
    return found
