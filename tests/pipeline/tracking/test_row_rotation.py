"""The turn that all whiskers make together, on drawn lines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detection.image_model import Picture
from pipeline.detection.line import Line
from pipeline.tracking.close_tracks import reassign_lines
from pipeline.tracking.row_rotation import bent, common_turns, even_turns, places, turn_line
from pipeline.tracking.track_state import Track

SHAPE = (240, 320)


def fan(angles):
    """Straight lines from the left, angles [rad, from +x to +y]."""
    lines = []
    for k, angle in enumerate(angles):
        line = Line.empty(300)
        line.n = 150
        s = np.arange(150.0)
        line.x[:150], line.y[:150] = 40 + s * np.cos(angle), 100 + 6 * k + s * np.sin(angle)
        line.amplitude[:] = 0.3
        lines.append(line)
    return lines


def picture(lines):
    """The lines drawn as dark valleys of SD 1 px."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = np.full(SHAPE, 200.0)
    for line in lines:
        p = line.points
        t = p[-1] - p[0]
        t /= np.hypot(*t)
        along = (columns - p[0, 0]) * t[0] + (rows - p[0, 1]) * t[1]
        across = (columns - p[0, 0]) * t[1] - (rows - p[0, 1]) * t[0]
        inside = (along >= 0) & (along < line.n)
        light *= 1 - 0.3 * np.exp(-0.5 * across**2) * inside
    return light.astype(np.uint8)


def before_light(image):
    """A picture in front of even light, as compiled code takes it."""
    light, weight = np.full(SHAPE, 200, np.float32), np.ones(SHAPE, np.float32)
    return Picture(image, light, weight, light, light, 1.0)


@pytest.mark.parametrize(("turn", "slope"), [(7.0, 0.0), (-6.0, 3.0), (0.0, 0.0)])
def test_a_fan_is_found_where_it_has_turned_by_more_than_its_spacing(turn, slope):
    angles = np.radians(np.array([-22.0, -17, -12, -8, -2, 3, 9]))
    moved = angles + np.radians(turn + slope * np.linspace(-1, 1, len(angles)))
    got = common_turns(before_light(picture(fan(moved))), fan(angles))
    assert np.degrees(got) == pytest.approx(np.degrees(moved - angles), abs=0.6)


def test_the_order_of_the_lines_does_not_matter():
    angles = np.radians(np.array([-22.0, -17, -12, -8, -2, 3, 9]))
    moved = angles + np.radians(-6 + 3 * np.linspace(-1, 1, len(angles)))
    order = [3, 0, 6, 2, 5, 1, 4]
    lines = [fan(angles)[k] for k in order]
    got = common_turns(before_light(picture(fan(moved))), lines)
    assert np.degrees(got) == pytest.approx(np.degrees(moved - angles)[order], abs=0.6)


@pytest.mark.parametrize("middle", [0.0, np.pi / 2, np.pi, -np.pi / 2])
def test_places_run_from_side_to_side_wherever_the_face_is(middle):
    lines = fan(middle + np.array([0.2, -0.2, 0.0, 0.1]))
    assert places(lines) == pytest.approx([1, -1, 0, 0.5])


def test_even_turns_leave_out_a_line_that_has_gone_on_with_another():
    place = np.linspace(-1, 1, 9)
    turn = np.radians(3 + 1.5 * place)
    seen = turn.copy()
    seen[2], seen[6] = np.nan, np.radians(14)
    assert np.degrees(even_turns(place, seen)) == pytest.approx(np.degrees(turn), abs=0.2)
    assert not even_turns(place, np.full(9, np.nan)).any()


def test_even_turns_leave_out_a_line_that_has_gone_astray_at_the_end_of_the_row():
    # a rat's row in protraction: two of the outer lines were on the body's edge
    place = [-1, -0.95, -0.72, -0.71, -0.55, -0.45, -0.37, -0.24, -0.09, 0.06, 0.2, 0.82, 1]
    seen = np.radians([4.3, 4.0, 3.2, 2.9, 4.1, 5.1, 5.3, 3.8, 4.2, 3.4, 4.6, 11.6, 18.9])
    got = np.degrees(even_turns(np.array(place), seen))
    assert got == pytest.approx(np.full(len(place), 4.1), abs=1.0)


def test_a_dark_edge_does_not_turn_the_row():
    angles = np.radians(np.array([-22.0, -17, -12, -8, -2, 3, 9]))
    moved = angles + np.radians(3.0)
    seen = picture(fan(moved))
    lines = fan(angles)
    lines[0].amplitude[:] = 1.0  # its track was already on the body
    column = np.arange(SHAPE[1])
    edge = 100 + np.tan(angles[0] - np.radians(12.0)) * (column - 40)
    seen[np.arange(SHAPE[0])[:, None] < edge] = 10  # the body, beyond the first line
    got = common_turns(before_light(seen), lines)
    assert np.degrees(got[1:]) == pytest.approx(np.full(6, 3.0), abs=0.6)


def test_lines_turn_about_a_point_behind_their_base():
    line = fan([0.3])[0]
    turned = line.copy()
    turn_line(turned, 0.1, 20.0)  # px behind
    behind = line.points[0] - 20.0 * np.array([np.cos(0.3), np.sin(0.3)])
    assert np.hypot(*(turned.points[0] - behind)) == pytest.approx(20.0)
    assert np.hypot(*(turned.points[0] - line.points[0])) == pytest.approx(40 * np.sin(0.05))


def test_turning_keeps_base_and_length():
    line = fan([0.1])[0]
    turned = line.copy()
    turn_line(turned, 0.2)
    assert np.allclose(turned.points[0], line.points[0])
    chord = turned.points[-1] - turned.points[0]
    assert np.arctan2(chord[1], chord[0]) == pytest.approx(0.3)
    assert np.hypot(*chord) == pytest.approx(149.0)


ANGLES = st.floats(-3.0, 3.0)  # rad


@given(ANGLES, ANGLES, st.floats(-0.5, 0.5))
def test_a_line_is_bent_by_what_its_far_half_turns_by_beside_its_near_one(start, turn, bend):
    (before,), (now,) = fan([start]), fan([start + turn])
    far = np.arange(76.0)
    now.x[74:150] = now.x[74] + far * np.cos(start + turn + bend)
    now.y[74:150] = now.y[74] + far * np.sin(start + turn + bend)
    assert bent(now, before) == pytest.approx(bend, abs=0.02)
    assert bent(*fan([start, start + turn])) == pytest.approx(0, abs=1e-9)


@given(st.floats(-0.3, 0.3), st.permutations(range(5)))
def test_lines_are_given_to_the_tracks_that_they_go_on_with_whatever_all_turn_by(turn, order):
    angles = np.radians([-20.0, -12, -8, 3, 9])
    now = fan(angles + turn)
    tracks = [Track(before=line) for line in fan(angles)]
    for track, k in zip(tracks, order, strict=True):
        track.take(now[k], track.before)
    reassign_lines(tracks)
    assert all(track.line is line for track, line in zip(tracks, now, strict=True))
