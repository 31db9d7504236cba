"""How sure the names of a crowd's lines are, once the whole video has been seen."""

import numpy as np
import pytest
from usual_limits import USUAL

from pipeline.identity import consensus
from pipeline.identity.assign import names
from pipeline.identity.features import ANGLE, LENGTH
from pipeline.identity.limits import Limits
from pipeline.identity.unnamed import Unnamed
from pipeline.session.parameters import IdentityParams

FRAMES = 300
#    near bend, angle [rad], logs of thickness and length, bends [rad]
FAN = np.array(
    [
        [-0.04, -0.50, -1.8, 4.20, 0.02, 0.04],
        [-0.02, -0.30, -1.6, 4.35, -0.02, -0.03],
        [-0.01, -0.10, -1.5, 4.50, 0.03, 0.03],
        [0.02, 0.10, -1.2, 4.70, 0.00, 0.00],
        [0.04, 0.30, -1.0, 4.90, -0.03, -0.02],
    ]
)
NOISE = np.array([0.005, 0.01, 0.04, 0.02, 0.004, 0.003])
HOP = 150  # frame from which two tracks go on with each other's lines


def whisking(seed):
    """Features (rows, 6), frames and whiskers (rows,) of a fan that whisks."""
    phase = 0.3 * np.sin(np.arange(FRAMES) / 4)
    features = FAN + NOISE * np.random.default_rng(seed).normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += phase[:, None]
    return features.reshape(-1, 6), *np.divmod(np.arange(FRAMES * len(FAN)), len(FAN))


def test_a_name_is_the_surer_the_more_namings_agree_on_it(monkeypatch):
    features, frame, true = whisking(6)
    features[true == 1, LENGTH] += FAN[0, LENGTH] - FAN[1, LENGTH]  # which does not tell them
    wrong = np.where((frame < 60) & (true < 2), 1 - true, true)

    usual = consensus._namings

    def more(lines):
        yield from (next(usual(lines)), true + 1, wrong, true)  # their numbers do not matter

    monkeypatch.setattr(consensus, "_namings", more)
    found, sure = names(frame, np.where(frame < HOP, true, true + 5), features, USUAL)
    assert (found == true).all()
    inner = frame < 60 - USUAL.along_track  # beyond, votes are averaged with later ones
    assert sure[(wrong != true) & inner].max() < 3 / 4
    assert np.median(sure[wrong == true]) > 0.9


def test_tracks_that_are_all_seen_at_once_in_one_order_are_named_without_a_doubt(monkeypatch):
    features, frame, true = whisking(6)
    monkeypatch.setattr(consensus, "_namings", None)
    seen = (true != 2) | (frame % 7 > 0)  # a whisker may be missed now and then
    found, sure = names(frame[seen], 10 - true[seen], features[seen], USUAL)
    assert (found == true[seen]).all()
    assert (sure == 1).all()


def test_namings_agree_where_tracks_have_gone_on_with_each_others_lines():
    features, frame, true = whisking(7)
    track = true.copy()
    later = frame >= HOP
    track[later & (true == 1)], track[later & (true == 2)] = 2, 1
    found, sure = names(frame, track, features, USUAL)
    assert (found == true).all()
    assert np.median(sure) > 0.9


def test_times_are_frames_of_the_recording_but_never_fewer_than_at_1000_per_s():
    params = IdentityParams(lasting_s=0.015, same_mean_s=0.3, along_track_s=0.014)
    for rate, lasting, same_mean, along in ((2000.0, 30, 601, 14), (100.0, 15, 301, 7)):
        limits = Limits(params, rate)
        assert (limits.lasting, limits.same_mean, limits.along_track) == (
            lasting,
            same_mean,
            along,
        )


@pytest.mark.slow
def test_a_whisker_seen_less_often_than_the_parameter_says_gets_no_name():
    rng = np.random.default_rng(7)
    features = FAN + NOISE * rng.normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += (0.3 * np.sin(np.arange(FRAMES) / 4))[:, None]
    frame, true = np.divmod(np.arange(FRAMES * len(FAN)), len(FAN))
    seen = (true > 0) | (frame < 0.3 * FRAMES)
    frame, true, features = frame[seen], true[seen], features.reshape(-1, 6)[seen]
    for seldom, first in ((0.1, 0), (0.5, -1)):
        named, _ = names(frame, true, features, Limits(IdentityParams(seldom=seldom), 1000.0))
        assert set(named[true == 0]) == {first}


@pytest.mark.parametrize(("wanted", "more"), [(3, 2), (5, 0)])
def test_whiskers_without_a_name_are_counted_and_fur_is_not(wanted, more):
    features, frame, true = whisking(8)
    fur = (
        FAN[0]
        + [0, 0, -1.5, -1.0, 0, 0]
        + NOISE * np.random.default_rng(8).normal(size=(FRAMES, 6))
    )
    frame, features = np.append(frame, np.arange(FRAMES)), np.concatenate([features, fur])
    named = np.append(np.where(true < wanted, true, -1), np.full(FRAMES, -1))
    there = np.random.default_rng(9).random(len(frame)) < 0.95  # lines are missed now and then
    unnamed = Unnamed(fur_share=0.18, first_look=7)
    assert unnamed.count == 7
    unnamed.add(frame[there], named[there], features[there])
    assert unnamed.count == more
