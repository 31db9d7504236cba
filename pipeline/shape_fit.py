"""Fit of the elastic rod to a traced whisker: base pose, rest shape and contact force at once.

The curvature of the model is κ(s) = Σ_j a_j P_j(s) + F g(s): a rest shape of a few Legendre
polynomials, and the bending of a unit force at the point nearest to the pole, at full angles,

    g(s) = (r_c − r(s)) × f̂ / (E I(s)) for s < c,   f̂ = −side (n̂_c − µ side t̂_c).

Laid from the contact towards the follicle, every place depends only on what has been laid, so
the rod and its derivatives by (offset and direction at the contact, a_j, F) come in one pass:
Gauss–Newton on the misfit across the whisker. A prior on a_j (from free frames,
rest_curvature.py) makes the rest shape's uncertainty part of the force's standard error.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.splines import FAST
from pipeline.stations import N_STATIONS, Stations
from whiskermodel.whisker import Whisker

N_REST = 4  # Legendre polynomials of the rest curvature
ITERATIONS = 12
SETTLED_SD = 0.2  # length of a step from which on Gauss–Newton has arrived (to 0.02 SD); …
FINE_SETTLED_SD = 1e-4  # … where the likelihood's slope by the origin is asked for
FEWEST_STATIONS = 10
BLOCK_ROWS = 2048  # held in memory at a time
ANCHOR_MOVES_M = 2e-6  # the contact point is moved along the whisker in steps above this
ORIGIN_STEP_M = 1e-5  # of the derivatives by the origin
HUBER = 3.0  # SD beyond which a station counts less
SMALL_TURN = 0.2  # rad: up to here a series of eight terms gives sine and cosine to 1e-11
CURVATURE_REACH_M = 2.5e-3  # stations this near tell how a curvature differs from the rod's
FEWEST_NEAR = 8
ANCHOR_SPAN = 6  # stations whose chord continues the trace into the fur
_FREE, _LOADED = N_REST + 2, N_REST + 3  # numbers of parameters

_COLUMNS = (
    "force", "force_var", "gap", "gap_var", "gap_force_cov", "compliance", "contact",
    "angle", "follicle_x", "follicle_y", "moment_per_force", "axial_per_force",
    "lateral_per_force", "curvature_per_force", "lever_at_curvature", "rest_curvature",
    "chi2", "count", "clear_gap", "clear_gap_var",
    "moment_var", "axial_var", "lateral_var",
    "force_by_origin", "moment_by_origin", "axial_by_origin", "lateral_by_origin",
    "origin_pull", "origin_bend", "curvature", "curvature_var", "curvature_slope",
)  # fmt: skip


@dataclass(frozen=True)
class ShapeFit:
    """Fitted rods, one per row. SI units, y up; NaN where the trace was too short.

    Attributes
    ----------
    table : dict of (rows,) arrays:
        force, force_var : what the contact force would be if the whisker touched the pole at its
            nearest point, positive pushes the whisker away from the pole [N, N²]
        gap, gap_var, gap_force_cov : surface distance of the fitted rod from the pole
        compliance : gap opened per force at a fixed base [m/N]
        contact : arc length of the nearest point [m]
        angle, follicle_x, follicle_y : pose of the follicle
        moment_per_force, axial_per_force, lateral_per_force : base loads per contact force
        curvature_per_force : change of curvature at `curvature_at` per force [1/(m N)]
        lever_at_curvature : moment there per force [m]
        rest_curvature : of the fitted rest shape at `curvature_at` [1/m]
        chi2, count : reduced χ² of the stations, their number
        clear_gap, clear_gap_var : gap that the whisker would have without the force
        moment_var, axial_var, lateral_var : of the base loads, (moment_per_force · force) …
        force_by_origin, moment_by_origin, axial_by_origin, lateral_by_origin : how force and
            base loads change with `Stations.origin`, the rest shape moving along [N/m, N, N/m]
        origin_pull, origin_bend : slope and curvature of the log-likelihood by the origin, all
            else fitted again, for measurements with the stations' information [1/m, 1/m²]
        curvature, curvature_var, curvature_slope : at `curvature_at`: the rod's, and what a
            parabola through the stations' misfits about it adds, so that neither the kink at a
            contact nor the taper biases it; variance [1/m², of noise alone] and slope [1/m²]
    rest : (rows, N_REST) rest-shape coefficients a_j [1/m]
    rest_cov : (rows, N_REST, N_REST)
    """

    table: dict
    rest: np.ndarray
    rest_cov: np.ndarray

    def __getitem__(self, name):
        return self.table[name]


@dataclass(frozen=True)
class RestPrior:
    """What free frames tell of the rest shape: a = weights · (1, u, u², …) + drift, ± cov.

    `u` is (base angle − centre)/scale. `weights` (terms, N_REST), `drift` (rows, N_REST) or
    zeros, `cov` (rows, N_REST, N_REST). Errors of the weights are common to all rows: their
    covariance `weights_cov` (terms, N_REST, terms, N_REST) is part of `cov`; None where they are
    not in question.
    """

    weights: np.ndarray
    centre: float
    scale: float
    drift: np.ndarray
    cov: np.ndarray
    weights_cov: np.ndarray | None = None


def rest_basis(whisker: Whisker, arc_length) -> np.ndarray:
    """Legendre polynomials P_j over the whisker's length, (points, N_REST)."""
    u = 2 * np.asarray(arc_length, float) / whisker.length - 1
    return np.polynomial.legendre.legvander(u, N_REST - 1)


