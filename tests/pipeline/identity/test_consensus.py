"""Which of several namings of a video's lines is believed."""

from dataclasses import replace

import numpy as np
import pytest
from usual_limits import USUAL

from pipeline.identity import consensus
from pipeline.identity.features import ANGLE, BEND, LENGTH, N_FEATURES
from pipeline.identity.tracked_lines import TrackedLines

LENGTHS = np.array([65.0, 95, 140, 160, 100, 205, 90])  # px, of a row
FRAMES, MOVES_ON = 120, 57  # the frame from which the row whisks


def row(rng):
    """Lines of a row that rests, then whisks by more than its whiskers are apart; true names."""
    frame = np.repeat(np.arange(FRAMES), len(LENGTHS))
    true = np.tile(np.arange(len(LENGTHS)), FRAMES)
    phase = np.where(frame < MOVES_ON, 0.0, 0.3 * np.sin(0.8 * frame))
    features = np.full((len(frame), N_FEATURES), np.nan)
    features[:, ANGLE] = 0.15 * true + phase + rng.normal(0, 0.01, len(frame))
    features[:, BEND] = 0.02 * true + 0.1 * phase
    features[:, LENGTH] = np.log(LENGTHS[true]) + rng.normal(0, 0.03, len(frame))
    return TrackedLines(features, frame, true, USUAL), true


def moved_on(true):
    """Names of a row that is taken for the row beside it from the first whisk on."""
    later = np.repeat(np.arange(FRAMES), len(LENGTHS)) >= MOVES_ON
    names = np.where(later, true - 1, true)
    return np.where(names < 0, -1, names)


def test_a_row_named_one_whisker_further_costs_more_than_the_true_names():
    lines, true = row(np.random.default_rng(1))
    assert consensus._length_cost(lines, moved_on(true)) > 2 * consensus._length_cost(lines, true)


@pytest.mark.parametrize("wrong_first", [True, False])
def test_the_naming_that_keeps_lengths_is_believed_and_the_other_one_hardly_counts(
    monkeypatch, wrong_first
):
    lines, true = row(np.random.default_rng(2))
    found = [moved_on(true), true]
    monkeypatch.setattr(
        consensus, "_namings", lambda _: iter(found if wrong_first else found[::-1])
    )
    names, sure = consensus.best_names(lines)
    assert np.array_equal(names, true)
    assert np.all(sure > 0.8)


def test_a_few_lines_that_have_nothing_in_common_get_no_names():
    rng, frame = np.random.default_rng(4), np.sort([*range(12), *range(0, 12, 2)])
    apart = TrackedLines(
        rng.normal(size=(len(frame), N_FEATURES)), frame, np.arange(len(frame)), USUAL
    )
    names, _ = consensus.best_names(apart)
    assert (names == -1).all()


def test_good_namings_that_disagree_take_confidence(monkeypatch):
    lines, true = row(np.random.default_rng(3))
    lines.features[:, LENGTH] = np.log(100 + true)  # both namings keep them
    exchanged = np.flatnonzero((lines.frame >= 80) & (true < 2))
    other = true.copy()
    other[exchanged] = 1 - true[exchanged]
    monkeypatch.setattr(consensus, "_namings", lambda _: iter([true, other]))
    names, sure = consensus.best_names(lines)
    assert np.array_equal(names, true)
    assert np.allclose(sure[true >= 2], 1)
    late = exchanged[lines.frame[exchanged] >= 80 + lines.limits.along_track]
    assert np.all(
        (sure[late] > 0.5**consensus.ALIKE) & (sure[late] < 0.55)
    )  # the better one of two


def test_names_are_agreed_on_line_by_line_and_no_whisker_has_two_lines():
    frame = np.array([0, 0, 1, 1])
    lines = TrackedLines(np.zeros((4, N_FEATURES)), frame, np.arange(4), USUAL)  # four tracks
    found = [[0, 1, 0, 1], [0, 1, 1, 0], [1, 0, 1, 0], [1, -1, 1, -1]]
    named, share = consensus._agreed(lines, found, np.array([3.0, 2.0, 1.5, 1.5]))
    assert named.tolist() == [0, 1, 1, 0]
    assert np.allclose(share, [5 / 8, 5 / 8, 5 / 8, 3.5 / 8])
    named, share = consensus._agreed(lines, found[2:], np.array([1.0, 3.0]))
    assert named.tolist() == [1, -1, 1, -1]
    assert np.allclose(share, [1, 0.75, 1, 0.75])


def test_no_name_counts_by_half():
    lines = TrackedLines(np.zeros((1, N_FEATURES)), np.zeros(1, int), np.zeros(1, int), USUAL)
    found = [[0], [-1]]
    for weights, name in (([1.0, 1.9], 0), ([1.0, 2.1], -1)):
        named, share = consensus._agreed(lines, found, np.array(weights))
        assert named.tolist() == [name]
        assert share == pytest.approx(weights[0 if name == 0 else 1] / sum(weights))


