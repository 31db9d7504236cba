"""Figures of tables beside the truth: errors, coverage, contacts found and missed."""

from itertools import permutations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.tables.columns import CONTACT_COLUMNS, as_table
from synthetic.scoring.table_scoring import (
    contact_agreement,
    coverage,
    edge_errors,
    edges_within,
    error_figures,
    join_frames,
    match_contacts,
    overlaps,
    peak_figures,
)

# Frames --------------------------------------------------------------------------------------


def test_error_figures_of_gaussian_errors():
    rng = np.random.default_rng(3)
    n = 20000
    truth = pd.DataFrame({"frame": np.arange(n), "whisker": "A", "k": 1.0, "in_contact": False})
    result = truth.assign(k=rng.normal(1.2, 0.5, n), k_se=0.5, tracked=True)[: n - 1000]
    joined = join_frames(result, truth)
    figures = error_figures(joined, "k")
    assert figures["count"] == n - 1000
    assert figures["bias"] == pytest.approx(0.2, abs=0.015)  # 4 standard errors
    assert figures["sd"] == pytest.approx(0.5, abs=0.012)
    assert figures["robust_sd"] == pytest.approx(0.5, abs=0.02)
    assert figures["coverage"] == pytest.approx(0.931, abs=0.01)  # Φ(1.56) − Φ(−2.36)
    assert contact_agreement(joined) == 1


def test_full_turns_are_no_error_of_an_angle():
    truth = pd.DataFrame({"frame": [0, 1, 2], "whisker": "A", "base_angle_deg": [170.0, 180, 190]})
    found = truth.assign(base_angle_deg=[171.0, -180, -171], base_angle_se_deg=1.0, tracked=True)
    figures = error_figures(join_frames(found, truth), "base_angle_deg")
    assert figures["bias"] == pytest.approx(0.0)
    assert figures["sd"] == pytest.approx(np.sqrt(2 / 3))
    assert figures["coverage"] == 1.0


def test_untracked_frames_disagree_only_in_contact():
    truth = pd.DataFrame({"frame": [0, 1, 2, 3], "whisker": "A", "in_contact": [0, 1, 1, 0]})
    result = pd.DataFrame({"frame": [0, 1], "whisker": "A", "tracked": True, "in_contact": True})
    assert contact_agreement(join_frames(result, truth)) == pytest.approx(0.5)


def test_coverage_needs_standard_errors():
    assert np.isnan(coverage([0.1, 0.2], [np.nan, 0.0]))
    assert coverage([0.1, 3.0, np.nan], [1.0, 1.0, 1.0]) == pytest.approx(0.5)


# Contacts ------------------------------------------------------------------------------------


def contacts(*intervals, peaks=None, whisker="A", flags=""):
    rows = [
        {"video": "v", "whisker": whisker, "onset_frame": a, "offset_frame": b, "flags": flags}
        for a, b in intervals
    ]
    table = as_table(pd.DataFrame(rows), CONTACT_COLUMNS)
    return table if peaks is None else table.assign(peak_force_uN=peaks)


def test_contacts_found_missed_invented_and_split():
    truth = contacts((10, 30), (50, 60), (80, 90))
    result = contacts((11, 20), (22, 29), (51, 59), (100, 110))
    match = match_contacts(result, truth)
    assert match.pairs["true_onset_frame"].tolist() == [10, 50]
    assert match.pairs["onset_frame"].tolist() == [11, 51]
    assert match.missed["onset_frame"].tolist() == [80]
    assert match.surplus["onset_frame"].tolist() == [22]
    assert match.invented["onset_frame"].tolist() == [100]
    assert match.pairs["overlap"].tolist() == [9 / 20, 8 / 10]


def test_two_true_contacts_found_as_one_are_one_found_and_one_missed():
    match = match_contacts(contacts((10, 43)), contacts((10, 20), (23, 43)))
    assert len(match.pairs) == len(match.missed) == 1
    assert match.missed["onset_frame"].tolist() == [10]


def test_contacts_of_another_whisker_do_not_match():
    match = match_contacts(contacts((10, 20), whisker="B"), contacts((10, 20)))
    assert len(match.missed) == len(match.invented) == 1
    assert match_contacts(contacts(), contacts((1, 2))).missed["onset_frame"].tolist() == [1]


intervals = st.lists(st.tuples(st.integers(0, 30), st.integers(1, 8)), min_size=1, max_size=4)


@settings(deadline=None, max_examples=25)
@given(intervals, intervals)
def test_matching_is_the_best_of_all(true, found):
    true, found = (contacts(*[(a, a + n) for a, n in each]) for each in (true, found))
    share = overlaps(true, found)
    if share.shape[0] > share.shape[1]:
        share = share.T
    rows = range(share.shape[0])
    best = max(
        sum(share[i, j] for i, j in zip(rows, order, strict=True))
        for order in permutations(range(share.shape[1]), share.shape[0])
    )
    assert match_contacts(found, true).pairs["overlap"].sum() == pytest.approx(best)


def test_edges():
    match = match_contacts(contacts((11, 28), (50, 60)), contacts((10, 30), (50, 60)))
    onset, offset = edge_errors(match)
    assert onset.tolist() == [1, 0]
    assert offset.tolist() == [-2, 0]
    assert edges_within(match, 1) == 0.5
    assert edges_within(match, 2) == 1
    cut = match_contacts(contacts((0, 28)), contacts((2, 30), flags="starts_before"))
    assert [len(each) for each in edge_errors(cut)] == [0, 1]


def test_peaks():
    truth = contacts((0, 9), (10, 19), (20, 29), (30, 39), peaks=[10.0, 1.0, 20.0, 5.0])
    result = contacts((0, 9), (10, 19), (20, 29), (30, 39), peaks=[10.2, 1.09, 22.0, np.nan])
    figures = peak_figures(match_contacts(result, truth), "peak_force_uN", 0.03, 0.1)
    assert figures["count"] == 4
    assert figures["within"] == 0.5  # a peak that was not measured is not within
    assert figures["median"] == pytest.approx((0.09 + 0.1) / 2)
    assert figures["bias"] == pytest.approx(0.09)
    assert figures["p95"] == np.inf
