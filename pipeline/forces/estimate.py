"""Rods fitted to the whiskers of a video: the force of every frame."""

from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.forces import forces
from pipeline.kinematics.base_angle import rows_of
from pipeline.kinematics.resampled import PART_ROWS
from pipeline.kinematics.stations import N_STATIONS, Stations
from pipeline.numerics.runs import parts
from pipeline.session.parameters import DEFAULTS, RodParams
from pipeline.tables.columns import EVIDENCE_COLUMNS, as_table
from pipeline.tracking.whiskers import BEYOND_TRACE, nominal_whisker

MEASURED = [  # columns of the frames in which the rods have the last word
    "base_angle_deg", "base_angle_se_deg", "follicle_x_px", "follicle_y_px", "curvature_per_m",
    "curvature_per_m_se", "rest_curvature_per_m", "rest_curvature_per_m_se",
    "curvature_change_per_m", "curvature_change_per_m_se", "pole_distance_mm",
]  # fmt: skip


def estimate_forces(
    frames: pd.DataFrame,
    places: Stations,
    whiskers: dict,
    curvature_at: float,
    friction: float = 0.0,
    pixels_per_m: float | None = None,
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
    params : the room's parameters

    Returns
    -------
    frames : the table with distance, rest curvature and curvature change filled; curvature as the
        fitted rods have it, and, where they are steady, base angle and (given the scale) follicle
    evidence : EVIDENCE_COLUMNS, aligned with `frames`; NaN in frames without a trace
    """
    frames = frames.reset_index(drop=True)
    new, of_touch = {c: frames[c].to_numpy(float, copy=True) for c in MEASURED}, {}
    kinematics = frames[["time_s", *MEASURED]]
    for index, name in enumerate(places.names):
        all_rows = places.of(name)
        known = whisker = whiskers.get(name)
        if known is None:  # what stands in for it has another tip
            length = (N_STATIONS - 1) * places.spacing[index]
            whisker = nominal_whisker(name, length / BEYOND_TRACE, 0.0)
            all_rows = replace(all_rows, end_px=np.full_like(all_rows.end_px, np.nan))
        for part in parts(len(all_rows), PART_ROWS):
            own = all_rows.rows(part)
            rows = rows_of(frames, name, own.frame)
            evidence, measured = forces.measure_forces(
                own, whisker, kinematics.loc[rows], curvature_at, friction, params=params
            )
            if known is None:  # and may bend otherwise
                evidence[["chi2", "bending_origin_m", "bending_origin_se_m"]] = np.nan
            _fill(new, rows, measured, pixels_per_m)
            new["pole_distance_mm"][rows] = 1e3 * evidence["distance_m"]
            _gather(of_touch, rows, evidence, len(frames))
    columns = {"frame": frames["frame"], "whisker": frames["whisker"], **of_touch}
    evidence = as_table(pd.DataFrame(columns, copy=False), EVIDENCE_COLUMNS)
    return frames.assign(**new), evidence


def _fill(columns, rows, measured, pixels_per_m):
    """Write what the rods measured into arrays of all rows, by column of the table of frames."""
    x, y = (measured.pop(f"follicle_{axis}_m").to_numpy() for axis in "xy")
    for column in measured:
        columns[column][rows] = measured[column]
    if pixels_per_m is not None:
        known = np.isfinite(x)
        columns["follicle_x_px"][rows[known]] = pixels_per_m * x[known]
        columns["follicle_y_px"][rows[known]] = -pixels_per_m * y[known]


def _gather(columns, rows, evidence, count):
    """Put the evidence of some rows into arrays of all `count` rows, by column, in place."""
    for name, values in evidence.items():
        missing = np.nan if values.dtype == float else 0.0
        columns.setdefault(name, np.full(count, missing))[rows] = values.to_numpy()
