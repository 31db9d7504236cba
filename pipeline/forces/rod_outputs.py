"""What a fitted rod tells: contact force, base loads and curvature, with their variances.

A row of results has the COLUMNS; `shape_fit.ShapeFit` says what they mean.
"""

import numpy as np
from numba import njit

from pipeline.forces.normal_equations import misfit_of, robust_weight
from pipeline.forces.rod_integration import (
    LOADED,
    along_normal,
    laid_from,
    lay,
    point_at,
    polynomials,
    softness,
    unit_force,
)
from pipeline.numerics.cholesky import factorise, invert

ORIGIN_STEP_M = 1e-5  # of the derivatives by the origin
CURVATURE_REACH_M = 2.5e-3  # stations this near tell how a curvature differs from the rod's
FEWEST_NEAR = 8

COLUMNS = (
    "force", "force_var", "gap", "gap_var", "gap_force_cov", "compliance", "contact",
    "angle", "follicle_x", "follicle_y", "moment_per_force", "axial_per_force",
    "lateral_per_force", "curvature_per_force", "lever_at_curvature", "rest_curvature",
    "chi2", "count", "clear_gap", "clear_gap_var",
    "moment_var", "axial_var", "lateral_var",
    "force_by_origin", "moment_by_origin", "axial_by_origin", "lateral_by_origin",
    "origin_pull", "origin_bend", "curvature", "curvature_var", "curvature_slope",
    "angle_var", "base_curvature",
)  # fmt: skip


@njit(cache=True)
def report_loads(
    o, seen, chi2, cov, arc, rod, load, pole, radius, at, place, p, laid, nudged, sums,
    precision, influence,
):  # fmt: skip
    """Fill one row of results that need the force, and its `influence` where there is room."""
    size, (origin, moved, h) = LOADED, arc
    contact = laid_from(p, place)
    place_at = point_at(laid.x, laid.y, laid.angle, h, at - origin)
    _loads(
        o, p, cov, size, load, place.c + origin, contact, laid, place_at, at, softness(at, rod),
        pole, radius,
    )  # fmt: skip
    unit = unit_force(p[1], load[0], load[1])
    gradient, follows = np.zeros((3, LOADED)), np.zeros(LOADED)
    _load_errors(o, p[size - 1], cov, size, unit, laid.base, gradient)
    lay(p, rod, load, (origin + ORIGIN_STEP_M, moved + ORIGIN_STEP_M, h), place, nudged, False)
    _follow(seen, chi2, laid, nudged, size, sums, follows, o)
    for each in influence:
        _influence(seen, chi2, laid, nudged, size, follows, precision, each)
    _loads_by_origin(o, p[size - 1], size, unit, contact, nudged.follicle, gradient, follows)


@njit(cache=True)
def report_curvature(o, seen, chi2, arc, rod, load, at, place, p, laid, sums):
    """Fill one row's curvature at `at`, its variance and slope."""
    origin, _, h = arc
    rod_now = p, rod, load, arc, place, laid
    near = at - origin  # the place among the stations
    o[31] = (
        _rod_curvature(rod_now, near + h / 2, sums.mean)
        - _rod_curvature(rod_now, near - h / 2, sums.mean)
    ) / h
    more, o[30] = _more_curvature(seen, chi2, laid, h, near, sums)
    o[29] = _rod_curvature(rod_now, near, sums.mean) + more


@njit(cache=True)
def report_base(o, cov, size, rod_now, values):
    """Fill one row's variance of the base angle, and the curvature at the follicle."""
    base, total = rod_now[5].base, 0.0
    for a in range(size):
        for b in range(size):
            total += base[2, a] * cov[a, b] * base[2, b]
    o[32] = total
    o[33] = _rod_curvature(rod_now, -rod_now[3][0], values)


