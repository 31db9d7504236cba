"""The visible base of every row as a curve of linear curvature, with its covariance.

The curve, θ(s) = θ + k0 s + k1 s²/2, is fitted to the resampled places of a window beyond the
fur, about the window's middle. The window is a physical length with a floor in pixels, so that
a scale that is wrong by a factor of two still leaves enough of the whisker to measure. Near the
face, fur, codec and crossings shift the places by more than the picture's noise; how much more, is
learnt for each station from all frames of the whisker.

Parameters are scaled by the half-width L of the window, (offset/L, θ, k0 L, k1 L²): all of them
are angles [rad].
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pipeline.kinematics.stations import BLOCK_ROWS
from pipeline.numerics.cholesky import factorise, solve
from pipeline.numerics.robust import robust_sd, trimmed_part
from pipeline.numerics.runs import evenly, parts
from pipeline.session.parameters import KinematicsParams

FEWEST_STATIONS = 8
STEPS = 4  # of Gauss–Newton
LEARNING_ROWS, LEARNING_PASSES = 300, 4  # frames from which fur's part is learnt
TRIMMED = 0.9  # part of the rows that count; …
TRIMMED_MEAN = trimmed_part(TRIMMED)  # … the mean of their squares, over that of all
NOISE_DEGREES = (4, 5, 6)  # degrees that only noise has
MOST_GROWTH = 1.6  # of the noise's SD from one degree to the next lower one
FEWEST_ROWS = 12  # from which something is learnt about all
FUR = 4.0  # times the usual excess: what lies over the whisker moves it
HUBER = 3.0  # usual misfits beyond which a station counts less
LOOSE = np.array([1e3, 1e3, 3.0, 3.0])  # SD [rad] of what any base may have
LEAST_KNOWN = 1e-12
PIECES = 16  # of a curve that is walked along


@dataclass(frozen=True)
class BaseCurves:
    """Curves of one whisker's rows, before anything is known of the other frames.

    Attributes
    ----------
    middle, half : arc length of the window's middle, and the half-width L that scales [m]
    x, y : (rows,) place at the middle [m, y up]; NaN where a row is too short
    shape : (rows, 3) θ, k0 L and k1 L² [rad]
    root : (rows, 4, 4) upper triangular; root rootᵀ is the covariance of (offset/L, θ, k0 L,
        k1 L²) [rad²], which is positive whatever is rounded
    """

    middle: float
    half: float
    x: np.ndarray
    y: np.ndarray
    shape: np.ndarray
    root: np.ndarray

    def rows(self, rows) -> "BaseCurves":
        """Return a copy of the given rows."""
        own = (each[rows] for each in (self.x, self.y, self.shape, self.root))
        return BaseCurves(self.middle, self.half, *own)


def lay_to(x, y, shape, half, z):
    """Walk from (x, y) along curves of `shape` to `z`, (rows,) each: x, y [m] and angle [rad]."""
    x, y, z = np.copy(x), np.copy(y), np.broadcast_to(z, np.shape(x))
    for k in range(PIECES):
        angle = angle_at(shape, z * ((k + 0.5) / PIECES))
        x += half * z / PIECES * np.cos(angle)
        y += half * z / PIECES * np.sin(angle)
    return x, y, angle_at(shape, z)


def angle_at(shape, z):
    """Direction [rad] of curves of `shape` (rows, 3) at z, a number or (rows,)."""
    return shape[:, 0] + z * (shape[:, 1] + 0.5 * z * shape[:, 2])


def fit_base_curves(places, pixels_per_m: float, params: KinematicsParams) -> BaseCurves | None:
    """Fit the bases of one whisker's `Stations`; None where hardly any row shows one."""
    span = _window(places, pixels_per_m, params)
    if span is None:
        return None
    spacing, (first, last) = places.spacing[places.whisker[0]], span
    grid = _Grid(spacing * np.arange(first, last))
    excess = np.zeros(last - first)
    few = evenly(len(places), LEARNING_ROWS)
    sample = _seen(places.rows(few).loaded(), span)
    for _ in range(LEARNING_PASSES):
        excess = _excess(sample, grid, excess)
    red = _redness(sample, grid, excess)
    fitted = [
        _fit(_seen(places.rows(rows).loaded(), span), grid, excess)[:3]
        for rows in parts(len(places), BLOCK_ROWS)
    ]
    place, shape, root = (np.concatenate(each) for each in zip(*fitted, strict=True))
    return BaseCurves(grid.middle, grid.half, place[:, 0], place[:, 1], shape, root * red)


