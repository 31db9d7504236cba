"""Rows of contacts.csv: forces of each contact, and the uncertainty of its peak."""

from collections import Counter

import numpy as np
import pandas as pd
from scipy.ndimage import binary_dilation

from pipeline.contacts.peaks import contact_course
from pipeline.contacts.probability import by_whisker
from pipeline.session.recording import Recording
from pipeline.tables.columns import CONTACT_COLUMNS, as_table, empty_table

WILD, WILD_SHARE = 4.0, 0.1  # of the usual standard error, and of the force: larger is wild
MAY_TOUCH = 0.5  # probability from which a frame is not free, even if a person says so
_FORCE_COLUMNS = {  # of the evidence, by method: force, standard error, the origin's part of it
    "shape": ("shape_force_N", "shape_force_se_N", "origin_force_se_N"),
    "point": ("point_force_N", "point_force_se_N", "point_origin_force_se_N"),
}


def contact_table(
    frames: pd.DataFrame,
    evidence: pd.DataFrame,
    intervals: pd.DataFrame,
    recording: Recording,
    video="",
    method: str = "shape",
):
    """A table with CONTACT_COLUMNS, a row per contact; pulses and base loads are still missing.

    Parameters
    ----------
    frames : FRAME_COLUMNS with forces
    evidence : aligned with `frames`, with forces of `method`, "shape" or "point"
    intervals : `whisker`, `onset_frame`, `offset_frame`, and where known `slip`, `curated`,
        `flags`
    """
    if len(intervals) == 0:
        return empty_table(CONTACT_COLUMNS)
    courses = by_whisker(_courses(frames, evidence, method))
    for own in courses.values():
        own["free"] = ~binary_dilation(own.pop("touching"))
    rows, numbers, rate = [], Counter(), recording.frames_per_second
    intervals = intervals.to_dict("records")
    for interval in sorted(intervals, key=lambda each: (each["whisker"], each["onset_frame"])):
        name, onset, offset = (interval[c] for c in ("whisker", "onset_frame", "offset_frame"))
        numbers[name] += 1
        rows.append(
            {
                "video": video,
                "whisker": name,
                "contact": numbers[name],
                "onset_frame": onset,
                "offset_frame": offset,
                "onset_s": onset / rate,
                "duration_ms": 1e3 * (offset - onset) / rate,
                **_contact_row(courses[name], onset, offset, 1e3 / rate),
                "slip": bool(interval.get("slip", False)),
                "curated": bool(interval.get("curated", False)),
                "flags": interval.get("flags", "") or "",
            }
        )
    return as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def _courses(frames, evidence, method):
    """Per frame and whisker, what the rows of contacts are computed from; forces in µN."""
    force, total, origin = (1e6 * evidence[c].to_numpy(float) for c in _FORCE_COLUMNS[method])
    table = frames["contact_force_uN"].to_numpy(float)  # NaN without dimensions
    may_touch = evidence["probability"].to_numpy(float) > MAY_TOUCH
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = {
            load: frames[column].to_numpy(float) / table
            for load, column in (("moment", "base_moment_nN_m"), ("axial", "axial_force_uN"))
        }
    return pd.DataFrame(
        {
            "frame": frames["frame"].to_numpy(),
            "whisker": frames["whisker"].array,
            "force": np.where(np.isfinite(table), force, np.nan),
            "error": np.sqrt(np.maximum(total**2 - origin**2, 0.0)),
            "origin": origin,
            "touching": frames["in_contact"].to_numpy(bool) | may_touch,
            "interpolated": evidence["interpolated"].to_numpy(bool),
            "place": frames["contact_arc_length_mm"].to_numpy(float),
            **shares,
        }
    )