def fit_free(stations: Stations, whisker: Whisker, curvature_at: float) -> ShapeFit:
    """Fit pose and rest shape, no force: for frames in which the whisker touches nothing."""
    n = len(stations)
    prior = RestPrior(np.zeros((1, N_REST)), 0.0, 1.0, np.zeros((n, N_REST)), _vague(n))
    return _fit(stations, whisker, curvature_at, prior, loaded=False, friction=0.0)


def fit_loaded(
    stations: Stations,
    whisker: Whisker,
    curvature_at: float,
    prior: RestPrior,
    friction=0.0,
    shift=0.0,
    influence=None,
) -> ShapeFit:
    """Fit pose and the force that a pole at the nearest point would exert, given the rest shape.

    `friction`, one or (rows,), is the signed ratio of tangential to normal force, + pulls
    towards the tip. `shift` [m], one or (rows,), is added to the arc lengths beside
    `stations.origin`; the rest shape, measured without it, moves along. `influence`, if given, a
    (rows, N_STATIONS + N_REST) array, is filled with how `origin_pull` follows an error of each
    station across the whisker [1/m²], and of each coefficient of the prior's rest shape [1]; fits
    are settled the finer then.
    """
    return _fit(stations, whisker, curvature_at, prior, True, friction, shift, influence)


def _vague(n):
    """Covariance of an all but flat prior: 300 1/m in every coefficient."""
    return np.broadcast_to(np.eye(N_REST) * 300.0**2, (n, N_REST, N_REST))