@njit(cache=True)
def _loads(o, p, cov, size, load, c, contact, laid, place_at, at, softness_at, pole, radius):
    """Fill gap, contact and base loads of one row."""
    c_angle, (c_x, c_y), (px, py, pole_radius), base = p[1], contact, pole, laid.base
    side = load[0]
    fx, fy = unit_force(c_angle, side, load[1])
    x, y, angle = laid.follicle
    at_x, at_y, _ = place_at
    force = p[size - 1]
    o[0], o[1] = force, cov[size - 1, size - 1]
    surface = max(radius[0] - radius[1] * c, 0.0)
    o[2] = np.hypot(px - c_x, py - c_y) - pole_radius - surface
    o[3], o[4] = cov[0, 0], -side * cov[0, size - 1]
    # with the base held, the contact moves against the base's motion and turning
    q = size - 1
    move_x = -base[0, q] + base[2, q] * (c_y - y)
    move_y = -base[1, q] - base[2, q] * (c_x - x)
    o[5] = -side * (-np.sin(c_angle) * move_x + np.cos(c_angle) * move_y)
    o[6] = c
    o[10] = (c_x - x) * fy - (c_y - y) * fx
    o[11] = fx * np.cos(angle) + fy * np.sin(angle)
    o[12] = fy * np.cos(angle) - fx * np.sin(angle)
    lever = (c_x - at_x) * fy - (c_y - at_y) * fx if at < c else 0.0
    o[13], o[14] = lever * softness_at, lever
    o[18] = o[2] - force * o[5]
    o[19] = o[3] + o[5] ** 2 * o[1] - 2 * o[5] * o[4]


@njit(cache=True)
def _load_errors(o, force, cov, size, unit, base, gradient):
    """Variances of base moment, axial and lateral force; `gradient` (3, parameters) of them."""
    fx, fy = unit
    gradient[:, :] = 0.0
    # the rod turns and shifts as a whole with the first two parameters: no load changes
    for q in range(2, size):
        gradient[0, q] = force * (base[1, q] * fx - base[0, q] * fy)
        gradient[1, q] = force * base[2, q] * o[12]
        gradient[2, q] = -force * base[2, q] * o[11]
    for k in range(3):
        gradient[k, size - 1] += o[10 + k]
        total = 0.0
        for a in range(size):
            for b in range(size):
                total += gradient[k, a] * cov[a, b] * gradient[k, b]
        o[20 + k] = total


@njit(cache=True)
def _rod_curvature(rod_now, near, values):
    """Curvature of the fitted rod at grid place `near`; `values` (rest terms,) is scratch."""
    p, rod, load, (origin, moved, h), place, laid = rod_now
    polynomials(2 * (near + origin - moved) / rod[0] - 1, values)
    total = 0.0
    for j in range(len(values)):
        total += p[2 + j] * values[j]
    if load[0] != 0 and near < place.c:
        fx, fy = unit_force(p[1], load[0], load[1])
        at_x, at_y, _ = point_at(laid.x, laid.y, laid.angle, h, near)
        c_x, c_y = laid_from(p, place)
        lever = (c_x - at_x) * fy - (c_y - at_y) * fx
        total += p[2 + len(values)] * lever * softness(near + origin, rod)
    return total