def _contact_row(whisker: dict[str, np.ndarray], onset, offset, frame_ms) -> dict:
    """Peaks, mean and impulse of one contact.

    `whisker` : `_courses` of all its frames, and which are `free`; wild forces in the contact are
    set to NaN there
    """
    start, stop = np.searchsorted(whisker["frame"], [onset, offset])
    measured, errors = whisker["force"], whisker["error"]
    measured[start:stop] = _without_wild(measured[start:stop], errors[start:stop])
    force, place = np.maximum(measured[start:stop], 0.0), whisker["place"][start:stop]
    if not np.isfinite(force).any():
        return {
            "contact_arc_length_mm": np.nanmedian(place) if np.isfinite(place).any() else np.nan
        }
    rows, course, error = contact_course(
        measured, errors, whisker["free"], whisker["interpolated"], start, stop
    )
    if np.isfinite(course).any():
        force[rows - start] = course = np.maximum(course, 0.0)
    else:  # forces without errors
        course = force[rows - start]
    peak, mean = int(np.nanargmax(course)), float(np.nanmean(force))
    moment, axial, place, origin = (
        without_gaps(whisker[c][rows]) for c in ("moment", "axial", "place", "origin")
    )
    return {
        "peak_force_uN": course[peak],
        "mean_force_uN": mean,
        "impulse_uN_ms": mean * len(force) * frame_ms,
        "peak_base_moment_nN_m": _largest(moment * course),
        "peak_axial_force_uN": _largest(axial * course),
        "contact_arc_length_mm": place[peak],
        "peak_force_se_uN": np.hypot(error[peak], origin[peak]),
        "tracking_se_uN": error[peak],
        "hidden_length_se_uN": origin[peak],
    }


def _without_wild(force, error):
    """Force (frames,) of one contact, NaN where its error is wild.

    Otherwise a single frame in which two whiskers cross, with ten times the usual error, may be
    the peak.
    """
    known = error[np.isfinite(error)]
    if not len(known):
        return force
    return np.where(
        error > WILD * np.median(known) + WILD_SHARE * np.maximum(force, 0), np.nan, force
    )


def without_gaps(values):
    """Values (frames,), interpolated where they are not known."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return values
    return np.interp(np.arange(len(values)), known, values[known])


def _largest(signed):
    """Value of largest magnitude, with its sign."""
    return signed[np.nanargmax(np.abs(signed))] if np.isfinite(signed).any() else np.nan


def peak_errors(contacts: pd.DataFrame, evidence: pd.DataFrame, whiskers: dict) -> pd.DataFrame:
    """The uncertainty of each contact's peak force, and its sources.

    Parameters
    ----------
    contacts : as in `contact_table`
    evidence : as in `measure_forces`, with `whisker`
    whiskers : name → Whisker

    Returns
    -------
    Table aligned with `contacts` [µN]: `peak_force_se_uN`, of which `tracking_se_uN` and
    `hidden_length_se_uN`; and how much the peak changes for 1 % more in a value of session.toml,
    `radius_uN_per_percent` (the fourth power), `modulus_uN_per_percent`, `scale_uN_per_percent`
    (pixels per mm: curvature, lever and stiffness at the middle of the bent part).
    """
    moves, shapes = by_whisker(evidence, ["origin_per_tip"]), np.full((4, len(contacts)), np.nan)
    for i, name in enumerate(contacts["whisker"]):
        if whisker := whiskers.get(name):
            # how far the origin of the arc lengths moves with the place of the tip
            per_tip = np.nanmedian(moves[name]["origin_per_tip"])
            shapes[:, i] = whisker.length, whisker.cone_length, per_tip, 1.0
    length, cone_length, per_tip, known = shapes
    force, place = (contacts[c].to_numpy() for c in ("peak_force_uN", "contact_arc_length_mm"))
    middle = 0.6e-3 * place
    # a larger scale brings all places nearer to the base; the base itself moves along as far as
    # it is placed by the tip
    taper = 4 * (middle - per_tip * length) / (cone_length - middle)
    errors = "peak_force_se_uN", "tracking_se_uN", "hidden_length_se_uN"
    return pd.DataFrame(
        {
            **{name: known * contacts[name].to_numpy() for name in errors},
            "radius_uN_per_percent": 0.04 * known * force,
            "modulus_uN_per_percent": 0.01 * known * force,
            "scale_uN_per_percent": 0.01 * known * force * (2 + taper),
        },
        contacts.index,
    )
