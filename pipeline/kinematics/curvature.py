"""Centreline → curvature at one arc length, with its standard error.

It comes from a local polynomial v(u), in axes along and across the whisker, fitted to the
*unsmoothed* measurements of the centreline (each with its Fisher information). So the standard
error follows from the fit, and the only smoothing is the window, a physical length. Two errors are
added: a codec's noise is correlated along the whisker; and where the curvature changes along it,
an error of the hidden length is also one of curvature.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numba import njit

from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics.follicle import FEWEST_NODES
from pipeline.kinematics.resampled import Lines, pole_in_rows
from pipeline.numerics.polyline import nearest_node
from pipeline.session.parameters import KinematicsParams
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines

BLOCK_PX = 24  # longer than noise is correlated along a line, of compressed video or a tracker
NOISE_DEGREE = 6  # of the polynomial that it is looked for about
RED_EVERY = 12  # rows between two in which it is
RED_SKEW = 1.5  # mean over median of such variances, and what is longer still than a block


class _Window(NamedTuple):
    """Where curvature is taken and how far to both sides; first nodes left out otherwise [px]."""

    at: float
    half: int
    skip: int


class _Pole(NamedTuple):
    """Centre by row, NaN where it is not, and how near to it a touch is [px]."""

    x: np.ndarray
    y: np.ndarray
    near: float


@njit(cache=True, error_model="numpy")
def _in_frame(x, y, offset, first, last, at, tx, ty):
    """Measured points of nodes first … last − 1 along and across the tangent at node `at` [px].

    (3, nodes); the third row is the cosine between the node's normal and the tangent (tx, ty)'s.
    """
    out = np.empty((3, last - first))
    along, across, cosine = out[0], out[1], out[2]
    for i in range(first, last):
        p, q = max(i - 1, 0), min(i + 1, len(x) - 1)
        nx, ny = y[q] - y[p], x[p] - x[q]
        shrink = 1 / np.sqrt(nx * nx + ny * ny + 1e-18)
        dx = x[i] + offset[i] * nx * shrink - x[at]
        dy = y[i] + offset[i] * ny * shrink - y[at]
        # across: towards the counter-clockwise normal (ty, −tx)
        along[i - first], across[i - first] = dx * tx + dy * ty, dx * ty - dy * tx
        cosine[i - first] = (nx * ty - ny * tx) * shrink
    return out


@njit(cache=True)
def _tangent(x, y, at):
    a = max(at - 5, 0)
    b = min(at + 5, len(x) - 1)
    norm = np.sqrt((x[b] - x[a]) ** 2 + (y[b] - y[a]) ** 2)
    return (x[b] - x[a]) / norm, (y[b] - y[a]) / norm


@njit(cache=True)
def local_polynomial(x, y, offset, information, first, last, at, degree, coefficients, inverse):
    """Weighted least squares of v(u) = Σ c_k u^k around node `at`, u along its tangent [px].

    Returns the window's scale h [px] (the polynomial is in u/h) and the reduced χ².
    `coefficients` (degree + 1,) and `inverse` (covariance for unit χ²) are filled.
    """
    tx, ty = _tangent(x, y, at)
    scale = max(last - at, at - first, 4) * 1.0
    points = _in_frame(x, y, offset, first, last, at, tx, ty)
    points[0] /= scale
    chi2 = _polynomial(points, information[first:last], degree, coefficients, inverse)
    return scale, chi2


@njit(cache=True, error_model="numpy")
def _polynomial(points, information, degree, coefficients, inverse):
    """Weighted least squares of v = Σ c_k u^k; returns the reduced χ².

    points : (3, nodes) u, v and the cosine by which v counts less than across the line.
    """
    size = degree + 1
    moments, rhs = np.zeros(2 * size - 1), np.zeros(size)
    total = 0.0
    count = 0
    for i in range(len(information)):
        if not information[i] > 0:
            continue
        u, v = points[0, i], points[1, i]
        power = information[i] * points[2, i] * points[2, i]
        total += power * v * v
        count += 1
        for k in range(2 * size - 1):
            moments[k] += power
            if k < size:
                rhs[k] += power * v
            power *= u
    matrix = np.empty((size, size))
    for k in range(size):
        for m in range(size):
            matrix[k, m] = moments[k + m]
        matrix[k, k] += 1e-9
    inverse[:size, :size] = np.linalg.inv(matrix)
    misfit = total
    for k in range(size):
        coefficients[k] = 0.0
        for m in range(size):
            coefficients[k] += inverse[k, m] * rhs[m]
        misfit -= coefficients[k] * rhs[k]
    return max(misfit, 0.0) / max(count - size, 1)


@njit(cache=True)
def redness(x, y, offset, information, first, last):
    """Variance of the errors over long stretches of a whisker, over that of white noise.

    A polynomial of NOISE_DEGREE is fitted to the nodes first … last − 1, and the standardised
    residuals are summed over blocks of BLOCK_PX. Returned is the variance of these sums over
    that expected of white residuals of the same fit; NaN where the whisker is too short.
    """
    size = NOISE_DEGREE + 1
    coefficients = np.zeros(size)
    inverse = np.zeros((size, size))
    if (last - first) // BLOCK_PX < size + 3:
        return np.nan
    at = (first + last) // 2
    scale, chi2 = local_polynomial(
        x, y, offset, information, first, last, at, size - 1, coefficients, inverse
    )  # for the constant itself, all would be compiled once more
    points = _in_frame(x, y, offset, first, last, at, *_tangent(x, y, at))
    points[0] /= scale
    between = 0.0
    free = 0.0
    power = np.empty(size)
    sums = np.empty(size)
    for start in range(0, last - first - BLOCK_PX + 1, BLOCK_PX):
        total = 0.0
        count = 0
        sums[:] = 0.0
        for i in range(start, start + BLOCK_PX):
            if information[first + i] <= 0:
                continue
            root = np.sqrt(information[first + i]) * abs(points[2, i])
            power[0] = root
            fitted = coefficients[0] * root
            for k in range(1, size):
                power[k] = power[k - 1] * points[0, i]
                fitted += coefficients[k] * power[k]
            total += root * points[1, i] - fitted
            sums += power
            count += 1
        if count > 0:
            between += total * total / count
            free += 1.0 - sums @ inverse @ sums / count  # the rest the polynomial takes
    if free < 3 or chi2 <= 0:
        return np.nan
    return between / free / chi2


@njit(cache=True)
def _curvature(x, y, offset, information, at, beyond, first, last, degree):
    """Curvature [1/px] `beyond` px after node `at`, its standard error and slope [1/px²]."""
    coefficients = np.zeros(6)
    inverse = np.zeros((6, 6))
    scale, chi2 = local_polynomial(
        x, y, offset, information, first, last, at, degree, coefficients, inverse
    )
    u = beyond / scale
    slope = 0.0
    bend = 0.0
    change = 0.0
    variance = 0.0
    for k in range(1, degree + 1):
        slope += k * coefficients[k] * u ** (k - 1) / scale
        if k >= 2:
            second_k = k * (k - 1) * u ** (k - 2)
            bend += second_k * coefficients[k]
            for m in range(2, degree + 1):
                variance += second_k * m * (m - 1) * u ** (m - 2) * inverse[k, m]
        if k >= 3:
            change += k * (k - 1) * (k - 2) * u ** (k - 3) * coefficients[k]
    to_curvature = 1 / scale**2 / (1 + slope * slope) ** 1.5
    se = np.sqrt(max(variance, 0.0) * max(chi2, 1.0)) * to_curvature
    return bend * to_curvature, se, change / scale * to_curvature


@njit(cache=True)
def _measure_rows(lines, window, pole, n_whiskers, out):
    """Fill `out` (rows, 4): curvature [1/px], its error, its slope [1/px²], `redness`."""
    half = window.half
    for row in range(len(lines.start) - 1):
        a = lines.start[row]
        b = lines.start[row + 1]
        x, y = lines.x[a:b].astype(np.float64), lines.y[a:b].astype(np.float64)
        offset = lines.offset[a:b].astype(np.float64)
        information = lines.information[a:b].astype(np.float64)
        n = b - a
        out[row, :] = np.nan
        if n < FEWEST_NODES:
            continue
        at_node = window.at - lines.hidden[row]
        at = int(np.floor(at_node + 0.5))
        beyond = at_node - at
        if at < 4 or at > n - 5:
            continue
        first = max(at - half, 0)
        last = min(at + half, n)
        end = int(0.9 * n)
        if not np.isnan(pole.x[row]):
            node, distance = nearest_node(x, y, pole.x[row], pole.y[row])
            if distance < pole.near and node > at:
                last = min(last, node)
                end = min(end, node)
        degree = 4 if last - first > 1.4 * half and last - at > half // 4 else 3
        if last - first < 12 or last - at < 4:
            continue
        out[row, 0], out[row, 1], out[row, 2] = _curvature(
            x, y, offset, information, at, beyond, first, last, degree
        )
        if row // n_whiskers % RED_EVERY == 0:
            out[row, 3] = redness(x, y, offset, information, window.skip, end)


def measure(
    centrelines: Centrelines,
    recording: Recording,
    hidden_lengths,
    curvature_at: float,
    params: KinematicsParams,
    pole: PoleTrack | None = None,
) -> pd.DataFrame:
    """Curvature of every row of `centrelines`.

    Parameters
    ----------
    hidden_lengths : one per name in `centrelines.names` [m]: follicle to first visible point;
        used where the centrelines do not bring their own
    curvature_at : arc length from the follicle at which curvature is taken [m]
    params : the room's parameters
    pole : where the pole is; near a touch the curvature window ends at the pole, where the
        bending moment has its kink

    Returns
    -------
    Table with `frame`, `whisker` (index), `curvature_per_m`, `curvature_per_m_se`; NaN where the
    whisker is too short.
    """
    scale, per_mm = recording.pixels_per_m, recording.pixels_per_mm
    hidden = centrelines.hidden_of(np.asarray(hidden_lengths, float) * scale)
    out, (x, y, radius) = np.empty((len(centrelines), 4)), pole_in_rows(pole, centrelines.frame)
    _measure_rows(
        Lines.of(centrelines, hidden),
        _Window(
            curvature_at * scale,
            round(params.curvature_half_window_mm * per_mm),
            round(params.base_skip_mm * per_mm),
        ),
        _Pole(x, y, radius + params.curvature_pole_gap_mm * per_mm),
        len(centrelines.names),
        out,
    )
    se = out[:, 1] * _noise_factor(centrelines, out[:, 3])
    # an error of the hidden length shifts the place, which matters where the curvature changes
    se = np.hypot(se, params.hidden_error_mm * per_mm * out[:, 2])
    return pd.DataFrame(
        {
            "frame": centrelines.frame,
            "whisker": centrelines.whisker,
            "curvature_per_m": out[:, 0] * scale,
            "curvature_per_m_se": se * scale,
        }
    )


def _noise_factor(centrelines, redness):
    """Factor of every row's standard error, for noise that is correlated along the line.

    A codec's noise is, and alike in all frames, so that their median is used. Rods have their own
    calibration on free frames; this one is for frames in which none can be fitted. Without it, 65
    % instead of 95 % of the truths lie within ±1.96 standard errors at a correlation length of 1.5
    px.
    """
    factor = np.ones(len(centrelines))
    for k in range(len(centrelines.names)):
        of_whisker = centrelines.whisker == k
        red = redness[of_whisker]
        if np.isfinite(red).any():
            factor[of_whisker] = np.sqrt(1 + RED_SKEW * max(np.nanmedian(red) - 1, 0.0))
    return factor
