"""Every row's visible base as a curve of linear curvature, and how well that is known.

The curve, θ(s) = θ + k0 s + k1 s²/2, is fitted to the resampled places of a window beyond the
fur, about the window's middle. The window is a physical length with a floor in pixels, so that
a scale that is wrong by a factor of two still leaves enough of the whisker to measure. Fur, codec
and crossings move the places nearest to the face by more than the picture's noise: how much more,
station by station, is learnt from all frames of the whisker.

Parameters are scaled by the half-width L of the window, (offset/L, θ, k0 L, k1 L²): all of them
are angles [rad].
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import evenly
from pipeline.session.parameters import DEFAULTS, KinematicsParams

FEWEST_STATIONS = 8
STEPS = 4  # of Gauss–Newton
LEARNING_ROWS, LEARNING_PASSES = 300, 4  # frames from which fur's part is learnt
TRIMMED, TRIMMED_MEAN = 0.9, 0.623  # part of the rows that count; their mean of a unit χ²
NOISE_DEGREES = (4, 5, 6)  # degrees that only noise has
MOST_GROWTH = 1.6  # of the noise's SD from one degree to the next lower one
FEWEST_ROWS = 12
FUR = 4.0  # times the usual excess: what lies over the whisker moves it
HUBER = 3.0  # usual misfits beyond which a station counts less
LOOSE = np.array([1e3, 1e3, 3.0, 3.0])  # SD [rad] of what any base may have
LEAST_KNOWN = 1e-12
BLOCK_ROWS = 8192  # held in memory at a time


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
        parts = (each[rows] for each in (self.x, self.y, self.shape, self.root))
        return BaseCurves(self.middle, self.half, *parts)


def lay_to(x, y, shape, half, z, pieces=16):
    """Walk from (x, y) along curves of `shape` to `z`, (rows,) each: x, y [m] and angle [rad]."""
    x, y, z = np.copy(x), np.copy(y), np.broadcast_to(z, np.shape(x))
    for k in range(pieces):
        angle = angle_at(shape, z * ((k + 0.5) / pieces))
        x += half * z / pieces * np.cos(angle)
        y += half * z / pieces * np.sin(angle)
    return x, y, angle_at(shape, z)


def angle_at(shape, z):
    """Direction [rad] of curves of `shape` (rows, 3) at z, a number or (rows,)."""
    return shape[:, 0] + z * (shape[:, 1] + 0.5 * z * shape[:, 2])


def fit_base_curves(
    places, pixels_per_m: float, params: KinematicsParams = DEFAULTS.kinematics
) -> BaseCurves | None:
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
    parts = [
        _fit(_seen(places.rows(slice(a, a + BLOCK_ROWS)).loaded(), span), grid, excess)[:3]
        for a in range(0, len(places), BLOCK_ROWS)
    ]
    place, shape, root = (np.concatenate(each) for each in zip(*parts, strict=True))
    return BaseCurves(grid.middle, grid.half, place[:, 0], place[:, 1], shape, root * red)


class _Grid:
    """Arc lengths `s` [m] of the window's stations, and the polynomials fitted over them."""

    def __init__(self, s):
        self.spacing = s[1] - s[0]
        self.middle, self.half = (s[0] + s[-1]) / 2, (s[-1] - s[0]) / 2
        self.z = (s - self.middle) / self.half
        self.basis = np.stack([np.ones_like(self.z), self.z, self.z**2 / 2, self.z**3 / 6], axis=1)
        self.products = (self.basis[:, :, None] * self.basis[:, None, :]).reshape(-1, 16)