class _Grid:
    """Arc lengths `s` [m] of the window's stations, and the polynomials fitted over them."""

    def __init__(self, s):
        self.spacing = s[1] - s[0]
        self.middle, self.half = (s[0] + s[-1]) / 2, (s[-1] - s[0]) / 2
        self.z = (s - self.middle) / self.half
        self.basis = np.stack([np.ones_like(self.z), self.z, self.z**2 / 2, self.z**3 / 6], axis=1)


@njit(cache=True)
def _beside_curve(x, y, z, spacing, place, shape, along, beside):
    """Fill in how far places lie along and beside their curve [m], (stations,) each.

    x, y : (stations,) [m]
    z : (stations,) in half-widths from the middle, `spacing` [m] apart
    place, shape : (2,) [m], (3,) [rad] of the curve, which passes `place` at the middle
    """
    n, (turn, bend, change) = len(z), shape
    before, after = (n - 1) // 2, n // 2
    lx, ly, middle_x, middle_y = 0.0, 0.0, 0.0, 0.0
    for k in range(n):  # the curve from its first station on, into `along` and `beside`
        if k > 0:
            between = (z[k] + z[k - 1]) / 2
            angle = turn + between * (bend + 0.5 * between * change)
            lx += spacing * np.cos(angle)
            ly += spacing * np.sin(angle)
        along[k], beside[k] = lx, ly
        for middle in (before, after):
            if k == middle:
                middle_x, middle_y = middle_x + lx / 2, middle_y + ly / 2
    to_x, to_y = place[0] - middle_x, place[1] - middle_y
    for k in range(n):
        angle = turn + z[k] * (bend + 0.5 * z[k] * change)
        cos, sin = np.cos(angle), np.sin(angle)
        dx, dy = x[k] - (along[k] + to_x), y[k] - (beside[k] + to_y)
        along[k], beside[k] = dx * cos + dy * sin, dy * cos - dx * sin


def _window(places, pixels_per_m, params):
    """First and one-past-last station of the base; None where there are none."""
    spacing = places.spacing[places.whisker[0]]
    reach = max(1e-3 * params.base_window_mm, params.base_window_least_px / pixels_per_m)
    few = evenly(len(places), LEARNING_ROWS)
    seen = places.rows(few).loaded().information > 0
    rows = seen.sum(axis=1) >= FEWEST_STATIONS
    if not rows.any():
        return None
    furry = np.nanmedian(places.first) + params.base_skip_least_px / pixels_per_m
    first = max(int(np.median(np.argmax(seen[rows], axis=1))), int(np.ceil(furry / spacing)))
    last = min(first + max(round(reach / spacing), FEWEST_STATIONS) + 1, seen.shape[1])
    return (first, last) if last - first >= FEWEST_STATIONS else None


def _seen(places, span):
    """x, y [m] and information [1/m²] in the window, (rows, stations) each."""
    part = slice(*span)
    known = places.information[:, part] > 0
    x, y = (np.where(known, each[:, part], 0.0) for each in (places.x, places.y))
    return x, y, np.where(known, places.information[:, part], 0.0)


def _excess(sample, grid, excess):
    """Variance [m²] that stations have beside the picture's noise, from fits that allow for it."""
    _, _, root, misfit, known = _fit(sample, grid, excess)
    rows = np.isfinite(root[:, 0, 0])
    known, misfit = known[rows], misfit[rows]
    leverage = grid.half**2 * ((grid.basis @ root[rows]) ** 2).sum(axis=2)
    out = _scatter_beyond(misfit, known, leverage, sample[2][rows])
    fur = out > FUR * np.median(out)
    return np.where(
        fur, out * np.sqrt(fur.sum()), out
    )  # fur moves them together, as if they were one


