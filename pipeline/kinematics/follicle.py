"""Where the follicle is: how much of the whisker the fur hides, frame by frame.

The session tells the hidden length, follicle to first visible point, once. But the fur's edge
is crossed elsewhere when the whisker leaves the face obliquely, and the follicle itself moves.
So the follicle is anchored: its place is the median, over frames from the whole video, of what
the constant hidden length gives. In each frame the base's extrapolated curve passes the anchor,
and the nearest point is the follicle. Movement along the whisker, to which that is blind, shows
in the taper: a whisker's thickness falls linearly to zero at the apex, which slides with the
follicle. Where the cone's length is known, the apex tells the hidden length as well as the fur's
edge does (each to some 0.05 mm), and the two are averaged, as long as they agree.
"""

from dataclasses import replace

import numpy as np
from numba import njit
from scipy import ndimage

from pipeline.tables.centrelines import Centrelines

FARTHEST_M = 3.0e-3  # the fur is not thicker than this
SLIDE_LIMIT_M = 0.5e-3  # the follicle of a head-fixed mouse moves less along the whisker
ORDINARY_SLIDE_M = 0.045e-3  # SD of the slide that is believed whatever the sway
SLIDE_FRAMES = 41  # the slide is a running median and mean over so many frames
APEX_SHARE = 0.5  # weight of the apex against the fur's edge in the hidden length
APEX_TRUSTED_M = 0.2e-3  # differences between the two up to here are ordinary; …
APEX_DOUBTED_M = 0.5e-3  # … from here on the taper is not what the session says
BASE_SKIP_M = 0.25e-3  # fur clings to the first visible part
BASE_WINDOW_M = 4.5e-3  # part of the whisker that the hidden piece is extrapolated from
FEWEST_NODES = 12  # of a row that tells where the follicle is
MOST_STEPS, SHORT_STEP_PX = 4, 1e-3  # of Gauss–Newton; what follows is far shorter


@njit(cache=True, inline="always")
def _turned(cos, sin, by):
    """Cosine and sine of an angle that is `by` [rad, small] larger."""
    square = by * by
    c = 1.0 - square * (0.5 - square / 24)
    s = by * (1.0 - square * (1 / 6 - square / 120))
    return cos * c - sin * s, sin * c + cos * s


