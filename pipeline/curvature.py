"""Centreline → follicle, base angle and curvature at one arc length, with standard errors.

Both come from local polynomials v(u) in a frame laid along the whisker, fitted to the
*unsmoothed* measurements of the centreline (each with its Fisher information), so that the
standard errors follow from the fit and the only smoothing is the window, a physical length.
"""

import numpy as np
import pandas as pd
from numba import njit

from pipeline.follicle import BASE_SKIP_M, BASE_WINDOW_M, base_curve, base_window, walk_back
from pipeline.records import Centrelines, PoleTrack, Recording

BLOCK_PX = 12  # longer than the blocks' noise of compressed video is correlated
WINDOW_M = 3.0e-3  # half-width of the curvature window; a quartic keeps its bias small
POLE_NEAR_M = 0.15e-3  # a pole this near may bend the whisker there: the window ends at it


@njit(cache=True)
def local_polynomial(x, y, offset, information, first, last, at, degree, coefficients, inverse):
    """Weighted least squares of v(u) = Σ c_k u^k around node `at`, u along its tangent [px].

    Returns the window's scale h [px] (the polynomial is in u/h), the reduced χ² and how much
    more variance the residuals' sums over BLOCK_PX nodes have than white noise. `coefficients`
    (degree + 1,) and `inverse` (covariance for unit χ²) are filled.
    """
    size = degree + 1
    a = max(at - 5, 0)
    b = min(at + 5, len(x) - 1)
    tx = x[b] - x[a]
    ty = y[b] - y[a]
    norm = np.sqrt(tx * tx + ty * ty)
    tx /= norm
    ty /= norm
    scale = max(last - at, at - first, 4) * 1.0
    matrix = np.zeros((size, size))
    rhs = np.zeros(size)
    power = np.empty(size)
    total = 0.0
    count = 0
    for i in range(first, last):
        w = information[i]
        if w <= 0:
            continue
        p = max(i - 1, 0)
        q = min(i + 1, len(x) - 1)
        nx = y[q] - y[p]
        ny = -(x[q] - x[p])
        length = max(np.sqrt(nx * nx + ny * ny), 1e-9)
        dx = x[i] + offset[i] * nx / length - x[at]
        dy = y[i] + offset[i] * ny / length - y[at]
        u = (dx * tx + dy * ty) / scale
        v = dx * ty - dy * tx  # towards the counter-clockwise normal (ty, −tx)
        cos = (nx * ty - ny * tx) / length
        w *= cos * cos
        power[0] = 1.0
        for k in range(1, size):
            power[k] = power[k - 1] * u
        for k in range(size):
            rhs[k] += w * power[k] * v
            for m in range(size):
                matrix[k, m] += w * power[k] * power[m]
        total += w * v * v
        count += 1
    for k in range(size):
        matrix[k, k] += 1e-9
    inverse[:size, :size] = np.linalg.inv(matrix)
    for k in range(size):
        coefficients[k] = 0.0
        for m in range(size):
            coefficients[k] += inverse[k, m] * rhs[m]
    misfit = total
    for k in range(size):
        misfit -= coefficients[k] * rhs[k]
    chi2 = max(misfit, 0.0) / max(count - size, 1)
    return (
        scale,
        chi2,
        _redness(x, y, offset, information, first, last, at, tx, ty, scale, degree, coefficients),
    )


@njit(cache=True)
def _redness(x, y, offset, information, first, last, at, tx, ty, scale, degree, coefficients):
    """Variance of block sums of the standardised residuals, over that of white noise."""
    blocks = 0
    between = 0.0
    within = 0.0
    nodes = 0
    i = first
    while i + BLOCK_PX <= last:
        total = 0.0
        m = 0
        for j in range(i, i + BLOCK_PX):
            if information[j] <= 0:
                continue
            p = max(j - 1, 0)
            q = min(j + 1, len(x) - 1)
            nx = y[q] - y[p]
            ny = -(x[q] - x[p])
            length = max(np.sqrt(nx * nx + ny * ny), 1e-9)
            dx = x[j] + offset[j] * nx / length - x[at]
            dy = y[j] + offset[j] * ny / length - y[at]
            u = (dx * tx + dy * ty) / scale
            fitted = 0.0
            for k in range(degree, -1, -1):
                fitted = fitted * u + coefficients[k]
            r = (dx * ty - dy * tx - fitted) * np.sqrt(information[j])
            total += r
            within += r * r
            m += 1
        if m > 0:
            between += total * total / m
            nodes += m
            blocks += 1
        i += BLOCK_PX
    free = blocks - degree - 1  # the polynomial takes as many block sums as it has terms
    if free < 3 or within <= 0:
        return np.nan
    return between / free / (within / nodes)


