"""Chains of states, beside all paths there are."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.numerics.chains import likeliest_path, state_probabilities, two_states


def all_paths(steps):
    """Every path and its minus log probability."""
    n, size = len(steps), steps.shape[2]
    for path in product(range(size), repeat=n):
        cost = steps[0, 0, path[0]]
        yield path, cost + sum(steps[t, path[t - 1], path[t]] for t in range(1, n))


CHAINS = given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6), size=st.integers(1, 3))


@settings(deadline=None)
@CHAINS
def test_likeliest_path_is_the_cheapest_of_all(seed, n, size):
    steps = np.random.default_rng(seed).uniform(0, 5, (n, size, size))
    states, cost = likeliest_path(steps)
    path, least = min(all_paths(steps), key=lambda each: each[1])
    assert tuple(states) == path
    assert cost == pytest.approx(least)


def test_of_equally_likely_paths_one_stays_where_it_is():
    states, _ = likeliest_path(np.zeros((5, 2, 2)))
    assert states.tolist() == [0] * 5


@settings(deadline=None)
@CHAINS
def test_state_probabilities_are_sums_over_all_paths(seed, n, size):
    steps = np.random.default_rng(seed).uniform(0, 5, (n, size, size))
    expected = np.zeros((n, size))
    for path, cost in all_paths(steps):
        expected[np.arange(n), list(path)] += np.exp(-cost)
    expected /= expected.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(state_probabilities(steps), expected, rtol=1e-9)


def test_two_states_without_observations_are_at_equilibrium():
    starts, ends = 0.02, 0.1
    on = state_probabilities(two_states(np.zeros(50), starts, ends))[:, 1]
    np.testing.assert_allclose(on, starts / (starts + ends), rtol=1e-9)


def test_two_states_follow_what_is_sure():
    log_odds = np.array([-1e4, -1e4, 1e4, 1e4, -1e4])
    on = state_probabilities(two_states(log_odds, 0.02, 0.1))[:, 1]
    np.testing.assert_allclose(on, [0, 0, 1, 1, 0], atol=1e-12)
