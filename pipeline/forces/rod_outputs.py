"""What follows from a fitted rod: contact force, base loads and curvature, with their variances.

A row of results is an `OUTPUT_ROW`; `rod_fit.ShapeFit` says what its fields mean.
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
from pipeline.forces.rod_types import Arc
from pipeline.numerics.cholesky import factorise, invert

ORIGIN_STEP_M = 1e-5  # of the derivatives by the origin
CURVATURE_REACH_M = 2.5e-3  # stations this near show how a curvature differs from the rod's
FEWEST_NEAR = 8


@njit(cache=True)
def report_loads(o, problem, fitted, at, taper, nudged, precision, influence):
    """Fill one row of results that need the force, and its `influence` where there is room.

    `at`, `taper` as in `Setup`; `nudged` is a rod to be laid; `precision` of the rest shape.
    """
    beam, load, arc = problem.beam, problem.load, problem.arc
    force, laid = fitted.p[LOADED - 1], fitted.laid
    contact, unit = (
        laid_from(fitted.p, fitted.place),
        unit_force(fitted.p[1], load.side, load.friction),
    )
    _loads(o, problem, fitted, contact, at, taper)
    gradient, follows = np.zeros((3, LOADED)), np.zeros(LOADED)
    _load_errors(o, force, fitted.cov, unit, laid.base, gradient)
    moved = Arc(arc.origin + ORIGIN_STEP_M, arc.moved + ORIGIN_STEP_M, arc.spacing)
    lay(fitted.p, beam, load, moved, fitted.place, nudged, False)
    _follow(problem.seen, fitted, nudged, follows, o)
    for each in influence:
        _influence(problem.seen, fitted, nudged, follows, precision, each)
    _loads_by_origin(o, force, unit, contact, nudged.follicle, gradient, follows)


@njit(cache=True)
def report_curvature(o, problem, fitted, at):
    """Fill one row's curvature at `at`, its variance and slope."""
    h, mean = problem.arc.spacing, fitted.sums.mean
    near = at - problem.arc.origin  # the place among the stations
    o.curvature_slope = (
        _rod_curvature(problem, fitted, near + h / 2, mean)
        - _rod_curvature(problem, fitted, near - h / 2, mean)
    ) / h
    more, o.curvature_var = _more_curvature(problem.seen, fitted, h, near)
    o.curvature = _rod_curvature(problem, fitted, near, mean) + more


@njit(cache=True)
def report_base(o, problem, fitted):
    """Fill one row's variance of the base angle, and the curvature at the follicle."""
    o.angle_var = _variance(fitted.laid.base[2, : len(fitted.cov)], fitted.cov)
    o.base_curvature = _rod_curvature(problem, fitted, -problem.arc.origin, fitted.sums.mean)


@njit(cache=True)
def _loads(o, problem, fitted, contact, at, taper):
    """Fill gap, contact and base loads of one row."""
    p, cov, laid, arc = fitted.p, fitted.cov, fitted.laid, problem.arc
    size, side, c = LOADED, problem.load.side, fitted.place.c + arc.origin
    (c_x, c_y), base, pole = contact, laid.base, problem.pole
    c_angle, force = p[1], p[size - 1]
    fx, fy = unit_force(c_angle, side, problem.load.friction)
    x, y, angle = laid.follicle
    at_x, at_y, _ = point_at(laid.x, laid.y, laid.angle, arc.spacing, at - arc.origin)
    o.force, o.force_var = force, cov[size - 1, size - 1]
    surface = max(taper[0] - taper[1] * c, 0.0)
    o.gap = np.hypot(pole.x - c_x, pole.y - c_y) - pole.radius - surface
    o.gap_var, o.gap_force_cov = cov[0, 0], -side * cov[0, size - 1]
    # with the base held, the contact moves against the base's motion and turning
    q = size - 1
    move_x = -base[0, q] + base[2, q] * (c_y - y)
    move_y = -base[1, q] - base[2, q] * (c_x - x)
    o.compliance = -side * (-np.sin(c_angle) * move_x + np.cos(c_angle) * move_y)
    o.contact = c
    o.moment_per_force = (c_x - x) * fy - (c_y - y) * fx
    o.axial_per_force = fx * np.cos(angle) + fy * np.sin(angle)
    o.lateral_per_force = fy * np.cos(angle) - fx * np.sin(angle)
    lever = (c_x - at_x) * fy - (c_y - at_y) * fx if at < c else 0.0
    o.curvature_per_force, o.lever_at_curvature = lever * softness(at, problem.beam), lever
    o.clear_gap = o.gap - force * o.compliance
    both = o.compliance**2 * o.force_var - 2 * o.compliance * o.gap_force_cov
    o.clear_gap_var = o.gap_var + both