@njit(cache=True)
def _curvature(x, y, offset, information, at, beyond, first, last, degree):
    """Curvature [1/px] `beyond` px after node `at`, its standard error and the redness."""
    coefficients = np.zeros(6)
    inverse = np.zeros((6, 6))
    scale, chi2, redness = local_polynomial(
        x, y, offset, information, first, last, at, degree, coefficients, inverse
    )
    u = beyond / scale
    slope = 0.0
    bend = 0.0
    variance = 0.0
    for k in range(1, degree + 1):
        slope += k * coefficients[k] * u ** (k - 1) / scale
        if k >= 2:
            second_k = k * (k - 1) * u ** (k - 2)
            bend += second_k * coefficients[k]
            for m in range(2, degree + 1):
                variance += second_k * m * (m - 1) * u ** (m - 2) * inverse[k, m]
    to_curvature = 1 / scale**2 / (1 + slope * slope) ** 1.5
    se = np.sqrt(max(variance, 0.0) * max(chi2, 1.0)) * to_curvature
    return bend * to_curvature, se, redness


@njit(cache=True)
def _nearest_node(x, y, px, py):
    best = 0
    least = 1e18
    for i in range(len(x)):
        d = (x[i] - px) ** 2 + (y[i] - py) ** 2
        if d < least:
            least = d
            best = i
    return best, np.sqrt(least)


@njit(cache=True)
def _measure_rows(
    offsets, xs, ys, raw, info, hidden, at_px, window, skip, base_length, pole_x, pole_y, near, out
):
    for row in range(len(offsets) - 1):
        a = offsets[row]
        b = offsets[row + 1]
        x = xs[a:b]
        y = ys[a:b]
        n = b - a
        out[row, :] = np.nan
        if n < 12:
            continue
        first, last = base_window(n, skip, base_length)
        base = base_curve(x, y, raw[a:b], info[a:b], first, last)
        out[row, 0], out[row, 1], out[row, 2] = walk_back(*base, first + hidden[row])
        at = int(np.floor(at_px - hidden[row] + 0.5))
        beyond = at_px - hidden[row] - at
        if at < 4 or at > n - 5:
            continue
        first = max(at - window, 0)
        last = min(at + window, n)
        if not np.isnan(pole_x[row]):
            node, distance = _nearest_node(x, y, pole_x[row], pole_y[row])
            if distance < near and node > at:
                last = min(last, node)
        degree = 4 if last - first > 1.4 * window and last - at > window // 4 else 3
        if last - first < 12 or last - at < 4:
            continue
        kappa, se, redness = _curvature(x, y, raw[a:b], info[a:b], at, beyond, first, last, degree)
        out[row, 3] = kappa
        out[row, 4] = se
        out[row, 5] = redness


def measure(
    centrelines: Centrelines,
    recording: Recording,
    hidden_lengths,
    curvature_at: float,
    pole: PoleTrack | None = None,
) -> pd.DataFrame:
    """Follicle, base angle and curvature of every row of `centrelines`.

    Parameters
    ----------
    hidden_lengths : one per name in `centrelines.names` [m]: follicle to first visible point;
        used where the centrelines do not bring their own
    curvature_at : arc length from the follicle at which curvature is taken [m]
    pole : where the pole is; near a touch the curvature window ends at the pole, where the
        bending moment has its kink

    Returns
    -------
    Table with `frame`, `whisker` (index), `follicle_x_px`, `follicle_y_px`, `base_angle_deg`,
    `curvature_per_m`, `curvature_per_m_se`; NaN where the whisker is too short to tell.
    """
    scale = recording.pixels_per_m
    rows = len(centrelines)
    hidden = centrelines.hidden_of(np.asarray(hidden_lengths, float) * scale)
    raw, info = centrelines.offset_px, centrelines.information
    if raw is None:
        raw = np.zeros_like(centrelines.x_px)
        info = 1 / np.maximum(centrelines.se_px, 1e-3) ** 2
    pole_x = np.full(rows, np.nan)
    pole_y = np.full(rows, np.nan)
    near = 0.0
    if pole is not None:
        frame = np.minimum(centrelines.frame, len(pole.x_px) - 1)
        pole_x, pole_y = pole.x_px[frame], pole.y_px[frame]
        near = pole.radius_px + POLE_NEAR_M * scale
    out = np.empty((rows, 6))
    _measure_rows(
        centrelines.offsets,
        centrelines.x_px.astype(float),
        centrelines.y_px.astype(float),
        raw.astype(float),
        info.astype(float),
        hidden,
        curvature_at * scale,
        round(WINDOW_M * scale),
        round(BASE_SKIP_M * scale),
        round(BASE_WINDOW_M * scale),
        pole_x,
        pole_y,
        near,
        out,
    )
    for k in range(len(centrelines.names)):
        of_whisker = centrelines.whisker == k
        # compressed video has noise of some range: the same in all frames, told by their median
        redness = out[of_whisker, 5]
        if np.isfinite(redness).any():
            out[of_whisker, 4] *= np.sqrt(max(np.nanmedian(redness), 1.0))
    return pd.DataFrame(
        {
            "frame": centrelines.frame,
            "whisker": centrelines.whisker,
            "follicle_x_px": out[:, 0],
            "follicle_y_px": out[:, 1],
            "base_angle_deg": (np.degrees(out[:, 2]) + 180) % 360 - 180,
            "curvature_per_m": out[:, 3] * scale,
            "curvature_per_m_se": out[:, 4] * scale,
        }
    )