@njit(cache=True)
def _scatter_beyond(misfit, known, leverage, information):
    """Trimmed variance [m²] of each station's misfits beyond that of the picture's noise.

    All are (rows, stations); `leverage` [m²] is what the fit takes out of the misfits.
    """
    out = np.zeros(misfit.shape[1])
    for k in range(len(out)):
        at = np.flatnonzero(known[:, k])
        if len(at) < FEWEST_STATIONS:
            continue
        square = np.sort(misfit[at, k] ** 2)[: max(int(TRIMMED * len(at)), 1)]
        total = square.mean() / TRIMMED_MEAN
        noise = np.median(1 / information[at, k])
        out[k] = max(total + np.median(leverage[at, k]) - noise, 0.0)
    return out


def _redness(sample, grid, excess):
    """SD of the noise in polynomials of degree 0 … 3, over that of white noise.

    It is extrapolated from the next higher degrees, where a whisker's base has nothing but noise:
    noise that is correlated along the line is larger in lower degrees.
    """
    _, _, _, misfit, known = _fit(sample, grid, excess)
    rows = known.all(axis=1) & np.isfinite(misfit).all(axis=1)
    if rows.sum() < FEWEST_ROWS or len(grid.z) < NOISE_DEGREES[-1] + 4:
        return np.ones(4)
    weight = np.sqrt(np.median(1 / (1 / sample[2][rows] + excess), axis=0))
    modes, _ = np.linalg.qr(
        np.polynomial.legendre.legvander(grid.z, NOISE_DEGREES[-1]) * weight[:, None]
    )
    found = (misfit[rows] * weight) @ modes[:, list(NOISE_DEGREES)]
    sd = np.maximum(robust_sd(found, axis=0), np.finfo(float).eps)  # 0 where frames are repeated
    growth = np.clip(
        (sd[0] / sd[-1]) ** (1 / (NOISE_DEGREES[-1] - NOISE_DEGREES[0])), 1.0, MOST_GROWTH
    )
    return np.maximum(sd[0], 1.0) * growth ** (NOISE_DEGREES[0] - np.arange(4))


def _fit(seen, grid, excess):
    """Gauss–Newton: place (rows, 2), shape (rows, 3), root; misfit [m], known (rows, stations).

    The covariance is root rootᵀ with an upper triangular `root` (rows, 4, 4): column k is the
    error of the polynomial of degree k, given those of higher degrees.
    """
    x, y, information = seen
    known = information > 0
    weight = information / (1 + information * excess)
    enough = known.sum(axis=1) >= FEWEST_STATIONS
    weight = np.where(enough[:, None], weight, 0.0)
    place, shape = _start(x, y, weight, grid)
    root, misfit = np.zeros((len(x), 4, 4)), np.zeros(x.shape)
    loose = 1 / (LOOSE * grid.half) ** 2
    polynomial = grid.z, grid.basis, grid.spacing, grid.half, loose
    _fit_rows(x, y, weight, known, polynomial, place, shape, root, misfit)
    place[~enough], shape[~enough], root[~enough] = np.nan, np.nan, np.nan
    return place, shape, root, misfit, known


