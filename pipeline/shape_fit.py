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

import numpy as np
from numba import njit

from pipeline.stations import Stations
from whiskermodel.whisker import Whisker

N_REST = 4  # Legendre polynomials of the rest curvature
ITERATIONS = 12
FEWEST_STATIONS = 10
HUBER = 3.0  # SD beyond which a station counts less
ANCHOR_SPAN = 6  # stations whose chord continues the trace into the fur
_FREE, _LOADED = N_REST + 2, N_REST + 3  # numbers of parameters

_COLUMNS = (
    "force", "force_var", "gap", "gap_var", "gap_force_cov", "compliance", "contact",
    "angle", "follicle_x", "follicle_y", "moment_per_force", "axial_per_force",
    "lateral_per_force", "curvature_per_force", "lever_at_curvature", "rest_curvature",
    "chi2", "count", "clear_gap", "clear_gap_var",
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
    zeros, `cov` (rows, N_REST, N_REST).
    """

    weights: np.ndarray
    centre: float
    scale: float
    drift: np.ndarray
    cov: np.ndarray


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
    stations: Stations, whisker: Whisker, curvature_at: float, prior: RestPrior, friction=0.0
) -> ShapeFit:
    """Fit pose and the force that a pole at the nearest point would exert, given the rest shape.

    `friction` is the signed ratio of tangential to normal force, + pulls towards the tip.
    """
    return _fit(stations, whisker, curvature_at, prior, loaded=True, friction=friction)


def _vague(n):
    """Covariance of an all but flat prior: 300 1/m in every coefficient."""
    return np.broadcast_to(np.eye(N_REST) * 300.0**2, (n, N_REST, N_REST))


def _fit(stations, whisker, curvature_at, prior, loaded, friction):
    n, m = stations.x.shape
    s = np.arange(m) * whisker.length / (m - 1)
    out = np.full((n, len(_COLUMNS)), np.nan)
    rest = np.full((n, N_REST), np.nan)
    rest_cov = np.full((n, N_REST, N_REST), np.nan)
    # the very tip of a full cone has no stiffness; nothing touches there
    stiffness = np.maximum(whisker.flexural_rigidity(s), 1e-7 * whisker.base_flexural_rigidity)
    with np.errstate(invalid="ignore"):
        side = np.where(loaded & np.isfinite(stations.pole_x), stations.side, 0)
    radius = np.array([whisker.base_radius, whisker.base_radius / whisker.cone_length])
    _fit_rows(
        stations.x, stations.y, stations.information, s[1], stiffness, rest_basis(whisker, s),
        side.astype(np.float64), stations.pole_x, stations.pole_y, stations.pole_radius,
        stations.nearest, radius, curvature_at, rest_basis(whisker, [curvature_at])[0],
        float(whisker.flexural_rigidity(curvature_at)), np.ascontiguousarray(prior.weights),
        prior.centre, prior.scale, np.ascontiguousarray(prior.drift),
        np.linalg.inv(prior.cov), friction, out, rest, rest_cov,
    )  # fmt: skip
    table = {name: out[:, k] for k, name in enumerate(_COLUMNS)}
    return ShapeFit(table, rest, rest_cov)


@njit(cache=True)
def _fit_rows(
    xs, ys, info, h, stiffness, basis, side, pole_x, pole_y, pole_radius, nearest, radius, at,
    basis_at, stiffness_at, weights, centre, scale, drift, precision, friction, out, rest,
    rest_cov,
):  # fmt: skip
    m, terms = basis.shape
    x, y, angle, kappa = np.zeros(m), np.zeros(m), np.zeros(m), np.zeros(m)
    shift = np.zeros((m, _LOADED))
    base = np.zeros((3, _LOADED))
    normal, rhs = np.zeros((_LOADED, _LOADED)), np.zeros(_LOADED)
    p, mean = np.zeros(_LOADED), np.zeros(terms)
    for row in range(len(xs)):
        first, count = _span(info[row])
        if count < FEWEST_STATIONS:
            continue
        loaded = side[row] != 0 and nearest[row] > (first + 2) * h
        size = _LOADED if loaded else _FREE
        load = (side[row], friction) if loaded else (0.0, 0.0)
        c = min(nearest[row], (m - 1) * h) if loaded else (first + count // 2) * h
        p[:] = 0.0
        chi2 = 1.0
        _trace(xs[row], ys[row], info[row], first, h, x, y, angle)
        ref_x, ref_y, p[1] = _at(x, y, angle, h, c)
        for iteration in range(ITERATIONS):
            _prior_mean(weights, drift[row], (angle[0] - centre) / scale, mean)
            if iteration == 0:
                p[2 : 2 + terms] = mean
                if loaded:
                    p[size - 1] = _first_force(
                        x, y, angle, info[row], basis, mean, stiffness, h, c, side[row], friction
                    )
            elif loaded:
                c = _nearest_on_model(x, y, angle, h, c, pole_x[row], pole_y[row])
                ref_x, ref_y, p[1] = _at(x, y, angle, h, c)
                p[0] = 0.0
            _lay(p, basis, stiffness, load, h, c, ref_x, ref_y, x, y, angle, kappa, shift, base)
            change, chi2 = _step(
                xs[row], ys[row], info[row], x, y, angle, shift, size, mean, precision[row],
                p, normal, rhs, chi2, iteration,
            )  # fmt: skip
            _lay(p, basis, stiffness, load, h, c, ref_x, ref_y, x, y, angle, kappa, shift, base)
            if iteration > 2 and change < 1e-3:
                break
        cov = np.linalg.inv(normal[:size, :size]) * max(chi2, 1.0)
        rest[row] = p[2 : 2 + terms]
        rest_cov[row] = cov[2 : 2 + terms, 2 : 2 + terms]
        o = out[row]
        o[7], o[8], o[9] = angle[0], x[0], y[0]
        o[15] = (basis_at * rest[row]).sum()
        o[16], o[17] = chi2, count
        if loaded:
            _loads(
                o, p, cov, size, side[row], friction, c, h, x, y, angle, base, at, stiffness_at,
                pole_x[row], pole_y[row], pole_radius, radius,
            )  # fmt: skip


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
    before, slope = first, 0.0
    x[first], y[first] = xs[first], ys[first]
    for k in range(first + 1, m + 1):
        if k < m and not info[k] > 0:
            continue
        if k < m:
            slope = np.arctan2(ys[k] - ys[before], xs[k] - xs[before])
            step_x, step_y = (
                (xs[k] - xs[before]) / (k - before),
                (ys[k] - ys[before]) / (k - before),
            )
        else:
            step_x, step_y = h * np.cos(slope), h * np.sin(slope)
        for q in range(before + 1, min(k + 1, m)):
            x[q], y[q] = x[before] + (q - before) * step_x, y[before] + (q - before) * step_y
        before = k
    reach = min(first + ANCHOR_SPAN, m - 1)
    start = np.arctan2(y[reach] - y[first], x[reach] - x[first])
    for k in range(first):
        x[k] = x[first] - (first - k) * h * np.cos(start)
        y[k] = y[first] - (first - k) * h * np.sin(start)
    for k in range(m):
        p, q = max(k - 1, 0), min(k + 1, m - 1)
        angle[k] = np.arctan2(y[q] - y[p], x[q] - x[p])
        if k > 0:
            angle[k] = angle[k - 1] + _wrapped(angle[k] - angle[k - 1])


@njit(cache=True)
def _wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


@njit(cache=True)
def _first_force(x, y, angle, info, basis, mean, stiffness, h, c, side, friction):
    """Start force from the measured directions, which are linear in it and in one start angle."""
    c_x, c_y, c_angle = _at(x, y, angle, h, c)
    fx, fy = _unit_force(c_angle, side, friction)
    rest, load, g = 0.0, 0.0, 0.0
    n, sums = 0, np.zeros(4)  # Σ G, Σ G², Σ d, Σ G d
    for k in range(len(angle)):
        before = g
        g = ((c_x - x[k]) * fy - (c_y - y[k]) * fx) / stiffness[k] if k * h < c else 0.0
        if k > 0:
            load += 0.5 * h * (g + before)
            for j in range(len(mean)):
                rest += 0.5 * h * mean[j] * (basis[k, j] + basis[k - 1, j])
        if info[k] > 0:
            d = angle[k] - rest
            n += 1
            sums += np.array([load, load * load, d, load * d])
    spread = sums[1] - sums[0] ** 2 / n
    return (sums[3] - sums[0] * sums[2] / n) / spread if spread > 0 else 0.0


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


@njit(cache=True)
def _lay(p, basis, stiffness, load, h, c, ref_x, ref_y, x, y, angle, kappa, shift, base):
    """Lay the rod from arc length c both ways, with its derivatives by every parameter.

    `shift[k, q]`: how far station k moves along its normal per unit of parameter q; `base[:, q]`:
    how the follicle moves (x, y) and turns.
    """
    m, terms = basis.shape
    for k in range(m):
        kappa[k] = 0.0
        for j in range(terms):
            kappa[k] += p[2 + j] * basis[k, j]
    side, friction = load
    force = p[2 + terms] if side != 0 else 0.0
    sin, cos = np.sin(p[1]), np.cos(p[1])
    start_x, start_y = ref_x - p[0] * sin, ref_y + p[0] * cos
    fx, fy = _unit_force(p[1], side, friction)
    if side == 0:
        fx, fy = 0.0, 0.0
    before = min(int(np.ceil(c / h)) - 1, m - 1)
    # derivatives of x, y, angle, curvature by the rest terms and the force
    d = np.zeros((4, terms + 1))
    for direction in (-1, 1):
        s, at_x, at_y, theta = c, start_x, start_y, p[1]
        t = c / h - before
        d[:, :] = 0.0
        bend = 0.0
        for j in range(terms):
            d[3, j] = basis[before, j]
            if before + 1 < m:
                d[3, j] += t * (basis[before + 1, j] - basis[before, j])
            bend += p[2 + j] * d[3, j]
        k = before if direction < 0 else before + 1
        while 0 <= k < m:
            step = k * h - s
            softness = 1 / stiffness[k] if direction < 0 else 0.0
            bend, theta, at_x, at_y = _advance(
                step, kappa[k], softness, force, fx, fy, start_x, start_y, bend, theta, at_x,
                at_y, basis[k], d,
            )  # fmt: skip
            s = k * h
            x[k], y[k], angle[k], kappa[k] = at_x, at_y, theta, bend
            nx, ny = -np.sin(theta), np.cos(theta)
            shift[k, 0] = -sin * nx + cos * ny
            shift[k, 1] = -(at_y - start_y) * nx + (at_x - start_x) * ny
            for q in range(terms + 1):
                shift[k, 2 + q] = d[0, q] * nx + d[1, q] * ny
            k += direction
        if direction < 0:
            base[0, 0], base[1, 0], base[2, 0] = -sin, cos, 0.0
            base[0, 1], base[1, 1], base[2, 1] = -(at_y - start_y), at_x - start_x, 1.0
            base[:, 2:] = d[:3]


@njit(cache=True)
def _advance(
    step, rest, softness, force, fx, fy, start_x, start_y, bend, theta, at_x, at_y, basis, d
):
    """One step of the rod and of its derivatives `d`; returns curvature, angle, x, y there."""
    middle = theta + 0.5 * step * bend
    sin, cos = np.sin(middle), np.cos(middle)
    guess_x, guess_y = at_x + step * cos, at_y + step * sin
    lever = (start_x - guess_x) * fy - (start_y - guess_y) * fx
    new_bend = rest + force * lever * softness
    new_theta = theta + 0.5 * step * (bend + new_bend)
    middle = 0.5 * (theta + new_theta) + step * (bend - new_bend) / 8
    new_sin, new_cos = np.sin(new_theta), np.cos(new_theta)
    old_sin, old_cos = np.sin(theta), np.cos(theta)
    at_x += step / 6 * (old_cos + 4 * np.cos(middle) + new_cos)
    at_y += step / 6 * (old_sin + 4 * np.sin(middle) + new_sin)
    terms = len(basis)
    for q in range(terms + 1):
        turned = d[2, q] + 0.5 * step * d[3, q]
        dx, dy = d[0, q] - step * sin * turned, d[1, q] + step * cos * turned
        rate = force * softness * (dy * fx - dx * fy)
        rate += basis[q] if q < terms else lever * softness
        new_turn = d[2, q] + 0.5 * step * (d[3, q] + rate)
        d[0, q] -= 0.5 * step * (old_sin * d[2, q] + new_sin * new_turn)
        d[1, q] += 0.5 * step * (old_cos * d[2, q] + new_cos * new_turn)
        d[2, q], d[3, q] = new_turn, rate
    return new_bend, new_theta, at_x, at_y


@njit(cache=True)
def _nearest_on_model(x, y, angle, h, c, px, py):
    """Arc length where the pole lies square to the model, near `c`."""
    m = len(x)
    middle = min(max(int(c / h), 0), m - 2)
    for away in range(m):
        for k in (middle - away, middle + away):
            if not 0 <= k <= m - 2:
                continue
            ahead = (px - x[k]) * np.cos(angle[k]) + (py - y[k]) * np.sin(angle[k])
            behind = (px - x[k + 1]) * np.cos(angle[k + 1]) + (py - y[k + 1]) * np.sin(
                angle[k + 1]
            )
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


@njit(cache=True)
def _step(
    xs, ys, info, x, y, angle, shift, size, mean, precision, p, normal, rhs, chi2, iteration
):
    """One Gauss–Newton step of `p`; returns the last parameter's change in SD, and χ²."""
    terms = len(mean)
    normal[:, :] = 0.0
    rhs[:] = 0.0
    scale = np.sqrt(max(chi2, 1.0))
    total, count = 0.0, 0
    for k in range(len(xs)):
        if not info[k] > 0:
            continue
        misfit = -(xs[k] - x[k]) * np.sin(angle[k]) + (ys[k] - y[k]) * np.cos(angle[k])
        deviation = abs(misfit) * np.sqrt(info[k]) / scale
        weight = info[k]
        if iteration > 1 and deviation > HUBER:
            weight *= HUBER / deviation
        total += weight * misfit * misfit
        count += 1
        for a in range(size):
            rhs[a] += weight * shift[k, a] * misfit
            for b in range(a, size):
                normal[a, b] += weight * shift[k, a] * shift[k, b]
    chi2 = total / max(count - 4, 1)
    # the covariance is scaled by χ² afterwards, the prior must not be
    inflate = max(chi2, 1.0) if iteration > 1 else 1.0
    for a in range(terms):
        for b in range(terms):
            if b >= a:
                normal[2 + a, 2 + b] += precision[a, b] * inflate
            rhs[2 + a] += precision[a, b] * inflate * (mean[b] - p[2 + b])
    for a in range(size):
        for b in range(a):
            normal[a, b] = normal[b, a]
    scales = np.sqrt(np.diag(normal[:size, :size]))
    scaled = normal[:size, :size] / np.outer(scales, scales)
    step = np.linalg.solve(scaled, rhs[:size] / scales) / scales
    # half a radian at most: the model is laid again before it goes on
    p[:size] += min(1.0, 0.5 / max(abs(step[1]), 1e-9)) * step
    return abs(step[size - 1]) * scales[size - 1], chi2


@njit(cache=True)
def _loads(
    o, p, cov, size, side, friction, c, h, x, y, angle, base, at, stiffness_at, px, py,
    pole_radius, radius,
):  # fmt: skip
    """Fill one row of results that need the force."""
    c_x, c_y, c_angle = _at(x, y, angle, h, c)
    fx, fy = _unit_force(c_angle, side, friction)
    at_x, at_y, _ = _at(x, y, angle, h, at)
    force = p[size - 1]
    o[0], o[1] = force, cov[size - 1, size - 1]
    surface = max(radius[0] - radius[1] * c, 0.0)
    o[2] = np.hypot(px - c_x, py - c_y) - pole_radius - surface
    o[3], o[4] = cov[0, 0], -side * cov[0, size - 1]
    # with the base held, the contact moves against the base's motion and turning
    q = size - 1
    move_x = -base[0, q] + base[2, q] * (c_y - y[0])
    move_y = -base[1, q] - base[2, q] * (c_x - x[0])
    o[5] = -side * (-np.sin(c_angle) * move_x + np.cos(c_angle) * move_y)
    o[6] = c
    o[10] = (c_x - x[0]) * fy - (c_y - y[0]) * fx
    o[11] = fx * np.cos(angle[0]) + fy * np.sin(angle[0])
    o[12] = fy * np.cos(angle[0]) - fx * np.sin(angle[0])
    lever = (c_x - at_x) * fy - (c_y - at_y) * fx if at < c else 0.0
    o[13], o[14] = lever / stiffness_at, lever
    o[18] = o[2] - force * o[5]
    o[19] = o[3] + o[5] ** 2 * o[1] - 2 * o[5] * o[4]