@njit(cache=True)
def _beside_curves(x, y, z, spacing, place, shape, out):
    """Fill `out` (2, rows, stations): how far places lie along and beside their curves [m].

    x, y : (rows, stations) [m]
    z : (stations,) in half-widths from the middle, `spacing` [m] apart
    place, shape : (rows, 2) [m], (rows, 3) [rad] of the curves, which pass `place` at the middle
    """
    n = len(z)
    lx, ly = np.zeros(n), np.zeros(n)
    before, after = (n - 1) // 2, n // 2
    for i in range(len(place)):
        turn, bend, change = shape[i]
        for k in range(1, n):
            between = (z[k] + z[k - 1]) / 2
            angle = turn + between * (bend + 0.5 * between * change)
            lx[k] = lx[k - 1] + spacing * np.cos(angle)
            ly[k] = ly[k - 1] + spacing * np.sin(angle)
        to_x = place[i, 0] - (lx[before] + lx[after]) / 2
        to_y = place[i, 1] - (ly[before] + ly[after]) / 2
        for k in range(n):
            angle = turn + z[k] * (bend + 0.5 * z[k] * change)
            cos, sin = np.cos(angle), np.sin(angle)
            dx, dy = x[i, k] - (lx[k] + to_x), y[i, k] - (ly[k] + to_y)
            out[0, i, k] = dx * cos + dy * sin
            out[1, i, k] = dy * cos - dx * sin


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
    """SD of the noise in polynomials of degree 0 … 3, over what white noise would have there.

    Seen in the next degrees, which a whisker's base does not have: where noise runs along the
    line it is the larger the lower the degree.
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
    total = weight.sum(axis=1)
    enough = known.sum(axis=1) >= FEWEST_STATIONS
    weight = np.where(enough[:, None], weight, 0.0)
    place, shape = _start(x, y, weight, grid)
    robust, chi2, beside = weight, np.ones(len(x)), np.empty((2, *x.shape))
    loose = np.diag(1 / (LOOSE * grid.half) ** 2)
    for step in range(STEPS + 1):
        _beside_curves(x, y, grid.z, grid.spacing, place, shape, beside)
        along, misfit = beside
        if step:
            chi2 = (robust * misfit**2).sum(axis=1) / np.maximum(known.sum(axis=1) - 4, 1)
            off = np.abs(misfit) * np.sqrt(weight / np.maximum(chi2, 1.0)[:, None])
            robust = weight * np.minimum(1.0, HUBER / np.maximum(off, HUBER))
        matrix, size = _of_unit_diagonal((robust @ grid.products).reshape(-1, 4, 4) + loose)
        if step == STEPS:
            break
        shape_now = np.column_stack([np.zeros(len(shape)), np.zeros(len(shape)), shape[:, 1:]])
        rhs = (robust * misfit) @ grid.basis - shape_now * np.diag(loose) * grid.half
        change = np.linalg.solve(matrix, (rhs / size)[..., None])[..., 0] / size
        slide = (weight * along).sum(axis=1) / np.maximum(total, 1e-300)
        turn = shape[:, 0]
        place[:, 0] += slide * np.cos(turn) - change[:, 0] * np.sin(turn)
        place[:, 1] += slide * np.sin(turn) + change[:, 0] * np.cos(turn)
        shape = shape + change[:, 1:] / grid.half
    root = np.linalg.inv(np.linalg.cholesky(matrix)).transpose(0, 2, 1) / size[..., None]
    root *= (np.sqrt(np.maximum(chi2, 1.0)) / grid.half)[:, None, None]
    place[~enough], shape[~enough], root[~enough] = np.nan, np.nan, np.nan
    return place, shape, root, misfit, known


def _of_unit_diagonal(matrix):
    """Information matrices (rows, 4, 4) scaled to a diagonal of 1, and by what, (rows, 4).

    What is known of a parameter is at least a share `LEAST_KNOWN` of what it would be were the
    others given, far above rounding: no such matrix is singular, whatever its stations' weights.
    """
    size = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
    return matrix / (size[:, :, None] * size[:, None]) + LEAST_KNOWN * np.eye(4), size


def _start(x, y, weight, grid):
    """Where the stations lie in the mean, and the direction of their line."""
    total = np.maximum(weight.sum(axis=1), 1e-300)
    mean_x, mean_y, mean_z = (
        (weight * each).sum(axis=1) / total for each in (x, y, np.broadcast_to(grid.z, x.shape))
    )
    away = weight * (grid.z - mean_z[:, None])
    dx, dy = (away * x).sum(axis=1), (away * y).sum(axis=1)
    turn = np.arctan2(dy, dx)
    place = np.column_stack(
        [
            mean_x - mean_z * grid.half * np.cos(turn),
            mean_y - mean_z * grid.half * np.sin(turn),
        ]
    )
    return place, np.column_stack([turn, np.zeros((len(turn), 2))])
