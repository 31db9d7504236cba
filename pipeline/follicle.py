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

import numpy as np
from numba import njit

from pipeline.records import Centrelines

FARTHEST_M = 3.0e-3  # the fur is not thicker than this
SLIDE_LIMIT_M = 0.5e-3  # the follicle of a head-fixed mouse moves less along the whisker
ORDINARY_SLIDE_M = 0.045e-3  # SD of the slide that is believed whatever the sway
SLIDE_FRAMES = 41  # the slide is a running median and mean over so many frames
APEX_SHARE = 0.5  # weight of the apex against the fur's edge in the hidden length
APEX_TRUSTED_M = 0.2e-3  # differences between the two up to here are ordinary; …
APEX_DOUBTED_M = 0.5e-3  # … from here on the taper is not what the session says
BASE_SKIP_M = 0.25e-3  # fur clings to the first visible part
BASE_WINDOW_M = 4.5e-3  # part of the whisker that the hidden piece is extrapolated from


@njit(cache=True)
def base_curve(x, y, offset, information, first, last):
    """Fit a curve of linear curvature, θ(s) = θ0 + k0 s + k1 s²/2, to the nodes first … last − 1.

    s counts nodes (px) from `first`. Gauss–Newton with the derivatives of the small-angle form.
    Returns x, y [px] and θ0 [rad, counter-clockwise on the screen] at `first`, k0 [1/px] and
    k1 [1/px²].
    """
    ahead = min(first + 8, len(x) - 1)
    theta = np.arctan2(-(y[ahead] - y[first]), x[ahead] - x[first])
    px = x[first]
    py = y[first]
    scale = max(last - first, 4) * 1.0
    k0 = 0.0
    k1 = 0.0
    row = np.empty(4)
    for _ in range(4):
        matrix = np.zeros((4, 4))
        rhs = np.zeros(4)
        mx = px
        my = py
        for i in range(first, last):
            s = i - first
            angle = theta + s * (k0 + 0.5 * k1 * s)
            r = -(x[i] - mx) * np.sin(angle) - (y[i] - my) * np.cos(angle) + offset[i]
            u = s / scale
            row[0] = 1.0
            row[1] = u
            row[2] = 0.5 * u * u
            row[3] = u * u * u / 6
            for k in range(4):
                rhs[k] += information[i] * row[k] * r
                for m in range(4):
                    matrix[k, m] += information[i] * row[k] * row[m]
            middle = theta + (s + 0.5) * (k0 + 0.5 * k1 * (s + 0.5))
            mx += np.cos(middle)
            my -= np.sin(middle)
        for k in range(4):
            matrix[k, k] += 1e-9
        step = np.linalg.solve(matrix, rhs)
        px -= step[0] * np.sin(theta)
        py -= step[0] * np.cos(theta)
        theta += step[1] / scale
        k0 += step[2] / scale**2
        k1 += step[3] / scale**3
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
    step = 0.5
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
        out[row] = apex(thickness[offsets[row] : offsets[row + 1]], skip)


@njit(cache=True)
def _ends(offsets, xs, ys, raw, info, hidden, skip, window, out):
    """Point `hidden` px before each row's first node, on its base curve."""
    for row in range(len(offsets) - 1):
        a = offsets[row]
        b = offsets[row + 1]
        first, last = base_window(b - a, skip, window)
        p = base_curve(xs[a:b], ys[a:b], raw[a:b], info[a:b], first, last)
        out[row, 0], out[row, 1], _ = walk_back(*p, first + hidden[row])


@njit(cache=True)
def _across(offsets, xs, ys, raw, info, rows, feet, anchors, whisker, skip, window):
    """Distance of each row's follicle from its anchor, across the whisker [px]."""
    out = np.empty(len(rows))
    for i in range(len(rows)):
        a = offsets[rows[i]]
        b = offsets[rows[i] + 1]
        first, last = base_window(b - a, skip, window)
        p = base_curve(xs[a:b], ys[a:b], raw[a:b], info[a:b], first, last)
        x, y, angle = walk_back(*p, first + feet[i])
        k = whisker[rows[i]]
        out[i] = -(x - anchors[k, 0]) * np.sin(angle) - (y - anchors[k, 1]) * np.cos(angle)
    return out