def _fit(stations, whisker, curvature_at, prior, loaded, friction, shift=0.0, influence=None):
    n, m = len(stations), N_STATIONS
    settled = SETTLED_SD if influence is None else FINE_SETTLED_SD
    influence = np.empty((0, m + N_REST)) if influence is None else influence
    s = np.arange(m) * whisker.length / (m - 1)
    out = np.full((n, len(_COLUMNS)), np.nan)
    rest = np.full((n, N_REST), np.nan)
    rest_cov = np.full((n, N_REST, N_REST), np.nan)
    # the very tip of a full cone has no stiffness; nothing touches there
    stiffness = np.maximum(whisker.flexural_rigidity(s), 1e-7 * whisker.base_flexural_rigidity)
    shift, friction = (np.broadcast_to(np.asarray(a, float), n).copy() for a in (shift, friction))
    rod = (whisker.length, whisker.cone_length, whisker.base_flexural_rigidity)
    with np.errstate(invalid="ignore"):
        side = np.where(loaded & np.isfinite(stations.pole_x), stations.side, 0)
    side, basis = side.astype(np.float64), rest_basis(whisker, s)
    radius = np.array([whisker.base_radius, whisker.base_radius / whisker.cone_length])
    weights, drift = np.ascontiguousarray(prior.weights), np.ascontiguousarray(prior.drift)
    for start in range(0, n, BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        part = stations.rows(rows).loaded()
        _fit_rows(
            part.x, part.y, part.information, part.origin + shift[rows], s[1], rod,
            stiffness, basis, side[rows], part.pole_x, part.pole_y, part.pole_radius,
            part.nearest, radius, curvature_at, shift[rows], weights, prior.centre, prior.scale,
            drift[rows], np.linalg.inv(prior.cov[rows]), friction[rows], settled,
            out[rows], rest[rows], rest_cov[rows], influence[rows],
        )  # fmt: skip
    table = {name: out[:, k] for k, name in enumerate(_COLUMNS)}
    return ShapeFit(table, rest, rest_cov)


class _Rod(NamedTuple):
    """A rod as laid, and how it answers to its parameters: what `_lay` fills."""

    x: np.ndarray
    y: np.ndarray
    angle: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    shift: np.ndarray
    base: np.ndarray
    follicle: np.ndarray


class _Sums(NamedTuple):
    """Misfit and weight of every station, normal equations, their solution's parts, and the
    prior's rest shape `mean`."""

    misfit: np.ndarray
    weight: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    rhs: np.ndarray
    lower: np.ndarray
    inverse: np.ndarray
    mean: np.ndarray


class _Place(NamedTuple):
    """From where a rod is laid: grid place `c`, and what its offset and direction count from."""

    c: float
    x: float
    y: float


@njit(cache=True)
def _fit_rows(
    xs, ys, info, origin, h, rod, stiffness, basis, side, pole_x, pole_y, pole_radius, nearest,
    radius, at, moved, weights, centre, scale, drift, precision, friction, settled, out, rest,
    rest_cov, influence,
):  # fmt: skip
    m, terms = basis.shape
    laid, nudged, sums = _empty_rod(m), _empty_rod(m), _empty_sums(m, terms)
    p = np.zeros(_LOADED)
    for row in range(len(xs)):
        seen, arc = (xs[row], ys[row], info[row]), (origin[row], moved[row], h)
        pole = pole_x[row], pole_y[row], pole_radius
        prior = weights, drift[row], centre, scale, precision[row]
        first, count = _span(info[row])
        if count < FEWEST_STATIONS:
            continue
        loaded = side[row] != 0 and nearest[row] > (first + 2) * h
        size = _LOADED if loaded else _FREE
        load = (side[row], friction[row]) if loaded else (0.0, 0.0)
        c = min(nearest[row], (m - 1) * h) if loaded else (first + count // 2) * h
        known, chi2, place = _solve(
            seen, first, arc, rod, load, pole, c, prior, stiffness, basis, settled, p, laid, sums
        )
        if not known:
            continue
        cov = sums.inverse[:size, :size] * max(chi2, 1.0)
        rest[row] = p[2 : 2 + terms]
        rest_cov[row] = cov[2 : 2 + terms, 2 : 2 + terms]
        o = out[row]
        o[7], o[8], o[9] = laid.follicle[2], laid.follicle[0], laid.follicle[1]
        _polynomials(2 * (at - moved[row]) / rod[0] - 1, sums.mean)
        o[15] = (sums.mean * rest[row]).sum()
        o[16], o[17] = chi2, count
        if loaded:
            _report_loads(
                o, seen, chi2, cov, arc, rod, load, pole, radius, at, place, p, laid, nudged,
                sums, precision[row], influence[row : row + 1],
            )  # fmt: skip
        _report_curvature(o, seen, chi2, arc, rod, load, at, place, p, laid, sums)


@njit(cache=True)
def _empty_rod(m):
    return _Rod(
        np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m), np.zeros((_LOADED, m)),
        np.zeros((3, _LOADED)), np.zeros(3),
    )  # fmt: skip


@njit(cache=True)
def _empty_sums(m, terms):
    square = (_LOADED, _LOADED)
    return _Sums(
        np.zeros(m), np.zeros(m), np.zeros(m),
        np.zeros(square), np.zeros(_LOADED), np.zeros(square), np.zeros(square), np.zeros(terms),
    )  # fmt: skip


@njit(cache=True)
def _solve(seen, first, arc, rod, load, pole, c, prior, stiffness, basis, settled, p, laid, sums):
    """Gauss–Newton into `p`, `laid` and `sums`; returns whether it got there, χ², and the place.

    `seen`: x, y and information of the stations, the `first` of which is the first measured;
    `arc`: origin, what of it came after the rest shape was measured, and the stations' spacing;
    `load`: side and friction; `pole`: x, y, radius; `prior`: weights, drift, centre, scale,
    precision; `c`: grid place from which to lay at first; `settled`: step in SD that is the last.
    """
    weights, drift, centre, scale, precision = prior
    h, loaded, terms = arc[2], load[0] != 0, len(sums.mean)
    size = _LOADED if loaded else _FREE
    x, y, angle = laid.x, laid.y, laid.angle
    p[:] = 0.0
    chi2, change, known = 1.0, np.inf, False
    _trace(seen[0], seen[1], seen[2], first, h, x, y, angle)
    ref_x, ref_y, p[1] = _at(x, y, angle, h, c)
    laid.follicle[2] = angle[0]
    for iteration in range(ITERATIONS + 1):
        _prior_mean(weights, drift, (laid.follicle[2] - centre) / scale, sums.mean)
        lay = iteration == 0
        if iteration == 0:
            p[2 : 2 + terms] = sums.mean
            if loaded:
                p[size - 1] = _first_force(
                    x, y, angle, seen[2], basis, sums.mean, stiffness, h, c, load[0], load[1]
                )
        elif loaded:
            nearest_now = _nearest_on_model(x, y, laid.cos, laid.sin, h, c, pole[0], pole[1])
            if abs(nearest_now - c) > ANCHOR_MOVES_M:
                lay, c = True, nearest_now
                ref_x, ref_y, p[1] = _at(x, y, angle, h, c)
                p[0] = 0.0
        place = _Place(c, ref_x, ref_y)
        if lay:
            _lay(p, rod, load, arc, place, laid, True)
        if iteration == 1:  # from here on, stations count less by what is usual of all
            chi2 = _weigh(seen, laid, chi2, False, sums.misfit, sums.weight)
        chi2 = _equations(seen, laid, size, precision, p, sums, chi2, iteration > 0)
        known = np.isfinite(chi2) and _invert(sums.normal, size, sums.lower, sums.inverse)
        if not known or iteration == ITERATIONS or (iteration > 1 and change < settled):
            break
        change = _step(size, p, sums.inverse, sums.rhs)
        _lay(p, rod, load, arc, place, laid, True)
    return known, chi2, _Place(c, ref_x, ref_y)


@njit(cache=True)
def _report_loads(
    o, seen, chi2, cov, arc, rod, load, pole, radius, at, place, p, laid, nudged, sums,
    precision, influence,
):  # fmt: skip
    """Fill one row of results that need the force, and its `influence` where there is room."""
    size, (origin, moved, h) = _LOADED, arc
    contact = _start(p, place)
    place_at = _at(laid.x, laid.y, laid.angle, h, at - origin)
    _loads(
        o, p, cov, size, load, place.c + origin, contact, laid, place_at, at, _softness(at, rod),
        pole, radius,
    )  # fmt: skip
    unit = _unit_force(p[1], load[0], load[1])
    gradient, follows = np.zeros((3, _LOADED)), np.zeros(_LOADED)
    _load_errors(o, p[size - 1], cov, size, unit, laid.base, gradient)
    _lay(p, rod, load, (origin + ORIGIN_STEP_M, moved + ORIGIN_STEP_M, h), place, nudged, False)
    _follow(seen, chi2, laid, nudged, size, sums, follows, o)
    for each in influence:
        _influence(seen, chi2, laid, nudged, size, follows, precision, each)
    _loads_by_origin(o, p[size - 1], size, unit, contact, nudged.follicle, gradient, follows)


@njit(cache=True)
def _report_curvature(o, seen, chi2, arc, rod, load, at, place, p, laid, sums):
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
def _span(info):
    """First measured station, and how many there are."""
    first, count = -1, 0
    for k in range(len(info)):
        if info[k] > 0:
            if first < 0:
                first = k
            count += 1
    return first, count


@njit(cache=True)
def _trace(xs, ys, info, first, h, x, y, angle):
    """Measured places at all stations: straight across gaps and beyond both ends."""
    m = len(xs)
    before, step_x, step_y = first, h, 0.0
    x[first], y[first] = xs[first], ys[first]
    for k in range(first + 1, m + 1):
        if k < m and not info[k] > 0:
            continue
        if k < m:
            step_x = (xs[k] - xs[before]) / (k - before)
            step_y = (ys[k] - ys[before]) / (k - before)
        else:
            longer = h / np.sqrt(step_x * step_x + step_y * step_y)
            step_x, step_y = longer * step_x, longer * step_y
        for q in range(before + 1, min(k + 1, m)):
            x[q], y[q] = x[before] + (q - before) * step_x, y[before] + (q - before) * step_y
        before = k
    reach = min(first + ANCHOR_SPAN, m - 1)
    start = np.arctan2(y[reach] - y[first], x[reach] - x[first])
    for k in range(first):
        x[k] = x[first] - (first - k) * h * np.cos(start)
        y[k] = y[first] - (first - k) * h * np.sin(start)
    angle[0] = np.arctan2(y[1] - y[0], x[1] - x[0])
    before_x, before_y = x[1] - x[0], y[1] - y[0]
    for k in range(1, m):
        q = min(k + 1, m - 1)
        now_x, now_y = x[q] - x[k - 1], y[q] - y[k - 1]
        across, along = before_x * now_y - before_y * now_x, before_x * now_x + before_y * now_y
        angle[k] = angle[k - 1] + _turn(across, along)
        before_x, before_y = now_x, now_y


@njit(cache=True, inline="always")
def _turn(across, along):
    """Angle of a vector; a series, to 1e-11, where that is little."""
    if abs(across) > 0.05 * along:
        return np.arctan2(across, along)
    t = across / along
    square = t * t
    return t * (1 - square * (1 / 3 - square * (1 / 5 - square * (1 / 7 - square * (1 / 9)))))


@njit(cache=True)
def _first_force(x, y, angle, info, basis, mean, stiffness, h, c, side, friction):
    """Start force from the measured directions, which are linear in it and in one start angle."""
    c_x, c_y, c_angle = _at(x, y, angle, h, c)
    fx, fy = _unit_force(c_angle, side, friction)
    rest, load, g, bend = 0.0, 0.0, 0.0, 0.0
    n, sum_g, sum_gg, sum_d, sum_gd = 0, 0.0, 0.0, 0.0, 0.0
    for k in range(len(angle)):
        before = g
        g = ((c_x - x[k]) * fy - (c_y - y[k]) * fx) / stiffness[k] if k * h < c else 0.0
        bent, bend = bend, 0.0
        for j in range(len(mean)):
            bend += mean[j] * basis[k, j]
        if k > 0:
            load += 0.5 * h * (g + before)
            rest += 0.5 * h * (bend + bent)
        if info[k] > 0:
            d = angle[k] - rest
            n += 1
            sum_g, sum_gg = sum_g + load, sum_gg + load * load
            sum_d, sum_gd = sum_d + d, sum_gd + load * d
    spread = sum_gg - sum_g**2 / n
    return (sum_gd - sum_g * sum_d / n) / spread if spread > 0 else 0.0


@njit(cache=True)
def _unit_force(c_angle, side, friction):
    """Force on the whisker per unit of its normal component, in the lab."""
    cos, sin = np.cos(c_angle), np.sin(c_angle)
    return side * sin + friction * cos, -side * cos + friction * sin


@njit(cache=True)
def _prior_mean(weights, drift, u, mean):
    for j in range(len(mean)):
        value = 0.0
        for k in range(len(weights) - 1, -1, -1):
            value = value * u + weights[k, j]
        mean[j] = value + drift[j]


@njit(cache=True, inline="always")
def _polynomials(u, values):
    """Legendre polynomials at `u`, into `values` (N_REST,)."""
    before, now = 1.0, u
    for j in range(N_REST):
        values[j] = before
        before, now = now, ((2 * j + 3) * u * now - (j + 1) * before) * (1 / (j + 2))


@njit(cache=True, fastmath=FAST, error_model="numpy")
def _lay(p, rod, load, arc, place, laid, answers):
    """Lay the rod from its place both ways, with its derivatives by all parameters if `answers`.

    `rod` is (length, cone length, base rigidity); station k is at arc length k h + origin, of
    which `moved` came after the rest shape was measured: `arc` is (origin, moved, h).
    `shift[q, k]`: how far station k moves along its normal per unit of parameter q; `base[:, q]`:
    how the follicle moves (x, y) and turns; `follicle`: its place and angle.
    """
    origin, moved, h = arc
    x, y, angle, cosines, sines, shift, base, follicle = laid
    m, terms, per_half, c = len(x), N_REST, 2 / rod[0], place.c
    side, friction = load
    force = p[2 + terms] if side != 0 else 0.0
    sin, cos = np.sin(p[1]), np.cos(p[1])
    start_x, start_y = _start(p, place)
    fx, fy = _unit_force(p[1], side, friction)
    if side == 0:
        fx, fy = 0.0, 0.0
    # derivatives of x, y, angle, curvature by the rest terms and the force
    d = np.zeros((4, terms + 1))
    low, middle, high = np.empty(terms), np.empty(terms), np.empty(terms)
    before = min(int(np.ceil(c / h)) - 1, m - 1)
    for direction in (-1, 1):
        s, at_x, at_y, theta, heading = c, start_x, start_y, p[1], (cos, sin)
        d[:, :] = 0.0
        _polynomials((c + origin - moved) * per_half - 1, low)
        d[3, :terms] = low
        bends = direction < 0 and side != 0
        soft = _softness(c + origin, rod) if bends else 0.0
        rest = 0.0
        for j in range(terms):
            rest += p[2 + j] * low[j]
        bend, slope = rest, -soft * force * (cos * fy - sin * fx)
        k = before if direction < 0 else before + 1
        while -1 <= k < m:
            # past station 0 comes the follicle itself
            step = (k * h if k >= 0 else -origin) - s
            end = s + step + origin
            _polynomials((end - moved - step / 2) * per_half - 1, middle)
            _polynomials((end - moved) * per_half - 1, high)
            middle_soft = _softness(end - step / 2, rod) if bends else 0.0
            next_soft = _softness(end, rod) if bends else 0.0
            middle_rest, next_rest = 0.0, 0.0
            for j in range(terms):
                middle_rest += p[2 + j] * middle[j]
                next_rest += p[2 + j] * high[j]
            turn, new_x, new_y, new_heading, bent, bend = _stretch(
                step, rest, middle_rest, next_rest, soft * force, middle_soft * force,
                next_soft * force, fx, fy, start_x - at_x, start_y - at_y, heading, bend, slope,
            )  # fmt: skip
            slope = (bend - bent) / step if step != 0 else slope  # a station may lie at c
            if answers:
                _advance(
                    step, heading, new_heading, next_soft, force, fx, fy, start_x - at_x - new_x,
                    start_y - at_y - new_y, high, d,
                )  # fmt: skip
            theta, at_x, at_y, heading = theta + turn, at_x + new_x, at_y + new_y, new_heading
            s, soft, rest = s + step, next_soft, next_rest
            if k < 0:
                break
            x[k], y[k], angle[k], cosines[k], sines[k] = at_x, at_y, theta, heading[0], heading[1]
            if answers:
                nx, ny = -heading[1], heading[0]
                shift[0, k] = -sin * nx + cos * ny
                shift[1, k] = -(at_y - start_y) * nx + (at_x - start_x) * ny
                for q in range(terms + 1):
                    shift[2 + q, k] = d[0, q] * nx + d[1, q] * ny
            k += direction
        if direction < 0:
            follicle[0], follicle[1], follicle[2] = at_x, at_y, theta
            base[0, 0], base[1, 0], base[2, 0] = -sin, cos, 0.0
            base[0, 1], base[1, 1], base[2, 1] = -(at_y - start_y), at_x - start_x, 1.0
            base[:, 2:] = d[:3]


@njit(cache=True)
def _start(p, place):
    """Where the rod is laid from: of a loaded one, the contact point."""
    return place.x - p[0] * np.sin(p[1]), place.y + p[0] * np.cos(p[1])


@njit(cache=True, fastmath=FAST, error_model="numpy", inline="always")
def _softness(s, rod):
    """1/(E I(s)) [1/(N m²)]; the very tip of a full cone, which has none, is stiffened."""
    square = (1 - s / rod[1]) ** 2
    return 1 / (rod[2] * max(square * square, 1e-7))


@njit(cache=True, inline="always")
def _turned(heading, turn):
    """Cosine and sine of a direction that turns by `turn`; a series where that is little."""
    cos, sin = heading
    if abs(turn) > SMALL_TURN:
        c, s = np.cos(turn), np.sin(turn)
    else:
        t = turn * turn
        c = 1 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720)))
        s = turn * (1 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040))))
    return cos * c - sin * s, sin * c + cos * s


