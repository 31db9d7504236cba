"""Fit of the elastic rod to a traced whisker: base pose, rest shape and contact force at once.

The curvature of the model is κ(s) = Σ_j a_j P_j(s) + F g(s): a rest shape of a few Legendre
polynomials, and the bending of a unit force at the point nearest to the pole, at full angles,

    g(s) = (r_c − r(s)) × f̂ / (E I(s)) for s < c,   f̂ = −side (n̂_c − µ side t̂_c).

One pass along the rod integrates it with its derivatives by the parameters: offset and direction
at the contact, a_j, F (rod_integration.py). Gauss–Newton minimises the misfit across the whisker
(normal_equations.py). A prior on a_j (from free frames, rest_shape.py) makes the rest shape's
uncertainty part of the force's standard error. Other results of the fit are in rod_outputs.py.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pipeline.forces.normal_equations import (
    empty_sums,
    fill_equations,
    misfit_of,
    take_step,
    weigh,
)
from pipeline.forces.rod_integration import (
    FREE,
    LOADED,
    N_REST,
    Place,
    empty_rod,
    integrate,
    move,
    nearest_to,
    point_at,
)
from pipeline.forces.rod_outputs import report_curvature, report_loads, report_pose, variance
from pipeline.forces.rod_types import (
    COMPILED,
    OUTPUT_ROW,
    OUTPUTS,
    Arc,
    Beam,
    Filled,
    Fitted,
    Load,
    Pole,
    Prior,
    Problem,
    Rows,
    Seen,
    Setup,
)
from pipeline.kinematics.stations import BLOCK_ROWS, N_STATIONS, Stations
from pipeline.numerics.cholesky import factorise, invert
from whiskermodel.whisker import Whisker

ITERATIONS = 12
SETTLED_SD = 0.5  # length of the last step of Gauss–Newton (then it is right to 0.02 SD); …
FINE_SETTLED_SD = 1e-4  # … where the likelihood's slope by the origin is needed
PLACE_MOVES_M = 2e-6  # the contact point is moved along the whisker in steps above this, …
PLACE_SD = 0.002  # … and the rod integrated again beyond this, in arc lengths and SD of the force
FEWEST_STATIONS = 10
LOADS = ("force", "moment", "axial", "lateral")
CHORD = 2  # stations either side whose chord has the direction between


@dataclass(frozen=True)
class ShapeFit:
    """Fitted rods, one per row. SI units, y up; NaN where the trace was too short.

    Attributes
    ----------
    table : dict of (rows,) arrays:
        force, force_var : what the contact force would be if the whisker touched the pole at its
            nearest point, positive pushes the whisker away from the pole [N, N²]
        gap, gap_var, gap_force_cov : surface distance of the fitted rod from the pole
        contact : arc length of the nearest point [m]
        angle, follicle_x, follicle_y : pose of the follicle
        moment_per_force, axial_per_force, lateral_per_force : base loads per contact force
        curvature_per_force : change of curvature at `curvature_at` per force [1/(m N)]
        lever_at_curvature : moment there per force [m]
        chi2 : reduced χ² of the stations
        moment_var, axial_var, lateral_var : of the base loads, (moment_per_force · force) …
        force_shared_var, moment_shared_var, axial_shared_var, lateral_shared_var : the part of
            these that is due to `RestPrior.shared`
        force_by_origin, moment_by_origin, axial_by_origin, lateral_by_origin : how force and
            base loads change with `Stations.origin`, the rest shape moving along, and by
            `RestPrior.by_origin` [N/m, N, N/m]
        origin_pull, origin_bend : slope and curvature of the log-likelihood by the origin, all
            else fitted again, for measurements with the stations' information [1/m, 1/m²]
        curvature, curvature_var, curvature_slope : at `curvature_at`: the rod's, and what a
            parabola through the stations' misfits about it adds, so that neither the kink at a
            contact nor the taper biases it; variance [1/m², of noise alone] and slope [1/m²]
        angle_var, base_curvature : variance of `angle` [rad², of noise alone]; the rod's curvature
            at the follicle [1/m]
    rest : (rows, N_REST) rest-shape coefficients a_j [1/m]
    rest_cov : (rows, N_REST, N_REST)
    pull_by_rest : (rows, N_REST) how `origin_pull` changes with the prior's rest shape [1]
    """

    table: dict
    rest: np.ndarray
    rest_cov: np.ndarray
    pull_by_rest: np.ndarray

    def __getitem__(self, name):
        return self.table[name]


@dataclass(frozen=True)
class RestPrior:
    """The rest shape as free frames show it: a = weights · (1, u, u², …) + drift, ± cov.

    `u` is (base angle − centre)/scale. `weights` (terms, N_REST), `drift` (rows, N_REST) or
    zeros, `cov` (rows, N_REST, N_REST). Part of that is of the weights, which all rows share:
    `weights_cov` (terms, N_REST, terms, N_REST) by the rows' `powers` of u (rows, terms).
    `by_origin` (rows, N_REST) [1/m²]: how a depends on the row's origin; None: not at all.
    `shared` (rows, N_REST, N_REST): part of `cov`, of errors that all rows share; None: none.
    """

    weights: np.ndarray
    centre: float
    scale: float
    drift: np.ndarray
    cov: np.ndarray
    weights_cov: np.ndarray | None = None
    powers: np.ndarray | None = None
    by_origin: np.ndarray | None = None
    shared: np.ndarray | None = None


def rest_basis(whisker: Whisker, arc_length) -> np.ndarray:
    """Legendre polynomials P_j over the whisker's length, (points, N_REST)."""
    u = 2 * np.asarray(arc_length, float) / whisker.length - 1
    return np.polynomial.legendre.legvander(u, N_REST - 1)