@njit(cache=True)
def _feet(offsets, xs, ys, raw, info, anchors, skip, window, farthest, out):
    """Hidden length of each row whose follicle is the point nearest to the anchor."""
    for row in range(len(offsets) - 1):
        a = offsets[row]
        b = offsets[row + 1]
        first, last = base_window(b - a, skip, window)
        p = base_curve(xs[a:b], ys[a:b], raw[a:b], info[a:b], first, last)
        out[row] = _nearest_on_base(*p, anchors[row, 0], anchors[row, 1], first, farthest)


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
        self.skip = round(BASE_SKIP_M * pixels_per_m)
        self.window = round(BASE_WINDOW_M * pixels_per_m)
        self.farthest = FARTHEST_M * pixels_per_m
        self.slide_limit = SLIDE_LIMIT_M * pixels_per_m
        self.ordinary_slide = ORDINARY_SLIDE_M * pixels_per_m
        ends = np.full((len(samples), 2), np.nan)
        _ends(
            *self._points(samples), self.hidden_px[samples.whisker], self.skip, self.window, ends
        )
        self.anchors = _medians(ends, samples.whisker, len(samples.names))
        self.cone_px = None if cone_px is None else np.asarray(cone_px, float)
        self.limits = np.array([APEX_TRUSTED_M, APEX_DOUBTED_M]) * pixels_per_m
        self.reach = np.full(len(samples.names), np.nan)
        self.correction = np.zeros(len(samples.names))
        self.slides = [
            _Slide(self.slide_limit, self.ordinary_slide) for _ in range(len(samples.names))
        ]

    def hidden(self, lines: Centrelines) -> np.ndarray:
        """Hidden length of every row [px], float64 (rows,); call it with a video's chunks in turn.

        The first chunk in which a whisker is seen sets the apex that its slides are counted from.
        """
        feet = self._feet(lines)
        reach = self._apexes(lines) + feet
        out = np.empty(len(lines))
        for k in range(len(lines.names)):
            rows = np.flatnonzero(lines.whisker == k)
            if len(rows) and not np.isfinite(self.reach[k]):
                self._set_reach(k, reach[rows])
            sway = self._sideways(lines, rows, feet[rows])
            slide = self.slides[k].follow(self.reach[k] - reach[rows], sway)
            out[rows] = feet[rows] + slide + self.correction[k]
        return np.clip(out, 0.0, self.farthest)

    def _set_reach(self, k, reach):
        reach = reach[np.isfinite(reach)]
        if len(reach):
            self.reach[k] = np.median(reach)
            if self.cone_px is not None:
                off = self.cone_px[k] - self.reach[k]
                self.correction[k] = off * APEX_SHARE * np.interp(abs(off), self.limits, [1, 0])

    def _sideways(self, lines, rows, feet):
        """How far the follicle stands off its anchor across the whisker [px]; (rows,)."""
        if not len(rows):
            return np.zeros(0)
        return _across(*self._points(lines), rows, feet, self.anchors, lines.whisker,
                       self.skip, self.window)  # fmt: skip

    def _points(self, lines):
        info = lines.information.astype(float)
        arrays = (
            lines.x_px.astype(float),
            lines.y_px.astype(float),
            lines.offset_px.astype(float),
        )
        return (lines.offsets, *arrays, info)

    def _feet(self, lines):
        out = np.empty(len(lines))
        anchors = self.anchors[lines.whisker]
        _feet(*self._points(lines), anchors, self.skip, self.window, self.farthest, out)
        nominal = self.hidden_px[lines.whisker]
        return np.where(np.isfinite(out), np.clip(out, 0, self.farthest), nominal)

    def _apexes(self, lines):
        out = np.empty(len(lines))
        _apexes(lines.offsets, lines.thickness_px.astype(float), self.skip, out)
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
    for average in (np.median, np.mean):
        padded = np.pad(values, half, mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, SLIDE_FRAMES)
        values = average(windows, axis=1)
    return values


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