@njit(cache=True, inline="always")
def _stretch(step, k0, k1, k2, f0, f1, f2, fx, fy, arm_x, arm_y, heading, bend, slope):
    """Fourth-order step of angle and place, by Simpson's rule.

    k: rest curvature at start, middle, end; f: force over rigidity there; arm: from the place
    to the contact; heading: cosine and sine; `bend` and `slope`: curvature at the start and its
    change per length, as known so far, by which the way to middle and end is bent where the
    lever is asked for. Returns the turn, the way made in x and y, the new heading, and the
    curvature at start and end.
    """
    half, sixth = step / 2, step / 6
    c1, s1 = heading
    lever, along, across = arm_x * fy - arm_y * fx, c1 * fy - s1 * fx, -s1 * fy - c1 * fx
    short = bend * bend / 6
    ahead, aside = half * (1 - half * half * short), half * half * (bend / 2 + slope * half / 6)
    r1 = k0 + f0 * lever
    r2 = k1 + f1 * (lever - ahead * along - aside * across)
    ahead, aside = step * (1 - step * step * short), step * step * (bend / 2 + slope * sixth)
    r3 = k2 + f2 * (lever - ahead * along - aside * across)
    c2, s2 = _turned(heading, step / 24 * (5 * r1 + 8 * r2 - r3))
    turn = sixth * (r1 + 4 * r2 + r3)
    c3, s3 = _turned(heading, turn)
    way_x, way_y = sixth * (c1 + 4 * c2 + c3), sixth * (s1 + 4 * s2 + s3)
    return turn, way_x, way_y, (c3, s3), r1, r3