def one_track(frames):
    """Lines of one track."""
    return TrackedLines(
        np.zeros((frames, N_FEATURES)), np.arange(frames), np.zeros(frames, int), USUAL
    )


def test_a_name_does_not_change_for_one_frame_of_a_track():
    found = np.repeat([[0], [0], [0], [1], [1]], 31, axis=1)
    found[0, 15] = 1
    named, _ = consensus._agreed(one_track(31), list(found), np.ones(5))
    assert not named.any()


def test_names_change_where_most_namings_see_the_track_go_on_with_another_whisker():
    found = np.repeat(np.arange(31) >= 15, 5).reshape(31, 5).T.astype(int)
    found[4] = 0
    named, share = consensus._agreed(one_track(31), list(found), np.ones(5))
    assert np.array_equal(named, np.arange(31) >= 15)
    assert share == pytest.approx(np.where(np.arange(31) >= 15, 0.8, 1.0))


def test_lines_measured_again_have_other_errors_of_the_least_size():
    lines, _ = row(np.random.default_rng(9))
    off = consensus._measured_again(lines, np.random.default_rng(0)).features - lines.features
    seen = [ANGLE, BEND, LENGTH]
    assert np.isnan(np.delete(off, seen, axis=1)).all()
    assert off[:, seen].std(axis=0) == pytest.approx(consensus.LEAST_SD[seen], rel=0.1)


@pytest.mark.parametrize("by_motion", [False, True])
def test_names_are_as_sure_where_a_naming_counts_looks_less(monkeypatch, by_motion):
    lines, true = row(np.random.default_rng(4))
    usual = consensus._likeliest(
        lines, consensus.seeds.appearance_of(lines, true, consensus.LEAST_SD), true
    )
    found, _ = consensus._likeliest(lines, usual[1], true, by_motion)
    monkeypatch.setattr(consensus, "_namings", lambda _: iter([found]))
    names, sure = consensus.best_names(lines)
    assert np.array_equal(names, true)
    assert np.median(sure) > 0.9


def test_the_second_time_names_may_leave_tracks(monkeypatch):
    lines, _ = row(np.random.default_rng(4))
    held = []
    improved = consensus.label_swaps.improved
    monkeypatch.setattr(
        consensus.label_swaps,
        "improved",
        lambda evidence, *rest: (
            held.append(evidence.rename_cost.any()) or improved(evidence, *rest)
        ),
    )
    found = list(consensus._namings(lines))
    tracks, none = [True] * consensus.ROUNDS, [False] * consensus.ROUNDS
    starts = (len(found) - len(consensus.MAY_MISLEAD)) // 2
    assert held == (tracks + none) * starts + tracks * len(consensus.MAY_MISLEAD)


def test_a_way_without_lengths_finds_the_same_names_whatever_they_are():
    rng = np.random.default_rng(5)
    lines, true = row(rng)
    swapped = true.copy()
    some = np.flatnonzero((lines.frame == 20) & (true < 2))
    swapped[some] = true[some[::-1]]
    features = lines.features.copy()
    features[:, LENGTH] = rng.permutation(features[:, LENGTH])
    mixed = replace(lines, features=features)
    for each in (lines, mixed):
        assert np.array_equal(consensus._without(each, LENGTH, swapped), true)


def test_a_whisker_that_is_taken_for_two_in_turn_costs_more():
    lines, true = row(np.random.default_rng(5))
    lines.features[(true == 2) & (lines.frame % 40 < 20), LENGTH] -= 0.3  # its tip fades in turn
    two = np.where((true == 2) & (lines.frame % 40 < 20), len(LENGTHS), true)
    assert consensus._length_cost(lines, two) > consensus._length_cost(lines, true)


def test_lines_backwards_are_the_same_lines_and_forwards_again_after_twice():
    lines, _ = row(np.random.default_rng(4))
    back, rows = lines.backwards()
    assert np.array_equal(back.features, lines.features[rows], equal_nan=True)
    assert np.array_equal(back.frame, FRAMES - 1 - lines.frame[rows])
    again, _ = back.backwards()
    assert np.array_equal(again.features, lines.features, equal_nan=True)
    assert np.array_equal(again.frame, lines.frame)


def test_every_way_names_the_row():
    lines, true = row(np.random.default_rng(5))
    first = 7  # frames without lines before
    late = TrackedLines(lines.features, lines.frame + first, lines.track, lines.limits)
    found = list(consensus._namings(late))
    assert len(found) >= 2
    for names in found:
        assert (consensus._renamed(names, true) == true).mean() > 0.95
