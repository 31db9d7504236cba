"""Lines that other programs traced: even nodes on a smooth curve, and their noise as it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d

from pipeline.convert.results import lines_of_rows
from pipeline.kinematics.given_lines import as_centrelines, chunks_of, sample_of

noise_tolerance = 0.2  # relative, of a standard deviation
correlated_tolerance = 0.25  # the same: some correlation is longer than a block
place_tolerance = 0.1  # px
RADIUS_PX, ANGLE = 600.0, 0.6  # an arc of 360 px
ROWS = 60


def arc(step_px, noise):
    """Points of an arc, `step_px` apart, moved across it by the `noise`."""
    angle = np.linspace(0, ANGLE, round(RADIUS_PX * ANGLE / step_px) + 1)
    radius = RADIUS_PX + noise(len(angle))
    return np.column_stack([100 + radius * np.sin(angle), radius * np.cos(angle)])


def traced(noise, step_px=1.0):
    rows = [arc(step_px, noise) for _ in range(ROWS)]
    return lines_of_rows(("C2",), [(frame, 0) for frame in range(ROWS)], rows)


@pytest.mark.parametrize("sd", [0.05, 0.2])
@pytest.mark.parametrize("step_px", [0.8, 1.3])
def test_nodes_lie_evenly_on_the_curve_and_show_the_noise(sd, step_px):
    rng = np.random.default_rng(0)
    lines = as_centrelines(traced(lambda n: rng.normal(0, sd, n), step_px))
    points = np.column_stack([lines.x_px, lines.y_px]).astype(float)
    steps = np.hypot(*np.diff(lines.row(0).astype(float), axis=0).T)
    np.testing.assert_allclose(steps, 1, atol=0.02)
    away = np.hypot(points[:, 0] - 100, points[:, 1]) - RADIUS_PX
    assert np.sqrt(np.mean(away**2)) < 0.5 * sd
    per_px = sd * np.sqrt(step_px)  # of independent errors 1 px apart, as telling as these
    assert np.median(lines.se_px) == pytest.approx(per_px, rel=noise_tolerance)
    np.testing.assert_allclose(lines.information, lines.se_px**-2.0, rtol=1e-4)


def test_noise_that_runs_along_the_line_leaves_less_known():
    rng = np.random.default_rng(0)
    sd, sigma = 0.1, 3.0
    white = 2 * np.sqrt(np.pi) * sigma  # variance that the filter takes away

    def noise(n):
        return gaussian_filter1d(rng.normal(0, sd * np.sqrt(white), n), sigma)

    lines = as_centrelines(traced(noise))
    assert np.median(lines.se_px) == pytest.approx(sd * np.sqrt(white), rel=correlated_tolerance)


def test_short_lines_and_names_without_lines_are_left_out():
    long, short = arc(1.0, np.zeros), arc(1.0, np.zeros)[:20]
    keys = [(0, 2), (1, 0), (2, 2)]
    lines = as_centrelines(lines_of_rows(("a", "b", "c"), keys, [long, short, long]))
    assert lines.names == ("c",)
    np.testing.assert_array_equal(lines.frame, [0, 2])
    np.testing.assert_array_equal(lines.whisker, [0, 0])


def test_points_upon_each_other_do_no_harm():
    points = np.repeat(arc(1.0, np.zeros), 2, axis=0)
    lines = as_centrelines(lines_of_rows(("a",), [(0, 0)], [points]))
    assert np.isfinite(lines.x_px).all()
    assert len(lines.x_px) == pytest.approx(RADIUS_PX * ANGLE, abs=1)


@pytest.mark.parametrize("place", [1e9, np.inf, np.nan])
def test_points_that_no_picture_has_are_left_out(place):
    """A line that leads there would take all memory."""
    points = arc(1.0, np.zeros)
    whole = as_centrelines(lines_of_rows(("a",), [(0, 0)], [points]))
    damaged = np.insert(points, 5, place, axis=0)
    lines = as_centrelines(lines_of_rows(("a",), [(0, 0)], [damaged]))
    np.testing.assert_array_equal(lines.x_px, whole.x_px)


@given(sizes=st.lists(st.integers(0, 5), min_size=1, max_size=8), data=st.data())
def test_rows_are_those_asked_for(sizes, data):
    rows = [np.arange(2 * n).reshape(n, 2) + 10 * i for i, n in enumerate(sizes)]
    lines = lines_of_rows(("a",), [(i, 0) for i in range(len(sizes))], rows)
    chosen = data.draw(st.lists(st.integers(0, len(sizes) - 1), max_size=6))
    some = lines.rows(np.array(chosen, int))
    assert len(some) == len(chosen)
    for i, number in enumerate(chosen):
        assert some.frame[i] == number
        np.testing.assert_array_equal(some.row(i), rows[number])


def test_chunks_hold_every_row_once_and_samples_spread():
    rng = np.random.default_rng(0)
    lines = traced(np.zeros)
    lines = lines.rows(rng.permutation(ROWS))
    chunks = list(chunks_of(lines, 25))
    assert [len(chunk) for chunk in chunks] == [25, 25, 10]
    np.testing.assert_array_equal(np.concatenate([c.frame for c in chunks]), np.arange(ROWS))
    assert len(sample_of(lines, 12)) == 12
    assert len(next(chunks_of(lines.rows(np.empty(0, int)), 25))) == 0
