"""Peaks of noisy time courses beside those of the courses themselves."""

import numpy as np
import pytest

from pipeline.contacts.peaks import _noise, _smoothed, firm_peak, half_width, smoothed

NOISE = 0.05  # of the peak
BIAS = 0.01  # of the peak: of the mean over many courses
RESTS = 1e-9


def half_gaussian(n, peak=1.0):
    t = (np.arange(n) + 0.5) / n - 0.5
    return 2 * peak * (np.exp(-4 * np.log(2) * t**2) - 0.5)


def plateau(n, peak=1.0):
    return peak * (1 - np.abs(np.linspace(-1, 1, n)) ** 3)


def peak_of(values, errors):
    return smoothed(values, half_width(values, errors)).max()


@pytest.mark.parametrize("course", [half_gaussian(40), half_gaussian(200), plateau(150)])
@pytest.mark.parametrize("growing", [False, True])
def test_noise_does_not_lift_the_peak(course, growing):
    rng = np.random.default_rng(0)
    errors = NOISE * (course + 0.05 if growing else np.ones(len(course)))
    seen = course + errors * rng.normal(size=(100, len(course)))
    found = np.mean([peak_of(each, 2 * errors) for each in seen])
    most = seen.max(axis=1).mean()
    assert abs(found / course.max() - 1) < 0.4 * (most / course.max() - 1)
    if len(course) >= 100:
        assert abs(found / course.max() - 1) < 2 * BIAS


def test_noise_is_judged_where_the_force_is_large():
    """Noise of the upper half only, of which the errors say nothing."""
    rng = np.random.default_rng(6)
    course = half_gaussian(100)
    seen = course + np.where(course > 0.6, NOISE, 0.1 * NOISE) * rng.normal(size=(60, 100))
    found = np.mean([peak_of(each, np.full(100, NOISE)) for each in seen])
    assert found < 1 + 0.4 * (seen.max(axis=1).mean() - 1)


@pytest.mark.parametrize("n", [5, 20, 60, 250])
def test_without_noise_the_peak_is_the_largest_value(n):
    course = half_gaussian(n)
    assert peak_of(course, np.full(n, 1e-3)) == pytest.approx(course.max(), rel=2e-3)


def test_a_brief_peak_on_a_long_touch_stays():
    course = plateau(200, 0.5)
    course[90:100] += half_gaussian(10, 0.5)
    rng = np.random.default_rng(1)
    seen = course + 0.02 * rng.normal(size=(50, 200))
    found = np.mean([peak_of(each, np.full(200, 0.02)) for each in seen])
    assert found == pytest.approx(course.max(), rel=5 * BIAS)


def test_missing_values_stay_missing_and_short_courses_as_they_are():
    values = np.array([0.0, 1.0, np.nan, 3.0, 1.0])
    np.testing.assert_array_equal(smoothed(values, half_width(values, np.ones(5))), values)
    long = np.where(np.arange(60) == 30, np.nan, half_gaussian(60))
    course = smoothed(long, 4)
    assert np.isnan(course[30])
    assert np.isfinite(np.delete(course, 30)).all()
    assert np.isnan(smoothed(np.full(4, np.nan), 0)).all()


def test_a_parabola_is_not_changed():
    t = np.arange(50.0)
    parabola = 3 - 0.01 * (t - 20) ** 2
    np.testing.assert_allclose(smoothed(parabola, 8), parabola, atol=RESTS)


def test_a_plateau_that_the_video_cuts_off_is_not_its_noisiest_frame():
    rng = np.random.default_rng(2)
    course = np.minimum(np.arange(80) / 40, 1.0)
    seen = course + 0.3 * rng.normal(size=(50, 80))
    found = np.mean([peak_of(each, np.ones(80)) for each in seen])
    assert abs(found - 1) < 0.5 * (seen.max(axis=1).mean() - 1)


def test_frames_seen_badly_make_no_peak_and_no_confidence():
    """Every other frame errs ten times as much as the others."""
    rng = np.random.default_rng(3)
    course = plateau(120)
    errors = NOISE * np.where(np.arange(120) % 2 == 0, 0.4, 4.0)
    found = []
    for _ in range(50):
        seen = course + errors * rng.normal(size=120)
        at, value, error = firm_peak(seen, half_width(seen, errors), errors)
        found.append((value - 1, (value - course[at]) / error, seen.max() - 1))
    off, deviation, lift = np.array(found).T
    assert abs(off.mean()) < 0.1 * lift.mean()
    assert np.mean(np.abs(deviation) < 2) > 0.9


