"""Peaks that a gap in the trace hides, frames that err wildly, loads with their signs."""

import numpy as np
import pytest

from pipeline.contacts.summary import _contact_row, _hidden_top, _largest, _without_wild
from pipeline.session.recording import Recording
from whiskermodel.force_profiles import half_gaussian

UN = 1.0  # all forces here


def pulse(n, peak=8.0):
    """Frames of a half-Gaussian touch of n frames [µN], the middle one its peak."""
    return half_gaussian(np.arange(n) + 0.5, float(n), peak * UN)


@pytest.mark.parametrize("hidden", [1, 5, 11])
def test_a_peak_in_a_gap_is_as_far_above_its_ends_as_in_a_half_gaussian(hidden):
    """The gap lies about the middle, of which the frames beside it are the largest seen."""
    n = 41
    force, first = pulse(n), (n - hidden) // 2
    known = np.ones(n, bool)
    known[first : first + hidden] = False
    more = _hidden_top(known, first - 1)
    assert force[first - 1] * (1 + more) == pytest.approx(force.max(), rel=1e-9)
    assert _hidden_top(known, first + hidden) == more
    assert _hidden_top(known, first - 2) == 0


@pytest.mark.parametrize(("known", "peak"), [([0, 1, 1, 1, 1, 1], 1), ([1, 1, 1, 1, 1, 0], 4)])
def test_a_gap_at_an_end_hides_as_one_inside(known, peak):
    inside = np.array([1, 1, 0, 1, 1, 1], bool)
    assert _hidden_top(np.array(known, bool), peak) == _hidden_top(inside, 1) > 0


def test_in_a_long_gap_a_peak_may_be_some_times_larger_only():
    known = np.zeros(60, bool)
    known[:3] = True
    assert 2 < _hidden_top(known, 2) < 4


@pytest.mark.parametrize(("error", "kept"), [(0.9, True), (1.4, False)])
def test_a_frame_that_errs_five_times_as_usual_and_by_a_tenth_is_left_out(error, kept):
    """The usual error is 0.1 µN; of 8 µN, 0.8 more are allowed, and four times the usual."""
    force, errors = pulse(21), np.full(21, 0.1)
    errors[10] = error
    assert np.isfinite(_without_wild(force, errors)[10]) == kept
    np.testing.assert_array_equal(_without_wild(force, np.full(21, np.nan)), force)


@pytest.mark.parametrize("sign", [1, -1])
def test_loads_keep_their_signs(sign):
    force, errors = pulse(21), np.full(21, 0.01)
    load = sign * 0.3 * force
    load[0] = -sign * 0.5
    force[5] = np.nan
    load[5] = sign * 99.0  # of a frame without a force
    assert _largest(load, 0, force, errors) == pytest.approx(sign * 0.3 * 8.0)
    assert np.isnan(_largest(np.full(21, np.nan), 0, force, errors))


def test_a_row_of_a_touch():
    force = pulse(20)
    part = {
        "contact_force_uN": force,
        "contact_force_uN_se": np.full(20, 0.01),
        "base_moment_nN_m": -9.0 * force,
        "axial_force_uN": 0.2 * force,
        "contact_arc_length_mm": np.linspace(9, 10, 20),
    }
    row = _contact_row(part, Recording(500.0, 25.0, "left"))
    assert row["peak_force_uN"] == force.max()
    assert row["mean_force_uN"] == pytest.approx(force.mean())
    assert row["impulse_uN_ms"] == pytest.approx(force.sum() * 2.0)  # 2 ms a frame
    assert row["peak_base_moment_nN_m"] == pytest.approx(-9 * force.max())
    assert row["peak_axial_force_uN"] == pytest.approx(0.2 * force.max())
    assert row["contact_arc_length_mm"] == pytest.approx(9.5, abs=0.03)
