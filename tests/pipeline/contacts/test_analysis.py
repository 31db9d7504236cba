"""Contacts found in traced rendered motion without pictures; the decision's parts."""

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
import traced_motion
from hypothesis import given, settings
from hypothesis import strategies as st
from measured_contacts import analyse_contacts
from scipy.integrate import quad
from scipy.stats import norm
from usual_parameters import measure_stations

from pipeline.contacts import analysis
from pipeline.contacts.intervals import find_intervals, in_contact
from pipeline.contacts.probability import (
    _log_odds,
    _log_skewed,
    add_probability,
    force_noise,
    posterior,
)
from pipeline.session.parameters import DEFAULTS
from pipeline.tables.columns import CONTACT_FLAGS, CORRECTION_COLUMNS, as_table, split_flags
from synthetic.presets import make_trial

pytestmark = pytest.mark.slow

edge_tolerance = 1  # frames
frames_in_agreement = 0.995
peak_force_tolerance = 0.03  # relative, or
peak_force_floor = 0.1  # µN


@lru_cache
def analysed(preset, trial=0, frames=500, noise_px=0.02):
    motion = make_trial(preset, 0, trial, frames).motion
    traced = traced_motion.trace(motion, noise_px=noise_px)
    tables = analyse_contacts(
        traced.frames,
        traced.places,
        traced.recording,
        traced.whiskers,
        analysis.ContactOptions(video="test"),
    )
    return traced, tables


def agreement(traced, tables):
    truth = traced.true_frames["in_contact"].to_numpy()
    return (tables.frames["in_contact"].to_numpy() == truth).mean()


@pytest.mark.parametrize(
    ("preset", "trial"), [("noisy", 0), ("noisy", 1), ("close_touches", 0), ("moving_pole", 0)]
)
def test_every_contact_to_the_frame(preset, trial):
    traced, tables = analysed(preset, trial)
    truth = traced.true_contacts
    assert len(truth) > 2
    assert len(tables.contacts) == len(truth)
    for edge in ("onset_frame", "offset_frame"):
        off = tables.contacts[edge].to_numpy() - truth[edge].to_numpy()
        assert np.abs(off).max() <= edge_tolerance
    assert agreement(traced, tables) >= frames_in_agreement
    error = tables.contacts["peak_force_uN"].to_numpy() - truth["peak_force_uN"].to_numpy()
    allowed = np.maximum(peak_force_tolerance * truth["peak_force_uN"], peak_force_floor)
    assert (np.abs(error) < allowed).all()


@pytest.mark.parametrize("trial", [0, 1, 2, 3])
def test_whisker_almost_at_rest(trial):
    """Free frames lie at angles far from those of the touches; in one trial none is 0.2 mm off."""
    traced, tables = analysed("resting", trial, 400)
    truth, found = traced.true_contacts, tables.contacts
    assert len(truth) == len(found) == 3
    for edge in ("onset_frame", "offset_frame"):
        assert np.abs(found[edge] - truth[edge]).max() <= edge_tolerance
    for column in ("peak_force_uN", "peak_base_moment_nN_m"):
        np.testing.assert_allclose(found[column], truth[column], rtol=0.015)
    error = found["peak_force_uN"] - truth["peak_force_uN"]
    assert (np.abs(error) < 1.96 * found["peak_force_se_uN"]).all()
    assert (found["peak_force_se_uN"] < 0.06 * truth["peak_force_uN"]).all()
    assert not found["flags"].str.contains("no_rest_curvature|gaps_in_trace|doubtful").any()
    free = ~traced.true_frames["in_contact"].to_numpy(bool)
    force = tables.evidence["shape_force_N"].to_numpy(float)[free]
    assert np.nanstd(force) < 0.05e-6
    assert tables.frames["contact_force_uN_se"].max() < 2.0


