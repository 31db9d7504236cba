"""The robust SD of normal values, with and without some that are far off."""

import numpy as np
import pytest

from pipeline.numerics.robust import column_medians, robust_sd

N = 20_000
CHANCE = 4 * 1.17 / np.sqrt(N)  # relative: the estimate's SD is 1.17/√n


def test_normal_values():
    values = np.random.default_rng(0).normal(3.0, 2.0, N)
    assert robust_sd(values) == pytest.approx(2.0, rel=CHANCE)
    assert robust_sd(values, about=3.0) == pytest.approx(2.0, rel=CHANCE)


def test_a_few_far_values_change_little():
    values = np.random.default_rng(1).normal(0.0, 1.0, N)
    values[: N // 100] = 1e6
    assert robust_sd(values) == pytest.approx(1.0, rel=0.02 + CHANCE)


def test_along_an_axis():
    values = np.random.default_rng(2).normal(0.0, [1.0, 5.0], (N, 2))
    np.testing.assert_allclose(robust_sd(values, 0.0, axis=0), [1, 5], rtol=CHANCE)
    np.testing.assert_allclose(robust_sd(values, axis=0), [1, 5], rtol=CHANCE)


def test_column_medians_are_those_of_the_known_values_of_each_column():
    values = np.array([[1.0, np.nan, 4.0], [3.0, np.nan, np.nan], [9.0, np.nan, 5.0]])
    np.testing.assert_array_equal(column_medians(values), [3.0, np.nan, 4.5])