@njit(cache=True)
def _more_curvature(seen, chi2, laid, h, near, sums):
    """Curvature of the stations beyond the rod's about grid place `near`, and its variance.

    NaN where they do not lie on both sides of it.
    """
    info, square, rhs, inverse = seen[2], sums.normal, sums.rhs, sums.inverse
    square[:3, :3] = 0.0
    rhs[:3] = 0.0
    count, before, after = 0, 0, 0
    start = max(int(np.ceil((near - CURVATURE_REACH_M) / h)), 0)
    for k in range(start, min(int((near + CURVATURE_REACH_M) / h) + 1, len(info))):
        if not info[k] > 0:
            continue
        u = (k * h - near) / CURVATURE_REACH_M
        misfit = misfit_of(seen, laid, k)
        weight = robust_weight(info[k], misfit, 1 / max(chi2, 1.0))
        power = (1.0, u, u * u)
        for a in range(3):
            rhs[a] += weight * power[a] * misfit
            for b in range(3):
                square[a, b] += weight * power[a] * power[b]
        count += 1
        before, after = before + (u < 0), after + (u > 0)
    enough = count >= FEWEST_NEAR and min(before, after) >= 2
    if not (enough and factorise(square, 3, sums.lower)):
        return np.nan, np.nan
    invert(sums.lower, 3, inverse)
    bend = 0.0
    for a in range(3):
        bend += inverse[2, a] * rhs[a]
    scale = 2 / CURVATURE_REACH_M**2
    return scale * bend, scale**2 * inverse[2, 2] * max(chi2, 1.0)


@njit(cache=True)
def _follow(seen, chi2, laid, nudged, size, sums, follows, o):
    """Fill `follows` with the parameters' derivatives by the origin, which moved the model.

    And the log-likelihood's slope and curvature by the origin: Gauss–Newton's, as for the rest.
    """
    info, shift, inverse, rhs = seen[2], laid.shift, sums.inverse, sums.rhs
    rhs[:] = 0.0
    pull, bend = 0.0, 0.0
    for k in range(len(info)):
        if not info[k] > 0:
            continue
        away, misfit = _moved_by_origin(laid, nudged, k), misfit_of(seen, laid, k)
        weight = robust_weight(info[k], misfit, 1 / max(chi2, 1.0))
        pull += weight * misfit * away
        bend += weight * away * away
        for a in range(size):
            rhs[a] -= weight * shift[a, k] * away
    follows[:] = 0.0
    for a in range(size):
        for b in range(size):
            follows[a] += inverse[a, b] * rhs[b]
        bend -= rhs[a] * follows[a]
    o[27], o[28] = pull, bend


@njit(cache=True, inline="always")
def _moved_by_origin(laid, nudged, k):
    """How far station `k` moves along its normal per unit of origin, by which it was nudged."""
    return along_normal(laid, k, nudged.x[k] - laid.x[k], nudged.y[k] - laid.y[k]) / ORIGIN_STEP_M


@njit(cache=True)
def _influence(seen, chi2, laid, nudged, size, follows, precision, out):
    """Fill `out` with the change of the origin's pull by an error of each station and rest term.

    What the pull is for a rod that is fitted again: a misfit counts as far as no parameter
    answers to it, and a rest shape as far as the stations do not correct the prior.
    """
    info, shift = seen[2], laid.shift
    m, terms = len(info), len(precision)
    for j in range(terms):
        out[m + j] = 0.0
        for b in range(terms):
            out[m + j] += follows[2 + b] * precision[b, j] * max(chi2, 1.0)
    for k in range(m):
        out[k] = 0.0
        if not info[k] > 0:
            continue
        away, misfit = _moved_by_origin(laid, nudged, k), misfit_of(seen, laid, k)
        for a in range(size):
            away += shift[a, k] * follows[a]
        out[k] = robust_weight(info[k], misfit, 1 / max(chi2, 1.0)) * away


@njit(cache=True)
def _loads_by_origin(o, force, size, unit, contact, follicle, gradient, follows):
    """Derivatives of force and base loads by the origin, from those of the parameters."""
    (fx, fy), (c_x, c_y) = unit, contact
    x, y, angle = follicle
    moved = (
        (c_x - x) * fy - (c_y - y) * fx,
        fx * np.cos(angle) + fy * np.sin(angle),
        fy * np.cos(angle) - fx * np.sin(angle),
    )
    o[23] = follows[size - 1]
    for k in range(3):
        o[24 + k] = force * (moved[k] - o[10 + k]) / ORIGIN_STEP_M
        for a in range(size):
            o[24 + k] += gradient[k, a] * follows[a]