def fit_free(stations: Stations, whisker: Whisker, curvature_at: float, misfit=None) -> ShapeFit:
    """Fit pose and rest shape, no force: for frames in which the whisker touches nothing.

    `misfit` as in `fit_loaded`.
    """
    n = len(stations)
    prior = RestPrior(np.zeros((1, N_REST)), 0.0, 1.0, np.zeros((n, N_REST)), _vague(n))
    return _fit(stations, whisker, curvature_at, prior, misfit=misfit)


def fit_loaded(
    stations: Stations,
    whisker: Whisker,
    curvature_at: float,
    prior: RestPrior,
    friction=0.0,
    shift=0.0,
    fine=False,
    misfit=None,
) -> ShapeFit:
    """Fit pose and force, given the rest shape, as if the point nearest to the pole touched it.

    `friction`, one or (rows,), is the signed ratio of tangential to normal force, positive where
    it pulls towards the tip. `shift` [m], one or (rows,), is added to the arc lengths, as
    `stations.origin` is; the rest shape, measured without it, moves along. With `fine`, fits
    converge as closely as the likelihood's slope by the origin needs. `misfit`, if given,
    (rows, 2, N_STATIONS), is filled for all stations with their distance from the rod, along its
    normal [m], and the variance of the rod's place there [m²].
    """
    load = friction, shift
    return _fit(stations, whisker, curvature_at, prior, load, fine, misfit)


def _vague(n):
    """Covariance of a nearly flat prior: SD of 300 1/m in every coefficient."""
    return np.broadcast_to(np.eye(N_REST) * 300.0**2, (n, N_REST, N_REST))