@pytest.mark.parametrize(("before", "after"), [(5, 8), (2, 4)])
def test_short_clip_with_few_free_frames(before, after):
    traced, _ = analysed("resting", 0, 400)
    onset = int(traced.true_contacts["onset_frame"].iloc[0])
    offset = int(traced.true_contacts["offset_frame"].iloc[0])
    keep = slice(onset - before, offset + after)
    places = traced.places.rows(keep)
    tables = analyse_contacts(traced.frames.iloc[keep], places, traced.recording, traced.whiskers)
    assert len(tables.contacts) == 1
    found = tables.contacts.iloc[0]
    assert (found["onset_frame"], found["offset_frame"]) == (onset, offset)
    peak = traced.true_contacts["peak_force_uN"].iloc[0]
    assert found["peak_force_uN"] == pytest.approx(peak, rel=0.05)
    assert abs(found["peak_force_uN"] - peak) < 2.5 * found["peak_force_se_uN"]


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_few_frames(frames):
    traced, _ = analysed("resting", 0, 400)
    tables = analyse_contacts(
        traced.frames.iloc[:frames], traced.places.rows(slice(frames)), traced.recording,
        traced.whiskers,
    )  # fmt: skip
    assert len(tables.frames) == frames
    assert tables.contacts["peak_force_uN"].isna().all()


@pytest.mark.parametrize("cut", ["begins", "ends"])
def test_a_contact_of_which_the_video_has_one_frame(cut):
    traced, _ = analysed("noisy")
    truth = traced.true_contacts.iloc[3]  # 0.8 µN in its first and last frame
    onset, offset = int(truth["onset_frame"]), int(truth["offset_frame"])
    keep = slice(offset - 1, offset + 200) if cut == "begins" else slice(onset - 150, onset + 1)
    tables = analyse_contacts(
        traced.frames.iloc[keep], traced.places.rows(keep), traced.recording, traced.whiskers
    )
    at = offset - 1 if cut == "begins" else onset
    (found,) = tables.contacts[tables.contacts["onset_frame"] == at].itertuples()
    assert found.offset_frame == at + 1
    assert ("starts_before" if cut == "begins" else "ends_after") in found.flags
    force = traced.true_frames["contact_force_uN"][at]
    assert found.peak_force_uN == pytest.approx(force, abs=peak_force_floor)


def test_touched_throughout_has_no_rest_shape_but_no_gaps():
    traced, _ = analysed("resting", 0, 400)
    first = traced.true_contacts.iloc[0]
    keep = slice(int(first["onset_frame"]), int(first["offset_frame"]))
    tables = analyse_contacts(
        traced.frames.iloc[keep], traced.places.rows(keep), traced.recording, traced.whiskers
    )
    (flags,) = tables.contacts["flags"]
    assert "no_rest_curvature" in flags
    assert "gaps_in_trace" not in flags
    assert tables.contacts["peak_force_uN"].isna().all()


def test_a_force_that_errs_leaves_the_gap_to_decide():
    sd = np.full(3, 1e-6), np.full(3, 0.01e-6)
    gap = np.array([40e-6, 40e-6, 0.5e-6])
    force = np.array([-0.3e-6, 0.0, -0.3e-6])  # a pole does not pull
    away, plainly_away, touching = _log_odds(
        gap, sd[0], force, sd[1], np.zeros(3), DEFAULTS.contacts
    )
    assert plainly_away < away < -5
    assert touching > 3


def test_faint_pushes_do_not_say_where_the_pole_is():
    """Free frames that seem pushed, as by a trace that errs near the base, are no touches."""
    traced, tables = analysed("noisy")
    evidence = tables.evidence.copy()
    free = ~traced.true_frames["in_contact"].to_numpy(bool)
    evidence.loc[free, "shape_force_N"] += 10 * evidence.loc[free, "shape_force_se_N"]
    evidence.loc[free, "gap_m"] = np.clip(evidence.loc[free, "gap_m"], 60e-6, 120e-6)
    found = find_intervals(
        add_probability(evidence, traced.recording, DEFAULTS.contacts), params=DEFAULTS.contacts
    )
    assert len(found) == len(traced.true_contacts)
    onset = found["onset_frame"] - traced.true_contacts["onset_frame"]
    assert np.abs(onset).max() <= 2  # a frame that seems pushed beside a contact


def test_what_a_whisker_passes_over_it_does_not_touch():
    traced, tables = analysed("noisy")
    evidence = tables.evidence.copy()
    assert not evidence["across"].any()
    free = evidence.index[tables.frames["in_contact"].to_numpy() == 0]
    few, many = evidence.copy(), evidence.copy()
    few.loc[free[:5], "across"] = True  # it slipped past
    many.loc[free[: tables.frames["in_contact"].sum() + 1], "across"] = True
    kept, dropped = (
        find_intervals(
            add_probability(each, traced.recording, DEFAULTS.contacts), params=DEFAULTS.contacts
        )
        for each in (few, many)
    )
    assert len(kept) == len(tables.contacts)
    assert len(dropped) == 0


