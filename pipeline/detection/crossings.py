"""Two lines that cross: each must go on with its own far part, and not with the other's.

Where whiskers cross at a small angle, lines may turn off onto each other there. A whisker is
smooth: with its own far part it is nearly a parabola, and with the other's it has a bend. One that
the pole bends is no parabola, yet smooth on either side of the crossing; so what is near the
crossing decides, and the whole lines only where they cross too flatly for that.
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
    gap : nodes left out where both lie upon each other
    local : nodes on either side that decide where they can, then twice as many, then all
    """

    near: float
    least: int
    gap: int
    local: int

    @classmethod
    def of(cls, params, pixels_per_m) -> "Reach":
        """As the room's parameters say, for a scale."""
        lengths = params.crossing_least_mm, params.crossing_hidden_mm, params.crossing_reach_mm
        least, gap, local = (round(pixels_in(each, pixels_per_m)) for each in lengths)
        least = max(least, 2 * gap, 4)  # something is left on either side
        return cls(pixels_in(params.crossing_mm, pixels_per_m), least, gap, max(local, least))


@njit(cache=True)
def tails_exchanged(x, y, n, other_x, other_y, m, near):
    """Nodes (i, j) after which two lines have each other's far parts; (−1, −1) for none.

    near : `Reach`
    """
    i, j = nearest_nodes(x, y, n, other_x, other_y, m, near.near, near.least)
    if i < 0 or min(i, j, n - i, m - j) < near.least:
        return -1, -1
    gap = near.gap
    for reach in (near.local, 2 * near.local, max(n, m)):
        stride = max(reach // STRIDE, 1)
        one, one_tail = max(i - reach, 0), min(i + reach, n)
        two, two_tail = max(j - reach, 0), min(j + reach, m)
        now = _misfit(x, y, one, i, x, y, i, one_tail, gap, stride)
        now += _misfit(other_x, other_y, two, j, other_x, other_y, j, two_tail, gap, stride)
        then = _misfit(x, y, one, i, other_x, other_y, j, two_tail, gap, stride)
        then += _misfit(other_x, other_y, two, j, x, y, i, one_tail, gap, stride)
        if max(now, then) < LEAST_MISFIT:
            continue
        if then < MUCH_BETTER * now:
            return i, j
        if now < MUCH_BETTER * then:
            break
    return -1, -1


@njit(cache=True)
def _misfit(x, y, start, i, tail_x, tail_y, j, end, gap, stride):
    """Mean square distance [px²] of nodes start … i and j … end from a smooth curve.

    `gap` nodes beside i and j are left out; every `stride`-th other one is looked at.
    """
    first, second = i - gap - start, j + gap
    count = 0
    x0, y0 = x[start], y[start]
    ux, uy = tail_x[end - 1] - x0, tail_y[end - 1] - y0
    norm = max(np.hypot(ux, uy), 1e-9)
    ux, uy = ux / norm, uy / norm
    gram, right, total = np.zeros((TERMS, TERMS)), np.zeros(TERMS), 0.0
    powers = np.empty(TERMS)
    for k in range(0, first + end - second, stride):
        count += 1
        if k < first:
            dx, dy = x[start + k] - x0, y[start + k] - y0
        else:
            dx, dy = tail_x[second + k - first] - x0, tail_y[second + k - first] - y0
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
