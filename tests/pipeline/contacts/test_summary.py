"""Rows of contacts: loads with their signs, gaps, what free frames show, forces without errors."""

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import binary_dilation

from pipeline.contacts.summary import _contact_row, _courses, _largest, _without_wild, without_gaps
from whiskermodel.force_profiles import half_gaussian

FORCE_UN = 0.02  # of a row's forces, whose frames err by half of that


def pulse(n, peak=8.0):
    """Frames of a half-Gaussian touch of n frames [µN]."""
    return half_gaussian(np.arange(n) + 0.5, float(n), peak)


def whisker(n=20, **changes):
    """Courses of a whisker with 10 free frames, a contact of n, and 10 free frames again."""
    force = np.concatenate([np.zeros(10), pulse(n), np.zeros(10)])
    touching = force > 0
    return {
        "frame": np.arange(len(force)),
        "force": force,
        "error": np.full(len(force), 0.01),
        "origin": 0.02 * force,
        "free": ~binary_dilation(touching),
        "interpolated": np.zeros(len(force), bool),
        "place": np.where(touching, np.linspace(8.5, 10, len(force)), np.nan),
        "moment": np.where(touching, -9.0, np.nan),
        "axial": np.where(touching, 0.2, np.nan),
    } | changes


def test_a_row_of_a_touch():
    row = _contact_row(whisker(), 10, 30, 2.0)
    force = pulse(20)
    assert row["peak_force_uN"] == pytest.approx(force.max(), abs=FORCE_UN)
    assert row["mean_force_uN"] == pytest.approx(force.mean(), abs=FORCE_UN)
    assert row["impulse_uN_ms"] == pytest.approx(force.sum() * 2.0, abs=40 * FORCE_UN)
    assert row["peak_base_moment_nN_m"] == pytest.approx(-9 * force.max(), abs=9 * FORCE_UN)
    assert row["peak_axial_force_uN"] == pytest.approx(0.2 * force.max(), abs=FORCE_UN)
    assert row["contact_arc_length_mm"] == pytest.approx(9.25, abs=0.03)
    assert row["hidden_length_se_uN"] == pytest.approx(0.02 * force.max(), rel=1e-9)
    assert 0.002 < row["tracking_se_uN"] < 0.012
    parts = np.hypot(row["tracking_se_uN"], row["hidden_length_se_uN"])
    assert row["peak_force_se_uN"] == pytest.approx(parts)


def test_a_peak_in_a_gap_is_larger_than_what_is_seen():
    """Loads and place at the peak lie between those beside the gap."""
    hidden = whisker()
    for course in ("force", "error", "origin", "place", "moment", "axial"):
        hidden[course][18:22] = np.nan
    row, seen = _contact_row(hidden, 10, 30, 1.0), np.nanmax(hidden["force"])
    assert seen + FORCE_UN < row["peak_force_uN"] == pytest.approx(8.0, abs=0.2)
    assert row["peak_base_moment_nN_m"] == pytest.approx(-9 * row["peak_force_uN"])
    assert row["contact_arc_length_mm"] == pytest.approx(9.25, abs=0.05)


def test_a_force_below_zero_counts_as_none():
    row = _contact_row(whisker(force=np.full(40, -1.0)), 10, 30, 1.0)
    assert (row["peak_force_uN"], row["mean_force_uN"]) == (0, 0)


def test_frames_beside_a_touch_do_not_count_as_free():
    late = whisker()
    late["force"][[9, 30]] = 4.0
    row = _contact_row(late, 10, 30, 1.0)
    assert row == _contact_row(whisker(), 10, 30, 1.0)


def test_forces_without_errors_are_taken_as_they_are():
    row = _contact_row(whisker(error=np.full(40, np.nan)), 10, 30, 1.0)
    assert row["peak_force_uN"] == pulse(20).max()
    assert np.isnan(row["peak_force_se_uN"])
    nothing = whisker(force=np.full(40, np.nan))
    assert list(_contact_row(nothing, 10, 30, 1.0)) == ["contact_arc_length_mm"]


@pytest.mark.parametrize(("error", "kept"), [(0.9, True), (1.4, False)])
def test_a_frame_that_errs_five_times_as_usual_and_by_a_tenth_is_left_out(error, kept):
    """The usual error is 0.1 µN; of 8 µN, 0.8 more are allowed, and four times the usual."""
    force, errors = pulse(21), np.full(21, 0.1)
    errors[10] = error
    assert np.isfinite(_without_wild(force, errors)[10]) == kept
    np.testing.assert_array_equal(_without_wild(force, np.full(21, np.nan)), force)


@pytest.mark.parametrize("sign", [1, -1])
def test_loads_keep_their_signs(sign):
    assert _largest(sign * np.array([-0.5, np.nan, 2.4, 1.0])) == sign * 2.4
    assert np.isnan(_largest(np.full(3, np.nan)))


def test_gaps_are_bridged_by_straight_lines():
    values = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan])
    np.testing.assert_allclose(without_gaps(values), [1, 1, 2, 3, 4, 4])
    assert np.isnan(without_gaps(np.full(2, np.nan))).all()


def test_courses_are_forces_of_the_method_without_what_is_common():
    frames = pd.DataFrame(
        {
            "frame": [0, 1, 2],
            "whisker": "C2",
            "in_contact": [False, True, True],
            "contact_force_uN": [0.0, 2.0, np.nan],
            "base_moment_nN_m": [0.0, -16.0, np.nan],
            "axial_force_uN": [0.0, 0.5, np.nan],
            "contact_arc_length_mm": [np.nan, 9.0, 9.0],
        }
    )
    evidence = pd.DataFrame(
        {
            "point_force_N": [1e-7, 2e-6, 3e-6],
            "point_force_se_N": [5e-8, 5e-8, 5e-8],
            "point_origin_force_se_N": [3e-8, 3e-8, 6e-8],
            "interpolated": [False, True, False],
            "probability": [0.9, 1.0, 1.0],
        }
    )
    found = _courses(frames, evidence, "point")
    np.testing.assert_allclose(found["force"], [0.1, 2, np.nan])
    np.testing.assert_allclose(found["error"], [0.04, 0.04, 0])
    np.testing.assert_allclose(found["origin"], [0.03, 0.03, 0.06])
    np.testing.assert_allclose(found["moment"], [np.nan, -8, np.nan])
    np.testing.assert_allclose(found["axial"], [np.nan, 0.25, np.nan])
    assert found["touching"].all()  # the first frame is free by a person's word alone
