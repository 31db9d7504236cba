"""What follows from a fitted rod: contact force, base loads and curvature, with their variances.

A row of results is an `OUTPUT_ROW`; `rod_fit.ShapeFit` says what its fields mean.
"""

import numpy as np
from numba import njit

from pipeline.forces.normal_equations import misfit_of, robust_weight
from pipeline.forces.rod_integration import (
    LOADED,
    ORIGIN,
    point_at,
    polynomials,
    softness,
    start_of,
    unit_force,
)
from pipeline.forces.rod_types import COMPILED
from pipeline.numerics.cholesky import factorise, invert

CURVATURE_REACH_M = 2.5e-3  # stations this near show how a curvature differs from the rod's
FEWEST_NEAR = 5


@njit(**COMPILED)
def report_loads(o, problem, fitted, prior, at, taper, by_rest):
    """Fill one row of results that need the force, and of `Filled.by_rest`.

    `at`, `taper` as in `Setup`.
    """
    load, force = problem.load, fitted.p[LOADED - 1]
    contact = start_of(fitted.p, fitted.place)
    unit = unit_force(fitted.p[1], load.side, load.friction)
    _loads(o, problem, fitted, contact, at, taper)
    gradient, follows = np.zeros((4, ORIGIN + 1)), np.zeros(ORIGIN + 1)
    _load_gradients(o, force, unit, fitted.rod.base, gradient)
    o.moment_var = variance(gradient[1], fitted.cov)
    o.axial_var = variance(gradient[2], fitted.cov)
    o.lateral_var = variance(gradient[3], fitted.cov)
    _follow(problem.seen, fitted, follows, o)
    _follow_rest(fitted, prior, follows, gradient, by_rest)
    o.force_by_origin = (gradient[0] * follows).sum()
    o.moment_by_origin = (gradient[1] * follows).sum()
    o.axial_by_origin = (gradient[2] * follows).sum()
    o.lateral_by_origin = (gradient[3] * follows).sum()


@njit(**COMPILED)
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


@njit(**COMPILED)
def report_pose(o, fitted, rest, rest_cov):
    """Fill one row's pose, with its error and the curvature there, and rest shape."""
    rod, terms = fitted.rod, len(rest)
    rest[:] = fitted.p[2 : 2 + terms]
    rest_cov[:] = fitted.cov[2 : 2 + terms, 2 : 2 + terms]
    o.follicle_x, o.follicle_y, o.angle, o.base_curvature = rod.follicle
    o.angle_var = variance(rod.base[2], fitted.cov)


@njit(**COMPILED)
def _loads(o, problem, fitted, contact, at, taper):
    """Fill gap, contact and base loads of one row."""
    p, cov, rod, arc = fitted.p, fitted.cov, fitted.rod, problem.arc
    size, side, c = LOADED, problem.load.side, fitted.place.c + arc.origin
    (c_x, c_y), pole = contact, problem.pole
    c_angle, force = p[1], p[size - 1]
    fx, fy = unit_force(c_angle, side, problem.load.friction)
    x, y, angle = rod.follicle[0], rod.follicle[1], rod.follicle[2]
    at_x, at_y, _ = point_at(rod.x, rod.y, rod.angle, arc.spacing, at - arc.origin)
    o.force, o.force_var = force, cov[size - 1, size - 1]
    surface = max(taper[0] - taper[1] * c, 0.0)
    o.gap = np.hypot(pole.x - c_x, pole.y - c_y) - pole.radius - surface
    o.gap_var, o.gap_force_cov = cov[0, 0], -side * cov[0, size - 1]
    o.contact = c
    o.moment_per_force = (c_x - x) * fy - (c_y - y) * fx
    o.axial_per_force = fx * np.cos(angle) + fy * np.sin(angle)
    o.lateral_per_force = fy * np.cos(angle) - fx * np.sin(angle)
    lever = (c_x - at_x) * fy - (c_y - at_y) * fx if at < c else 0.0
    o.curvature_per_force, o.lever_at_curvature = lever * softness(at, problem.beam), lever


@njit(**COMPILED)
def _load_gradients(o, force, unit, base, gradient):
    """Fill how force, base moment, axial and lateral force change with parameters and origin."""
    fx, fy = unit
    gradient[0, LOADED - 1] = 1.0
    # the rod turns and shifts as a whole with the first two parameters: no load changes
    for q in range(2, ORIGIN + 1):
        gradient[1, q] = force * (base[1, q] * fx - base[0, q] * fy)
        gradient[2, q] = force * base[2, q] * o.lateral_per_force
        gradient[3, q] = -force * base[2, q] * o.axial_per_force
    gradient[1, LOADED - 1] += o.moment_per_force
    gradient[2, LOADED - 1] += o.axial_per_force
    gradient[3, LOADED - 1] += o.lateral_per_force