@njit(cache=True)
def _solve(matrix, rhs):
    """Solve the symmetric positive definite `matrix` (its upper part) for `rhs`, in place."""
    n = len(rhs)
    for i in range(n):
        for k in range(i + 1, n):
            factor = matrix[i, k] / matrix[i, i]
            for m in range(k, n):
                matrix[k, m] -= factor * matrix[i, m]
            rhs[k] -= factor * rhs[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            rhs[i] -= matrix[i, k] * rhs[k]
        rhs[i] /= matrix[i, i]


@njit(cache=True)
def _base_equations(x, y, offset, information, first, last, curve, matrix, rhs):
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
            for m in range(k, 4):
                matrix[k, m] += weighted * row[m]
        # half a node on is the chord's direction
        cos, sin = _turned(cos, sin, 0.5 * (k0 + k1 * (s + 0.25)))
        mx += cos
        my -= sin
        cos, sin = _turned(cos, sin, 0.5 * (k0 + k1 * (s + 0.75)))
    for k in range(4):
        matrix[k, k] += 1e-9


@njit(cache=True)
def base_curve(x, y, offset, information, first, last):
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
    matrix = np.empty((4, 4))
    step = np.empty(4)
    for _ in range(MOST_STEPS):
        curve = (px, py, theta, k0, k1)
        _base_equations(x, y, offset, information, first, last, curve, matrix, step)
        _solve(matrix, step)
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
    """Point [px] and angle [rad] on a base curve, `distance` px of arc before its start."""
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
    """Arc length [px] before node 0 of the base curve's point that is nearest to an anchor."""
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
def apex(thickness, skip):
    """Node at which a line's thickness, linear in the node number, is zero; NaN unless clear.

    thickness : (nodes,) [px], NaN where it could not be measured. Two passes; nodes that are off
    by more than three mean deviations in the first are left out of the second.
    """
    n = len(thickness)
    last = int(0.9 * n)  # at the tip, little contrast is left and the noise's threshold biases
    intercept = 0.0
    slope = 0.0
    limit = 1e18
    for _ in range(2):
        count = s1 = s2 = t0 = t1 = 0.0
        for i in range(skip, last):
            t = thickness[i]
            if np.isnan(t) or abs(t - intercept - slope * i) > limit:
                continue
            count += 1.0
            s1 += i
            s2 += i * i
            t0 += t
            t1 += t * i
        if count < 60:
            return np.nan
        det = count * s2 - s1 * s1
        slope = (count * t1 - s1 * t0) / det
        intercept = (t0 - slope * s1) / count
        off = 0.0
        m = 0
        for i in range(skip, last):
            if not np.isnan(thickness[i]):
                off += abs(thickness[i] - intercept - slope * i)
                m += 1
        limit = 3 * off / max(m, 1)
    if slope >= -1e-6:
        return np.nan
    return -intercept / slope


@njit(cache=True)
def _apexes(offsets, thickness, skip, out):
    for row in range(len(offsets) - 1):
        out[row] = apex(thickness[offsets[row] : offsets[row + 1]].astype(np.float64), skip)


@njit(cache=True)
def _base_curves(offsets, xs, ys, raw, info, skip, window):
    """Every row's first node of the base window, and `base_curve` there; (rows, 6)."""
    out = np.full((len(offsets) - 1, 6), np.nan)
    for row in range(len(out)):
        a = offsets[row]
        b = offsets[row + 1]
        if b - a < FEWEST_NODES:
            continue
        first, last = base_window(b - a, skip, window)
        out[row, 0] = first
        b = min(b, a + max(last, first + 9))
        out[row, 1], out[row, 2], out[row, 3], out[row, 4], out[row, 5] = base_curve(
            xs[a:b].astype(np.float64), ys[a:b].astype(np.float64), raw[a:b].astype(np.float64),
            info[a:b].astype(np.float64), first, last,
        )  # fmt: skip
    return out


@njit(cache=True)
def _ends(curves, hidden):
    """Point and angle `hidden` px before each row's first node, on its base curve; (rows, 3)."""
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


def base_curves(lines: Centrelines, pixels_per_m: float) -> np.ndarray:
    """Every row's first node of the base window, and `base_curve` there; (rows, 6).

    NaN where the row is too short to tell.
    """
    skip, window = round(BASE_SKIP_M * pixels_per_m), round(BASE_WINDOW_M * pixels_per_m)
    return _base_curves(lines.offsets, lines.x_px, lines.y_px, *lines.raw(), skip, window)


def follicles(lines: Centrelines, hidden, pixels_per_m: float) -> np.ndarray:
    """Place [px] and angle [rad] of every row's follicle, (rows, 3), `hidden` px before the row.

    NaN where the row is too short to tell.
    """
    return _ends(base_curves(lines, pixels_per_m), hidden)


class FollicleFinder:
    """Hidden lengths of a video's whiskers, anchored on frames taken from all of it.

    Parameters
    ----------
    samples : Centrelines of frames from the whole video
    hidden_px : per name in `samples.names`, the session's hidden length [px]
    pixels_per_m : scale
    cone_px : per name, follicle → apex [px]; None where unknown
    """

    def __init__(self, samples: Centrelines, hidden_px, pixels_per_m: float, cone_px=None):
        self.hidden_px = np.asarray(hidden_px, float)
        self.pixels_per_m = pixels_per_m
        self.skip = round(BASE_SKIP_M * pixels_per_m)
        self.farthest = FARTHEST_M * pixels_per_m
        self.slide_limit = SLIDE_LIMIT_M * pixels_per_m
        self.ordinary_slide = ORDINARY_SLIDE_M * pixels_per_m
        ends = follicles(samples, self.hidden_px[samples.whisker], pixels_per_m)
        self.anchors = _medians(ends[:, :2], samples.whisker, len(samples.names))
        self.cone_px = None if cone_px is None else np.asarray(cone_px, float)
        self.limits = np.array([APEX_TRUSTED_M, APEX_DOUBTED_M]) * pixels_per_m
        self.reach = np.full(len(samples.names), np.nan)
        self.correction = np.zeros(len(samples.names))
        self.slides = [
            _Slide(self.slide_limit, self.ordinary_slide) for _ in range(len(samples.names))
        ]

    def place(self, lines: Centrelines) -> Centrelines:
        """Return the lines with hidden lengths and follicles; call it with the chunks in turn.

        The first chunk in which a whisker is seen sets the apex that its slides are counted from.
        """
        curves = base_curves(lines, self.pixels_per_m)
        hidden = self._hidden(lines, curves)
        return replace(lines, hidden_px=hidden, follicle=_ends(curves, hidden))

    def _hidden(self, lines, curves):
        """Hidden length of every row [px], float64 (rows,)."""
        feet = self._feet(lines, curves)
        reach = self._apexes(lines) + feet
        sway = self._sideways(lines, curves, feet)
        out = np.empty(len(lines))
        for k in range(len(lines.names)):
            rows = np.flatnonzero(lines.whisker == k)
            if len(rows) and not np.isfinite(self.reach[k]):
                self._set_reach(k, reach[rows])
            slide = self.slides[k].follow(self.reach[k] - reach[rows], sway[rows])
            out[rows] = feet[rows] + slide + self.correction[k]
        return np.clip(out, 0.0, self.farthest)

    def _set_reach(self, k, reach):
        reach = reach[np.isfinite(reach)]
        if len(reach):
            self.reach[k] = np.median(reach)
            if self.cone_px is not None:
                off = self.cone_px[k] - self.reach[k]
                self.correction[k] = off * APEX_SHARE * np.interp(abs(off), self.limits, [1, 0])

    def _sideways(self, lines, curves, feet):
        """How far the follicle stands off its anchor across the whisker [px]; (rows,)."""
        x, y, angle = _ends(curves, feet).T
        ax, ay = self.anchors[lines.whisker].T
        return -(x - ax) * np.sin(angle) - (y - ay) * np.cos(angle)

    def _feet(self, lines, curves):
        out = np.empty(len(lines))
        _feet(curves, self.anchors[lines.whisker], self.farthest, out)
        nominal = self.hidden_px[lines.whisker]
        return np.where(np.isfinite(out), np.clip(out, 0, self.farthest), nominal)

    def _apexes(self, lines):
        out = np.empty(len(lines))
        _apexes(lines.offsets, lines.thickness_px, self.skip, out)
        return out


def _medians(values, whisker, n):
    """Median of the rows (k, …) of each of `n` whiskers; NaN for one that has none."""
    out = np.full((n, values.shape[1]), np.nan)
    for k in range(n):
        rows = values[whisker == k]
        rows = rows[np.isfinite(rows).all(axis=1)]
        if len(rows):
            out[k] = np.median(rows, axis=0)
    return out


def _running(values):
    """Running median, then mean, over SLIDE_FRAMES; the values themselves where they are fewer."""
    if len(values) < SLIDE_FRAMES:
        return values
    half = SLIDE_FRAMES // 2
    middle = ndimage.median_filter(values, SLIDE_FRAMES, mode="mirror")
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(middle, half, mode="reflect"), SLIDE_FRAMES
    )
    return windows.mean(axis=1)


