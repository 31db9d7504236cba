"""Touches of one video: from places and forces to contacts, with a person's corrections on top."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.ndimage import binary_dilation

from pipeline.contacts.intervals import find_contacts, in_contact
from pipeline.contacts.probability import (
    CONTACT_ENDS,
    CONTACT_STARTS,
    add_probability,
    frame_log_odds,
    posterior,
)
from pipeline.contacts.summary import PEAK_ERROR_COLUMNS, contact_table, peak_errors
from pipeline.forces import forces
from pipeline.kinematics.resampled import N_STATIONS, Stations
from pipeline.session.recording import Recording
from pipeline.tables.columns import EVIDENCE_COLUMNS, FRAME_COLUMNS, as_table
from pipeline.tracking.whiskers import nominal_whisker

SURELY_FREE = 1e-3  # probability of contact below which a frame tells the rest shape
MUCH_MORE = 1.0  # near the pole than farther off, of free frames: worth another fit


@dataclass(frozen=True)
class Touch:
    """All about the touches in one video.

    Attributes
    ----------
    frames, contacts : tables of records.FRAME_COLUMNS and CONTACT_COLUMNS
    intervals : contacts as INTERVAL_COLUMNS and `curated`
    evidence : the measurements behind, aligned with `frames`, SI units
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    intervals: pd.DataFrame
    evidence: pd.DataFrame


def analyse_touch(
    frames: pd.DataFrame,
    places: Stations,
    recording: Recording,
    whiskers: dict,
    *,
    curvature_at: float = 5.5e-3,
    method: str = "shape",
    friction: float = 0.0,
    corrections=None,
    video: str = "",
) -> Touch:
    """Rest shape, contacts, forces, pulses and base loads of one video.

    Parameters
    ----------
    frames : records.FRAME_COLUMNS with the kinematics; a row per whisker and frame, any order
    places : `Stations` of all tracked rows, in any order
    whiskers : name → Whisker, or None: contacts are found all the same, forces are not
    curvature_at : arc length of the curvature in `frames` [m]
    method : "shape" or "point"
    friction : coefficient of friction between whisker and pole, >= 0
    corrections : table of a person's corrections (pipeline.contacts.corrections), or None
    """
    frames, evidence = measure_touch(
        frames, places, whiskers, curvature_at, friction, recording.pixels_per_m
    )
    return retouch(
        frames, evidence, recording, whiskers,
        curvature_at=curvature_at, method=method, corrections=corrections, video=video,
    )  # fmt: skip


def retouch(
    frames: pd.DataFrame,
    evidence: pd.DataFrame,
    recording: Recording,
    whiskers: dict,
    *,
    curvature_at: float = 5.5e-3,
    method: str = "shape",
    corrections=None,
    video: str = "",
) -> Touch:
    """Everything behind the evidence: contacts, a person's corrections, forces, pulses, loads."""
    from pipeline.contacts import base_moments, pulses

    evidence = add_probability(evidence, recording)
    intervals = find_contacts(evidence, curvature_at)
    intervals["curated"] = False
    if corrections is not None:
        intervals = _correct(intervals, corrections, evidence)
    frames = frames.copy()
    frames["in_contact"] = in_contact(frames, intervals)
    frames["contact_probability"] = evidence["probability"].to_numpy()
    frames = forces.add_forces(frames, evidence, whiskers, method)
    contacts = contact_table(frames, intervals, recording, video)
    contacts = pulses.add_pulses(contacts, frames, recording)
    contacts = base_moments.add_base_moments(contacts, frames, whiskers, recording)
    contacts[list(PEAK_ERROR_COLUMNS)] = peak_errors(contacts, evidence, whiskers)
    return Touch(as_table(frames, FRAME_COLUMNS), contacts, intervals, evidence)


