"""Rows of contacts.csv: forces of each contact, and the uncertainty of its peak."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numba import njit

from pipeline.contacts.peaks import firm_peak, half_width, smoothed
from pipeline.session.recording import Recording
from pipeline.tables.columns import CONTACT_COLUMNS, as_table, empty_table
from whiskermodel.force_profiles import half_gaussian_shape

WILD, WILD_SHARE = 4.0, 0.1  # times the usual standard error, plus this part of the force
LARGEST_GAP = 0.8  # of a contact, about its peak: what lies in a longer one is unknown
_CONTACT_COURSES = (  # columns of the frames that a contact's row is made from
    "contact_force_uN",
    "contact_force_uN_se",
    "base_moment_nN_m",
    "axial_force_uN",
    "contact_arc_length_mm",
)

PEAK_ERROR_COLUMNS = (
    "peak_force_se_uN",
    "tracking_se_uN",
    "hidden_length_se_uN",
    "radius_uN_per_percent",
    "modulus_uN_per_percent",
    "scale_uN_per_percent",
)


def contact_table(frames: pd.DataFrame, intervals: pd.DataFrame, recording: Recording, video=""):
    """One row per contact with records.CONTACT_COLUMNS; pulses and base loads are still missing.

    Parameters
    ----------
    frames : records.FRAME_COLUMNS with forces
    intervals : `whisker`, `onset_frame`, `offset_frame`, and where known `slip`, `curated`,
        `flags`
    """
    if len(intervals) == 0:
        return empty_table(CONTACT_COLUMNS)
    courses = frames[["frame", "whisker", *_CONTACT_COURSES]]
    by_whisker = {
        name: {c: part[c].to_numpy() for c in ("frame", *_CONTACT_COURSES)}
        for name, part in courses.sort_values("frame", kind="stable").groupby("whisker")
    }
    rows, numbers = [], {}
    ordered = intervals.sort_values(["whisker", "onset_frame"], kind="stable")
    for interval in ordered.to_dict("records"):
        name = interval["whisker"]
        numbers[name] = numbers.get(name, 0) + 1
        part = by_whisker[name]
        inside = slice(
            *np.searchsorted(part["frame"], [interval["onset_frame"], interval["offset_frame"]])
        )
        row = _contact_row({c: part[c][inside] for c in _CONTACT_COURSES}, recording)
        rows.append(
            {
                "video": video,
                "whisker": name,
                "contact": numbers[name],
                "onset_frame": int(interval["onset_frame"]),
                "offset_frame": int(interval["offset_frame"]),
                "onset_s": interval["onset_frame"] / recording.frames_per_second,
                "duration_ms": 1e3
                * (interval["offset_frame"] - interval["onset_frame"])
                / recording.frames_per_second,
                **row,
                "slip": bool(interval.get("slip", False)),
                "curated": bool(interval.get("curated", False)),
                "flags": interval.get("flags", "") or "",
            }
        )
    return as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def peak_errors(
    contacts: pd.DataFrame, evidence: pd.DataFrame, whiskers: dict, method: str = "shape"
) -> pd.DataFrame:
    """The uncertainty of each contact's peak force, and its sources.

    Parameters
    ----------
    contacts : CONTACT_COLUMNS with forces of `method`, "shape" or "point"
    evidence : as of `measure_forces`, with `frame` and `whisker`
    whiskers : name → Whisker

    Returns
    -------
    Table aligned with `contacts` [µN]: `peak_force_se_uN`, of which `tracking_se_uN` and
    `hidden_length_se_uN`; and how much the peak changes for 1 % more in a value of session.toml,
    `radius_uN_per_percent` (the fourth power), `modulus_uN_per_percent`, `scale_uN_per_percent`
    (pixels per mm: curvature, lever and stiffness at the middle of the bent part).
    """
    names = contacts["whisker"].to_numpy(object)
    measured = {name: _Measured.of(evidence, name, method) for name in np.unique(names)}
    wanted = ("onset_frame", "offset_frame", "peak_force_uN", "contact_arc_length_mm")
    rows = []
    for name, onset, offset, force, place in zip(
        names, *(contacts[c].to_numpy() for c in wanted), strict=True
    ):
        errors = measured[name].at_peak(onset, offset)
        if errors is None or whiskers.get(name) is None:
            rows.append({})
            continue
        total, origin = errors
        middle, whisker = 0.6e-3 * place, whiskers[name]
        # a larger scale moves all places towards the base; as far as the tip holds it, the base
        moved = middle - measured[name].per_tip * whisker.length
        rows.append(
            {
                "peak_force_se_uN": total,
                "tracking_se_uN": np.sqrt(max(total**2 - origin**2, 0.0)),
                "hidden_length_se_uN": origin,
                "radius_uN_per_percent": 0.04 * force,
                "modulus_uN_per_percent": 0.01 * force,
                "scale_uN_per_percent": 0.01
                * force
                * (2 + 4 * moved / (whisker.cone_length - middle)),
            }
        )
    return pd.DataFrame(rows, index=contacts.index, columns=list(PEAK_ERROR_COLUMNS), dtype=float)


_FORCE_COLUMNS = {  # of the evidence, by method: force, standard error, the origin's part of it
    "shape": ("shape_force_N", "shape_force_se_N", "origin_force_se_N"),
    "point": ("point_force_N", "point_force_se_N", "point_origin_force_se_N"),
}


class _Measured(NamedTuple):
    """Forces and errors of one whisker in the order of its frames [µN], each (frames,).

    `per_tip`: how far its arc lengths move with the place of its tip.
    """

    frame: np.ndarray
    force: np.ndarray
    total: np.ndarray
    origin: np.ndarray
    per_tip: float

    @classmethod
    def of(cls, evidence, name, method):
        columns = ["frame", *_FORCE_COLUMNS[method], "origin_per_tip"]
        own = evidence.loc[evidence["whisker"] == name, columns].sort_values("frame")
        courses = (1e6 * own[c].to_numpy(float) for c in _FORCE_COLUMNS[method])
        return cls(own["frame"].to_numpy(), *courses, np.nanmedian(own["origin_per_tip"]))

    def at_peak(self, onset, offset):
        """Total and origin's standard error about the peak; None where no force is known."""
        inside = slice(*np.searchsorted(self.frame, [onset, offset]))
        force = np.maximum(self.force[inside], 0.0)  # as in the table of frames
        total, origin = self.total[inside], self.origin[inside]
        force = _without_wild(force, total)
        if not np.isfinite(force).any():
            return None
        peak, value, error = firm_peak(force, half_width(force, total), total)
        error = np.hypot(error, value * _hidden_top(np.isfinite(force), peak))
        return error, min(origin[peak], error)


