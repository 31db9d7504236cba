"""The constant error of stations is recovered from free frames; where there is none, none."""

from dataclasses import replace

import numpy as np
import pytest
import traced_motion

from pipeline.forces import station_noise
from synthetic.presets import make_trial
from whiskermodel.whisker import mouse_c2

AT = 5.5e-3
SEEN_PX = 0.004, 0.04  # what the picture's noise lets expect, at the first and last station
variance_tolerance = 0.25  # of itself


@pytest.fixture(scope="module")
def free():
    return traced_motion.trace(make_trial("free", 0, 0, 200).motion, noise_px=0.001).places


@pytest.mark.parametrize(("multiple", "constant_px"), [(9.0, 0.05), (1.0, 0.0), (1.0, 0.05)])
def test_a_constant_error_is_told_from_a_multiple_of_the_noise(free, multiple, constant_px):
    rng = np.random.default_rng(0)
    expected = np.geomspace(*SEEN_PX, free.x.shape[1]) * free.pixel
    true = multiple * expected**2 + (constant_px * free.pixel) ** 2
    across = rng.normal(0, np.sqrt(true), free.x.shape)
    along_x, along_y = np.gradient(free.x, axis=1), np.gradient(free.y, axis=1)
    length = np.hypot(along_x, along_y)
    seen = replace(
        free,
        x=free.x - across * along_y / length,
        y=free.y + across * along_x / length,
        information=np.where(np.isfinite(length * free.x), expected**-2, 0.0),
    )
    found = station_noise.with_observed_scatter(seen, mouse_c2(), AT, np.ones(len(free), bool))
    known = found.information[50] > 0
    ratio = multiple / (found.information[50] * true)[known]
    np.testing.assert_allclose(ratio, 1.0, rtol=variance_tolerance)


def test_without_free_frames_nothing_is_known(free):
    found = station_noise.with_observed_scatter(free, mouse_c2(), AT, np.zeros(len(free), bool))
    np.testing.assert_array_equal(found.information, free.information)


def test_usual_misfits_are_variances_of_few_outliers():
    """Of normal misfits, the median square stands for the variance; ten rows are needed."""
    rng, sd = np.random.default_rng(4), np.array([1.0, 3.0, 2.0, 1.0])
    square = (sd * rng.normal(size=(4000, 4))) ** 2
    square[:400] = 1e4
    expected = rng.uniform(0.9, 1.1, (4000, 4)) * sd**2 / 2
    square[9:, 2], square[10:, 3] = np.nan, np.nan
    found, usual = station_noise.usual_misfit(square, expected)
    np.testing.assert_allclose(found[:2], sd[:2] ** 2, rtol=0.35)  # a tenth is wild
    np.testing.assert_allclose(usual[:2], sd[:2] ** 2 / 2, rtol=0.02)
    np.testing.assert_array_equal(np.isnan(found), [False, False, True, False])
    calm, _ = station_noise.usual_misfit(square[400:], expected[400:])
    np.testing.assert_allclose(calm[:2], sd[:2] ** 2, rtol=0.1)


def test_a_station_that_is_shifted_in_all_free_frames_counts_less(free):
    """As one upon which a hair lies; the others keep what they have."""
    aside = np.zeros(free.x.shape)
    aside[:, 25] = 0.1 * free.pixel
    along_x, along_y = np.gradient(free.x, axis=1), np.gradient(free.y, axis=1)
    length = np.hypot(along_x, along_y)
    rng = np.random.default_rng(0)
    across = aside + rng.normal(0, 0.02 * free.pixel, free.x.shape)
    seen = replace(
        free,
        x=free.x - across * along_y / length,
        y=free.y + across * along_x / length,
        information=np.where(np.isfinite(length * free.x), (0.02 * free.pixel) ** -2, 0.0),
    )
    found = station_noise.with_observed_scatter(seen, mouse_c2(), AT, np.ones(len(free), bool))
    known = np.flatnonzero(seen.information[50] > 0)
    part = found.information[50, known] / seen.information[50, known]
    away = np.abs(known - 25) * free.spacing[0]
    assert part[known == 25] < 0.05
    assert part[away > 2e-3].min() > 0.7