@pytest.mark.parametrize("shorter", [1.0, 0.85])
def test_a_whisker_that_bends_as_another_is_flagged(shorter):
    """Loads of a C2 given the dimensions of a whisker that is 15 % shorter."""
    traced, _ = analysed("noisy")
    (whisker,) = traced.whiskers.values()
    taken_for = replace(
        whisker, length=shorter * whisker.length, cone_length=shorter * whisker.cone_length
    )
    places = measure_stations(
        traced.lines, traced.recording, [taken_for], [traced_motion.HIDDEN], traced.pole
    )
    found = analyse_contacts(
        traced.frames, places, traced.recording, {whisker.name: taken_for}
    ).contacts
    strong = traced.true_contacts["peak_force_uN"] > 5
    unlike = found["flags"].str.contains("bends_unlike_rod")
    assert len(found) == len(strong)
    assert strong.sum() >= 3
    assert not unlike.any() if shorter == 1.0 else unlike[strong].all()


def test_a_contact_is_found_where_the_rest_shape_hides_its_force():
    """Forces in a short touch and beside it are off by more than its own: the rest shape errs."""
    _, tables = analysed("noisy")
    contacts, evidence = tables.contacts, tables.evidence.copy()
    short = contacts["duration_ms"].between(3, 40)
    shortest = contacts[short].sort_values("peak_force_uN").iloc[0]
    near = evidence["frame"].between(shortest["onset_frame"] - 20, shortest["offset_frame"] + 20)
    for method in ("shape", "point"):
        evidence.loc[near, f"{method}_force_N"] -= 1e-6 * shortest["peak_force_uN"]
        evidence.loc[near, f"{method}_force_se_N"] = 1e-6 * shortest["peak_force_uN"]
    found = find_intervals(evidence, params=DEFAULTS.contacts).set_index("onset_frame")
    assert len(found) == len(contacts)
    flagged = found.index[found["flags"].str.contains("faint_force")]
    assert flagged.tolist() == [shortest["onset_frame"]]
    # not so far from where other touches are, however much it is pushed
    away = evidence.copy()
    away.loc[near, "gap_m"] += 1e-3
    assert len(find_intervals(away, params=DEFAULTS.contacts)) == len(contacts) - 1
    # where it is pushed no more than beside, it touches as it stops where other touches are
    inside = near & tables.frames["in_contact"].to_numpy(bool)
    evidence.loc[inside, ["shape_force_N", "point_force_N"]] = -1e-6 * shortest["peak_force_uN"]
    assert len(find_intervals(evidence, params=DEFAULTS.contacts)) == len(contacts)
    # one that turns back there smoothly does not
    place = evidence.loc[tables.frames["in_contact"].to_numpy(bool), "gap_m"].median()
    middle = 0.5 * (shortest["onset_frame"] + shortest["offset_frame"])
    evidence.loc[near, "gap_m"] = place + 0.2e-6 * (evidence.loc[near, "frame"] - middle) ** 2
    assert (
        shortest["onset_frame"]
        not in find_intervals(evidence, params=DEFAULTS.contacts)["onset_frame"].tolist()
    )


@pytest.mark.parametrize(("distance", "more"), [(0.17e-3, 1), (0.25e-3, 0)])
def test_what_is_far_from_the_pole_touches_nothing(distance, more):
    """A force that seems there for some frames, as where the rest shape drifts, needs a pole."""
    traced, tables = analysed("noisy")
    evidence = tables.evidence.copy()
    far = evidence["distance_m"] > 0.5e-3
    start = next(i for i in evidence.index if far.loc[i : i + 11].sum() == 12)
    seeming = slice(start, start + 11)
    evidence.loc[seeming, ["log_odds", "probability", "distance_m"]] = 2.0, 1.0, distance
    evidence.loc[seeming, "shape_force_N"] = 9 * evidence["shape_force_se_N"].median()
    assert (
        len(find_intervals(evidence, params=DEFAULTS.contacts)) == len(traced.true_contacts) + more
    )