@njit(**COMPILED)
def variance(gradient, cov):
    """Variance of what has this gradient, by parameters of covariance `cov`."""
    total = 0.0
    for a in range(len(cov)):
        for b in range(len(cov)):
            total += gradient[a] * cov[a, b] * gradient[b]
    return total


@njit(**COMPILED)
def _rod_curvature(problem, fitted, near, values):
    """Curvature of the fitted rod at grid place `near`; `values` (rest terms,) is scratch."""
    (origin, moved, h), beam, load = problem.arc, problem.beam, problem.load
    p, rod, terms = fitted.p, fitted.rod, len(values)
    polynomials(2 * (near + origin - moved) / beam.length - 1, values)
    total = 0.0
    for j in range(terms):
        total += p[2 + j] * values[j]
    if load.side != 0 and near < fitted.place.c:
        fx, fy = unit_force(p[1], load.side, load.friction)
        at_x, at_y, _ = point_at(rod.x, rod.y, rod.angle, h, near)
        c_x, c_y = start_of(p, fitted.place)
        lever = (c_x - at_x) * fy - (c_y - at_y) * fx
        total += p[2 + terms] * lever * softness(near + origin, beam)
    return total


@njit(**COMPILED)
def _more_curvature(seen, fitted, h, near):
    """Curvature of the stations beyond the rod's about grid place `near`, and its variance.

    NaN where they do not lie on both sides of it.
    """
    rod, sums, chi2 = fitted.rod, fitted.sums, fitted.chi2
    info, square, rhs, inverse = seen.information, sums.normal, sums.rhs, sums.inverse
    square[:3, :3] = 0.0
    rhs[:3] = 0.0
    count, before, after = 0, 0, 0
    start = max(int(np.ceil((near - CURVATURE_REACH_M) / h)), 0)
    for k in range(start, min(int((near + CURVATURE_REACH_M) / h) + 1, len(info))):
        if not info[k] > 0:
            continue
        u = (k * h - near) / CURVATURE_REACH_M
        misfit = misfit_of(seen, rod, k)
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


@njit(**COMPILED)
def _follow(seen, fitted, follows, o):
    """Fill `follows` with the derivatives of parameters and origin by the origin.

    And the log-likelihood's slope and curvature by the origin: Gauss–Newton's, as for the rest.
    """
    rod, chi2, sums = fitted.rod, fitted.chi2, fitted.sums
    info, shift, inverse, rhs = seen.information, rod.shift, sums.inverse, sums.rhs
    rhs[:] = 0.0
    pull, bend = 0.0, 0.0
    for k in range(len(info)):
        if not info[k] > 0:
            continue
        away, misfit = shift[ORIGIN, k], misfit_of(seen, rod, k)
        weight = robust_weight(info[k], misfit, 1 / max(chi2, 1.0))
        pull += weight * misfit * away
        bend += weight * away * away
        for a in range(LOADED):
            rhs[a] -= weight * shift[a, k] * away
    follows[:] = 0.0
    follows[ORIGIN] = 1.0
    for a in range(LOADED):
        for b in range(LOADED):
            follows[a] += inverse[a, b] * rhs[b]
        bend -= rhs[a] * follows[a]
    o.origin_pull, o.origin_bend = pull, bend


@njit(**COMPILED)
def _follow_rest(fitted, prior, follows, gradient, by_rest):
    """Let the parameters follow the prior's rest shape, too, that moves along with the origin.

    And fill how the loads of these gradients, and the log-likelihood's slope by the origin, change
    with the prior's rest shape.
    """
    inverse, loads, inflate = fitted.sums.inverse, len(gradient), max(fitted.chi2, 1.0)
    by_rest[:] = 0.0
    for j in range(len(prior.by_origin)):
        for b in range(len(prior.by_origin)):
            by_rest[loads, j] += inflate * prior.precision[j, b] * follows[2 + b]
    for j in range(len(prior.by_origin)):
        for a in range(LOADED):
            moved = 0.0  # the parameter, by the prior's coefficient
            for b in range(len(prior.by_origin)):
                moved += inverse[a, 2 + b] * inflate * prior.precision[b, j]
            for k in range(loads):
                by_rest[k, j] += gradient[k, a] * moved
            follows[a] += moved * prior.by_origin[j]