@njit(cache=True)
def _advance(step, heading, new_heading, soft, force, fx, fy, arm_x, arm_y, basis, d):
    """Second-order step of the derivatives `d` of x, y, angle and curvature."""
    cos, sin = heading
    new_cos, new_sin = new_heading
    lever = arm_x * fy - arm_y * fx
    for q in range(N_REST + 1):
        turned = d[2, q] + 0.5 * step * d[3, q]
        dx, dy = d[0, q] - step * sin * turned, d[1, q] + step * cos * turned
        rate = force * soft * (dy * fx - dx * fy)
        rate += basis[q] if q < N_REST else lever * soft
        new_turn = d[2, q] + 0.5 * step * (d[3, q] + rate)
        d[0, q] -= 0.5 * step * (sin * d[2, q] + new_sin * new_turn)
        d[1, q] += 0.5 * step * (cos * d[2, q] + new_cos * new_turn)
        d[2, q], d[3, q] = new_turn, rate


@njit(cache=True)
def _nearest_on_model(x, y, cos, sin, h, c, px, py):
    """Arc length where the pole lies square to the model, near `c`."""
    m = len(x)
    middle = min(max(int(c / h), 0), m - 2)
    for away in range(m):
        for k in (middle - away, middle + away):
            if not 0 <= k <= m - 2:
                continue
            ahead = (px - x[k]) * cos[k] + (py - y[k]) * sin[k]
            behind = (px - x[k + 1]) * cos[k + 1] + (py - y[k + 1]) * sin[k + 1]
            if ahead >= 0 > behind:
                return (k + ahead / (ahead - behind)) * h
    return c