@njit(cache=True, error_model="numpy")
def _fit_rows(x, y, weight, known, polynomial, place, shape, root, misfit):
    """Fill in what `_fit` finds of every row, from `place` and `shape` where they start.

    weight, known : (rows, stations)
    polynomial : as in `_Grid` z, basis, spacing, half, and (4,) information about the parameters
        of any base
    """
    z, basis, spacing, half, loose = polynomial
    matrix, lower = np.empty((4, 4)), np.zeros((4, 4))
    rhs, size, along, robust = np.empty(4), np.empty(4), np.empty(len(z)), np.empty(len(z))
    for i in range(len(place)):
        total, freedom, chi2, beside = weight[i].sum(), max(known[i].sum() - 4, 1), 1.0, misfit[i]
        robust[:] = weight[i]
        for step in range(STEPS + 1):
            _beside_curve(x[i], y[i], z, spacing, place[i], shape[i], along, beside)
            if step > 0:
                chi2 = _robust_weights(weight[i], beside, freedom, robust)
            _normal_equations(robust, beside, basis, loose, matrix, rhs)
            _scale_to_unit_diagonal(matrix, size)
            factorise(matrix, 4, lower)
            if step == STEPS:
                break
            for k in range(2, 4):
                rhs[k] -= shape[i, k - 1] * loose[k] * half
            rhs /= size
            solve(lower, 4, rhs)
            rhs /= size
            slide = np.dot(weight[i], along) / max(total, 1e-300)
            cos, sin = np.cos(shape[i, 0]), np.sin(shape[i, 0])
            place[i, 0] += slide * cos - rhs[0] * sin
            place[i, 1] += slide * sin + rhs[0] * cos
            shape[i] += rhs[1:] / half
        _fill_root(lower, np.sqrt(max(chi2, 1.0)) / half / size, root[i])


@njit(cache=True, error_model="numpy")
def _fill_root(lower, scale, root):
    """Fill `root` (4, 4), of the covariance, from the factor of the information; rows × `scale`.

    It is the transpose of the factor's inverse.
    """
    for a in range(4):
        for b in range(a, 4):
            value = scale[a] if b == a else 0.0
            for c in range(a, b):
                value -= lower[b, c] * root[a, c]
            root[a, b] = value * lower[b, b]


@njit(cache=True, error_model="numpy")
def _robust_weights(weight, misfit, freedom, robust):
    """Bring the `robust` weights of a row's stations up to date; returns χ² per freedom."""
    chi2 = 0.0
    for k in range(len(weight)):
        chi2 += robust[k] * misfit[k] ** 2
    chi2 /= freedom
    for k in range(len(weight)):
        off = abs(misfit[k]) * np.sqrt(weight[k] / max(chi2, 1.0))
        robust[k] = weight[k] * min(1.0, HUBER / max(off, HUBER))
    return chi2


@njit(cache=True, error_model="numpy")
def _normal_equations(weight, misfit, basis, loose, matrix, rhs):
    """Fill `matrix` (4, 4) and `rhs` (4,) of a row's polynomial."""
    matrix[:], rhs[:] = 0.0, 0.0
    for k in range(len(weight)):
        for a in range(4):
            part = weight[k] * basis[k, a]
            rhs[a] += part * misfit[k]
            for b in range(a + 1):
                matrix[a, b] += part * basis[k, b]
    for a in range(4):
        matrix[a, a] += loose[a]


@njit(cache=True, error_model="numpy")
def _scale_to_unit_diagonal(matrix, size):
    """Scale the lower part of an information matrix (4, 4) to a diagonal of 1, by `size` (4,).

    What is known of a parameter is at least a share `LEAST_KNOWN` of what it would be were the
    others given, far above rounding: no such matrix is singular, whatever its stations' weights.
    """
    for a in range(4):
        size[a] = np.sqrt(matrix[a, a])
        for b in range(a + 1):
            matrix[a, b] /= size[a] * size[b]
        matrix[a, a] += LEAST_KNOWN


def _start(x, y, weight, grid):
    """Mean place of the stations, and the direction of a line through them."""
    total = np.maximum(weight.sum(axis=1), 1e-300)
    mean_x, mean_y, mean_z = (
        (weight * each).sum(axis=1) / total for each in (x, y, np.broadcast_to(grid.z, x.shape))
    )
    away = weight * (grid.z - mean_z[:, None])
    dx, dy = (away * x).sum(axis=1), (away * y).sum(axis=1)
    turn = np.arctan2(dy, dx)
    place = np.column_stack(
        [mean_x - mean_z * grid.half * np.cos(turn), mean_y - mean_z * grid.half * np.sin(turn)]
    )
    return place, np.column_stack([turn, np.zeros((len(turn), 2))])
