"""Stretches of frames beside a walk from frame to frame; samples that reach from end to end."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.numerics.runs import differences, evenly, runs_of_true


@given(st.lists(st.booleans()))
def test_runs_are_those_of_a_walk(mask):
    found, begun = [], None
    for frame, holds in enumerate([*mask, False]):
        if holds and begun is None:
            begun = frame
        elif not holds and begun is not None:
            found.append((begun, frame))
            begun = None
    assert runs_of_true(mask) == found


@given(st.integers(0, 500), st.integers(2, 50))
def test_a_spread_sample_reaches_from_the_first_to_the_last_in_even_steps(count, most):
    found = evenly(count, most).tolist()
    if count <= most:
        assert found == list(range(count))
    else:
        steps = [after - before for before, after in pairwise(found)]
        assert (found[0], found[-1], len(found)) == (0, count - 1, most)
        assert max(steps) - min(steps) <= 1


@given(
    st.lists(st.integers(1, 2), min_size=5, max_size=30),
    st.integers(1, 4),
    st.integers(0, 30),
    st.integers(0, 99),
)
def test_differences_are_those_of_frames_that_follow_each_other(steps, order, unknown, seed):
    frame = np.cumsum(steps)
    values = np.random.default_rng(seed).normal(size=len(frame))
    values[unknown : unknown + 1] = np.nan
    naive = [
        np.diff(values[k : k + order + 1], order)[0]
        for k in range(len(frame) - order)
        if steps[k + 1 : k + order + 1] == [1] * order
        and np.isfinite(values[k : k + order + 1]).all()
    ]
    np.testing.assert_array_equal(differences(values, frame, order), naive)