@njit(cache=True)
def _load_errors(o, force, cov, unit, base, gradient):
    """Variances of base moment, axial and lateral force; `gradient` (3, parameters) of them."""
    (fx, fy), size = unit, LOADED
    gradient[:, :] = 0.0
    # the rod turns and shifts as a whole with the first two parameters: no load changes
    for q in range(2, size):
        gradient[0, q] = force * (base[1, q] * fx - base[0, q] * fy)
        gradient[1, q] = force * base[2, q] * o.lateral_per_force
        gradient[2, q] = -force * base[2, q] * o.axial_per_force
    gradient[0, size - 1] += o.moment_per_force
    gradient[1, size - 1] += o.axial_per_force
    gradient[2, size - 1] += o.lateral_per_force
    o.moment_var = _variance(gradient[0], cov)
    o.axial_var = _variance(gradient[1], cov)
    o.lateral_var = _variance(gradient[2], cov)


@njit(cache=True)
def _variance(gradient, cov):
    """Variance of what has this gradient, by parameters of covariance `cov`."""
    total = 0.0
    for a in range(len(gradient)):
        for b in range(len(gradient)):
            total += gradient[a] * cov[a, b] * gradient[b]
    return total


@njit(cache=True)
def _rod_curvature(problem, fitted, near, values):
    """Curvature of the fitted rod at grid place `near`; `values` (rest terms,) is scratch."""
    (origin, moved, h), beam, load = problem.arc, problem.beam, problem.load
    p, laid, terms = fitted.p, fitted.laid, len(values)
    polynomials(2 * (near + origin - moved) / beam.length - 1, values)
    total = 0.0
    for j in range(terms):
        total += p[2 + j] * values[j]
    if load.side != 0 and near < fitted.place.c:
        fx, fy = unit_force(p[1], load.side, load.friction)
        at_x, at_y, _ = point_at(laid.x, laid.y, laid.angle, h, near)
        c_x, c_y = laid_from(p, fitted.place)
        lever = (c_x - at_x) * fy - (c_y - at_y) * fx
        total += p[2 + terms] * lever * softness(near + origin, beam)
    return total


@njit(cache=True)
def _more_curvature(seen, fitted, h, near):
    """Curvature of the stations beyond the rod's about grid place `near`, and its variance.

    NaN where they do not lie on both sides of it.
    """
    laid, sums, chi2 = fitted.laid, fitted.sums, fitted.chi2
    info, square, rhs, inverse = seen.information, sums.normal, sums.rhs, sums.inverse
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
def _follow(seen, fitted, nudged, follows, o):
    """Fill `follows` with the parameters' derivatives by the origin, which moved the model.

    And the log-likelihood's slope and curvature by the origin: Gauss–Newton's, as for the rest.
    """
    laid, chi2, sums, size = fitted.laid, fitted.chi2, fitted.sums, LOADED
    info, shift, inverse, rhs = seen.information, laid.shift, sums.inverse, sums.rhs
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
    o.origin_pull, o.origin_bend = pull, bend


@njit(cache=True, inline="always")
def _moved_by_origin(laid, nudged, k):
    """How far station `k` moves along its normal per unit of origin, by which it was nudged."""
    return along_normal(laid, k, nudged.x[k] - laid.x[k], nudged.y[k] - laid.y[k]) / ORIGIN_STEP_M


@njit(cache=True)
def _influence(seen, fitted, nudged, follows, precision, out):
    """Fill `out` with the change of the origin's pull by an error of each station and rest term.

    What the pull is for a rod that is fitted again: a misfit counts as far as no parameter
    answers to it, and a rest shape as far as the stations do not correct the prior.
    """
    laid, chi2 = fitted.laid, fitted.chi2
    info, shift = seen.information, laid.shift
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
        for a in range(len(follows)):
            away += shift[a, k] * follows[a]
        out[k] = robust_weight(info[k], misfit, 1 / max(chi2, 1.0)) * away


@njit(cache=True)
def _loads_by_origin(o, force, unit, contact, follicle, gradient, follows):
    """Derivatives of force and base loads by the origin, from those of the parameters."""
    (fx, fy), (c_x, c_y) = unit, contact
    x, y, angle = follicle
    moment = (c_x - x) * fy - (c_y - y) * fx - o.moment_per_force
    axial = fx * np.cos(angle) + fy * np.sin(angle) - o.axial_per_force
    lateral = fy * np.cos(angle) - fx * np.sin(angle) - o.lateral_per_force
    per_origin = force / ORIGIN_STEP_M
    o.force_by_origin = follows[LOADED - 1]
    o.moment_by_origin = per_origin * moment + (gradient[0] * follows).sum()
    o.axial_by_origin = per_origin * axial + (gradient[1] * follows).sum()
    o.lateral_by_origin = per_origin * lateral + (gradient[2] * follows).sum()
