"""Curves through a frame, and how those whose ends point at each other are joined."""

from typing import NamedTuple

import numpy as np
from numba import njit

DIRECTION_REACH = 14  # points that give an end's direction
LEAST_COSINE, LEAST_COSINE_HIDDEN = 0.9, 0.866  # of what a line may turn by across a gap


class Curves(NamedTuple):
    """Curves end to end, as compiled functions take them.

    Attributes
    ----------
    places : float64 (n, 2) of x, y [px]
    offsets : int64 (curves + 1,) first place of every curve, and the number of places
    """

    places: np.ndarray
    offsets: np.ndarray

    @classmethod
    def of(cls, curves) -> "Curves":
        """From a sequence of curves, (n, 2) each."""
        offsets = np.cumsum([0, *map(len, curves)])
        return cls(np.concatenate([np.empty((0, 2)), *curves]), offsets)

    def each(self) -> list[np.ndarray]:
        """The curves, views (n, 2)."""
        return [self.curve(k) for k in range(len(self.offsets) - 1)]

    def curve(self, k) -> np.ndarray:
        """One curve, a view (n, 2)."""
        return self.places[self.offsets[k] : self.offsets[k + 1]]


def length(curve) -> float:
    """Length of a curve (n, 2) [px]."""
    return float(np.hypot(*np.diff(curve, axis=0).T).sum())


def join(curves: Curves, longest_gap=45.0, hidden=0) -> Curves:
    """Join curves whose ends point at each other, best pair first; return the joined curves.

    A gap of g px is bridged where both ends point along it to about 11° (more for short gaps,
    whose direction is uncertain). Every end is used once, and no ring is closed.

    hidden : half the size [px] of what lies over the gaps, such as a pole: it shifts the curves'
        last points, so that ends need not point along the gap, and may turn by 30° across it
    """
    least_cosine = LEAST_COSINE_HIDDEN if hidden else LEAST_COSINE
    return Curves(*_joined(curves.places, curves.offsets, longest_gap, least_cosine, hidden))


@njit(cache=True)
def _joined(places, offsets, longest_gap, least_cosine, hidden):
    """Places and offsets of `join`."""
    count = len(offsets) - 1
    ends, directions = _ends(places, offsets, hidden)
    pairs, costs = _gap_costs(ends, directions, longest_gap, least_cosine, hidden > 0)
    partner, group = np.full(2 * count, -1), np.arange(count)
    for k in np.argsort(costs, kind="mergesort"):  # which keeps the order of equal ones
        a, b = pairs[k]
        one, other = group[a // 2], group[b // 2]
        if partner[a] < 0 and partner[b] < 0 and one != other:
            partner[a], partner[b] = b, a
            group[group == other] = one
    return _walked(places, offsets, partner, group)


@njit(cache=True)
def _ends(places, offsets, unsure):
    """Ends (2n, 2) of the curves, first and last in turn, and the unit directions out of them.

    The last `unsure` points are left out of the direction.
    """
    ends = np.empty((2 * (len(offsets) - 1), 2))
    directions = np.empty(ends.shape)
    for k in range(len(offsets) - 1):
        first, last = offsets[k], offsets[k + 1] - 1
        near = min(unsure, last - first)
        far = min(unsure + DIRECTION_REACH, last - first)
        near = near if near < far else 0
        for end, at, inwards in ((2 * k, first, 1), (2 * k + 1, last, -1)):
            ends[end] = places[at]
            out = places[at + inwards * near] - places[at + inwards * far]
            directions[end] = out / max(np.sqrt(out[0] * out[0] + out[1] * out[1]), 1e-9)
    return ends, directions


@njit(cache=True)
def _gap_costs(places, directions, longest_gap, least_cosine, hidden):
    """Pairs (n, 2) of ends of different curves that may be bridged, and the cost of each."""
    pairs, costs = [(0, 0)][:0], [0.0][:0]
    for a in range(len(places)):
        for b in range(a + 2 - a % 2, len(places)):
            gx, gy = places[b, 0] - places[a, 0], places[b, 1] - places[a, 1]
            if gx * gx + gy * gy > longest_gap * longest_gap:
                continue
            length = np.sqrt(gx * gx + gy * gy)
            ax, ay = directions[a]
            bx, by = directions[b]
            if ax * bx + ay * by > -least_cosine:
                continue
            across = max(abs(ax * gy - ay * gx), abs(bx * gy - by * gx))
            # both point along the gap
            along = length <= 2 or min(ax * gx + ay * gy, -bx * gx - by * gy) >= 0.5 * length
            if hidden or (along and across <= 1.5 + 0.2 * length):
                pairs.append((a, b))
                costs.append(length + 4 * across)
    return pairs, np.array(costs)


@njit(cache=True)
def _walked(places, offsets, partner, group):
    """Places and offsets of the joined curves, each from the first loose end of its group on.

    partner : (2n,) the end that an end is joined with, −1: none; group : (n,) of the curves
    """
    out, starts = np.empty_like(places), np.zeros(len(offsets), np.int64)
    seen, count, total = np.zeros(len(group), np.bool_), 0, 0
    for loose in range(len(partner)):
        if partner[loose] >= 0 or seen[group[loose // 2]]:
            continue
        seen[group[loose // 2]], end = True, loose
        while end >= 0:
            first, last = offsets[end // 2], offsets[end // 2 + 1] - 1
            for i in range(last - first + 1):
                out[total] = places[first + i if end % 2 == 0 else last - i]
                total += 1
            end = partner[end ^ 1]
        count += 1
        starts[count] = total
    return out, starts[: count + 1]
