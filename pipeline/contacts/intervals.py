"""From the probability of contact in every frame to contacts, each with its flags."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.contacts.probability import FEWEST_SURE, by_whisker, force_noise
from pipeline.forces import forces
from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import runs_of_true
from pipeline.session.parameters import ContactParams

LEAST_PEAK_SD = 3.5  # peak force in standard errors
CLEAR_PEAK_SCATTER = 8.0  # peak force over its scatter in free frames, by both estimates
BESIDE_FRAMES = 6  # looked at before a contact, and after it
FEWEST_HELD = 3  # frames that show a whisker held, and as many beside the contact
AT_PLACE_SD = 2.0  # from the gap of other contacts, within which a gap is the same
HIGH_LOAD = 0.5  # of a contact's largest force
SURELY_SD = 3.0  # standard errors by which the base must be corrected to be contradicted
PUSH_COLUMNS = "shape_force_N", "shape_force_se_N", "origin_force_se_N", "rest_known"

INTERVAL_COLUMNS = {
    "whisker": str, "onset_frame": int, "offset_frame": int, "probability": float, "side": int,
    "slip": bool, "flags": str,
}  # fmt: skip
_EVIDENCE = (
    "frame", "probability", "side", "distance_m", "gap_m", "gap_se_m", "shape_force_N",
    "shape_force_se_N", "origin_force_se_N", "point_force_N", "chi2", "contact_m",
    "lateral_per_force", "bending_origin_m", "bending_origin_se_m", "rest_known", "base_angle_rad",
)  # fmt: skip


class _Criteria(NamedTuple):
    """Arc length of the curvature [m], frames within which a slip shows, the room's parameters."""

    curvature_at: float
    slip_frames: int
    params: ContactParams


def find_intervals(
    evidence: pd.DataFrame,
    curvature_at: float = 5.5e-3,
    frames_per_second: float = 1000.0,
    *,
    params: ContactParams,
) -> pd.DataFrame:
    """Contact intervals from evidence with `probability`: INTERVAL_COLUMNS, half-open frames."""
    criteria = _Criteria(curvature_at, max(round(params.slip_s * frames_per_second), 1), params)
    rows = []
    for name, part in by_whisker(evidence, _EVIDENCE).items():
        usual = _usual_misfit(part)
        for start, stop in _real_runs(part, 1e-3 * params.near_pole_mm):
            rows.append(_interval(part, name, start, stop, criteria, usual))
    columns = zip(*rows, strict=True) if rows else [()] * len(INTERVAL_COLUMNS)
    kinds = INTERVAL_COLUMNS.items()
    return pd.DataFrame(
        {name: np.array(own, kind) for (name, kind), own in zip(kinds, columns, strict=True)}
    )


def _runs(part):
    """Runs of rows with a probability above ½, split where the pole changes sides."""
    side = part["side"]
    for start, stop in runs_of_true(part["probability"] > 0.5):
        first = start
        known = np.flatnonzero(side[start:stop]) + start
        for before, after in pairwise(known):
            if side[before] != side[after]:
                yield first, after
                first = after
        yield first, stop


def _real_runs(part, near_pole):
    """Runs near the pole in which the whisker is pushed, or held where others are pushed.

    Rendered whiskers need neither test: free ones are never taken to touch. Without both tests,
    real ones that pass within 0.2 mm of a pole are taken to touch 5 times in 9700 frames, for 1
    to 4 frames. By the force's error alone, touches would be lost where the rest shape is hardly
    known, as with few free frames: these stand out, or stop where others touch.
    """
    runs = [run for run in _runs(part) if _is_near(part["distance_m"][slice(*run)], near_pole)]
    sides = [np.sign(part["side"][slice(*run)].sum()) for run in runs]
    firm = [_is_pushed(part, *run) for run in runs]
    touching = [(run, own) for run, own, yes in zip(runs, sides, firm, strict=True) if yes]
    places = {
        side: _touching_place(part, [run for run, own in touching if own == side])
        for side in set(sides)
    }
    return [
        run
        for run, own, yes in zip(runs, sides, firm, strict=True)
        if yes or (places[own] is not None and _is_held(part, *run, *places[own]))
    ]


def _is_near(distance, near_pole):
    """Whether a whisker is near the pole in half of the frames; if not, it cannot touch."""
    known = distance[np.isfinite(distance)]
    return len(known) == 0 or np.median(known) < near_pole


def _touching_place(part, runs):
    """Median gap [m] in contacts, and its scatter; None where too few frames show it."""
    gap = np.concatenate([part["gap_m"][slice(*run)] for run in runs]) if runs else np.empty(0)
    gap = gap[np.isfinite(gap)]
    if len(gap) < FEWEST_SURE:
        return None
    place = np.median(gap)
    return place, robust_sd(gap, place)


def _is_held(part, start, stop, place, spread):
    """Whether a whisker stops abruptly where others touch, at a gap `place` ± `spread` [m]."""
    sd = np.maximum(spread, part["gap_se_m"][start:stop])
    at_place = np.abs(part["gap_m"][start:stop] - place) < AT_PLACE_SD * sd
    held = np.count_nonzero(at_place) >= FEWEST_HELD
    return held and _is_stopped(part, start, stop, spread)


