"""Whether whiskers are dark or bright, where that is hard to see."""

import cv2
import numpy as np
import pytest

from pipeline.scene.polarity import whiskers_are_bright
from synthetic.presets import make_trial
from synthetic.render import Renderer

HEIGHT, WIDTH, SCALE = 240, 320, 14.0  # px, px/mm
FACE_PX = 60
SEEDS = range(3)


def frames_of(seed, swing, gleams=0):
    """Eight frames of a dark face at the left, with whiskers that turn by ±swing [rad].

    gleams : bright places that flicker in a dark apparatus at the right
    """
    rng = np.random.default_rng(seed)
    frames = []
    for phase in np.linspace(0, 6, 8):
        image = np.full((HEIGHT, WIDTH), 150, np.uint8)
        image[:, :FACE_PX] = image[:100, 250:] = 20
        for y in (120, 160, 200):
            angle = 0.1 + swing * np.sin(phase)
            tip = FACE_PX + 120 * np.cos(angle), y + 120 * np.sin(angle)
            cv2.line(image, (FACE_PX - 4, y), tuple(map(round, tip)), 110, 1, cv2.LINE_AA)
        for _ in range(gleams):
            x, y = rng.integers([255, 5], [300, 90])
            cv2.line(image, (x, y), (x + rng.integers(6, 16), y), 255, 1, cv2.LINE_AA)
        image = cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, 1.5, image.shape)
        frames.append(np.clip(np.rint(image), 0, 255).astype(np.uint8))
    return np.stack(frames)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("swing", "gleams"), [(0.2, 0), (0.0, 0), (0.2, 6)])
def test_dark_whiskers_and_their_negative(seed, swing, gleams):
    frames = frames_of(seed, swing, gleams)
    assert not whiskers_are_bright(frames, SCALE)
    assert whiskers_are_bright(255 - frames, SCALE)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("weakest", [0.2, 0.4])
def test_light_that_falls_off_sideways(seed, turns, weakest):
    towards = np.rot90(np.linspace(weakest, 1, 320)[:, None], turns)
    light = cv2.resize(towards, (WIDTH, HEIGHT))
    frames = np.rint(frames_of(seed, 0.2) * light).astype(np.uint8)
    assert not whiskers_are_bright(frames, SCALE)
    assert whiskers_are_bright(255 - frames, SCALE)


@pytest.mark.parametrize("preset", ["border", "moving_fur"])
def test_the_ground_beside_clear_whiskers_is_no_line(preset):
    trial = make_trial(preset, 1, 0, frames=100)
    renderer = Renderer(trial.scene, trial.motion)
    frames = np.stack([renderer.frame(k) for k in range(5, 100, 13)])
    assert not whiskers_are_bright(frames, trial.scene.camera.pixels_per_mm)
    assert whiskers_are_bright(255 - frames, trial.scene.camera.pixels_per_mm)


def test_a_border_that_flickers_is_no_whisker():
    frames = 255 - frames_of(0, 0.2)
    frames[::2, :, -1] = 0  # as a camera or codec leaves the last column
    assert whiskers_are_bright(frames, SCALE)
