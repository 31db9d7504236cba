"""Curves joined across gaps."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detection.curves import Curves, join


def joined(curves, **gaps):
    return join(Curves.of(curves), **gaps).each()


def hooked_part(start, end, turn, hook=12):
    """A straight line of points 1 px apart, the last `hook` turned aside by `turn` [rad]."""
    start, end = np.array(start, float), np.array(end, float)
    length = int(np.hypot(*(end - start)))
    bend = np.r_[np.zeros(length - hook), np.linspace(0, turn, hook)]
    angles = np.arctan2(*(end - start)[::-1]) + bend
    steps = np.column_stack([np.cos(angles), np.sin(angles)])
    return start + np.cumsum(steps, axis=0)


def test_parts_that_turn_into_what_hides_them_are_joined_where_that_is_given():
    near = hooked_part((0, 100), (200, 100), np.radians(50))
    far = hooked_part((410, 110), (210, 110), np.radians(-50))
    assert len(joined([near, far])) == 2
    (whole,) = joined([near, far], longest_gap=25.0, hidden=18)
    assert len(whole) == len(near) + len(far)
    assert np.hypot(*np.diff(whole, axis=0).T).max() < 25
    turned = hooked_part((350, 250), (210, 110), np.radians(-50))  # by 45°
    assert len(joined([near, turned], longest_gap=25.0, hidden=18)) == 2


def pieces_of_lines(rng):
    """Straight lines across a picture, cut into pieces with gaps of 5 to 60 px, in any order."""
    pieces = []
    for _ in range(rng.integers(1, 5)):
        start, angle = rng.uniform(0, 300, 2), rng.uniform(0, 2 * np.pi)
        along = np.array([np.cos(angle), np.sin(angle)])
        at = 0.0
        for _ in range(rng.integers(1, 4)):
            n = rng.integers(15, 60)
            piece = start + (at + np.arange(n))[:, None] * along
            pieces.append(piece[:: rng.choice([-1, 1])])
            at += n + rng.uniform(5, 60)
    return [pieces[k] for k in rng.permutation(len(pieces))]


def gap_cost(one, other):
    """Cost of the gap from one piece's end to the other's start, None where it is too wide."""
    gap, n = other[0] - one[-1], 14
    length = np.hypot(*gap)
    out, into = (v / np.hypot(*v) for v in (one[-1] - one[-1 - n], other[n] - other[0]))
    across = max(abs(v[0] * gap[1] - v[1] * gap[0]) for v in (out, into))
    along = length <= 2 or min(out @ gap, into @ gap) >= 0.5 * length
    if length > 45 or out @ into < 0.9 or not along or across > 1.5 + 0.2 * length:
        return None
    return length + 4 * across


def joined_one_by_one(pieces):
    """The cheapest gap of all is bridged, then the cheapest of what there is now, …"""
    pieces = list(pieces)
    while True:
        best = None
        for i, one in enumerate(pieces):
            for j in range(i):
                for a in (one, one[::-1]):
                    for b in (pieces[j], pieces[j][::-1]):
                        cost = gap_cost(a, b)
                        if cost is not None and (best is None or cost < best[0]):
                            best = cost, i, j, np.concatenate([a, b])
        if best is None:
            return pieces
        _, i, j, both = best
        pieces = [each for k, each in enumerate(pieces) if k not in (i, j)] + [both]


def as_one_way(curves):
    """Curves from their leftmost end on, in order."""
    return sorted(min(c.tolist(), c[::-1].tolist()) for c in curves)


@given(st.integers(0, 2**32 - 1))
def test_joined_as_when_the_cheapest_gap_is_bridged_again_and_again(seed):
    pieces = pieces_of_lines(np.random.default_rng(seed))
    assert as_one_way(joined(pieces)) == as_one_way(joined_one_by_one(pieces))
