"""Two lines that cross: each must go on with its own far part, and not with the other's.

Where whiskers cross at a small angle, lines may turn off onto each other there. A whisker is
smooth: with its own far part it is nearly a parabola, and with the other's it has a bend. One that
the pole bends is no parabola, yet smooth on either side of the crossing; two that cross flatly are
smooth there either way, and only the whole lines tell. So the crossing is looked at from near by
and from farther away, and where the two ways differ most decides. While two lines lie upon each
other, neither is seen well: that stretch is left out, however long it is.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.numerics.polyline import nearest_nodes
from pipeline.session.quantities import pixels_in

MUCH_BETTER = 0.5  # part of the other way's misfit: that much less decides
LEAST_MISFIT = 0.02  # px², mean square: less is noise
TERMS = 4  # of the polynomial along the chord
PER_NODE = ("x", "y", "amplitude", "information", "score", "thickness")
STRIDE = 40  # nodes, from which on not all are looked at


class Reach(NamedTuple):
    """How much of two lines about their crossing counts.

    Attributes
    ----------
    near : distance at which lines cross or touch [px]
    least : nodes on either side of the crossing
    hidden : distance up to which both lie upon each other [px]
    local : nodes on either side that are looked at first, then twice as many, then all
    """

    near: float
    least: int
    hidden: float
    local: int

    @classmethod
    def of(cls, params, pixels_per_m) -> "Reach":
        """As the room's parameters say, for a scale."""
        lengths = params.crossing_least_mm, params.crossing_reach_mm
        least, local = (max(round(pixels_in(each, pixels_per_m)), TERMS) for each in lengths)
        near = pixels_in(params.crossing_mm, pixels_per_m)
        return cls(near, least, params.crossing_hidden_px, local)


@njit(cache=True)
def tails_exchanged(x, y, n, other_x, other_y, m, near):
    """Nodes (i, j) after which two lines have each other's far parts; (−1, −1) for none.

    near : `Reach`
    """
    i, j = nearest_nodes(x, y, n, other_x, other_y, m, near.near, near.least)
    if i < 0:
        return -1, -1
    a, b = _apart(x, y, n, i, other_x, other_y, m, j, -1, near.hidden)
    c, d = _apart(x, y, n, i, other_x, other_y, m, j, 1, near.hidden)
    if min(a, b, n - c, m - d) < near.least:
        return -1, -1
    kept = changed = 0.0
    for reach in (near.local, 2 * near.local, max(n, m)):
        stride = max(reach // STRIDE, 1)
        one, one_tail = max(a - reach, 0), min(c + reach, n)
        two, two_tail = max(b - reach, 0), min(d + reach, m)
        now = _misfit(x, y, one, a, x, y, c, one_tail, stride)
        now += _misfit(other_x, other_y, two, b, other_x, other_y, d, two_tail, stride)
        then = _misfit(x, y, one, a, other_x, other_y, d, two_tail, stride)
        then += _misfit(other_x, other_y, two, b, x, y, c, one_tail, stride)
        if abs(now - then) > abs(kept - changed):
            kept, changed = now, then
    exchanged = kept > LEAST_MISFIT and changed < MUCH_BETTER * kept
    return (i, j) if exchanged else (-1, -1)


@njit(cache=True)
def _apart(x, y, n, i, other_x, other_y, m, j, step, hidden):
    """The nodes next to i and j from which on two lines are more than `hidden` px apart.

    step : 1 towards the tips, −1 towards the bases
    """
    while 0 < i < n - 1 and 0 < j < m - 1:
        i += step
        apart = np.hypot(x[i] - other_x[j], y[i] - other_y[j])
        while 0 < j < m - 1:
            after = np.hypot(x[i] - other_x[j + step], y[i] - other_y[j + step])
            if after > apart:
                break
            j, apart = j + step, after
        if apart > hidden:
            break
    return i, j


@njit(cache=True)
def _misfit(x, y, start, i, tail_x, tail_y, j, end, stride):
    """Mean square distance [px²] of nodes start … i − 1 and j … end − 1 from a smooth curve.

    Every `stride`-th of them is looked at.
    """
    first, count = i - start, 0
    x0, y0 = x[start], y[start]
    ux, uy = tail_x[end - 1] - x0, tail_y[end - 1] - y0
    norm = max(np.hypot(ux, uy), 1e-9)
    ux, uy = ux / norm, uy / norm
    gram, right, total = np.zeros((TERMS, TERMS)), np.zeros(TERMS), 0.0
    powers = np.empty(TERMS)
    for k in range(0, first + end - j, stride):
        count += 1
        if k < first:
            dx, dy = x[start + k] - x0, y[start + k] - y0
        else:
            dx, dy = tail_x[j + k - first] - x0, tail_y[j + k - first] - y0
        s, v = (dx * ux + dy * uy) / norm, dx * uy - dy * ux
        powers[0] = 1.0
        for a in range(1, TERMS):
            powers[a] = powers[a - 1] * s
        for a in range(TERMS):
            right[a] += powers[a] * v
            for b in range(a + 1):
                gram[a, b] += powers[a] * powers[b]
        total += v * v
    for a in range(TERMS):
        gram[a, a] += 1e-9 * count
        for b in range(a):
            gram[b, a] = gram[a, b]
    found = np.linalg.solve(gram, right)
    return max(total - np.dot(found, right), 0.0) / count


def uncross(one, other, reach: Reach):
    """Give two `detection.Line`s their own far parts back, in place.

    Returns copies of both as they were; None where they have their own.
    """
    i, j = tails_exchanged(one.x, one.y, one.n, other.x, other.y, other.n, reach)
    if i < 0:
        return None
    before = one.copy(), other.copy()
    n, m = one.n, other.n
    for name in PER_NODE:
        mine, theirs = getattr(one, name), getattr(other, name)
        tail = mine[i:n].copy()
        mine[i : i + m - j] = theirs[j:m]
        theirs[j : j + n - i] = tail
    one.n, other.n = i + m - j, j + n - i
    for line in (one, other):
        line.amplitude[line.n :] = line.amplitude[line.n - 1]
    return before