def _fit(stations, whisker, curvature_at, prior, load=None, fine=False, misfit=None):
    """Fit all rows; `load` is (friction, shift), None where no pole is touched."""
    n, m = len(stations), N_STATIONS
    friction, shift = (0.0, 0.0) if load is None else load
    settled = FINE_SETTLED_SD if fine else SETTLED_SD
    out = Filled(
        np.full(n, np.nan, OUTPUT_ROW).view(np.recarray),
        np.full((n, N_REST), np.nan),
        np.full((n, N_REST, N_REST), np.nan),
        np.full((n, len(LOADS) + 1, N_REST), np.nan),
        np.empty((0, 2, m)) if misfit is None else misfit,
    )
    shift, friction = (np.broadcast_to(np.asarray(a, float), n).copy() for a in (shift, friction))
    with np.errstate(invalid="ignore"):
        side = np.where(np.isfinite(stations.pole_x) & (load is not None), stations.side, 0)
    by_origin = np.zeros((n, N_REST)) if prior.by_origin is None else prior.by_origin
    setup = _setup(whisker, stations.pole_radius, curvature_at, settled)
    for start in range(0, n, BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        part = stations.rows(rows).loaded()
        block = Rows(  # of copies: all is compiled once more for arrays that are read only
            part.x, part.y, part.information, part.origin + shift[rows], shift[rows],
            side[rows].astype(np.float64), friction[rows], part.pole_x, part.pole_y, part.nearest,
            np.array(prior.drift[rows], order="C"), np.array(prior.cov[rows], order="C"),
            by_origin[rows],
        )  # fmt: skip
        turning = np.ascontiguousarray(prior.weights), prior.centre, prior.scale
        _fit_rows(block, setup, turning, Filled(*(each[rows] for each in out)))
    table = {name: out.table[name] for name in OUTPUTS}
    shared = np.zeros((n, N_REST, N_REST)) if prior.shared is None else prior.shared
    *by_load, pull_by_rest = out.by_rest.transpose(1, 0, 2)
    for load, by_rest in zip(LOADS, by_load, strict=True):
        table[f"{load}_shared_var"] = np.einsum("nv,nvw,nw->n", by_rest, shared, by_rest)
    return ShapeFit(table, out.rest, out.rest_cov, pull_by_rest)


def _setup(whisker, pole_radius, curvature_at, settled):
    """What all rows of a whisker share."""
    return Setup(
        whisker.length / (N_STATIONS - 1),
        Beam(whisker.length, whisker.cone_length, whisker.base_flexural_rigidity),
        (whisker.base_radius, whisker.base_radius / whisker.cone_length),
        pole_radius,
        curvature_at,
        settled,
    )


@njit(**COMPILED)
def _fit_rows(rows, setup, turning, out):
    """Fit every one of the `Rows`; `turning`: weights, centre and scale of the `RestPrior`."""
    m, terms, h = N_STATIONS, N_REST, setup.spacing
    weights, centre, scale = turning
    precision = np.zeros((terms, terms))
    rod, sums, p, usual = empty_rod(m), empty_sums(m, terms), np.zeros(LOADED), 1.0
    for row in range(len(rows.x)):
        stations = np.flatnonzero(rows.information[row] > 0)
        if len(stations) < FEWEST_STATIONS or not factorise(rows.rest_cov[row], terms, sums.lower):
            continue
        invert(sums.lower, terms, precision)
        seen = Seen(rows.x[row], rows.y[row], rows.information[row])
        loaded = rows.side[row] != 0 and rows.nearest[row] > (stations[0] + 2) * h
        size = LOADED if loaded else FREE
        problem = Problem(
            seen,
            Arc(rows.origin[row], rows.moved[row], h),
            setup.beam,
            Load(rows.side[row], rows.friction[row]) if loaded else Load(0.0, 0.0),
            Pole(rows.pole_x[row], rows.pole_y[row], setup.pole_radius),
        )
        by_origin = rows.rest_by_origin[row]
        prior = Prior(weights, rows.drift[row], centre, scale, precision, by_origin)
        c = min(rows.nearest[row], (m - 1) * h) if loaded else stations[len(stations) // 2] * h
        known, chi2, place = _solve(problem, (stations, c, usual), prior, setup, p, rod, sums)
        if not known:
            p[:] = 0.0
            continue
        usual = chi2
        fitted = Fitted(p, sums.inverse[:size, :size] * max(chi2, 1.0), chi2, place, rod, sums)
        o = out.table[row]
        o.chi2 = chi2
        report_pose(o, fitted, out.rest[row], out.rest_cov[row])
        if loaded:
            by_rest = out.by_rest[row]
            report_loads(o, problem, fitted, prior, setup.at, setup.taper, by_rest)
        report_curvature(o, problem, fitted, setup.at)
        for each in out.misfit[row : row + 1]:
            _report_misfit(seen, fitted, each)


@njit(**COMPILED)
def _report_misfit(seen, fitted, out):
    """Fill how far stations lie beside the rod, and the variance of the rod's place."""
    shift, cov = fitted.rod.shift, fitted.cov
    for k in range(len(seen.x)):
        out[0, k] = misfit_of(seen, fitted.rod, k)
        out[1, k] = variance(shift[:, k], cov)


@njit(**COMPILED)
def _solve(problem, start, prior, setup, p, rod, sums):
    """Fit `p`, `rod` and `sums` by Gauss–Newton; return whether it converged, χ², and the place.

    It does not converge where a trace jumps from line to line: no rod has that shape.

    start : numbers of the measured stations, grid place where the integration begins at first,
        usual χ²
    p : parameters, as in `integrate`; force and, without a load, rest shape are those of the row
        before at first
    """
    (stations, c, chi2), (seen, arc, beam, load, pole) = start, problem
    h, loaded, terms = arc.spacing, load.side != 0, len(sums.mean)
    size = LOADED if loaded else FREE
    p[0] = 0.0
    known = False
    rod.follicle[2], p[1], place = _begin(seen, stations, c, h)
    for iteration in range(ITERATIONS):
        u = (rod.follicle[2] - prior.centre) / prior.scale
        _prior_mean(prior.weights, prior.drift, u, sums.mean)
        if iteration == 0 and loaded:
            p[2 : 2 + terms] = sums.mean
        integrate(p, beam, load, arc, place, rod)
        if loaded and iteration > 0:
            c, place = place.c, _nearest_place(rod, place, h, pole, p)
            force_sd = sums.lower[size - 1, size - 1] * np.sqrt(max(chi2, 1.0))
            if abs(p[size - 1] * (place.c - c)) > PLACE_SD * force_sd * c:
                integrate(p, beam, load, arc, place, rod)
        if iteration == 1:  # from here on, stations count less by what is usual of all
            chi2 = weigh(seen, rod, chi2, False, sums.misfit, sums.weight)
        chi2 = fill_equations(seen, rod, size, prior.precision, p, sums, chi2, iteration > 0)
        known = np.isfinite(chi2) and factorise(sums.normal, size, sums.lower)
        if not known:
            break
        change = take_step(size, p, sums.lower, sums.rhs) / np.sqrt(max(chi2, 1.0))
        move(rod, sums.rhs[:size])
        if iteration > 0 and change < setup.settled:
            break  # the next step would change nothing
    known = known and _lies_there(sums.misfit, sums.weight, h)
    if known:
        invert(sums.lower, size, sums.inverse)
    return known, chi2, place


@njit(**COMPILED)
def _lies_there(misfit, weight, spacing):
    """Whether the RMS misfit of a rod is less than the distance between stations."""
    return (weight * misfit * misfit).sum() < spacing * spacing * weight.sum()


@njit(**COMPILED)
def _nearest_place(rod, place, h, pole, p):
    """The place of the rod nearest to the pole; `p` is changed to count from there."""
    x, y, angle = rod.x, rod.y, rod.angle
    c = nearest_to(x, y, rod.cos, rod.sin, h, place.c, pole.x, pole.y)
    if abs(c - place.c) < PLACE_MOVES_M:
        return place
    at_x, at_y, direction = point_at(x, y, angle, h, c)
    p[0] = 0.0
    p[1] += direction - point_at(x, y, angle, h, place.c)[2]
    return Place(c, at_x, at_y)


@njit(**COMPILED)
def _begin(seen, known, c, h):
    """Angle at the base, and direction and `Place` at `c`, by chords of the `known` stations."""
    x, y = seen.x, seen.y
    near = min(max(np.searchsorted(known, c / h), CHORD), len(known) - 1 - CHORD)
    base, base_end = known[0], known[2 * CHORD]
    start, end = known[near - CHORD], known[near + CHORD]
    base_x, base_y = x[base_end] - x[base], y[base_end] - y[base]
    way_x, way_y = x[end] - x[start], y[end] - y[start]
    across, along = base_x * way_y - base_y * way_x, base_x * way_x + base_y * way_y
    angle = np.arctan2(base_y, base_x)
    low, high = known[near - 1], known[near]
    part = (c / h - low) / (high - low)
    place = Place(c, x[low] + part * (x[high] - x[low]), y[low] + part * (y[high] - y[low]))
    return angle, angle + np.arctan2(across, along), place


@njit(**COMPILED)
def _prior_mean(weights, drift, u, mean):
    for j in range(len(mean)):
        value = 0.0
        for k in range(len(weights) - 1, -1, -1):
            value = value * u + weights[k, j]
        mean[j] = value + drift[j]
