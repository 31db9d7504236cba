"""Quasi-static force on a whisker, in every frame as if it touched, and in contacts.

There are two estimates. `point` (Birdwell et al. 2007; Pammer et al. 2013): the bending moment at
one arc length, M_p = E I(s_p) Δκ, over its lever arm, F = M_p / |(r_c − r_p) × n̂|. `shape`: the
elastic rod fitted to the whole traced centreline (rod_fit.py). Both hold for large angles; signs
are as in docs/conventions.md.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from pipeline.forces import arc_length_offset, lasting_errors, rest_shape, rod_fit, station_noise
from pipeline.forces.rod_fit import ShapeFit
from pipeline.forces.whisker_rows import WhiskerRows
from pipeline.kinematics.stations import Stations, lies_across
from pipeline.numerics.angles import jitter, wrap_angle
from pipeline.numerics.robust import robust_sd, sd_about_0, sd_with_tails
from pipeline.session.parameters import RodParams
from whiskermodel.whisker import Whisker

METHODS = ("point", "shape")
SLIDING_FRAMES = 3
LEAST_NOISE = 0.5  # of the fit's standard error: free frames do not reduce it below this
FARTHEST_TURN_RAD = 0.2  # of a fitted rod's base from the traced part's continuation
STEADY_RAD = 5e-3  # jitter of base angles that clean pictures and touches have, too
LESS_STEADY = 1.2  # jitter over that of the traced base angles, up to which rods are used
FEWEST_FREE = 20  # free frames from which the scatter of the force is estimated
ERROR, CHANGE_ERROR = "base_angle_se_deg", "curvature_change_per_m_se"
STEP_M = 1e-5  # along the whisker, for a slope
_EVIDENCE_OF_FIT = {
    "gap": "gap_m",
    "gap_force_cov": "gap_force_cov",
    "contact": "contact_m",
    "angle": "base_angle_rad",
    "moment_per_force": "moment_per_force_m",
    "axial_per_force": "axial_per_force",
    "lateral_per_force": "lateral_per_force",
    "chi2": "chi2",
    "force": "shape_force_N",
}

_ERROR_COLUMNS = {
    "force": "shape_force_se_N",
    "moment": "moment_se_N_m",
    "axial": "axial_se_N",
    "lateral": "lateral_se_N",
}

_LOADS = {  # column of the frames: its unit, and in the evidence its share of the force, its error
    "contact_force_uN": (1e6, "", "shape_force_se_N"),
    "axial_force_uN": (1e6, "axial_per_force", "axial_se_N"),
    "lateral_force_uN": (1e6, "lateral_per_force", "lateral_se_N"),
    "base_moment_nN_m": (1e9, "moment_per_force_m", "moment_se_N_m"),
}


def measure_forces(
    places: Stations,
    whisker: Whisker,
    kinematics,
    curvature_at: float,
    friction=0.0,
    *,
    params: RodParams,
):
    """The force on one whisker in every frame, as if its point nearest to the pole touched it.

    Parameters
    ----------
    places : the whisker's `Stations`, one row per tracked frame
    whisker : its dimensions (or stand-ins)
    kinematics : table aligned with `places`: `time_s`, `curvature_per_m`, `curvature_per_m_se`,
        `base_angle_deg`
    curvature_at : arc length of the curvature [m]
    friction : coefficient of friction between whisker and pole, >= 0
    params : the room's parameters

    Returns
    -------
    evidence : table aligned with `places`, SI units
    measured : table aligned with `places`, from the fitted rods: `base_angle_deg`,
        `base_angle_se_deg`, `follicle_x_m`, `follicle_y_m` (y up), `curvature_per_m`, rest
        curvature and curvature change, with their standard errors
    """
    time = kinematics["time_s"].to_numpy(float)
    angle = wrap_angle(np.radians(kinematics["base_angle_deg"].to_numpy(float)))  # as rods have it
    free = far_from_pole(places, params)
    own = WhiskerRows(places, whisker, curvature_at, angle, time, free)
    fit, origin, model = _fit_rods(own, friction, params)
    evidence = _evidence(places, fit, origin, model is not None, free, params)
    # the load also bends the hidden part, which the rod has and the trace has not
    own = replace(own, angle=np.where(np.isfinite(fit["angle"]), fit["angle"], angle))
    before, basis, after = rod_fit.rest_basis(whisker, curvature_at + STEP_M * np.arange(-1, 2))
    shape = _turned_to(model, basis, own)
    measured = _rest_columns(*_curvature(kinematics, fit, origin), shape, own)
    measured |= _base(kinematics, fit, origin.se, places.frame)
    point, error = point_force(measured, fit, params)
    evidence["point_force_N"] = point
    stiffer = 4 / (whisker.cone_length - curvature_at)  # E I goes with (cone length − s)⁴
    evidence["point_origin_force_se_N"] = np.abs(stiffer * origin.se * point)
    evidence["point_force_se_N"] = np.hypot(error, evidence["point_origin_force_se_N"])
    # with the origin, the rest shape moves along the whisker; the bending by the load does not
    added = fit["curvature_slope"] - fit.rest @ (after - before) / (2 * STEP_M)
    measured[CHANGE_ERROR] = np.hypot(measured[CHANGE_ERROR], np.nan_to_num(added) * origin.se)
    return evidence, pd.DataFrame(measured)


def far_from_pole(places, params: RodParams) -> np.ndarray:
    """Rows in which the whisker is so far from the pole that it cannot touch it, bool (rows,)."""
    free = rest_shape.free_frames(places.distance, np.isfinite(places.pole_x), params)
    return free & np.isfinite(places.last)


def _fit_rods(own: WhiskerRows, friction, params):
    """Loaded rods of all rows, the `Origin` of their arc lengths, and the `RestModel` or None."""
    whisker, at = own.whisker, own.curvature_at
    places = station_noise.with_observed_scatter(own.places, whisker, at, own.free)
    own = replace(own, places=places)
    places = lasting_errors.with_lasting_errors(own, 1e-3 * params.loaded_distance_mm)
    origin, by_tip = arc_length_offset.origin_from_tip(places, whisker, own.time, params)
    places = replace(places, origin=origin.per_row)
    own = replace(own, places=places)
    model = own.rest_shape()
    if model is None:
        return rod_fit.fit_free(places, whisker, at), origin, None
    rod = places, whisker, at, own.rest_prior(model)
    rubbing = friction * sliding(rod_fit.fit_loaded(*rod)["contact"]) if friction else 0.0

    def from_free(design):
        smoothed = model.smoother(design[model.rows].toarray())
        angle = own.filled_angle(model)
        return lambda rows: smoothed(angle[rows], own.time[rows])

    origin, prior = arc_length_offset.origin_from_bending(*rod, by_tip, from_free, rubbing)
    shift = origin.per_row - places.origin
    rod = places, whisker, at, prior
    return rod_fit.fit_loaded(*rod, rubbing, shift), origin, model


def _evidence(places, fit, origin, rest_known, free, params) -> pd.DataFrame:
    """The table of evidence, with standard errors scaled to the scatter of free frames."""
    evidence = {
        "distance_m": places.distance,
        "nearest_m": places.nearest,
        "side": places.side,
        "pole_known": np.isfinite(places.pole_x),
        "extended": places.extended,
        "across": lies_across(places),
        "interpolated": places.interpolated,
        "rest_known": rest_known,
        "origin_m": origin.per_row,
        "origin_se_m": origin.se,
        "origin_per_tip": origin.per_tip,
        "bending_origin_m": origin.by_bending,
        "bending_origin_se_m": origin.bending_se,
    }
    for name, column in _EVIDENCE_OF_FIT.items():
        evidence[column] = fit[name]
    # an error of the rest shape hardly shows in the free frames that it was learnt from
    own = {load: fit[f"{load}_var"] - fit[f"{load}_shared_var"] for load in _ERROR_COLUMNS}
    noise = _force_noise(fit["force"], np.sqrt(own["force"]), places, free, params)
    evidence["gap_se_m"] = np.sqrt(fit["gap_var"]) * noise
    evidence["gap_force_cov"] = fit["gap_force_cov"] * noise**2
    for load, column in _ERROR_COLUMNS.items():
        # an error of the arc-length offset changes each load in its own proportion
        follows = np.abs(fit[f"{load}_by_origin"]) * origin.se
        variance = noise**2 * own[load] + fit[f"{load}_shared_var"] + follows**2
        evidence[column] = np.sqrt(variance)
    evidence["origin_force_se_N"] = np.abs(fit["force_by_origin"]) * origin.se
    return pd.DataFrame(evidence)


def sliding(place) -> np.ndarray:
    """Direction in which friction pulls the whisker: +1 towards its tip, −1 towards its base.

    `place` (rows,) is the contact's arc length [m], frame after frame. Where it grows, the whisker
    slides back over the pole. 0 where it changes by no more than its scatter.
    """
    known = np.flatnonzero(np.isfinite(place))
    out = np.zeros(len(place))
    if len(known) < 2 * SLIDING_FRAMES + 1:
        return out
    smooth = gaussian_filter1d(place[known], SLIDING_FRAMES)
    rate = np.gradient(smooth)
    scatter = robust_sd(place[known], smooth) / SLIDING_FRAMES**1.5
    out[known] = np.sign(rate) * (np.abs(rate) > scatter)
    return out


def point_force(rest: dict, fit: ShapeFit, params: RodParams):
    """F = E I(s_p) Δκ / |(r_c − r_p) × n̂| and its standard error [N].

    Positive pushes away from the pole. NaN where the contact lies before or just beyond s_p.
    """
    with np.errstate(all="ignore"):
        usable = np.abs(fit["lever_at_curvature"]) > 1e-3 * params.shortest_lever_mm
        change = fit["curvature_per_force"]
        force = rest["curvature_change_per_m"] / change
        error = rest["curvature_change_per_m_se"] / np.abs(change)
    return np.where(usable, force, np.nan), np.where(usable, error, np.nan)


def _force_noise(force, error, places, free, params):
    """Scatter of the force in free frames, where it is zero, over its standard error.

    Rendered pictures need no such factor; on real recordings the fit's own error covers the zero
    force of free frames too seldom (64 % instead of 99 % beside one rat's whisker).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        near = places.distance < 1e-3 * params.calibration_mm
        return _excess(force / error, free & near)


def _excess(ratio, free, sd=sd_about_0):
    """Scatter of the free frames, by `sd`; `ratio` (rows,) is an error over its standard error."""
    ratio = ratio[free & np.isfinite(ratio)]
    return max(LEAST_NOISE, float(sd(ratio))) if len(ratio) >= FEWEST_FREE else 1.0


def _base(kinematics, fit, origin_se, frame) -> dict:
    """Base angle and follicle of the fitted rods; the traced angle where no rod is used.

    A rod far from the continuation of the traced part has been fitted to something else; rods
    whose angle jitters from frame to frame follow noise. Full turns are those of the traced angle.
    """
    angle = np.radians(kinematics["base_angle_deg"].to_numpy(float))
    error = np.radians(np.asarray(kinematics.get(ERROR, np.nan), float))
    off = wrap_angle(fit["angle"] - angle)
    with np.errstate(invalid="ignore"):
        found = np.abs(off) <= FARTHEST_TURN_RAD
    found &= _steady(angle, angle + off, frame)
    rod_error = np.hypot(np.sqrt(fit["angle_var"]), fit["base_curvature"] * origin_se)
    return {
        "base_angle_deg": np.degrees(angle + np.where(found, off, 0.0)),
        ERROR: np.degrees(np.where(found, rod_error, error)),
        "follicle_x_m": np.where(found, fit["follicle_x"], np.nan),
        "follicle_y_m": np.where(found, fit["follicle_y"], np.nan),
    }


def _steady(traced, rods, frame) -> bool:
    """Whether the rods' base angles are steady, or at least not less so than the traced ones."""
    unsteady = jitter(rods, frame)
    return not unsteady > max(STEADY_RAD, LESS_STEADY * jitter(traced, frame))


def _curvature(kinematics, fit, origin):
    """Curvature [1/m], its error by noise alone, and that by its place; (rows,) each.

    From the fitted rod; where there is none, from the kinematics.
    """
    curvature, noise = fit["curvature"], np.sqrt(fit["curvature_var"])
    place = np.abs(fit["curvature_slope"]) * origin.se
    known = np.isfinite(curvature) & np.isfinite(noise)
    return (
        np.where(known, curvature, kinematics["curvature_per_m"].to_numpy(float)),
        np.where(known, noise, kinematics["curvature_per_m_se"].to_numpy(float)),
        np.where(known, place, 0.0),
    )


def _turned_to(model, basis, own: WhiskerRows):
    """Curvature of the rest shape in all frames, at the place of `basis` (N_REST,), and its error.

    The error is that of the change from the free frames' usual angle.
    """
    shape, error = np.full((2, len(own.angle)), np.nan)
    known = np.isfinite(own.angle)
    if model is not None and known.any():
        angle = own.angle[known]
        shape[known] = model.values(angle, own.time[known]) @ basis
        error[known] = np.sqrt(model.turning_cov(angle) @ basis @ basis)
    return shape, error


def _rest_columns(curvature, noise, place, shape, own: WhiskerRows):
    """Curvature, rest curvature and curvature change at one arc length, with standard errors."""
    rest, rest_error = _rest_curvature(curvature, noise, shape, own)
    # a codec's errors are alike at neighbouring stations, so that curvature errs by more than the
    # noise, in some frames by far: free frames show by how much. A rest curvature that wanders
    # looks the same
    error = noise * _excess((curvature - rest) / noise, own.free, sd_with_tails)
    rest, rest_error = _rest_curvature(curvature, error, shape, own)
    return {
        "curvature_per_m": curvature,
        "curvature_per_m_se": np.hypot(error, place),
        "rest_curvature_per_m": rest,
        "rest_curvature_per_m_se": rest_error,
        "curvature_change_per_m": curvature - rest,
        "curvature_change_per_m_se": np.hypot(error, rest_error),
    }


def _rest_curvature(curvature, error, shape, own: WhiskerRows):
    """Rest curvature and its standard error in all frames; NaN where it is not known.

    It follows base angle and time as the rest shape does (`_turned_to`); free frames show by how
    much the two differ.
    """
    rest, rest_error = np.full((2, len(curvature)), np.nan)
    turned, turning_error = shape
    of_frames = own.angle, own.time, own.free
    model = rest_shape.fit_rest(curvature - turned, error**2, *of_frames, degree=0)
    if model is not None:
        known = np.isfinite(own.angle)
        value, cov = model.predict(own.angle[known], own.time[known])
        rest[known] = turned[known] + value[:, 0]
        rest_error[known] = np.sqrt(cov[:, 0, 0] + turning_error[known] ** 2)
    return rest, rest_error


def add_forces(
    frames: pd.DataFrame, evidence: pd.DataFrame, whiskers: dict, method: str = "shape"
) -> pd.DataFrame:
    """Fill contact place and force columns of the table of frames, given `in_contact`.

    Free frames have no force (0) and no place; untracked ones, and whiskers without dimensions,
    have NaN.

    Parameters
    ----------
    frames : FRAME_COLUMNS with `tracked` and `in_contact`
    evidence : table aligned with `frames`, as in `measure_forces`
    whiskers : name → Whisker, or None where its dimensions are not known
    method : "shape" or "point"
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {METHODS}, got {method!r}")
    touching = frames["in_contact"].to_numpy(bool)
    known = [name for name, whisker in whiskers.items() if whisker is not None]
    known = frames["whisker"].isin(known).to_numpy() & frames["tracked"].to_numpy(bool)
    force = evidence[f"{method}_force_N"].to_numpy(float)
    error = evidence[f"{method}_force_se_N"].to_numpy(float)
    new = {"contact_arc_length_mm": np.where(touching, 1e3 * evidence["contact_m"], np.nan)}
    for column, (unit, per_force, own_error) in _LOADS.items():
        share = evidence[per_force].to_numpy(float) if per_force else 1.0
        # noise may make a touch's first force negative; a pole does not pull
        value = np.where(touching, unit * share * np.maximum(force, 0.0), 0.0)
        new[column] = np.where(known, value, np.nan)
        spread = evidence[own_error].to_numpy(float) if method == "shape" else abs(share) * error
        new[f"{column}_se"] = np.where(known, unit * spread, np.nan)
    return frames.assign(**new)