@njit(cache=True)
def _at(x, y, angle, h, s):
    """Place and direction between stations: the arc through both."""
    k = min(int(s / h), len(x) - 2)
    t = s / h - k
    chord_x, chord_y = x[k] + t * (x[k + 1] - x[k]), y[k] + t * (y[k + 1] - y[k])
    turned = angle[k + 1] - angle[k]
    direction = angle[k] + t * turned
    sagitta = -0.5 * turned * h * t * (1 - t)  # κ/2 · t(1 − t) h² off the chord
    return chord_x - sagitta * np.sin(direction), chord_y + sagitta * np.cos(direction), direction


@njit(cache=True, inline="always")
def _misfit(seen, laid, k):
    """How far station `k` was seen to lie beside the rod, along its normal [m]."""
    return _across(laid, k, seen[0][k] - laid.x[k], seen[1][k] - laid.y[k])


@njit(cache=True, inline="always")
def _across(laid, k, dx, dy):
    """Part of (dx, dy) along the rod's normal at station `k`."""
    return dy * laid.cos[k] - dx * laid.sin[k]


@njit(cache=True)
def _equations(seen, laid, size, precision, p, sums, chi2, robust):
    """Fill Gauss–Newton's normal equations; returns the reduced χ² of the misfit."""
    mean, normal, rhs = sums.mean, sums.normal, sums.rhs
    terms = len(mean)
    chi2 = _weigh(seen, laid, chi2, robust, sums.misfit, sums.weight)
    _products(laid.shift, sums.misfit, sums.weight, size, sums.share, normal, rhs)
    # the covariance is scaled by χ² afterwards, the prior must not be
    inflate = max(chi2, 1.0) if robust else 1.0
    for a in range(terms):
        for b in range(terms):
            normal[2 + a, 2 + b] += precision[a, b] * inflate
            rhs[2 + a] += precision[a, b] * inflate * (mean[b] - p[2 + b])
    return chi2


