"""Some frames say how a video is to be looked at; they are read once."""

import cv2
import numpy as np
import pytest

from pipeline.scene.estimate import find_scenes, survey
from pipeline.scene.looking import first_look
from pipeline.session.recording import Recording
from pipeline.video.arrays import ArrayVideo

HEIGHT, WIDTH, SCALE = 240, 320, 14.0  # px, px/mm
MARGIN = 60  # px
N_FRAMES = 40


def whiskers(n=N_FRAMES):
    """Frames of a dark face at the left, with three whiskers that turn."""
    rng = np.random.default_rng(1)
    frames = []
    for phase in np.linspace(0, 6, n):
        image = np.full((HEIGHT, WIDTH), 150, np.uint8)
        image[:, :60] = image[:100, 250:] = 20
        for y in (120, 160, 200):
            angle = 0.1 + 0.2 * np.sin(phase)
            tip = 60 + 120 * np.cos(angle), y + 120 * np.sin(angle)
            cv2.line(image, (56, y), tuple(map(round, tip)), 110, 1, cv2.LINE_AA)
        image = cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, 1.5, image.shape)
        frames.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    return np.stack(frames)


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
    look = first_look(ArrayVideo(255 - frames if bright else frames), SCALE)
    np.testing.assert_array_equal(look.frames, frames[look.indices])
    assert not look.part.used[:MARGIN].any()


def test_a_short_video_is_read_once_for_all_that_stands_still():
    video = Counted(np.pad(255 - whiskers(), ((0, 0), (MARGIN, MARGIN), (0, 0))))
    start = video.read.copy()  # the first frame's size
    recording = Recording(1000.0, SCALE, "left")
    look = first_look(video, SCALE)
    find_scenes(look.video, recording, seen=survey(look, recording))
    assert (video.read - start).max() == 1


def test_of_black_frames_one_is_looked_at():
    frames = whiskers()
    frames[:10] = 0
    assert first_look(ArrayVideo(frames), SCALE).indices.min() >= 10
    assert len(first_look(ArrayVideo(np.zeros_like(frames)), SCALE).frames) == 1
