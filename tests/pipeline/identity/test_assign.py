"""How sure the names of a crowd's lines are, once the whole video has been seen."""

import numpy as np

from pipeline.identity.assign import DOUBT, _beside_new_name, names
from pipeline.identity.features import ANGLE
from pipeline.identity.motion_model import LASTING
from pipeline.identity.ordered_assignment import Lines

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
    assert frame[found].tolist() == list(range(49 - LASTING, 52 + LASTING + 1))


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
    near = np.isin(track, (1, 2)) & (frame >= HOP - 1 - LASTING) & (frame <= HOP + LASTING)
    assert sure[near].max() <= 1 - DOUBT
    assert np.median(sure[~near]) > 0.9
