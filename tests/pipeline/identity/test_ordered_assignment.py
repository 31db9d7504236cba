"""Appearance and names from the order along the face, and from what the whole row turns."""

import itertools

import numpy as np
import pytest
from usual_limits import USUAL

from pipeline.identity import ordered_assignment
from pipeline.identity.assign import names
from pipeline.identity.consensus import LEAST_SD
from pipeline.identity.features import ANGLE
from pipeline.identity.ordered_assignment import (
    JUMP,
    NAMELESS,
    OFF_TURN,
    SURE_TURN,
    UNSEEN,
    UNSURE,
    TrackedLines,
    _aligned,
    named_in_order,
)

#    near bend, angle [rad], logs of thickness and length, bends [rad]
FAN = np.array(
    [
        [-0.04, -0.50, -1.8, 4.20, 0.02, 0.04],
        [-0.02, -0.32, -1.6, 4.35, -0.02, -0.03],
        [-0.01, -0.15, -1.5, 4.50, 0.03, 0.03],
        [0.02, 0.05, -1.2, 4.70, 0.00, 0.00],
        [0.04, 0.25, -1.0, 4.90, -0.03, -0.02],
        [0.06, 0.42, -0.9, 4.95, 0.01, 0.02],
    ]
)
NOISE = np.array([0.01, 0.03, 0.08, 0.05, 0.008, 0.006])
FRAMES = 400
ANGLE_PRECISION = 0.02  # rad


def whisking(rng, seen=0.75):
    """Lines of a fan that turns by up to 0.6 rad, a quarter of them missing, and true names."""
    phase = 0.3 * np.sin(np.arange(FRAMES) / 3) + 0.3 * np.sin(np.arange(FRAMES) / 40)
    features = FAN + NOISE * rng.normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += phase[:, None]
    there = rng.uniform(size=(FRAMES, len(FAN))) < seen
    frame, true = np.nonzero(there)
    return frame, true, features[there]


def test_names_and_looks_without_any_tracks():
    frame, true, features = whisking(np.random.default_rng(1))
    track = np.arange(len(frame))  # a track per line: nothing shows how the fan turns
    found = named_in_order(TrackedLines(features, frame, track, USUAL), LEAST_SD)[0]
    assert len(found.model.middle) == len(FAN)
    assert (found.names == true).mean() > 0.99
    middle = found.model.middle[:, ANGLE]
    assert middle - middle[0] == pytest.approx(FAN[:, ANGLE] - FAN[0, ANGLE], abs=ANGLE_PRECISION)


@pytest.mark.slow
def test_names_hold_forwards_and_backwards_though_tracks_go_on_with_neighbours():
    frame, true, features = whisking(np.random.default_rng(2))
    piece = frame // 12  # frames after which all tracks break off
    beside = (true + piece) % len(FAN)
    track = 100 * piece + np.where(frame % 12 > 6, true, beside)
    forwards, sure = names(frame, track, features, USUAL)
    back = np.lexsort((track, -frame))
    backwards = np.empty(len(frame), int)
    backwards[back], _ = names(FRAMES - 1 - frame[back], track[back], features[back], USUAL)
    assert (forwards == true).mean() > 0.97
    assert (backwards == true).mean() > 0.97
    assert (forwards == true)[sure > 0.9].mean() > 0.97


def test_alignment_is_the_cheapest_of_all_in_order():
    rng = np.random.default_rng(3)
    for _ in range(20):
        cost = rng.uniform(0, 30, size=(3, 4))
        rows, whiskers = rng.permutation(3), rng.permutation(4)
        least = min(
            sum(cost[rows[i], whiskers[k]] for i, k in zip(some, which, strict=True))
            + NAMELESS * (3 - n)
            + UNSEEN * (4 - n)
            for n in range(4)
            for some in itertools.combinations(range(3), n)
            for which in itertools.combinations(range(4), n)
        )
        room, found = (np.empty((4, 5)), np.empty((4, 5), np.int8)), np.empty(3, np.int64)
        total = _aligned(cost, rows, whiskers, room, found)
        given = found >= 0
        again = cost[given, found[given]].sum() + NAMELESS * (~given).sum()
        again += UNSEEN * (4 - given.sum())
        assert total == pytest.approx(least)
        assert again == pytest.approx(least)
        place = np.argsort(whiskers)[found[rows][given[rows]]]
        assert (np.diff(place) > 0).all()


def test_lines_follow_whiskers_that_pass_each_other():
    """The second whisker turns less than the others: its place in the row goes with the phase."""
    starts, along = 3 * np.arange(5), np.tile(np.arange(3), 4)
    # columns, as of a model: there is code for these
    middle, slope = np.array([[0.0, 1.0], [0.1, 0.0], [0.3, 1.0]]).T
    phase = np.array([0.0, 0.2, -0.3, 0.0])
    names, total = np.empty(12, int), np.empty(4)
    cost = np.zeros((12, 3))
    ordered_assignment._align_frames(cost, along, starts, phase, middle, slope, names, total)
    assert names.reshape(4, 3).tolist() == [[0, 1, 2], [1, 0, 2], [0, 2, 1], [0, 1, 2]]


def test_costs_are_averaged_along_a_track():
    frame = np.array([0, 1, 2, 2, 4])
    track = np.array([7, 7, 7, 8, 7])  # broken off after frame 2
    lines = TrackedLines(np.zeros((5, 6)), frame, track, USUAL)
    cost = np.array([[1.0], [2.0], [6.0], [5.0], [9.0]])
    got = ordered_assignment.along_tracks(cost, *lines.pieces, 7)
    assert got[:, 0] == pytest.approx([3, 3, 3, 5, 9])


def test_a_resting_row_that_looks_moved_on_by_one_is_named_as_it_moves():
    rng = np.random.default_rng(3)
    fan = np.tile(FAN[2], (6, 1))  # all look alike, and stand 0.2 rad apart
    fan[:, ANGLE] = 0.2 * np.arange(6)
    onset = np.linspace(-0.4, 0, 12)
    phase = np.concatenate([np.full(100, -0.4), onset, 0.25 * np.sin(np.arange(300) / 5)])
    features = fan + 0.3 * NOISE * rng.normal(size=(len(phase), *fan.shape))
    features[..., ANGLE] += phase[:, None]
    there = np.ones(features.shape[:2], bool)
    there[:100, :2] = False  # at rest, two lie in the fur: the others stand where all would
    frame, true = np.nonzero(there)
    lines = TrackedLines(features[there], frame, true, USUAL)
    found = next(each for each in named_in_order(lines, LEAST_SD) if len(each.model.middle) == 6)
    for part in (frame < 100, frame >= 112):
        assert (found.names == true)[part].mean() > 0.95


def test_the_likeliest_path_is_the_cheapest_of_all():
    rng = np.random.default_rng(4)
    for _ in range(20):
        cost, phase = rng.exponential(3, (5, 3)), rng.normal(0, 0.1, (5, 3))
        turn = np.where(rng.uniform(size=5) < 0.3, np.nan, rng.normal(0, 0.1, 5))

        def total(path, cost=cost, phase=phase, turn=turn):
            taken = phase[range(5), path]
            change = np.diff(taken)
            off = np.abs(change - np.nan_to_num(turn[1:]))
            priced = np.minimum(OFF_TURN * np.maximum(off - SURE_TURN, 0), JUMP)
            priced = np.where(np.isnan(turn[1:]), UNSURE * off, priced)
            return cost[range(5), path].sum() + priced.sum()

        best = min(itertools.product(range(3), repeat=5), key=total)
        assert tuple(ordered_assignment._likeliest_path(cost, phase, turn)) == best
