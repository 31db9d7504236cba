"""Names from how lines move: tracks cut where lines jump, joined, and gathered as whiskers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from usual_limits import USUAL

from pipeline.identity.features import ANGLE, LENGTH, THICKNESS
from pipeline.identity.tracked_lines import TrackedLines
from pipeline.identity.tracklets import (
    HELD_TO_MEAN,
    RowMotion,
    _appearance,
    named_by_tracklets,
    often_seen,
)

FRAMES = 200
NOISE = np.array([0.005, np.radians(0.3), 0.04, 0.02, 0.004, 0.003])
#    near bend, angle [rad], logs of thickness and length, bends [rad]
FAN = np.array([[0.0, np.radians(a), t, n, 0.0, 0.0] for a, t, n in (
    (-40, -1.8, 4.2), (-25, -1.6, 4.4), (-10, -1.5, 4.5), (5, -1.2, 4.7), (25, -1.0, 4.9)
)])  # fmt: skip


def whisking(seed, track):
    """Lines of a fan that whisks, with tracks (frames, whiskers), and their true names."""
    rng = np.random.default_rng(seed)
    features = FAN + NOISE * rng.normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += 0.4 * np.sin(np.arange(FRAMES) / 9)[:, None]
    frame, true = np.divmod(np.arange(FRAMES * len(FAN)), len(FAN))
    order = np.lexsort((track.ravel(), frame))
    return TrackedLines(
        features.reshape(-1, 6)[order], frame[order], track.ravel()[order], USUAL
    ), true[order]


def agreement(named, true):
    """Share of the lines that bear the name most lines of their whisker bear."""
    best = [np.bincount(named[(true == k) & (named >= 0)]).max() for k in range(len(FAN))]
    return sum(best) / len(true)


def test_lines_that_jump_to_a_neighbour_keep_their_whiskers_name():
    track = np.tile(np.arange(5), (FRAMES, 1))
    for first, last, one, other in ((40, 90, 1, 2), (120, FRAMES, 3, 4)):
        track[first:last, [one, other]] = track[first:last, [other, one]]
    lines, true = whisking(1, track)
    assert agreement(named_by_tracklets(lines), true) > 0.99


def test_tracks_that_are_broken_off_are_joined():
    track = 5 * (np.arange(FRAMES)[:, None] // np.array([31, 37, 41, 43, 47])) + np.arange(5)
    lines, true = whisking(2, track)
    seen = np.random.default_rng(3).uniform(size=len(true)) > 0.1
    lines = TrackedLines(lines.features[seen], lines.frame[seen], lines.track[seen], USUAL)
    assert agreement(named_by_tracklets(lines), true[seen]) > 0.97


def test_a_name_is_given_once_a_frame_and_seldom_ones_are_dropped():
    lines, _ = whisking(4, np.tile(np.arange(5), (FRAMES, 1)))
    features, frame, track = lines.features, lines.frame, lines.track
    frame = np.append(frame, np.arange(50, 70))  # a hair, far from all whiskers
    features = np.append(features, np.tile(FAN[4] + [0, 1.0, -1, -1, 0, 0], (20, 1)), axis=0)
    order = np.lexsort((np.append(track, np.full(20, 9)), frame))
    track = np.append(track, np.full(20, 9))[order]
    named = named_by_tracklets(TrackedLines(features[order], frame[order], track, USUAL))
    assert len(np.unique(named)) == 6
    assert not (np.bincount(frame[order] * 6 + named) > 1).any()
    kept = often_seen(named, frame[order], 0.15)
    assert (kept[track == 9] == -1).all()
    assert sorted(np.unique(kept)) == [-1, 0, 1, 2, 3, 4]


def test_what_moves_with_the_row_is_foreseen():
    lines, _ = whisking(5, np.tile(np.arange(5), (FRAMES, 1)))
    turn = 0.4 * np.sin(np.arange(FRAMES) / 9)
    got = RowMotion.of(lines).carried(0.1 + turn[30], 30)
    assert got == pytest.approx(0.1 + turn[30 : 30 + len(got)], abs=np.radians(3))


@given(seed=st.integers(0, 10_000), paths=st.integers(2, 6), frames=st.integers(3, 12))
def test_directions_in_the_row_are_those_of_least_squares(seed, paths, frames):
    rng = np.random.default_rng(seed)
    frame, owner = (each.ravel() for each in np.indices((frames, paths)))
    seen = rng.uniform(size=len(frame)) < 0.7
    seen[:paths] = True
    frame, owner = frame[seen], owner[seen]
    features = np.zeros((len(frame), 6))
    features[:, ANGLE] = rng.normal(size=len(frame))
    features[:, [LENGTH, THICKNESS]] = owner[:, None]
    got = _appearance(
        [np.flatnonzero(owner == p) for p in range(paths)],
        TrackedLines(features, frame, owner, USUAL),
    )
    columns = [owner[:, None] == np.arange(paths), frame[:, None] == np.arange(frames)]
    design = np.concatenate(columns, axis=1).astype(float)
    held = np.sqrt(HELD_TO_MEAN) * np.eye(paths, paths + frames)
    target = np.append(features[:, ANGLE], np.zeros(paths))
    naive = np.linalg.lstsq(np.concatenate([design, held]), target, rcond=None)[0][:paths]
    off = got[:, 0] - naive  # of which the level is free
    assert np.ptp(off) < 0.01  # rad
    assert (got[:, 1:] == np.arange(paths)[:, None]).all()