class _Slide:
    """A whisker's slide [px], smoothed, and believed as far as it is not much above its sway.

    The follicle moves along the whisker about as much as across it, which is measured far
    better; a slide that is much larger is noise of the taper (compressed video) for the most
    part. How much is believed rests on all frames so far, and what is smoothed reaches back into
    the chunk before, so that nothing jumps where a chunk ends.
    """

    def __init__(self, limit, ordinary):
        self.limit, self.ordinary = limit, ordinary
        self.before = np.empty((2, 0))  # the last slides and sways
        self.sums = np.zeros((3, 2))  # number, sum and sum of squares of both
        self.share = None  # believed at the last frame

    def follow(self, slide, sway) -> np.ndarray:
        """Slide to believe in the next frames, (frames,); zero where nothing is known of it."""
        both = np.concatenate([self.before, np.stack([slide, sway])], axis=1)
        start = self.before.shape[1]
        self.before = both[:, -SLIDE_FRAMES:]
        known = np.isfinite(both[0]) & (np.abs(both[0]) < 3 * self.limit)
        if known.sum() < SLIDE_FRAMES:
            return np.zeros(len(slide))
        every = np.arange(both.shape[1])
        both[0] = np.interp(every, every[known], both[0, known])
        smooth = np.stack([_running(each)[start:] for each in both])
        self.sums += [np.full(2, smooth.shape[1]), smooth.sum(axis=1), (smooth**2).sum(axis=1)]
        mean = self.sums[1] / self.sums[0]
        slides, sways = self.sums[2] / self.sums[0] - mean**2
        share = min(1.0, (sways + self.ordinary**2) / max(slides, 1e-6))
        shares = np.linspace(self.share or share, share, len(slide))
        self.share = share
        return np.clip(shares * smooth[0], -self.limit, self.limit)
