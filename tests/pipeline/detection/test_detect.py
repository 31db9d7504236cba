"""How lines of one frame are compared: which run along each other, and which are only blur."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.detection.detect import is_ghost, shared_fraction
from pipeline.detection.line import Line
from pipeline.session.parameters import DEFAULTS

LIMIT = 120


def line(points, amplitude=0.5):
    """A `Line` through points (n, 2) [px]."""
    out = Line.empty(LIMIT)
    out.n = len(points)
    out.x[: out.n], out.y[: out.n] = np.asarray(points, float).T
    out.amplitude[:] = amplitude
    return out


def straight(angle, n, start=(0.0, 0.0)):
    """Nodes 1 px apart."""
    return np.add(start, np.arange(n)[:, None] * [np.cos(angle), np.sin(angle)])


@settings(deadline=None, max_examples=60)
@given(
    angles=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    lengths=st.tuples(st.integers(1, LIMIT), st.integers(1, LIMIT)),
    near=st.floats(0.5, 6.0),
)
def test_the_share_of_nodes_near_another_line(angles, lengths, near):
    one, other = (straight(a, n) for a, n in zip(angles, lengths, strict=True))
    apart = np.hypot(*(one[::3, None] - other[None, ::2]).transpose(2, 0, 1)).min(axis=1)
    away = np.abs(apart - near) > 1e-9  # on the edge, rounding decides
    got = shared_fraction(line(one), line(other), near) * len(apart)
    assert (apart[away] < near).sum() - 1e-9 <= got <= (apart < near).sum() + (~away).sum() + 1e-9


def test_no_nodes_are_near_nothing():
    some, none = line(straight(0, 30)), line(np.empty((0, 2)))
    assert shared_fraction(some, none) == 0
    assert shared_fraction(none, some) == 0


@pytest.mark.parametrize(
    ("strength", "away_px", "ghost"),
    [(0.9, 1.0, True), (1.1, 1.0, False), (0.9, 5.0, False), (0.5, 5.0, True), (0.5, 9.0, False)],
)
def test_a_ghost_is_faint_and_beside_a_dark_line(strength, away_px, ghost):
    dark = line(straight(0.2, 80), 0.6)
    faint = line(straight(0.2, 60, (0, away_px)), strength * DEFAULTS.detection.blur_share * 0.6)
    assert is_ghost(faint, [line(straight(-1, 80)), dark]) == ghost
    assert not is_ghost(dark, [faint])
