"""Courses of noisy forces beside those without noise, and beside plain conditional Gaussians."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pipeline.contacts.peaks import (
    AROUND,
    MOST,
    _factor,
    _fitted,
    _given_free,
    _noise,
    _posterior,
    _priors,
    contact_course,
)
from whiskermodel.force_profiles import half_gaussian

NOISE = 0.05  # of the peak
BIAS = 0.01  # of the peak: of the mean over many courses
RESTS = 1e-8
FREE = 40  # frames before and after a contact


def pulse(n):
    return half_gaussian(np.arange(n) + 0.5, float(n), 1.0)


def plateau(n):
    return 1 - np.abs(np.linspace(-1, 1, n)) ** 3


def course_of(contact, error, offset=0.0, interpolated=None):
    """Rows from the contact's first frame on, course and its error, with free frames around."""
    n, force = len(contact), np.concatenate([np.zeros(FREE), contact, np.zeros(FREE)]) + offset
    free = np.ones(len(force), bool)
    free[FREE : FREE + n] = False
    coded = np.zeros(len(force), bool) if interpolated is None else interpolated
    known = np.full(len(force), error)
    rows, course, left = contact_course(force, known, free, coded, FREE, FREE + n)
    return rows - FREE, course, left


def noises(rng, n, error):
    """Errors of a contact of n frames and of the free frames about it."""
    frame = np.arange(n + 2 * FREE)
    cov = _noise(frame, np.full(len(frame), error), np.zeros(len(frame), bool))
    return np.linalg.cholesky(cov) @ rng.normal(size=len(frame))


@pytest.mark.parametrize(
    "contact", [pulse(5), pulse(12), pulse(60), plateau(100), np.sqrt(pulse(40))]
)
def test_a_peak_is_neither_lifted_nor_cut_and_its_error_is_a_frames(contact):
    rng, found = np.random.default_rng(0), []
    for _ in range(150):
        _, course, error = course_of(contact, NOISE, noises(rng, len(contact), NOISE))
        at = course.argmax()
        found.append((course[at], error[at]))
    peak, error = np.transpose(found)
    off = peak - contact.max()
    assert abs(off.mean()) < 2 * BIAS
    assert np.min(error) >= NOISE
    assert np.std(off) < 1.2 * NOISE


@pytest.mark.parametrize("n", [3, 5, 20, 60, 150])
@pytest.mark.parametrize("shape", [pulse, plateau])
def test_without_noise_the_course_is_as_measured(n, shape):
    contact = shape(n)
    rows, course, error = course_of(contact, 1e-4)
    np.testing.assert_array_equal(rows, np.arange(n))
    np.testing.assert_allclose(course, contact, atol=2e-3)
    assert error.max() < 2e-4


def test_a_brief_peak_on_a_long_contact_stays():
    contact = 0.5 * plateau(150)
    contact[70:80] += 0.5 * pulse(10)
    rng = np.random.default_rng(1)
    found = [course_of(contact + 0.02 * rng.normal(size=150), 0.02)[1].max() for _ in range(40)]
    assert np.mean(found) == pytest.approx(contact.max(), rel=3 * BIAS)


def test_what_all_frames_err_by_is_seen_where_nothing_touches():
    """An error of the rest shape, two standard errors of a frame: most of it is taken off."""
    contact, off = pulse(20), 2 * NOISE
    lifted = course_of(contact, NOISE, off)[1].max() - 1
    np.testing.assert_allclose(lifted, 0.0, atol=0.2 * off)
    # but not a contact's frames next to it, nor frames far away
    force = np.full(3 * AROUND + 20, off)
    force[-20:] += contact
    start = len(force) - 20
    free = np.arange(len(force)) < start - AROUND
    found = contact_course(
        force, np.full(len(force), NOISE), free, np.zeros(len(force), bool), start, len(force)
    )[1]
    assert found.max() - 1 > 0.8 * off


def test_frames_that_a_codec_made_out_of_others_count_less():
    """They show a tenth less; every third frame is one of its own."""
    contact = pulse(40)
    coded = np.arange(40 + 2 * FREE) % 3 > 0
    seen = contact * np.where(coded[FREE : FREE + 40], 0.9, 1.0)
    plain = course_of(seen, NOISE)[1].max()
    better = course_of(seen, NOISE, interpolated=coded)[1].max()
    assert plain < better - BIAS
    assert better < 1


@pytest.mark.parametrize("shape", [pulse, plateau])
def test_a_gap_is_filled_with_no_smaller_error(shape):
    contact, hidden = shape(41), np.abs(np.arange(41) - 20) < 6
    rows, course, error = course_of(np.where(hidden, np.nan, contact), 0.01)
    assert len(rows) == 41
    assert abs(course[20] - 1) < 3 * error[20]
    assert error[hidden].min() >= error[~hidden].max()


def test_of_a_long_contact_the_frames_about_its_largest_force_are_used():
    contact = plateau(3 * MOST)
    contact[-30] = 1.1
    rows, course, _ = course_of(contact, 0.2)
    np.testing.assert_array_equal(rows, np.arange(2 * MOST, 3 * MOST))
    np.testing.assert_allclose(course[:50], contact[rows[:50]], atol=0.1)


def test_without_errors_nothing_is_known():
    rows, course, error = course_of(pulse(8), np.nan)
    assert len(rows) == len(course) == 8
    assert np.isnan([course, error]).all()
    assert np.isnan(course_of(np.full(8, np.nan), 0.1)[1]).all()


def test_a_fit_is_a_conditional_gaussian():
    """Free frames beside a contact, whose force has no variance, are taken out first."""
    rng, frame = np.random.default_rng(2), np.arange(25)
    touching, seen = (frame >= 5) & (frame < 20), rng.random(25) > 0.2
    noise = _noise(frame[seen], rng.uniform(0.1, 0.3, seen.sum()), rng.random(seen.sum()) > 0.5)
    force = rng.normal(size=25)
    given, left_noise = _given_free(force[seen], noise, ~touching[seen])
    likelihoods, naive = [], []
    for inside in _priors(frame[touching], 5, 20, 1.0):
        prior = np.zeros((25, 25))
        prior[5:20, 5:20] = inside
        known = prior[np.ix_(seen, seen)] + noise
        gain = prior[:, seen] @ np.linalg.inv(known)
        likelihood, factor, _ = _fitted(inside, given, left_noise, seen[touching])
        mean, error = _posterior(factor, inside, given, seen[touching])
        np.testing.assert_allclose(mean, (gain @ force[seen])[5:20], atol=RESTS)
        left = np.diag(prior - gain @ prior[seen])
        np.testing.assert_allclose(error**2, left[5:20], atol=RESTS)
        likelihoods.append(likelihood)
        naive.append(multivariate_normal(cov=known).logpdf(force[seen]))
    np.testing.assert_allclose(np.diff(likelihoods), np.diff(naive), rtol=1e-6)


def test_noise_is_shared_by_near_frames_and_larger_where_interpolated():
    errors = np.array([0.1, 0.2, 0.1])
    cov = _noise(np.array([0, 40, 400]), errors, np.array([False, True, False]))
    np.testing.assert_allclose(np.diag(cov), [0.01, 0.04 * (0.3 + 0.7 * 4), 0.01])
    assert cov[0, 1] == pytest.approx(0.3 * 0.1 * 0.2 / np.e)
    assert cov[0, 2] < 1e-6


def test_what_is_no_covariance_has_no_factor():
    with pytest.raises(np.linalg.LinAlgError, match="minor 2"):
        _factor(np.array([[1.0, 2.0], [2.0, 1.0]]))
