"""Whiskers of little contrast, in noise, and more of them than a first look has shown."""

import numpy as np
import pytest
from traced_lines import trace_templates
from usual_parameters import options_for

from pipeline.detection.image_model import ImageModel
from pipeline.detection.static_scene import StaticScene
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking.registry import find_templates

FACE, LENGTH, LIGHT, SIGMA = 40, 400, 200.0, 1.2  # px, px, grey, px
OPTIONS = options_for(Recording(1000.0, 25.0, "left"))
GIVEN = options_for(Recording(1000.0, 25.0, "left"), (LENGTH * 1e-3 / 25,), (0.0,))
BASES = 80, 150, 220


def movie(darkness, noise, bases=(150,), n=6):
    """Straight whiskers that turn together and get fainter towards their tips."""
    y, x = np.mgrid[:300, :520].astype(float)
    rng, frames = np.random.default_rng(0), []
    for turn in 0.1 * np.sin(np.arange(n)):
        light = np.where(x < FACE, 8.0, LIGHT)
        along = (x - FACE) / LENGTH
        for base in bases:
            off = (y - base - turn * (x - FACE)) / np.hypot(1, turn)
            dark = darkness * np.clip(1 - along, 0, 1) * np.exp(-0.5 * (off / SIGMA) ** 2)
            light *= 1 - dark * (x >= FACE)
        light += rng.normal(0, noise, light.shape)
        frames.append(np.clip(np.rint(light), 0, 255).astype(np.uint8))
    return np.array(frames)


def scene_of(noise):
    face, no_thing = np.zeros((2, 300, 520), bool)
    face[:, :FACE] = True
    background = np.where(face, 8, LIGHT).astype(np.float32)
    return StaticScene(background, 0.0, noise**2 + 1 / 12, face, no_thing, None, "left")


def seen_share(frames, scene):
    """Part of a whisker's length that its lines show, at least, frame by frame."""
    templates = find_templates(frames, scene, OPTIONS)
    (lines,) = trace_templates(list(frames), scene, templates, OPTIONS)
    assert np.array_equal(lines.frame, np.arange(len(frames)))
    return np.diff(lines.offsets).min() / LENGTH


@pytest.mark.parametrize(
    ("darkness", "noise", "seen"),
    [(0.03, 0.4, 0.75), (0.025, 0.8, 0.65), (0.12, 8.0, 0.5)],
    ids=["little contrast", "little contrast and some noise", "noise"],
)
def test_most_of_a_whisker_is_seen(darkness, noise, seen):
    assert seen_share(movie(darkness, noise), scene_of(noise)) > seen


@pytest.mark.parametrize("options", [OPTIONS, GIVEN], ids=["no lengths", "given lengths"])
def test_the_first_look_shows_most_of_a_whisker_in_noise(options):
    """Absorbance falls from 0.08 to 0 over the length; four fifths of it are above 0.016."""
    assert first_look_share(options) == pytest.approx(0.8, abs=0.08)


def first_look_share(options):
    """Part of a whisker's length that the first look shows in noise, on average."""
    (template,) = find_templates(movie(0.08, 8.0), scene_of(8.0), options)
    return np.mean([line.n for line in template.samples]) / LENGTH


def test_what_may_be_seen_follows_the_picture():
    usual, noisy = (
        ImageModel.from_scene(scene_of(noise), DEFAULTS.detection) for noise in (0.4, 8.0)
    )
    faint = ImageModel.from_scene(scene_of(0.4), DEFAULTS.detection, absorbed=0.02)
    assert faint.faintest < usual.faintest == noisy.faintest
    assert usual.half == faint.half < noisy.half


def test_a_first_look_that_shows_one_whisker_does_not_limit_what_is_followed():
    frames, scene = movie(0.4, 1.0, BASES), scene_of(1.0)
    templates = find_templates(frames, scene, OPTIONS)
    assert len(templates) == len(BASES)
    (lines,) = trace_templates(list(frames), scene, templates[:1], OPTIONS, given=())
    assert np.array_equal(np.bincount(lines.frame), [len(BASES)] * len(frames))
