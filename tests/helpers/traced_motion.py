"""True motion of a whisker, traced as a good tracker would: for tests of what comes after it."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d
from usual_parameters import measure_stations

from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics import curvature, follicle, resampled
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import FRAME_COLUMNS, as_table
from synthetic.truth import contact_table, frame_table

HIDDEN = 1.4e-3  # m
TIP_UNSEEN = 0.3e-3  # m


@dataclass(frozen=True)
class Traced:
    """What the analysis is given, and the truth beside it."""

    frames: pd.DataFrame
    places: resampled.Stations
    recording: Recording
    whiskers: dict
    true_frames: pd.DataFrame
    true_contacts: pd.DataFrame
    lines: Centrelines
    pole: PoleTrack | None


def trace(motion, seed=0, noise_px=0.03, hidden=HIDDEN, curvature_at=5.5e-3, without_pole=False):
    """Trace a `synthetic.motion.Motion` with white noise of `noise_px` across the whisker."""
    rng = np.random.default_rng(seed)
    scene = motion.scene
    scale = scene.camera.pixels_per_m
    recording = Recording(scene.camera.frames_per_second, scene.camera.pixels_per_mm, "left")
    lines = trace_lines(motion, rng, noise_px, hidden)
    pole = None
    if scene.pole is not None and not without_pole:
        x, y = scene.to_pixels(motion.pole_x, motion.pole_y)
        pole = PoleTrack(x, y, scene.pole.radius * scale)
    whiskers = {hair.whisker.name: hair.whisker for hair in scene.hairs}
    params = DEFAULTS.kinematics
    table = curvature.measure(
        lines, recording, [hidden] * len(whiskers), curvature_at, params, pole
    )
    x, y, angle = follicle.follicles(lines, np.full(len(lines), hidden * scale), scale, params).T
    table = table.assign(follicle_x_px=x, follicle_y_px=y, base_angle_deg=np.degrees(angle))
    table["whisker"] = np.asarray(lines.names, object)[table["whisker"]]
    table["tracked"] = True
    table["time_s"] = table["frame"] / recording.frames_per_second
    places = measure_stations(
        lines, recording, list(whiskers.values()), [hidden] * len(whiskers), pole
    )
    return Traced(
        frames=as_table(table, FRAME_COLUMNS),
        places=places,
        recording=recording,
        whiskers=whiskers,
        true_frames=frame_table(motion, curvature_at),
        true_contacts=contact_table(motion, "test"),
        lines=lines,
        pole=pole,
    )


def trace_lines(motion, rng, noise_px, hidden=HIDDEN) -> Centrelines:
    """Centrelines from the fur to near the tip: a smooth line and unsmoothed measurements."""
    rows = []
    for h, hair in enumerate(motion.scene.hairs):
        x, y = motion.centrelines(h)
        s = np.linspace(0, hair.whisker.length, x.shape[1])
        seen = (s >= hidden - 1e-9) & (s <= hair.whisker.length - TIP_UNSEEN)
        sd = noise_px * (1 + 2 * (s[seen] / hair.whisker.length) ** 4)
        for frame in range(len(x)):
            raw = rng.normal(0, sd)
            smooth = gaussian_filter1d(raw, 6.0)
            px, py = x[frame, seen], y[frame, seen]
            tx, ty = np.gradient(px), np.gradient(py)
            norm = np.hypot(tx, ty)
            # the normal, counter-clockwise as seen on the screen, is (ty, −tx)
            px, py = px + smooth * ty / norm, py - smooth * tx / norm
            rows.append((frame, h, px, py, raw - smooth, 1 / sd**2))
    frame, whisker, x, y, offset, information = zip(*rows, strict=True)
    return Centrelines(
        names=motion.scene.names,
        frame=np.array(frame, np.int32),
        whisker=np.array(whisker, np.int32),
        offsets=np.concatenate([[0], np.cumsum([len(p) for p in x])]),
        x_px=np.concatenate(x).astype(np.float32),
        y_px=np.concatenate(y).astype(np.float32),
        se_px=(np.concatenate(information) ** -0.5).astype(np.float32),
        confidence=np.ones(len(frame), np.float32),
        offset_px=np.concatenate(offset).astype(np.float32),
        information=np.concatenate(information).astype(np.float32),
    )


def rows_of(lines: Centrelines, keep) -> Centrelines:
    """Return the given rows (mask) of `lines`."""
    rows = np.flatnonzero(keep)
    counts = np.diff(lines.offsets)[rows]
    points = [np.arange(lines.offsets[i], lines.offsets[i + 1]) for i in rows]
    points = np.concatenate(points) if points else np.empty(0, int)
    per_point = ("x_px", "y_px", "se_px", "offset_px", "information")
    return Centrelines(
        names=lines.names,
        frame=lines.frame[rows],
        whisker=lines.whisker[rows],
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        confidence=lines.confidence[rows],
        **{name: getattr(lines, name)[points] for name in per_point},
    )