def test_alike_errors_are_those_of_the_peak():
    course = half_gaussian(60)
    at, value, error = firm_peak(course, 4, np.full(60, NOISE))
    assert (at, error) == (pytest.approx(29.5, abs=0.5), pytest.approx(NOISE))
    assert value == pytest.approx(1.0, abs=BIAS)
    assert np.isnan(firm_peak(course, 0, np.full(60, np.nan))[2])


def test_the_peak_is_where_a_force_is_surely_reached():
    """A plateau of which the first half is seen ten times as well as the second."""
    rng = np.random.default_rng(5)
    errors = np.where(np.arange(100) < 50, 0.02, 0.2)
    first = []
    for _ in range(40):
        at, value, _ = firm_peak(1 + errors * rng.normal(size=100), 0, errors)
        first.append(at < 50)
        assert value == pytest.approx(1.0, abs=0.08) or not first[-1]
    # the largest of 50 values is 2.2 SD above the plateau: half of the time not surely so
    assert np.mean(first) > 0.3
    at, _, error = firm_peak(np.ones(100), 0, errors)
    assert (at < 50, error) == (True, 0.02)


@pytest.mark.parametrize("half", [3, 8])
def test_smoothed_values_and_variances_are_numpys_weighted_parabolas(half):
    rng = np.random.default_rng(7)
    n, width = 40, 2 * half + 1
    errors, values = rng.uniform(0.5, 2, n), rng.normal(size=n)
    values[17] = np.nan
    course, variance = _smoothed(values, half, np.where(np.isnan(values), np.inf, errors))
    for i in np.flatnonzero(np.isfinite(values)):
        first = np.clip(i - half, 0, n - width)
        near = np.arange(first, first + width)
        near = near[np.isfinite(values[near])]
        line, cov = np.polyfit(near - i, values[near], 2, w=1 / errors[near], cov="unscaled")
        assert course[i] == pytest.approx(line[2], rel=1e-6, abs=1e-9)
        assert variance[i] == pytest.approx(cov[2, 2], rel=1e-6)
    assert np.isnan(course[17])
    assert np.isnan(variance[17])


@pytest.mark.parametrize("low_noise", [1.0, 0.1])
def test_noise_is_found_in_units_of_the_errors(low_noise):
    """Of the upper half of a course, whatever the noise of the lower half is."""
    rng, course = np.random.default_rng(8), half_gaussian(400)
    errors = rng.uniform(0.5, 2, 400)
    values = course + 0.02 * np.where(course > 0.55, 1.0, low_noise) * errors * rng.normal(
        size=400
    )
    values[30] = np.nan
    found = _noise(values, np.where(np.isnan(values), np.inf, errors))
    known = np.isfinite(values)
    np.testing.assert_allclose(found[known], 0.02 * errors[known], rtol=0.12)
    assert np.isinf(found[30])


def test_a_peak_is_lowered_by_a_hundredth_or_left_as_it_is():
    rng, lifts = np.random.default_rng(9), []
    for noise in np.geomspace(1e-3, 0.03, 300):
        values = plateau(80) + noise * rng.normal(size=80)
        lifts.append(values.max() / peak_of(values, np.ones(80)) - 1)
    lowered = np.array(lifts)[np.array(lifts) != 0]
    assert 40 < len(lowered) < 260
    assert lowered.min() == pytest.approx(0.01, abs=2e-3)


@pytest.mark.parametrize(("error", "peak"), [(0.7, 1), (0.9, 0)])
def test_a_peak_is_where_two_standard_errors_below_it_is_highest(error, peak):
    """8 ± 0.1 is surely above 7.8; 9.5 ± 0.7 above 8.1, but 9.5 ± 0.9 above 7.7 only."""
    values, errors = np.array([8.0, 9.5]), np.array([0.1, error])
    at, value, its_error = firm_peak(values, 0, errors)
    assert (at, value, its_error) == (peak, values[peak], pytest.approx(errors[peak]))