def test_contact_does_not_hang_on_the_forces_standard_error():
    traced, tables = analysed("noisy")
    evidence = tables.evidence.copy()
    evidence["shape_force_se_N"] = 1e-3  # as if next to nothing were known of the rest shape
    kept = find_intervals(evidence, params=DEFAULTS.contacts)
    assert len(kept) == len(traced.true_contacts)
    assert (kept["onset_frame"] == tables.contacts["onset_frame"]).all()
    # nor does a push that no force shows make one
    none = evidence.assign(shape_force_N=1e-12, point_force_N=1e-12)
    assert len(find_intervals(none, params=DEFAULTS.contacts)) == 0


def test_a_hidden_length_that_is_hardly_known_makes_no_force_faint():
    """It changes forces by a share of them: what pushes clearly pushes all the same."""
    traced, tables = analysed("noisy")
    evidence = tables.evidence.copy()
    share = 0.5 * evidence["shape_force_N"].abs()
    own = force_noise(evidence)
    evidence["origin_force_se_N"], evidence["shape_force_se_N"] = share, np.hypot(own, share)
    found = find_intervals(
        add_probability(evidence, traced.recording, DEFAULTS.contacts), params=DEFAULTS.contacts
    )
    assert found["onset_frame"].tolist() == tables.intervals["onset_frame"].tolist()
    assert found["flags"].tolist() == tables.intervals["flags"].tolist()


@pytest.mark.parametrize("preset", ["noisy", "faint_touch", "large_deflection"])
def test_every_flag_has_a_meaning(preset):
    flags = [flag for each in analysed(preset)[1].contacts["flags"] for flag in split_flags(each)]
    assert set(flags) <= set(CONTACT_FLAGS)
    assert flags or preset == "noisy"


def test_faint_touches_near_the_tip():
    traced, tables = analysed("faint_touch")
    clear = traced.true_contacts[traced.true_contacts["peak_force_uN"] >= 0.3]
    assert len(clear) > 2
    found = tables.contacts
    for onset, offset in clear[["onset_frame", "offset_frame"]].to_numpy():
        overlap = (found["onset_frame"] < offset) & (found["offset_frame"] > onset)
        assert overlap.sum() == 1
    assert agreement(traced, tables) >= 0.98


@pytest.mark.parametrize("preset", ["near_miss", "free"])
def test_no_contact_is_invented(preset):
    traced, tables = analysed(preset)
    assert len(traced.true_contacts) == 0
    assert len(tables.contacts) == 0
    assert tables.frames["in_contact"].sum() == 0
    # near_miss does come near: it is not a large distance that keeps it free
    nearest = tables.frames["pole_distance_mm"].min()
    assert nearest == pytest.approx(traced.true_frames["pole_distance_mm"].min(), abs=5e-3)
    assert preset != "near_miss" or nearest < 0.3


def test_touch_that_is_not_seen_without_its_pole():
    motion = make_trial("noisy", 0, 0, 200).motion
    traced = traced_motion.trace(motion, without_pole=True)
    tables = analyse_contacts(traced.frames, traced.places, traced.recording, traced.whiskers)
    assert len(tables.contacts) == 0
    assert tables.frames["pole_distance_mm"].isna().all()


def test_contacts_without_dimensions_and_no_forces():
    traced, with_forces = analysed("noisy")
    tables = analyse_contacts(
        traced.frames, traced.places, traced.recording, dict.fromkeys(traced.whiskers)
    )
    assert agreement(traced, tables) > 0.99
    assert len(tables.contacts) == len(with_forces.contacts)
    assert tables.frames["contact_force_uN"].isna().all()
    assert tables.contacts["steady_peak_nN_m"].isna().all()
    # what stands in for the whisker says nothing of how it should bend
    assert not tables.contacts["flags"].str.contains("bends_unlike_rod").any()


def test_untraced_frames_are_bridged_inside_a_contact():
    motion = make_trial("noisy", 0, 0, 500).motion
    whole, _ = analysed("noisy")
    first = whole.true_contacts.query("duration_ms >= 12").iloc[0]
    middle = (first["onset_frame"] + first["offset_frame"]) // 2
    lost = np.arange(middle - 2, middle + 2)
    lines = traced_motion.rows_of(whole.lines, ~np.isin(whole.lines.frame, lost))
    whisker = list(whole.whiskers.values())
    places = measure_stations(lines, whole.recording, whisker, [traced_motion.HIDDEN], whole.pole)
    frames = whole.frames.copy()
    frames.loc[frames["frame"].isin(lost), "tracked"] = False
    tables = analyse_contacts(frames, places, whole.recording, whole.whiskers)
    assert len(motion) == len(frames)
    onset = tables.contacts["onset_frame"] - first["onset_frame"]
    same = tables.contacts[onset.abs() <= 1]
    assert len(same) == 1
    assert abs(same["offset_frame"].iloc[0] - first["offset_frame"]) <= 1
    assert "gaps_in_trace" in same["flags"].iloc[0].split(";")
    assert tables.frames.loc[lost, "contact_force_uN"].isna().all()