def _hidden_top(known, peak):
    """How much larger than its largest `known` value, beside a gap, a half-Gaussian may be.

    As a part of that value; 0 where the frames before and after `peak` are known.
    """
    seen = np.flatnonzero(known)
    place = np.searchsorted(seen, peak)
    around = np.concatenate([[-1], seen, [len(known)]])[place : place + 3]
    gap = max(np.diff(around)) - 1
    top = half_gaussian_shape(min((gap + 1) / len(known), LARGEST_GAP))
    return 1 / top - 1 if gap > 0 else 0.0


@njit(cache=True)
def _without_wild(force, error):
    """Force (frames,) of one contact, NaN where something else overlaps the whisker.

    Otherwise a single frame of a crossing, with ten times the usual error, may be the peak.
    """
    usual = np.nanmedian(error)  # where nothing is known no comparison holds
    return np.where(error > WILD * usual + WILD_SHARE * force, np.nan, force)


def _contact_row(part: dict[str, np.ndarray], recording: Recording) -> dict:
    """Peaks, mean and impulse over the frames of one contact, of which `part` has the courses."""
    force, error = part["contact_force_uN"], part["contact_force_uN_se"]
    force = _without_wild(force, error)
    if not np.isfinite(force).any():
        place = part["contact_arc_length_mm"]
        return {
            "contact_arc_length_mm": np.nanmedian(place) if np.isfinite(place).any() else np.nan
        }
    half = half_width(force, error)
    peak, largest, _ = firm_peak(force, half, error)
    frame_ms = 1e3 / recording.frames_per_second
    mean = float(np.nanmean(force))
    return {
        "peak_force_uN": largest,
        "mean_force_uN": mean,
        "impulse_uN_ms": mean * len(force) * frame_ms,
        "peak_base_moment_nN_m": _largest(part["base_moment_nN_m"], half, force, error),
        "peak_axial_force_uN": _largest(part["axial_force_uN"], half, force, error),
        "contact_arc_length_mm": smoothed(part["contact_arc_length_mm"], half, error)[peak],
    }


@njit(cache=True)
def _largest(signed, half, force, error):
    """Value of largest magnitude, with its sign, of a load that goes with the force; (frames,)."""
    signed = np.where(np.isfinite(force), signed, np.nan)
    course = smoothed(signed, half, error)
    if not np.isfinite(course).any():
        return np.nan
    sign = 1.0 if np.nanmax(course) >= -np.nanmin(course) else -1.0
    share = np.nanmean(np.abs(signed)) / max(np.nanmean(force), 1e-12)
    return sign * firm_peak(sign * signed, half, share * error)[1]
