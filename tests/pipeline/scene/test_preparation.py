"""Some frames say how a video is to be looked at; they are read once."""

import numpy as np
import pytest
from turning_whiskers import SCALE, grey, turning_whiskers

from pipeline.scene.estimate import find_scenes, still_states, survey
from pipeline.scene.preparation import prepare_video
from pipeline.session.recording import Recording
from pipeline.video.arrays import ArrayVideo

MARGIN = 60  # px
N_FRAMES = 40


def whiskers(n=N_FRAMES):
    return grey(turning_whiskers(n))


class Counted(ArrayVideo):
    """An array of frames that counts how often each of them is read."""

    def __init__(self, frames):
        self.read = np.zeros(len(frames), int)
        super().__init__(frames)

    def _image(self, index):
        self.read[index] += 1
        return super()._image(index)


@pytest.mark.parametrize("grey", [0, 255])
@pytest.mark.parametrize("bright", [False, True])
def test_a_margin_says_nothing_of_polarity_and_is_left_out(grey, bright):
    frames = np.pad(whiskers(), ((0, 0), (MARGIN, MARGIN), (MARGIN, MARGIN)), constant_values=grey)
    look = prepare_video(ArrayVideo(255 - frames if bright else frames))
    np.testing.assert_array_equal(look.frames, frames[look.indices])
    assert not look.part.used[:MARGIN].any()


def test_a_short_video_is_read_once_for_all_that_stands_still():
    video = Counted(np.pad(255 - whiskers(), ((0, 0), (MARGIN, MARGIN), (0, 0))))
    start = video.read.copy()  # the first frame's size
    recording = Recording(1000.0, SCALE, "left")
    look = prepare_video(video)
    find_scenes(look.video, recording, still=still_states(survey(look, recording), recording))
    assert (video.read - start).max() == 1


def test_of_black_frames_one_is_looked_at():
    frames = whiskers()
    frames[:10] = 0
    assert prepare_video(ArrayVideo(frames)).indices.min() >= 10
    assert len(prepare_video(ArrayVideo(np.zeros_like(frames))).frames) == 1