def test_rows_in_any_order_and_input_unchanged():
    traced, tables = analysed("noisy")
    order = np.random.default_rng(0).permutation(len(traced.frames))
    shuffled = traced.frames.iloc[order]
    before = shuffled.copy()
    again = analyse_contacts(
        shuffled,
        traced.places,
        traced.recording,
        traced.whiskers,
        analysis.ContactOptions(video="test"),
    )
    pd.testing.assert_frame_equal(shuffled, before)
    pd.testing.assert_frame_equal(again.contacts, tables.contacts)
    np.testing.assert_array_equal(again.frames["frame"], before["frame"])
    np.testing.assert_array_equal(
        again.frames["in_contact"], tables.frames["in_contact"].to_numpy()[order]
    )


def test_corrections_change_contacts_but_no_evidence():
    traced, tables = analysed("noisy")
    onset = int(tables.contacts["onset_frame"].iloc[0])
    offset = int(tables.contacts["offset_frame"].iloc[0])
    corrections = as_table(
        pd.DataFrame(
            {
                "whisker": ["C2"],
                "verdict": ["free"],
                "onset_frame": [onset],
                "offset_frame": [offset],
                "covers_from": [onset],
                "covers_to": [offset],
            }
        ),
        CORRECTION_COLUMNS,
    )
    again = analysis.find_contacts(
        tables.frames, tables.evidence, traced.recording, traced.whiskers, corrections=corrections
    )
    assert len(again.contacts) == len(tables.contacts) - 1
    assert onset not in set(again.contacts["onset_frame"])
    pd.testing.assert_frame_equal(again.evidence, tables.evidence)
    same = analysis.find_contacts(
        tables.frames, tables.evidence, traced.recording, traced.whiskers
    )
    pd.testing.assert_frame_equal(same.frames, tables.frames)
    pd.testing.assert_frame_equal(
        same.contacts.drop(columns="video"), tables.contacts.drop(columns="video")
    )


def test_a_contact_that_a_person_adds_is_certain():
    traced, tables = analysed("noisy")
    free = np.flatnonzero(~tables.frames["in_contact"].to_numpy(bool))
    onset = int(free[np.flatnonzero(np.diff(free, 4) == 0)[0]])
    added = {
        "whisker": "C2",
        "verdict": "contact",
        "onset_frame": onset,
        "offset_frame": onset + 3,
    }
    covers = {"covers_from": onset, "covers_to": onset + 3}
    again = analysis.find_contacts(
        tables.frames, tables.evidence, traced.recording, traced.whiskers,
        corrections=as_table(pd.DataFrame([added | covers]), CORRECTION_COLUMNS),
    )  # fmt: skip
    assert len(again.intervals) == len(tables.intervals) + 1
    assert again.intervals.loc[again.intervals["curated"], "probability"].tolist() == [1.0]


# Parts ---------------------------------------------------------------------------------------


def all_paths_posterior(log_odds, starts, ends):
    """Posterior of contact by summing over every path of states."""
    n = len(log_odds)
    first = starts / (starts + ends)
    total, contact_mass = 0.0, np.zeros(n)
    for code in range(2**n):
        states = (code >> np.arange(n)) & 1
        p = first if states[0] else 1 - first
        for a, b in pairwise(states):
            p *= ((1 - ends) if b else ends) if a else (starts if b else 1 - starts)
        p *= np.exp((states * log_odds).sum())
        total += p
        contact_mass += p * states
    return contact_mass / total


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(-20, 20), min_size=1, max_size=8),
    st.floats(0.01, 0.5),
    st.floats(0.01, 0.5),
)
def test_posterior_is_the_sum_over_all_paths(log_odds, starts, ends):
    log_odds = np.array(log_odds)
    np.testing.assert_allclose(
        posterior(log_odds, starts, ends), all_paths_posterior(log_odds, starts, ends), atol=1e-9
    )


