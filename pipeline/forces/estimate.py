"""Rods fitted to the whiskers of a video: the force of every frame."""

from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.forces import forces
from pipeline.kinematics.resampled import N_STATIONS, Stations
from pipeline.session.parameters import DEFAULTS, RodParams
from pipeline.tables.columns import EVIDENCE_COLUMNS, as_table
from pipeline.tracking.whiskers import nominal_whisker

MUCH_MORE = 1.0  # near the pole than farther off, of free frames: worth another fit


def estimate_forces(
    frames: pd.DataFrame,
    places: Stations,
    whiskers: dict,
    curvature_at: float,
    friction: float = 0.0,
    pixels_per_m: float | None = None,
    surely_free=None,
    params: RodParams = DEFAULTS.forces,
):
    """Rest curvature and evidence of touch for all whiskers of a video.

    Parameters
    ----------
    frames : FRAME_COLUMNS with the kinematics; a row per whisker and frame, any order
    places : `Stations` of all tracked rows, in any order
    whiskers : name → `Whisker`, None where its dimensions are not known
    curvature_at : arc length of the curvature in `frames` [m]
    friction : coefficient of friction between whisker and pole, >= 0
    pixels_per_m : scale; None: the follicle stays as it is in `frames`
    surely_free : function of a whisker's evidence, bool (rows,): frames that are free of touch
        although the pole is near; None: only those far from the pole count as free
    params : the room's parameters

    Returns
    -------
    frames : the table with distance, rest curvature and curvature change filled; curvature as the
        fitted rods have it, and, where they are steady, base angle and (given the scale) follicle
    evidence : EVIDENCE_COLUMNS, aligned with `frames`; NaN in frames without a trace
    """
    frames = frames.reset_index(drop=True).copy()
    parts = []
    for index, name in enumerate(places.names):
        own = places.of(name)
        if len(own) == 0:
            continue
        rows = _rows_of(frames, name, own.frame)
        length = (N_STATIONS - 1) * places.spacing[index]
        whisker = whiskers.get(name)
        if whisker is None:
            whisker = nominal_whisker(name, length / 1.03, 0.0)
            own = replace(own, to_tip=np.full(len(own), np.nan))  # of no known length
        rod = own, whisker, frames.loc[rows], curvature_at, friction
        evidence, measured = _measure(rod, surely_free, params)
        if whiskers.get(name) is None:
            evidence["chi2"] = np.nan  # what stands in for the whisker need not bend as it does
        _fill(frames, rows, measured, pixels_per_m)
        frames.loc[rows, "pole_distance_mm"] = 1e3 * evidence["distance_m"].to_numpy()
        parts.append(evidence.set_index(rows))
    return frames, _of_all_rows(parts, frames)


def _rows_of(frames, name, numbers):
    """Index in `frames` of one whisker's frames with these numbers."""
    rows = frames.index[frames["whisker"] == name].to_numpy()
    return pd.Series(rows, index=frames.loc[rows, "frame"]).loc[numbers].to_numpy()


def _measure(rod, surely_free, params):
    """Forces of one whisker; again, if free frames near the pole say more of its rest shape."""
    own = rod[0]
    evidence, measured = forces.measure_forces(*rod, params=params)
    if surely_free is None or not np.isfinite(own.pole_x).any():
        return evidence, measured
    far = forces.far_from_pole(own, params)
    free = np.isfinite(own.last) & surely_free(evidence)
    if np.count_nonzero(free & ~far) < MUCH_MORE * np.count_nonzero(far):
        return evidence, measured
    return forces.measure_forces(*rod, free | far, params)


def _fill(frames, rows, measured, pixels_per_m):
    """Write what the rods measured into the table of frames, in place."""
    x, y = (measured.pop(f"follicle_{axis}_m").to_numpy() for axis in "xy")
    for column in measured:
        frames.loc[rows, column] = measured[column].to_numpy()
    if pixels_per_m is not None:
        known = np.isfinite(x)
        frames.loc[rows[known], "follicle_x_px"] = pixels_per_m * x[known]
        frames.loc[rows[known], "follicle_y_px"] = -pixels_per_m * y[known]


def _of_all_rows(parts, frames):
    """Evidence of all whiskers as one table, aligned with `frames`."""
    evidence = pd.concat(parts) if parts else pd.DataFrame()
    evidence = evidence.reindex(frames.index)
    evidence["whisker"], evidence["frame"] = frames["whisker"], frames["frame"]
    for column in EVIDENCE_COLUMNS:
        if column.name in evidence and column.dtype in ("bool", "int64"):
            evidence[column.name] = evidence[column.name].astype(float).fillna(0)
    return as_table(evidence, EVIDENCE_COLUMNS)
