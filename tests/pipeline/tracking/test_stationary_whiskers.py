"""Backgrounds of whiskers that hardly move, against the light that is behind them."""

import functools

import numpy as np
import pytest
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking.registry import find_templates
from pipeline.tracking.stationary_whiskers import without_resting_whiskers

SCALE = 25.0  # px/mm
FACE_PX, PIVOT = 40, (10.0, 120.0)
FUR_PX = FACE_PX + int(DEFAULTS.tracking.resting_fur_mm * SCALE) + 2  # as far as fur reaches
LIGHT = 200.0  # grey
SHADE, CLEAN = 5.5, 3.5  # grey
DUST = 5.0  # grey, of the 80 that a speck takes


def light(dust_x=None):
    """Light [grey] behind the whisker, with a speck of dust on its line at `dust_x` [px]."""
    y, x = np.mgrid[:240, :500].astype(float)
    if dust_x is None:
        return np.full_like(x, LIGHT)
    return LIGHT * (1 - 0.4 * np.exp(-(np.hypot(x - dust_x, y - PIVOT[1]) ** 2) / (2 * 2.0**2)))


def picture(angle, seed, dust_x=None):
    """A dark face and a straight whisker that turns about a point within it."""
    y, x = np.mgrid[:240, :500].astype(float)
    along = (x - PIVOT[0]) * np.cos(angle) + (y - PIVOT[1]) * np.sin(angle)
    across = (y - PIVOT[1]) * np.cos(angle) - (x - PIVOT[0]) * np.sin(angle)
    dark = 0.8 * (1 - along / 480) * np.exp(-(across**2) / (2 * 1.2**2)) * (along < 470)
    image = np.where(x < FACE_PX, 10.0, light(dust_x) * (1 - dark))
    image += np.random.default_rng(seed).normal(0, 2, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@functools.cache
def backgrounds(swing, dust_x=None):
    """Scene and cleared scene of a whisker that turns by ±swing [rad]."""
    angles = swing * np.sin(np.linspace(0, 12, 24))
    frames = np.stack([picture(angle, i, dust_x) for i, angle in enumerate(angles)])
    recording = Recording(1000.0, SCALE, "left")
    scene = scene_from_frames(frames, recording, None)
    templates = find_templates(frames, scene, options_for(recording), None)
    return scene, without_resting_whiskers(scene, templates, SCALE, DEFAULTS.tracking)


def shade(scene):
    """Largest error of the light beyond the fur [grey]."""
    return np.abs(scene.background[60:180, FUR_PX:300] - LIGHT).max()


@pytest.mark.slow
def test_resting_whiskers_leave_no_shade():
    for swing in np.radians([0.2, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0]):
        scene, cleared = backgrounds(swing)
        assert shade(scene) < SHADE
        assert shade(cleared) < CLEAN


@pytest.mark.slow
def test_flanks_of_whiskers_that_hardly_move_are_taken_away():
    scene, cleared = backgrounds(np.radians(0.6))
    assert shade(cleared) < CLEAN < shade(scene)


@pytest.mark.parametrize("dust_x", [380, 460])
def test_dust_on_the_line_of_a_resting_whisker_stays(dust_x):
    """At the end of the line, too."""
    _, cleared = backgrounds(np.radians(0.6), dust_x)
    y = int(PIVOT[1])
    about = np.s_[y - 10 : y + 10, dust_x - 10 : dust_x + 10]
    error = cleared.background[about] - light(dust_x)[about]
    assert np.abs(error).max() < DUST


def test_the_fur_stays_as_it_is():
    scene, cleared = backgrounds(np.radians(1.0))
    fur = np.s_[:, : FUR_PX - 4]
    assert np.array_equal(cleared.background[fur], scene.background[fur])


def test_moving_whiskers_change_nothing():
    scene, cleared = backgrounds(np.radians(8.0))
    assert cleared is scene


def test_few_samples_show_nothing():
    scene, _ = backgrounds(np.radians(1.0))
    assert without_resting_whiskers(scene, [], SCALE, DEFAULTS.tracking) is scene
