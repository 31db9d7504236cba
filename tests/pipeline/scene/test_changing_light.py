"""Light that changes slowly across the picture is told from things that move, and taken out."""

import cv2
import numpy as np
import pytest
from turning_whiskers import HEIGHT, WIDTH, grey, turning_whiskers

from pipeline.scene.changing_light import UsualLight, usual_light
from pipeline.scene.preparation import prepare_video
from pipeline.video.arrays import ArrayVideo

N_FRAMES = 16
X, Y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
GROUND = (X > 90) & ~((X > 240) & (Y < 110))  # without face and apparatus, and their edges


def shadows(n, depth, width, direction):
    """Light of each frame, under a soft shadow that crosses the picture, (n, height, width)."""
    along = (X * direction[0] + Y * direction[1]) / WIDTH
    low, high = along.min(), along.max()
    places = low + (high - low) * np.linspace(0.1, 0.9, n)
    return np.stack([1 - depth * np.exp(-(((along - p) / width) ** 2)) for p in places])


def change(frames):
    """Of broad parts of the ground over time: SD over mean, flicker left out."""
    parts = np.stack([cv2.blur(frame.astype(np.float32), (9, 9))[GROUND] for frame in frames])
    parts /= np.median(parts, axis=1, keepdims=True)
    return np.median(parts.std(axis=0) / parts.mean(axis=0))


@pytest.mark.parametrize("direction", [(1, 0.3), (-1, 0), (0, 1), (0.4, -1)])
@pytest.mark.parametrize(("depth", "width"), [(0.2, 0.3), (0.4, 0.15), (0.5, 0.3)])
def test_a_shadow_that_moves_is_taken_out(depth, width, direction):
    steady = turning_whiskers(N_FRAMES)
    frames = grey(steady * shadows(N_FRAMES, depth, width, direction))
    look = prepare_video(ArrayVideo(frames))
    assert change(look.frames) < min(0.2 * change(frames), 0.01)
    np.testing.assert_array_equal(np.stack(list(look.video.frames())), look.frames)


def test_whiskers_are_as_dark_as_without_the_shadow():
    steady, light = turning_whiskers(N_FRAMES), shadows(N_FRAMES, 0.4, 0.2, (1, 0))
    frames = grey(steady * light)
    usual = usual_light(frames)
    evened = np.stack([usual.evened(frame) for frame in frames]).astype(float)

    def contrast(some):
        return np.stack([each / cv2.blur(each, (15, 15)) for each in some])[:, GROUND]

    assert np.abs(contrast(evened) - contrast(steady)).mean() < 0.01  # noise: 1.5 of 150 grey


@pytest.mark.parametrize("seed", range(3))
def test_steady_light_flicker_noise_and_things_that_move_are_left_as_they_are(seed):
    rng = np.random.default_rng(seed)
    steady = turning_whiskers(N_FRAMES, seed)
    flicker = steady * rng.uniform(0.7, 1.2, (N_FRAMES, 1, 1))
    noisy = steady + rng.normal(0, 8, steady.shape)
    thing = steady.copy()
    for frame, x in zip(thing, np.linspace(100, 320, N_FRAMES), strict=True):
        cv2.circle(frame, (round(x), 150), 40, 15, cv2.FILLED, cv2.LINE_AA)
    for frames in (steady, flicker, noisy, thing, 255 - steady):
        assert usual_light(grey(frames)) is None


def test_only_the_part_that_is_looked_at_counts():
    frames, used = turning_whiskers(N_FRAMES), np.ones((HEIGHT, WIDTH), bool)
    used[:, 200:] = False
    frames[:, :, 210:] *= shadows(N_FRAMES, 0.5, 0.2, (0, 1))[:, :, 210:]
    assert usual_light(grey(frames)) is not None
    assert usual_light(grey(frames), used) is None


@pytest.mark.filterwarnings("error")
def test_black_frames_stay_black():
    black = np.zeros((HEIGHT, WIDTH), np.uint8)
    assert not UsualLight(grey(turning_whiskers(N_FRAMES))).evened(black).any()
    assert usual_light(np.stack([black] * 5)) is None
