"""Crossing whiskers: lines that have each other's far parts get their own back."""

import numpy as np
import pytest

from pipeline.detection import crossings
from pipeline.detection.line import Line
from pipeline.session.parameters import DEFAULTS

NOISE_PX = 0.08
REACH = crossings.Reach.of(DEFAULTS.detection, 25e3)


def parabola(start, slope, bend, n, rng):
    """A noisy line from (20, start): y = start + slope s + bend s²."""
    line = Line.empty(300)
    s = np.arange(n, dtype=float)
    line.n = n
    line.x[:n] = 20 + s
    line.y[:n] = start + slope * s + bend * s**2 + NOISE_PX * rng.normal(size=n)
    line.amplitude[:] = 0.1 + 0.001 * n
    return line


def pair(seed=0):
    """Two whiskers that cross at a small angle, 60 px from their bases."""
    rng = np.random.default_rng(seed)
    return parabola(100.0, 0.1, -3e-4, 140, rng), parabola(110.0, -0.08, 1e-4, 120, rng)


def exchange(one, other, node):
    """Give two lines of the same x each other's y beyond a node, and lengths."""
    for a, b in ((one.y, other.y), (one.amplitude, other.amplitude)):
        a[node:], b[node:] = b[node:].copy(), a[node:].copy()
    x = max(one.n, other.n)
    one.x[:x] = other.x[:x] = 20 + np.arange(x)
    one.n, other.n = other.n, one.n


def crossing_of(one, other):
    n = min(one.n, other.n)
    return int(np.argmin(np.abs(one.y[10:n] - other.y[10:n]))) + 10


@pytest.mark.parametrize("seed", range(5))
def test_lines_get_their_own_far_parts_back(seed):
    one, other = pair(seed)
    first, second = pair(seed)
    exchange(first, second, crossing_of(one, other))
    assert crossings.uncross(first, second, REACH)
    assert first.n == pytest.approx(one.n, abs=3)
    assert second.n == pytest.approx(other.n, abs=3)
    for line, true in ((first, one), (second, other)):
        n = min(line.n, true.n)
        apart = np.interp(true.x[:n], line.x[:n], line.y[:n]) - true.y[:n]
        assert np.abs(apart).max() < 1.0  # px
        assert line.amplitude[n - 1] == pytest.approx(true.amplitude[n - 1])


def bent(seed=0):
    """A whisker that a pole bends, and one that crosses it beyond, 130 px from their bases."""
    rng = np.random.default_rng(seed)
    one, other = parabola(100.0, -0.35, 0.0, 260, rng), parabola(70.0, 0.0, 3e-4, 260, rng)
    s = np.arange(260.0)  # a rod held at its base and pushed back at 110 px, straight beyond
    one.y[:260] += 9.4e-6 * np.where(s < 110, s**2 * (330 - s), 110**2 * (3 * s - 110))
    return one, other


@pytest.mark.parametrize("seed", range(5))
def test_a_whisker_bent_by_the_pole_gets_its_own_far_part_back(seed):
    one, other = bent(seed)
    first, second = bent(seed)
    at = crossing_of(one, other)
    exchange(first, second, at)
    assert crossings.uncross(first, second, REACH)
    for line, true in ((first, one), (second, other)):
        apart = np.interp(true.x[: true.n], line.x[: line.n], line.y[: line.n]) - true.y[: true.n]
        assert np.abs(apart).max() < 1.0  # px


@pytest.mark.parametrize("make", [pair, bent])
@pytest.mark.parametrize("seed", range(5))
def test_lines_that_are_right_are_left(seed, make):
    one, other = make(seed)
    before = one.y.copy(), other.y.copy()
    assert not crossings.uncross(one, other, REACH)
    assert np.array_equal(one.y, before[0])
    assert np.array_equal(other.y, before[1])


def test_lines_that_do_not_come_near_each_other_are_left():
    rng = np.random.default_rng(9)
    one, other = parabola(100, 0.1, 0.0, 120, rng), parabola(90, 0.05, 0.0, 120, rng)
    assert crossings.tails_exchanged(one.x, one.y, 120, other.x, other.y, 120, REACH) == (-1, -1)
