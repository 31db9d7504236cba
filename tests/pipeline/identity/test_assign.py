"""How sure the names of a crowd's lines are, once the whole video has been seen."""

import numpy as np

from pipeline.identity.assign import _beside_new_name, names
from pipeline.identity.features import ANGLE
from pipeline.identity.limits import USUAL, Limits
from pipeline.identity.ordered_assignment import Lines
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


def test_frames_beside_a_new_name_are_found_on_that_track_only():
    frame = np.repeat(np.arange(100), 3)
    track = np.tile([2, 7, 8], 100)
    name = np.where(track == 7, np.where(frame < 52, 4, 5), track)
    name[(track == 7) & (frame >= 50) & (frame < 52)] = -1  # nobody's, in between
    lines = Lines(np.zeros((300, 6)), frame, track)
    found = _beside_new_name(lines, name)
    assert not found[track != 7].any()
    assert frame[found].tolist() == list(range(49 - USUAL.lasting, 52 + USUAL.lasting + 1))


def test_nobodys_frames_and_ends_of_tracks_are_no_new_names():
    frame = np.repeat(np.arange(60), 2)
    track = np.tile([0, 1], 60)
    name = np.where((frame > 20) & (frame < 30), -1, track)
    other = np.where(frame < 40, track, track + 2)  # tracks 2 and 3 begin in frame 40
    assert not _beside_new_name(Lines(np.zeros((120, 6)), frame, other), name).any()


def test_a_name_that_the_track_had_not_before_is_doubted_for_some_frames():
    rng = np.random.default_rng(6)
    phase = 0.3 * np.sin(np.arange(FRAMES) / 4)
    features = FAN + NOISE * rng.normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += phase[:, None]
    frame, true = np.divmod(np.arange(FRAMES * len(FAN)), len(FAN))
    track = true.copy()
    later = frame >= HOP
    track[later & (true == 1)], track[later & (true == 2)] = 2, 1
    found, sure = names(frame, track, features.reshape(-1, 6))
    assert (found == true).all()
    near = (frame >= HOP - 1 - USUAL.lasting) & (frame <= HOP + USUAL.lasting)
    near &= np.isin(track, (1, 2))
    assert sure[near].max() <= 1 - USUAL.params.doubt
    assert np.median(sure[~near]) > 0.9


def test_times_are_frames_of_the_recording_but_never_fewer_than_at_1000_per_s():
    params = IdentityParams(lasting_s=0.015, same_mean_s=0.3, along_track_s=0.014)
    for rate, lasting, same_mean, along in ((2000.0, 30, 601, 14), (100.0, 15, 301, 7)):
        limits = Limits(params, rate)
        assert (limits.lasting, limits.same_mean, limits.along_track) == (
            lasting,
            same_mean,
            along,
        )


def test_a_whisker_seen_less_often_than_the_parameter_says_gets_no_name():
    rng = np.random.default_rng(7)
    features = FAN + NOISE * rng.normal(size=(FRAMES, *FAN.shape))
    features[..., ANGLE] += (0.3 * np.sin(np.arange(FRAMES) / 4))[:, None]
    frame, true = np.divmod(np.arange(FRAMES * len(FAN)), len(FAN))
    seen = (true > 0) | (frame < 0.3 * FRAMES)
    frame, true, features = frame[seen], true[seen], features.reshape(-1, 6)[seen]
    for seldom, first in ((0.1, 0), (0.5, -1)):
        named, _ = names(frame, true, features, limits=Limits(IdentityParams(seldom=seldom)))
        assert set(named[true == 0]) == {first}
