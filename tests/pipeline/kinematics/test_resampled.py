"""Places at fixed arc lengths and distance to the pole, against geometry."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from usual_parameters import measure_stations

from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics import resampled
from pipeline.kinematics.stations import N_STATIONS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from whiskermodel.whisker import mouse_c2

HIDDEN = 1.4e-3
SCALE = 25e3  # px/m
RECORDING = Recording(1000.0, 25.0, "left")
place_tolerance = 0.002  # px
distance_tolerance = 0.01  # px


def lines_of(*curves, offset=None, information=None):
    """Centrelines of one whisker from arrays (points, 2), one per frame."""
    x, y = np.concatenate(curves).astype(np.float32).T
    counts = [len(c) for c in curves]
    return Centrelines(
        names=("C2",),
        frame=np.arange(len(curves), dtype=np.int32),
        whisker=np.zeros(len(curves), np.int32),
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        x_px=x,
        y_px=y,
        se_px=np.full(len(x), 0.1, np.float32),
        confidence=np.ones(len(curves), np.float32),
        offset_px=offset,
        information=information,
    )


def arc(curvature, start=(60.0, 200.0), direction=0.2, points=400):
    """Points 1 px apart on a circle, counter-clockwise on the screen for curvature > 0 [1/px]."""
    s = np.arange(points)
    angle = direction + curvature * s
    x = start[0] + (np.sin(angle) - np.sin(direction)) / curvature
    y = start[1] + (np.cos(angle) - np.cos(direction)) / curvature
    return np.column_stack([x, y])


def measure(lines, pole=None):
    return measure_stations(lines, RECORDING, [mouse_c2()], [HIDDEN], pole)


@pytest.mark.parametrize("curvature", [0.002, -0.004])
def test_places_lie_on_the_curve(curvature):
    """Averages over an arc's points lie inside of it; the places do not."""
    places = measure(lines_of(arc(curvature)))
    known = places.information[0] > 0
    assert known.mean() > 0.75
    s = np.flatnonzero(known) * places.spacing[0]
    node = (s - HIDDEN) * SCALE
    start, direction = np.array([60.0, 200.0]), 0.2
    angle = direction + curvature * node
    x = start[0] + (np.sin(angle) - np.sin(direction)) / curvature
    y = start[1] + (np.cos(angle) - np.cos(direction)) / curvature
    across = (places.x[0, known] * SCALE - x) * -np.sin(angle)
    across += (places.y[0, known] * SCALE + y) * np.cos(angle)
    assert np.abs(across).max() < place_tolerance


def test_unsmoothed_measurements_are_used():
    """An offset of every point along the normal moves the places by as much."""
    curve = arc(1e-6, direction=0.0)
    offset = np.full(len(curve), 0.25, np.float32)
    plain = measure(lines_of(curve))
    moved = measure(lines_of(curve, offset=offset, information=np.full(len(curve), 4.0)))
    known = moved.information[0] > 0
    # counter-clockwise normal of a line to the right points up
    np.testing.assert_allclose((moved.y - plain.y)[0, known] * SCALE, 0.25, atol=1e-3)
    per_station = places_per_station = plain.spacing[0] * SCALE
    middle = moved.information[0, 20] / SCALE**2
    assert middle == pytest.approx(4.0 * places_per_station, rel=0.15)
    assert per_station > 5


@settings(max_examples=30, deadline=None)
@given(
    st.floats(120, 350),
    st.floats(-60, 60).filter(lambda d: abs(d) > 1),
    st.floats(0.0005, 0.004),
    st.sampled_from([-1, 1]),
)
def test_distance_is_that_of_the_densely_sampled_curve(along, off, curvature, sign):
    curve = arc(sign * curvature)
    k = int(along)
    t = curve[k + 1] - curve[k - 1]
    normal = np.array([t[1], -t[0]]) / np.hypot(*t)  # counter-clockwise on the screen
    pole = curve[k] + off * normal
    places = measure(lines_of(curve), PoleTrack(pole[:1], pole[1:], 5.0))
    fine = np.arange(0, 399, 0.01)
    xy = np.column_stack([np.interp(fine, np.arange(400), c) for c in curve.T])
    radius = mouse_c2().radius(HIDDEN + fine / SCALE) * SCALE
    gap = np.hypot(*(xy - pole).T) - radius - 5.0
    assert places.distance[0] * SCALE == pytest.approx(gap.min(), abs=distance_tolerance)
    assert places.side[0] == np.sign(off)
    assert abs(places.nearest[0] - HIDDEN - fine[gap.argmin()] / SCALE) < 2 / SCALE
    assert not places.extended[0]


def test_nothing_is_measured_beside_the_pole():
    curve = arc(1e-6)
    places = measure(lines_of(curve), PoleTrack(curve[200, :1], curve[200, 1:] - 6.0, 5.0))
    s = np.arange(resampled.N_STATIONS) * places.spacing[0]
    node = (s - HIDDEN) * SCALE
    near = np.abs(node - 200) < 5.0
    assert (places.information[0, near] == 0).all()
    assert (
        places.information[0, (np.abs(node - 200) > 25) & (node > 20) & (node < 390)] > 0
    ).all()


def test_a_trace_that_ends_early_is_continued_straight():
    curve = arc(1e-6, direction=0.0, points=300)
    beyond = curve[-1] + [20.0, -8.0]
    places = measure(lines_of(curve), PoleTrack(beyond[:1], beyond[1:], 5.0))
    assert places.extended[0]
    assert places.distance[0] * SCALE == pytest.approx(8.0 - 5.0, abs=0.6)
    assert places.side[0] == 1


def test_short_traces_and_absent_poles_are_reported():
    pole = PoleTrack(np.array([np.nan, 300.0]), np.array([np.nan, 100.0]), 5.0)
    places = measure(lines_of(arc(0.001), arc(0.001, points=20)), pole)
    assert np.isnan(places.distance).all()
    assert list(places.side) == [0, 0]
    assert np.isfinite(places.first[0])
    assert np.isnan(places.first[1])
    assert (places.information[1] == 0).all()


def test_rows_of_one_whisker():
    both = measure(lines_of(arc(0.001), arc(0.002), arc(0.003)))
    np.testing.assert_array_equal(both.rows([2]).x, both.x[2:])
    np.testing.assert_array_equal(both.of("C2").frame, [0, 1, 2])


def test_arguments_must_match_the_names():
    with pytest.raises(ValueError, match="one entry per name"):
        measure_stations(lines_of(arc(0.001)), RECORDING, [], [HIDDEN])


@pytest.mark.parametrize("hidden", [np.nan, np.inf, -np.inf, 1e300, -1e300])
def test_an_impossible_hidden_length_gives_no_places(hidden):
    """It once became a negative station, written outside of the table."""
    lines = replace(lines_of(arc(0.002)), hidden_px=np.array([hidden]))
    places = measure(lines, PoleTrack(np.array([300.0]), np.array([150.0]), 6.0))
    assert not places.information.any()
    assert np.isnan(places.x).all()


def test_no_whisker_at_all():
    nothing = replace(lines_of(arc(0.002)), names=(), whisker=np.zeros(0, np.int32),
                      frame=np.zeros(0, np.int32), offsets=np.zeros(1, np.int64))  # fmt: skip
    places = measure_stations(nothing, RECORDING, [], [])
    assert places.x.shape == (0, N_STATIONS)
