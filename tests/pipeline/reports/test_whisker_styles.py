"""Every whisker is told from the others by colour and dashes, with any colour vision."""

import itertools

import numpy as np
import pytest
from colour_vision import SIGHTS, difference

from pipeline.reports.whisker_styles import COLOURS, DASHES, pieces, style_of, whisker_styles

APART = 20.0  # ΔE 2000
GROUND = "#f4f3f1"  # of the report's time courses
WHISKERS = 40  # the most that were followed at once in a real recording


@pytest.mark.parametrize("sight", SIGHTS)
def test_colours_differ_from_each_other_and_from_the_ground(sight):
    for one, other in itertools.combinations((*COLOURS, GROUND), 2):
        assert difference(one, other, sight) > APART, (one, other)


def test_no_two_of_forty_whiskers_look_the_same():
    styles = whisker_styles([f"w{k}" for k in range(WHISKERS)] * 2)
    assert len(styles) == len(set(styles.values())) == WHISKERS


def test_neighbours_differ_in_colour():
    styles = [style_of(k) for k in range(2 * WHISKERS)]
    assert all(a.colour != b.colour for a, b in itertools.pairwise(styles))


@pytest.mark.parametrize("dash", DASHES[1:])
def test_strokes_and_gaps_are_as_long_as_they_should_be(dash):
    line = np.column_stack([np.linspace(0, 60, 13), np.linspace(0, 80, 13)])  # 100 long
    strokes = sorted(pieces(line, dash), key=lambda each: each[0, 0])
    ends = [np.hypot(*each[[0, -1]].T) for each in strokes]
    assert all(b[0] > a[1] for a, b in itertools.pairwise(ends))
    np.testing.assert_allclose(np.ptp(ends[:-1], axis=1)[:2], np.resize(dash[::2], 2))
    np.testing.assert_allclose(ends[1][0] - ends[0][1], dash[1])
    np.testing.assert_allclose(3 * np.vstack(strokes)[:, 1], 4 * np.vstack(strokes)[:, 0])


def test_a_full_line_stays_whole():
    line = np.zeros((3, 2))
    (whole,) = pieces(line, ())
    assert np.array_equal(whole, line)