def measure_touch(
    frames, places: Stations, whiskers: dict, curvature_at, friction=0.0, pixels_per_m=None
):
    """Rest curvature and evidence of touch for all whiskers of a video.

    Returns
    -------
    frames : the table with distance, rest curvature and curvature change filled; base angle,
        curvature and, where the scale is given, follicle as the fitted rods have them
    evidence : aligned with `frames`; NaN in frames without a trace
    """
    frames = frames.reset_index(drop=True).copy()
    parts = []
    for index, name in enumerate(places.names):
        own = places.of(name)
        if len(own) == 0:
            continue
        rows = frames.index[frames["whisker"] == name].to_numpy()
        by_frame = pd.Series(rows, index=frames.loc[rows, "frame"])
        rows = by_frame.loc[own.frame].to_numpy()
        given = whiskers.get(name)
        length = (N_STATIONS - 1) * places.spacing[index]
        whisker = given or nominal_whisker(name, length / 1.03, 0.0)
        evidence, measured = _measure(
            own, whisker, frames.loc[rows], curvature_at, friction, pixels_per_m
        )
        if given is None:
            evidence["chi2"] = np.nan  # what stands in for the whisker need not bend as it does
        follicle = measured.pop("follicle_x_m"), measured.pop("follicle_y_m")
        for column in measured:
            frames.loc[rows, column] = measured[column].to_numpy()
        if pixels_per_m is not None:
            x, y = pixels_per_m * follicle[0].to_numpy(), -pixels_per_m * follicle[1].to_numpy()
            known = np.isfinite(x)
            frames.loc[rows[known], "follicle_x_px"] = x[known]
            frames.loc[rows[known], "follicle_y_px"] = y[known]
        frames.loc[rows, "pole_distance_mm"] = 1e3 * evidence["distance_m"].to_numpy()
        parts.append(evidence.set_index(rows))
    evidence = pd.concat(parts) if parts else pd.DataFrame()
    evidence = evidence.reindex(frames.index)
    evidence["whisker"], evidence["frame"] = frames["whisker"], frames["frame"]
    for column in EVIDENCE_COLUMNS:
        if column.name in evidence and column.dtype in ("bool", "int64"):
            evidence[column.name] = evidence[column.name].astype(float).fillna(0)
    return frames, as_table(evidence, EVIDENCE_COLUMNS)


def _measure(own, whisker, kinematics, curvature_at, friction, pixels_per_m):
    """Forces of one whisker; again, where frames near the pole tell more of its rest shape."""
    rod = own, whisker, kinematics, curvature_at, friction
    evidence, measured = forces.measure_forces(*rod)
    if pixels_per_m is None or not np.isfinite(own.pole_x).any():
        return evidence, measured
    far = forces.far_from_pole(own)
    free = np.isfinite(own.last) & _surely_free(evidence, pixels_per_m)
    if np.count_nonzero(free & ~far) < MUCH_MORE * np.count_nonzero(far):
        return evidence, measured
    return forces.measure_forces(*rod, free | far)


def _surely_free(evidence, pixels_per_m):
    """Frames free of touch, as first measured, and with them their neighbours."""
    log_odds = frame_log_odds(evidence, pixels_per_m)
    touching = posterior(log_odds, CONTACT_STARTS, CONTACT_ENDS) > SURELY_FREE
    return ~binary_dilation(touching)


def _correct(intervals, corrections, evidence):
    """Apply a person's corrections; fill what an added contact does not know of itself."""
    from pipeline.contacts.corrections import apply

    intervals = apply(intervals, corrections).reset_index(drop=True)
    for i in intervals.index[intervals["curated"]]:
        row = intervals.loc[i]
        part = evidence[evidence["whisker"] == row["whisker"]].sort_values("frame")
        inside = part["frame"].between(row["onset_frame"], row["offset_frame"] - 1)
        sides = part.loc[inside, "side"].sum()
        intervals.loc[i, "side"] = int(np.sign(sides)) or 1
        intervals.loc[i, "probability"] = 1.0
    intervals["slip"] = intervals["slip"].eq(True)
    intervals["flags"] = intervals["flags"].fillna("")
    return intervals
