"""Hairs apart from the row of whiskers, told from whiskers that stand apart."""

import numpy as np
import pytest
from scipy.cluster.hierarchy import fcluster, linkage

from pipeline.tracking.hairs import APART, LEAST, _close_together, are_hairs, are_hairs_beside

LENGTH = 120.0  # px
ROW = np.array([[10.0 * k, 3.0 * (k % 2)] for k in range(20)])


@pytest.mark.parametrize(
    ("strength", "gap", "hair"), [(2, 1.2, True), (2, 0.8, False), (20, 3, False)]
)
def test_what_is_weak_and_apart_is_hair(strength, gap, hair):
    """Neither a weak whisker within the row is, nor a strong one apart."""
    bases = np.vstack([ROW, ROW[-1] + [gap * APART * LENGTH, 0]])
    found = are_hairs(bases, np.append(np.full(20, 10.0), strength), LENGTH)
    assert not found[:-1].any()
    assert found[-1] == hair


@pytest.mark.parametrize("n", [0, 3])
def test_where_no_line_is_known_nothing_is_hair(n):
    assert not are_hairs(np.zeros((n, 2)), np.full(n, np.nan), np.nan).any()


@pytest.mark.parametrize(
    ("part", "seen", "gap", "hair"),
    [(0.9, 1.0, 1.2, True), (1.1, 1.0, 1.2, False), (0.9, 1.0, 0.8, False), (3.0, 0.1, 1.2, True)],
)
def test_several_hairs_apart_from_known_whiskers_are_no_likelier_than_one(part, seen, gap, hair):
    """What is as strong as a whisker, or as near, is one; what is seldom seen is none."""
    hairs = ROW[-1] + np.array([[gap * APART * LENGTH + 5.0 * k, 0] for k in range(5)])
    strength = np.concatenate([np.full(20, 10.0), np.full(5, part * LEAST * 10.0)])
    often = np.concatenate([np.ones(20), np.full(5, seen / 5 if seen < 1 else 1.0)])
    found = are_hairs_beside(np.vstack([ROW, hairs]), strength, often, LENGTH, ROW[:3])
    assert not found[:20].any()
    assert (found[20:] == hair).all()
    assert not are_hairs_beside(hairs, strength[20:], often[20:], LENGTH, ROW[:3]).any()


def test_groups_are_those_of_single_linkage():
    rng = np.random.default_rng(3)
    for _ in range(20):
        places = rng.uniform(-50, 250, (40, 2))
        ours = _close_together(places, 30.0)
        same = ours[:, None] == ours
        for reach, holds in ((27.0, np.greater_equal), (33.0, np.less_equal)):  # whole px
            groups = fcluster(linkage(places, "single"), reach, "distance")
            assert holds(same, groups[:, None] == groups).all()
