"""The drawn population against the published numbers of Fig. 3 d–f."""

import numpy as np
import pytest

from synthetic.population import PUBLISHED_CONTACTS, PUBLISHED_R2, draw_contacts, share_out

percentile_tolerance = 0.02  # of each published number
r2_tolerance = 0.01


def test_full_size_has_the_published_numbers():
    force, duration = draw_contacts(np.arange(PUBLISHED_CONTACTS), seed=3)
    found = [*np.percentile(1e6 * force, [5, 50, 95]), 1e6 * force.mean()]
    assert found == pytest.approx([1.8, 16.1, 44.4, 19.6], rel=percentile_tolerance)
    found = [*np.percentile(duration, [5, 50, 95]), duration.mean()]
    assert found == pytest.approx([5, 16, 113, 30.9], rel=percentile_tolerance)
    r2 = np.corrcoef(force, duration)[0, 1] ** 2
    assert r2 == pytest.approx(PUBLISHED_R2, abs=r2_tolerance)
    assert duration.min() == 3


def test_a_contact_does_not_depend_on_how_many_there_are():
    many, few = draw_contacts(np.arange(500), 1), draw_contacts(np.arange(100, 130), 1)
    assert np.array_equal(many[0][100:130], few[0])
    assert np.array_equal(many[1][100:130], few[1])
    assert not np.array_equal(draw_contacts(np.arange(500), 2)[0], many[0])


def test_sharing_out_respects_what_poles_bear():
    rng = np.random.default_rng(0)
    forces = rng.uniform(0, 40, 60)
    limits = np.array([100, 80, 50, 30, 20])
    chosen = share_out(forces, forces[:, None] < limits, rng)
    assert np.all(limits[chosen] > forces)
    assert np.bincount(chosen, minlength=5).max() <= 13
    assert share_out([5.0], [[False, False]], rng).tolist() == [-1]
