"""Distances between polylines, beside their definitions."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.numerics import polyline

X = np.arange(120.0)
LINES = given(
    apart=st.floats(0, 60), turn=st.floats(-3, 3), shift=st.floats(-80, 80), near=st.floats(1, 20)
)


def two_lines(apart, turn, shift):
    """A straight line along x, and another one."""
    return np.array([X, 0 * X]), np.array([shift + X * np.cos(turn), apart + X * np.sin(turn)])


def test_places_along_a_polyline():
    corner = np.array([(0, 0), (3, 4), (3, 10)])
    assert polyline.arc_along(corner) == pytest.approx([0, 5, 11])
    assert polyline.places_along(corner, [2.5, 6]) == pytest.approx(np.array([(1.5, 2), (3, 5)]))


def distances(first, second):
    return np.hypot(*(first[:, :, None] - second[:, None, :]))


@settings(deadline=None)
@LINES
def test_share_near_is_that_of_the_nodes(apart, turn, shift, near):
    first, second = two_lines(apart, turn, shift)
    share = polyline.share_near(*first, len(X), *second, len(X), near, (1, 1))
    assert share == pytest.approx(np.mean(distances(first, second).min(axis=1) < near))


def test_share_near_of_nothing():
    assert polyline.share_near(X, X, 0, X, X, 5, 3.0, (4, 4)) == 0
    assert polyline.share_near(X, X, 5, X, X, 0, 3.0, (4, 4)) == 0


@settings(deadline=None)
@LINES
def test_come_near_never_misses_lines_that_do(apart, turn, shift, near):
    first, second = two_lines(apart, turn, shift)
    least = distances(first, second).min()
    found = polyline.come_near(*first, len(X), *second, len(X), near)
    if least <= near:
        assert found
    if least > near + 18:
        assert not found


@settings(deadline=None)
@LINES
def test_near_pairs_are_those_that_come_near(apart, turn, shift, near):
    first, second = two_lines(apart, turn, shift)
    lines = [
        SimpleNamespace(x=each[0], y=each[1], n=n)
        for each, n in ((first, len(X)), (second, len(X)), (second + near, 50), (first, 0))
    ]
    found = polyline.near_pairs(lines, near)
    for a, one in enumerate(lines):
        for b, other in enumerate(lines):
            ours, theirs = (one.x, one.y, one.n), (other.x, other.y, other.n)
            expected = a != b and one.n * other.n > 0
            expected = expected and polyline.come_near(*ours, *theirs, near)
            assert found[a, b] == expected


@pytest.mark.parametrize("step", [1, 2, 7])
def test_every_few_nodes_of_lines_end_to_end(step):
    lines = [SimpleNamespace(x=X + k, y=2 * X - k, n=n) for k, n in enumerate((len(X), 0, 20))]
    x, y, starts = polyline.end_to_end(lines, step)
    for k, line in enumerate(lines):
        own = slice(starts[k], starts[k + 1])
        assert np.array_equal(x[own], line.x[: line.n : step])
        assert np.array_equal(y[own], line.y[: line.n : step])
    assert starts[-1] == len(x) == len(y)
    assert polyline.end_to_end([], step)[2].tolist() == [0]


def test_of_no_lines_none_are_near():
    assert polyline.near_pairs([], 3.0).shape == (0, 0)


@settings(deadline=None)
@given(x=st.floats(-50, 200), y=st.floats(-50, 50))
def test_nearest_node(x, y):
    node, distance = polyline.nearest_node(X, 0.1 * X, x, y)
    every = np.hypot(X - x, 0.1 * X - y)
    assert every[node] == pytest.approx(every.min())
    assert distance == pytest.approx(every.min())


@settings(deadline=None)
@LINES
def test_nearest_nodes_are_nearest(apart, turn, shift, near):
    first, second = two_lines(apart, turn, shift)
    every = distances(first, second)[:-1]
    i, j = polyline.nearest_nodes(*first, len(X), *second, len(X), near, 0)
    if every.min() < near - 1e-9:
        assert every[i, j] == pytest.approx(every.min(), abs=1e-9)  # px
    elif every.min() > near:
        assert (i, j) == (-1, -1)