@pytest.mark.parametrize("x", [-3.0, -0.2, 0.0, 0.5, 4.0, 60.0])
def test_skewed_density_is_the_blurred_exponential(x):
    sd, scale = 0.7, 3.0

    def density(t):
        return np.exp(-t / scale) / scale * norm.pdf(x, t, sd)

    low, high = max(x - 10 * sd, 0.0), max(x + 10 * sd, 5 * sd)
    direct, _ = quad(density, low, high, points=[max(x, 0.0)], epsabs=0, epsrel=1e-10)
    assert _log_skewed(np.array([x]), sd, scale)[0] == pytest.approx(np.log(direct), abs=1e-6)


def test_skewed_density_far_out_has_no_overflow():
    x = np.array([-1e3, -50.0, 1e3, 1e5])
    assert np.isfinite(_log_skewed(x, 1.0, 5.0)).all()


def test_odds_favour_contact_when_pushed_and_free_when_away():
    um, un = 1e-6, 1e-6
    args = (2 * um, np.array([0.05 * un] * 4), np.zeros(4))
    gap = np.array([0.0, 0.0, 40 * um, 400 * um])
    force = np.array([2 * un, 0.0, 0.0, 0.0])
    odds = _log_odds(gap, args[0], force, args[1], args[2], DEFAULTS.contacts)
    assert odds[0] > 10  # limited by the share of outliers
    assert abs(odds[1]) < 6
    assert odds[2] < -10
    assert odds[3] < -10


def test_in_contact_is_half_open():
    frames = pd.DataFrame({"frame": [0, 1, 2, 3] * 2, "whisker": ["a"] * 4 + ["b"] * 4})
    intervals = pd.DataFrame({"whisker": ["a"], "onset_frame": [1], "offset_frame": [3]})
    np.testing.assert_array_equal(
        in_contact(frames, intervals), [False, True, True, False] + [False] * 4
    )


@given(st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 30), st.integers(1, 9))))
def test_in_contact_is_what_counting_frames_says(spans):
    frames = pd.DataFrame([(f, w) for f in range(35) for w in "ba"], columns=["frame", "whisker"])
    frames = frames.sample(frac=1.0, random_state=0)
    columns = ["whisker", "onset_frame", "offset_frame"]
    intervals = pd.DataFrame([(w, on, on + n) for w, on, n in spans], columns=columns)
    touched = {(w, f) for w, on, n in spans for f in range(on, on + n)}
    expected = [(w, f) in touched for f, w in frames.itertuples(index=False)]
    np.testing.assert_array_equal(in_contact(frames, intervals), expected)


@pytest.mark.parametrize("wrong_by_mm", [0.0, 0.45, -0.45])
def test_a_hidden_length_that_the_bending_contradicts_is_corrected_and_flagged(wrong_by_mm):
    """Uncorrected, 0.45 mm would move the forces by more than 10 %."""
    traced, _ = analysed("noisy")
    hidden = traced_motion.HIDDEN + 1e-3 * wrong_by_mm
    places = measure_stations(
        traced.lines, traced.recording, list(traced.whiskers.values()), [hidden], traced.pole
    )
    found = analyse_contacts(traced.frames, places, traced.recording, traced.whiskers).contacts
    strong = (traced.true_contacts["peak_force_uN"] > 3).to_numpy()
    error = found["peak_force_uN"] / traced.true_contacts["peak_force_uN"] - 1
    assert np.median(np.abs(error[strong])) < 0.03
    off = (found["peak_force_uN"] - traced.true_contacts["peak_force_uN"])[strong]
    assert (np.abs(off) < 1.96 * found["peak_force_se_uN"][strong]).mean() > 0.9
    assert (found["flags"].str.contains("base_contradicted") == (wrong_by_mm != 0)).all()


@pytest.mark.parametrize(("error_mm", "flagged"), [(0.5, False), (0.05, True)])
def test_a_correction_that_its_own_error_explains_contradicts_nothing(error_mm, flagged):
    """As of touches so near the face that hardly anything visible is bent."""
    _, tables = analysed("noisy")
    evidence = tables.evidence.assign(bending_origin_m=1.1e-3, bending_origin_se_m=1e-3 * error_mm)
    found = find_intervals(evidence, params=DEFAULTS.contacts)
    assert len(found) > 5
    assert (found["flags"].str.contains("base_contradicted") == flagged).all()
