"""Where the follicle is: how much of the whisker the fur hides, frame by frame.

session.toml has one hidden length, from follicle to first visible point. But as the whisker turns,
it crosses the edge of the fur at another distance from the follicle. So the follicle is anchored:
with the constant hidden length, its place is computed in frames from the whole video, and the
median is the anchor. In each frame, a curve through the base's nodes is extrapolated past the
anchor, and its nearest point is the follicle. That curve is rough: when arc lengths are known from
it, `base_curves` fits the base anew, with its noise.
"""

from dataclasses import replace

import numpy as np
from numba import njit

from pipeline.numerics.cholesky import factorise, solve
from pipeline.session.parameters import KinematicsParams
from pipeline.tables.centrelines import Centrelines

FEWEST_NODES = 12  # of a row whose follicle can be estimated
MOST_STEPS, SHORT_STEP_PX = 4, 1e-3  # of Gauss–Newton; what follows is far shorter


@njit(cache=True, inline="always")
def _turned(cos, sin, by):
    """Cosine and sine of an angle increased by `by` [rad, small]."""
    square = by * by
    c = 1.0 - square * (0.5 - square / 24)
    s = by * (1.0 - square * (1 / 6 - square / 120))
    return cos * c - sin * s, sin * c + cos * s


@njit(cache=True)
def _rough_equations(x, y, offset, information, first, last, curve, matrix, rhs):
    """Normal equations of the small-angle form about a `curve` (x, y, θ0, k0, k1).

    Unknowns are the offset [px] and, over the window, what θ0, k0 and k1 turn to in offsets.
    """
    mx, my, theta, k0, k1 = curve
    per_node = 1.0 / max(last - first, 4)
    cos, sin = np.cos(theta), np.sin(theta)
    matrix[:] = 0.0
    rhs[:] = 0.0
    for i in range(first, last):
        s = float(i - first)
        r = -(x[i] - mx) * sin - (y[i] - my) * cos + offset[i]
        u = s * per_node
        row = (1.0, u, 0.5 * u * u, u * u * u / 6)
        for k in range(4):
            weighted = information[i] * row[k]
            rhs[k] += weighted * r
            for m in range(k + 1):
                matrix[k, m] += weighted * row[m]
        # half a node on is the chord's direction
        cos, sin = _turned(cos, sin, 0.5 * (k0 + k1 * (s + 0.25)))
        mx += cos
        my -= sin
        cos, sin = _turned(cos, sin, 0.5 * (k0 + k1 * (s + 0.75)))
    for k in range(4):
        matrix[k, k] += 1e-9


@njit(cache=True)
def rough_base(x, y, offset, information, first, last):
    """Fit a curve of linear curvature, θ(s) = θ0 + k0 s + k1 s²/2, to the nodes first … last − 1.

    s counts nodes (px) from `first`. Gauss–Newton with the derivatives of the small-angle form.
    Returns x, y [px] and θ0 [rad, counter-clockwise on the screen] at `first`, k0 [1/px] and
    k1 [1/px²].
    """
    ahead = min(first + 8, len(x) - 1)
    theta = np.arctan2(-(y[ahead] - y[first]), x[ahead] - x[first])
    px, py = float(x[first]), float(y[first])
    scale = max(last - first, 4) * 1.0
    k0 = 0.0
    k1 = 0.0
    matrix, lower = np.empty((2, 4, 4))
    step = np.empty(4)
    for _ in range(MOST_STEPS):
        curve = (px, py, theta, k0, k1)
        _rough_equations(x, y, offset, information, first, last, curve, matrix, step)
        factorise(matrix, 4, lower)
        solve(lower, 4, step)
        px -= step[0] * np.sin(theta)
        py -= step[0] * np.cos(theta)
        theta += step[1] / scale
        k0 += step[2] / scale**2
        k1 += step[3] / scale**3
        if np.max(np.abs(step)) < SHORT_STEP_PX:
            break
    return px, py, theta, k0, k1


@njit(cache=True)
def walk_back(px, py, theta, k0, k1, distance):
    """Point [px] and angle [rad] on a rough base, `distance` px of arc before its start."""
    s = 0.0
    while s > -distance:
        h = min(1.0, distance + s)
        middle = theta + (s - 0.5 * h) * (k0 + 0.5 * k1 * (s - 0.5 * h))
        px -= h * np.cos(middle)
        py += h * np.sin(middle)
        s -= h
    return px, py, theta + s * (k0 + 0.5 * k1 * s)