@njit(cache=True, error_model="numpy")
def _weigh(seen, laid, chi2, robust, misfit, weight):
    """Fill misfit [m] and weight [1/m²] of every station, 0 where none was seen; returns χ²."""
    info = seen[2]
    total, count = 0.0, 0
    for k in range(len(info)):
        known = info[k] > 0
        misfit[k] = _misfit(seen, laid, k) if known else 0.0
        weight[k] = info[k] if known else 0.0
        count += known
    if robust:
        scale = 1 / max(chi2, 1.0)
        for k in range(len(info)):
            deviation = abs(misfit[k]) * np.sqrt(weight[k] * scale)
            weight[k] *= HUBER / deviation if deviation > HUBER else 1.0
    for k in range(len(info)):
        total += weight[k] * misfit[k] * misfit[k]
    return total / max(count - 4, 1)


@njit(cache=True, fastmath=FAST)
def _products(shift, misfit, weight, size, share, normal, rhs):
    """Fill Σ weight shift shiftᵀ and Σ weight shift misfit of the first `size` parameters."""
    m = len(misfit)
    for a in range(size):
        one, total = shift[a], 0.0
        for k in range(m):
            share[k] = weight[k] * one[k]
            total += share[k] * misfit[k]
        rhs[a] = total
        for b in range(a + 1):
            other, total = shift[b], 0.0
            for k in range(m):
                total += share[k] * other[k]
            normal[a, b] = total
            normal[b, a] = total


