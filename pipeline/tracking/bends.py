"""How much lines bend along their length, and how much a whisker may."""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection import line_fit
from pipeline.numerics.polyline import bilinear


class Bends(NamedTuple):
    """How far a whisker's line may turn: in all, and in its first `hook` nodes [rad]."""

    largest: float
    hook: int
    at_hook: float


@njit(cache=True)
def is_like_a_whisker(values, n, before, m, outside, off_edges, base_gap, bends):
    """Whether a line leaves the face, is bent as whiskers are, and begins where it was before.

    values, before : of the `Line` and of the one before, with `n` and `m` nodes
    base_gap : how far from the face its base may be [px], and half as far from the line before;
        along that line it may be anywhere, as the edge of the fur is
    bends : `Bends`
    """
    x, y, before_x, before_y = values[0], values[1], before[0], before[1]
    return (
        bilinear(outside, x[0], y[0]) <= base_gap
        and min(
            _distance(x[0], y[0], before_x, before_y, m),
            _distance(before_x[0], before_y[0], x, y, n),
        )
        <= 0.5 * base_gap
        and turning_range(x, y, n) <= bends.largest
        and not hooked(x, y, n, bends)
        and line_fit.is_clear(x, y, n, off_edges)
    )


@njit(cache=True)
def _distance(x, y, line_x, line_y, n):
    """Distance of a point from the nodes of a line's nearer half [px]."""
    least = np.inf
    for i in range(n // 2 + 1):
        dx, dy = x - line_x[i], y - line_y[i]
        least = min(least, dx * dx + dy * dy)
    return np.sqrt(least)


@njit(cache=True)
def hooked(x, y, n, bends):
    """Whether a line turns sharply near its base: there it follows fur, not a whisker."""
    return turning_range(x, y, min(n, bends.hook)) > bends.at_hook


@njit(cache=True)
def turning_range(x, y, n):
    """Largest less smallest direction along a line, over chords of 10 nodes [rad]."""
    low = 0.0
    high = 0.0
    total = 0.0
    for i in range(10, n - 10, 5):
        ax = x[i] - x[i - 10]
        ay = y[i] - y[i - 10]
        bx = x[i + 5] - x[i - 5]
        by = y[i + 5] - y[i - 5]
        along, across = ax * bx + ay * by, ax * by - ay * bx
        if abs(across) < 0.2 * along:  # by the arctangent's series, to a millionth
            t = across / along
            total += t * (1 - t * t * (1 / 3 - t * t * (1 / 5 - t * t * (1 / 7))))
        else:
            total += np.arctan2(across, along)
        low = min(low, total)
        high = max(high, total)
    return high - low