@njit(cache=True)
def base_window(n, skip, window):
    """First and one-past-last node that the hidden piece is extrapolated from."""
    first = min(skip, n // 4)
    return first, min(first + window, n)


@njit(cache=True)
def _nearest_on_base(px, py, theta, k0, k1, ax, ay, first, farthest):
    """Arc length [px] before node 0 of the rough base's point that is nearest to an anchor."""
    best = 0.0
    least = 1e18
    s = 0.0
    x = px
    y = py
    step = 2.0  # px; the base hardly bends over so much
    while -s < first + farthest:
        d = (x - ax) ** 2 + (y - ay) ** 2
        angle = theta + s * (k0 + 0.5 * k1 * s)
        if d < least:
            least = d
            # the foot of the perpendicular, to first order
            best = -s - ((ax - x) * np.cos(angle) - (ay - y) * np.sin(angle))
        middle = theta + (s - 0.5 * step) * (k0 + 0.5 * k1 * (s - 0.5 * step))
        x -= step * np.cos(middle)
        y += step * np.sin(middle)
        s -= step
    return best - first


@njit(cache=True)
def _rough_bases(offsets, xs, ys, raw, info, skip, window):
    """Every row's first node of the base window, and `rough_base` there; (rows, 6)."""
    out = np.full((len(offsets) - 1, 6), np.nan)
    for row in range(len(out)):
        a = offsets[row]
        b = offsets[row + 1]
        if b - a < FEWEST_NODES:
            continue
        first, last = base_window(b - a, skip, window)
        out[row, 0] = first
        b = min(b, a + max(last, first + 9))
        out[row, 1], out[row, 2], out[row, 3], out[row, 4], out[row, 5] = rough_base(
            xs[a:b].astype(np.float64), ys[a:b].astype(np.float64), raw[a:b].astype(np.float64),
            info[a:b].astype(np.float64), first, last,
        )  # fmt: skip
    return out


@njit(cache=True)
def _ends(curves, hidden):
    """Point and angle `hidden` px before each row's first node, on its rough base; (rows, 3)."""
    out = np.full((len(curves), 3), np.nan)
    for row in range(len(curves)):
        first, x, y, theta, k0, k1 = curves[row]
        if not np.isnan(first):
            out[row] = walk_back(x, y, theta, k0, k1, first + hidden[row])
    return out


@njit(cache=True)
def _feet(curves, anchors, farthest, out):
    """Hidden length of each row whose follicle is the point nearest to the anchor."""
    for row in range(len(curves)):
        first, x, y, theta, k0, k1 = curves[row]
        ax, ay = anchors[row]
        out[row] = _nearest_on_base(x, y, theta, k0, k1, ax, ay, first, farthest)


def rough_bases(lines: Centrelines, pixels_per_m: float, params: KinematicsParams) -> np.ndarray:
    """Every row's first node of the base window, and `rough_base` there; (rows, 6).

    NaN where the row is too short.
    """
    per_mm = 1e-3 * pixels_per_m
    skip, window = round(params.base_skip_mm * per_mm), round(params.base_window_mm * per_mm)
    return _rough_bases(lines.offsets, lines.x_px, lines.y_px, *lines.raw(), skip, window)


def follicles(
    lines: Centrelines, hidden, pixels_per_m: float, params: KinematicsParams
) -> np.ndarray:
    """Place [px] and angle [rad] of every row's follicle, (rows, 3), `hidden` px before the row.

    NaN where the row is too short.
    """
    return _ends(rough_bases(lines, pixels_per_m, params), hidden)


class FollicleFinder:
    """Hidden lengths of a video's whiskers, anchored on frames taken from all of it.

    Parameters
    ----------
    samples : Centrelines of frames from the whole video
    hidden_px : per name in `samples.names`, the session's hidden length [px]
    pixels_per_m : scale
    params : the room's parameters
    """

    def __init__(
        self, samples: Centrelines, hidden_px, pixels_per_m: float, params: KinematicsParams
    ):
        self.hidden_px = np.asarray(hidden_px, float)
        self.pixels_per_m, self.params = pixels_per_m, params
        ends = follicles(samples, self.hidden_px[samples.whisker], pixels_per_m, params)
        self.anchors = _medians(ends[:, :2], samples.whisker, len(samples.names))

    def place(self, lines: Centrelines) -> Centrelines:
        """Return the lines with the hidden length of every row."""
        curves = rough_bases(lines, self.pixels_per_m, self.params)
        farthest = 1e-3 * self.params.hidden_most_mm * self.pixels_per_m
        out = np.empty(len(lines))
        _feet(curves, self.anchors[lines.whisker], farthest, out)
        out = np.where(np.isfinite(out), out, self.hidden_px[lines.whisker])
        return replace(lines, hidden_px=np.clip(out, 0.0, farthest))


def _medians(values, whisker, n):
    """Median of the rows (k, …) of each of `n` whiskers; NaN for one that has none."""
    out = np.full((n, values.shape[1]), np.nan)
    for k in range(n):
        rows = values[whisker == k]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows):
            out[k] = np.median(rows, axis=0)
    return out