@njit(cache=True)
def _robust_weight(info, misfit, chi2):
    """Information of a station, less where it lies off by more than HUBER usual misfits."""
    deviation = abs(misfit) * np.sqrt(info / max(chi2, 1.0))
    return info * HUBER / deviation if deviation > HUBER else info


@njit(cache=True)
def _step(size, p, inverse, rhs):
    """One Gauss–Newton step of `p`; returns its length, of all parameters together, in SD."""
    step = np.zeros(size)
    for a in range(size):
        for b in range(size):
            step[a] += inverse[a, b] * rhs[b]
    square = 0.0
    for a in range(size):
        square += step[a] * rhs[a]
    # half a radian at most: the model is laid again before it goes on
    factor = min(1.0, 0.5 / max(abs(step[1]), 1e-9))
    for a in range(size):
        p[a] += factor * step[a]
    return np.sqrt(max(square, 0.0))


@njit(cache=True)
def _invert(matrix, size, lower, inverse):
    """Inverse of the symmetric leading block by Cholesky; False where it has none to speak of."""
    scale = np.empty(size)
    for a in range(size):
        if not (matrix[a, a] > 0 and np.isfinite(matrix[a, a])):
            return False
        scale[a] = 1 / np.sqrt(matrix[a, a])
    for a in range(size):
        for b in range(a + 1):
            total = matrix[a, b] * (scale[a] * scale[b])
            for k in range(b):
                total -= lower[a, k] * lower[b, k]
            if a == b:
                if not total > 1e-13:
                    return False
                lower[a, a] = np.sqrt(total)
            else:
                lower[a, b] = total / lower[b, b]
    for q in range(size):
        for a in range(size):
            total = 1.0 if a == q else 0.0
            for k in range(a):
                total -= lower[a, k] * inverse[k, q]
            inverse[a, q] = total / lower[a, a]
        for a in range(size - 1, -1, -1):
            total = inverse[a, q]
            for k in range(a + 1, size):
                total -= lower[k, a] * inverse[k, q]
            inverse[a, q] = total / lower[a, a]
    for a in range(size):
        for q in range(size):
            inverse[a, q] *= scale[a] * scale[q]
    return True


@njit(cache=True)
def _loads(o, p, cov, size, load, c, contact, laid, place_at, at, softness_at, pole, radius):
    """Fill gap, contact and base loads of one row."""
    c_angle, (c_x, c_y), (px, py, pole_radius), base = p[1], contact, pole, laid.base
    side = load[0]
    fx, fy = _unit_force(c_angle, side, load[1])
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
def _rod_curvature(rod_now, near, values):
    """Curvature of the fitted rod at grid place `near`; `values` (rest terms,) is scratch."""
    p, rod, load, (origin, moved, h), place, laid = rod_now
    _polynomials(2 * (near + origin - moved) / rod[0] - 1, values)
    total = 0.0
    for j in range(len(values)):
        total += p[2 + j] * values[j]
    if load[0] != 0 and near < place.c:
        fx, fy = _unit_force(p[1], load[0], load[1])
        at_x, at_y, _ = _at(laid.x, laid.y, laid.angle, h, near)
        c_x, c_y = _start(p, place)
        lever = (c_x - at_x) * fy - (c_y - at_y) * fx
        total += p[2 + len(values)] * lever * _softness(near + origin, rod)
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
        misfit = _misfit(seen, laid, k)
        weight = _robust_weight(info[k], misfit, chi2)
        power = (1.0, u, u * u)
        for a in range(3):
            rhs[a] += weight * power[a] * misfit
            for b in range(3):
                square[a, b] += weight * power[a] * power[b]
        count += 1
        before, after = before + (u < 0), after + (u > 0)
    enough = count >= FEWEST_NEAR and min(before, after) >= 2
    if not (enough and _invert(square, 3, sums.lower, inverse)):
        return np.nan, np.nan
    bend = 0.0
    for a in range(3):
        bend += inverse[2, a] * rhs[a]
    scale = 2 / CURVATURE_REACH_M**2
    return scale * bend, scale**2 * inverse[2, 2] * max(chi2, 1.0)


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
        away, misfit = _moved_by_origin(laid, nudged, k), _misfit(seen, laid, k)
        weight = _robust_weight(info[k], misfit, chi2)
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
    return _across(laid, k, nudged.x[k] - laid.x[k], nudged.y[k] - laid.y[k]) / ORIGIN_STEP_M


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
        away, misfit = _moved_by_origin(laid, nudged, k), _misfit(seen, laid, k)
        for a in range(size):
            away += shift[a, k] * follows[a]
        out[k] = _robust_weight(info[k], misfit, chi2) * away


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
