"""Peaks of noisy time courses beside those of the courses themselves."""

import numpy as np
import pytest

from pipeline.contacts.peaks import firm_peak, half_width, smoothed

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