def _is_stopped(part, start, stop, spread):
    """Whether the gap is no cubic in time, from some frames before the contact to some after."""
    first = max(start - BESIDE_FRAMES, 0)
    gap, gap_sd = (part[name][first : stop + BESIDE_FRAMES] for name in ("gap_m", "gap_se_m"))
    time, known = np.arange(len(gap)), np.isfinite(gap) & np.isfinite(gap_sd)
    outside = np.count_nonzero(known) - np.count_nonzero(known[start - first : stop - first])
    if outside < FEWEST_HELD:
        return False
    path = np.polynomial.Polynomial.fit(time[known], gap[known], 3)
    misfit = np.sum((gap[known] - path(time[known])) ** 2) / max(known.sum() - 4, 1)
    return misfit > (LEAST_PEAK_SD * max(spread, np.median(gap_sd[known]))) ** 2


def _is_pushed(part, start, stop):
    """Whether the peak force is above its standard error, or above the forces of free frames."""
    rows = slice(start, stop)
    return _pushes(part, rows) or all(
        _stands_out(part, rows, f"{method}_force_N") for method in forces.METHODS
    )


def _pushes(part, rows):
    """Whether the peak force is above its standard error.

    Where there is none, it may be if no rest shape is known, but not in the blurred frame of a
    slip.
    """
    part = {name: part[name][rows] for name in PUSH_COLUMNS}
    with np.errstate(invalid="ignore"):
        push = part["shape_force_N"] / force_noise(part)
    if not np.isfinite(push).any():
        return not part["rest_known"].any()
    return np.nanmax(push) > LEAST_PEAK_SD


def _stands_out(part, rows, column):
    """Whether the peak force is far above free frames, which share the rest shape's error."""
    force, free = part[column], part["probability"] < 0.5
    free = free & np.isfinite(force)
    if free.sum() < FEWEST_SURE or not np.isfinite(force[rows]).any():
        return False
    middle = np.median(force[free])
    scatter = robust_sd(force[free], middle)
    return np.nanmax(force[rows]) - middle > CLEAR_PEAK_SCATTER * scatter


def _usual_misfit(part):
    """Median χ² of free frames' rods, at least 1; infinite where few are free."""
    free = part["chi2"][part["probability"] < 0.5]
    free = free[np.isfinite(free)]
    return max(float(np.median(free)), 1.0) if len(free) >= FEWEST_SURE else np.inf


def _bends_otherwise(part, rows, limit):
    """Whether χ² of the rods exceeds `limit` in the frames of high force."""
    force, misfit = part["shape_force_N"][rows], part["chi2"][rows]
    known = np.isfinite(force) & np.isfinite(misfit)
    high = known & (force >= HIGH_LOAD * np.max(force[known], initial=0.0))
    return bool(high.any()) and np.median(misfit[high]) > limit


def _interval(part, name, start, stop, criteria, usual_misfit):
    """One row of INTERVAL_COLUMNS."""
    rows = slice(start, stop)
    frame = part["frame"]
    sides = part["side"]
    side = int(np.sign(sides[rows].sum())) or 1
    after = sides[stop : stop + criteria.slip_frames]
    slip = len(after) > 0 and np.any(after == -side)
    probability = part["probability"][rows]
    flags = _flags(part, rows, criteria, slip, usual_misfit)
    return (
        name, frame[start], frame[stop - 1] + 1, probability.mean(), side, slip, ";".join(flags)
    )  # fmt: skip


def _flags(part, rows, criteria, slip, usual_misfit):
    """Flags of one contact: what to be careful about."""
    (curvature_at, _, params), start, stop = criteria, rows.start, rows.stop
    frame = part["frame"]
    contact = part["contact_m"][rows]
    lateral = part["lateral_per_force"][rows]
    with np.errstate(invalid="ignore"):
        tilted = np.nanmin(np.abs(lateral), initial=1.0) < np.cos(
            np.deg2rad(params.large_deflection_deg)
        )
        near = np.nanmin(contact, initial=np.inf) < curvature_at + 1e-3 * params.near_curvature_mm
    probability = part["probability"][rows]
    correction, error = np.abs(part["bending_origin_m"][rows]), part["bending_origin_se_m"][rows]
    contradicted = correction > np.maximum(1e-3 * params.contradicted_mm, SURELY_SD * error)
    rest_known = part["rest_known"][rows].astype(bool)
    # without a rest shape no force is fitted: then a missing place of contact is no gap
    lost = np.isnan(part["base_angle_rad"][rows]) | (rest_known & np.isnan(contact))
    applies = {
        "starts_before": start == 0,
        "ends_after": stop == len(frame),
        "slip": slip,
        "no_rest_curvature": not rest_known.any(),
        "large_deflection": tilted,
        "contact_near_curvature_window": near,
        "bends_unlike_rod": _bends_otherwise(part, rows, params.unlike_rod * usual_misfit),
        "base_contradicted": bool(np.any(contradicted)),
        "gaps_in_trace": lost.any(),
        "faint_force": not _pushes(part, rows),
        "doubtful": probability.max() < 0.99,
    }
    return [flag for flag, is_so in applies.items() if is_so]


def in_contact(frames: pd.DataFrame, intervals: pd.DataFrame) -> np.ndarray:
    """Bool (rows,): the frames of `frames` that lie in one of the half-open intervals."""
    frame, whisker = frames["frame"].to_numpy(), frames["whisker"].to_numpy(object)
    out = np.zeros(len(frames), dtype=bool)
    for name, own in intervals.groupby("whisker"):
        rows = np.flatnonzero(whisker == name)
        onsets, offsets = (np.sort(own[c].to_numpy()) for c in ("onset_frame", "offset_frame"))
        begun = np.searchsorted(onsets, frame[rows], side="right")
        out[rows] = begun > np.searchsorted(offsets, frame[rows], side="right")
    return out
