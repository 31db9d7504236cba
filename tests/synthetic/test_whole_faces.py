"""Whole faces: whiskers as long and thick as published, as fast, dark and hidden as recorded."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from synthetic.motion import whisking_bouts
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.whole_faces import pad_whisker
from whiskermodel.whisker import mouse_c2

FRAMES = 300
fastest_deg = 3.0, 10.0  # of a frame, the quickest step of each whisker
resting_deg = 1.0  # of a frame: hardly more than the whiskers' own slow motion
hidden_mm = 0.4, 3.0  # arc length at which whiskers leave the face
contrast = 0.04, 0.4  # share of the light that a whisker takes 3 mm beyond that, at its middle
PRESETS = ("mouse_face_on_top", "rat_both_sides")


@lru_cache
def trial(preset):
    return make_trial(preset, 5, 0, FRAMES)


@lru_cache
def renderer(preset):
    return Renderer(trial(preset).scene, trial(preset).motion)


def test_dimensions_follow_row_and_column():
    assert pad_whisker("C2").length == pytest.approx(33.2e-3)
    assert pad_whisker("C2").base_radius == pytest.approx(66.3e-6)
    mouse = pad_whisker("C2", mouse_c2())
    assert mouse.length == pytest.approx(mouse_c2().length)
    assert mouse.base_radius == pytest.approx(mouse_c2().base_radius)
    for name in ("C1", "D2"):  # caudal, ventral: longer and thicker
        assert pad_whisker(name).length > pad_whisker("C2").length
        assert pad_whisker(name).base_radius > pad_whisker("C2").base_radius


def test_bouts_and_rests_alternate():
    turn = whisking_bouts(4000, 200.0, np.random.default_rng(3), 0.25, 16.0, 0.3)
    range_100ms = np.ptp(turn.reshape(-1, 20), axis=1)
    whisking, resting = (range_100ms > 0.3).mean(), (range_100ms < 0.03).mean()
    assert whisking > 0.25
    assert resting > 0.25
    assert turn.min() > -0.2  # rad: whiskers swing forwards from where they rest


def test_hasty_whisks_are_faster_and_no_wider():
    plain, hasty = (
        whisking_bouts(4000, 500.0, np.random.default_rng(4), 0.25, 6.0, 1.0, haste)
        for haste in (0.0, 2.0)
    )
    speed = [np.abs(np.diff(each)).max() for each in (plain, hasty)]
    assert 1.7 < speed[1] / speed[0] < 3.5
    assert np.ptp(hasty) < 1.1 * np.ptp(plain)


@pytest.mark.parametrize("preset", PRESETS)
def test_whiskers_move_as_fast_as_recorded_rest_and_cross(preset):
    motion = trial(preset).motion
    angle = np.rad2deg([hair.contact.base_angle for hair in motion.hairs])
    step = np.abs(np.diff(angle, axis=1))
    assert (step.max(1) > fastest_deg[0]).all()
    assert (step.max(1) < fastest_deg[1]).all()
    assert (step.max(0) < resting_deg).mean() > 0.1  # all rest at once
    assert crossings(motion, range(0, FRAMES, 60)) > 2


def crossings(motion, frames):
    """Most pairs of whiskers in one of the frames that meet outside of the face."""
    most = 0
    for frame in frames:
        lines = [
            np.column_stack([p[frame, 20::2] for p in motion.centrelines(h)])
            for h in range(len(motion.hairs))
        ]
        most = max(most, sum(cross(a, b) for k, a in enumerate(lines) for b in lines[:k]))
    return most


def cross(a, b):
    return cKDTree(a).query(b)[0].min() < 1.0  # px


@pytest.mark.parametrize("preset", PRESETS)
def test_whiskers_leave_the_fur_where_the_truth_says_and_are_as_dark_as_recorded(preset):
    scene, motion, drawn = trial(preset).scene, trial(preset).motion, renderer(preset)
    scale, share = scene.camera.pixels_per_mm, drawn.opened(0) / drawn.background
    ratio = drawn.light(0) / drawn.without_whiskers(0)
    leaves, dips = [], []
    for h in range(len(scene.hairs)):
        x, y = (part[0] for part in motion.centrelines(h))
        passing = map_coordinates(share, [y, x], order=1, mode="nearest")
        first = np.argmax(passing > 0.5)
        leaves.append(first / scale)
        seen = slice(first + int(2.5 * scale), first + int(3.5 * scale))
        middle = np.median(map_coordinates(ratio, [y[seen], x[seen]], order=1, mode="nearest"))
        if passing[seen].min() > 0.8:  # not before a body
            dips.append(1 - middle)
    assert hidden_mm[0] < min(leaves)
    assert max(leaves) < hidden_mm[1]
    assert len(dips) > 0.7 * len(scene.hairs)
    assert contrast[0] < min(dips)
    assert np.median(dips) < contrast[1]


def test_a_pale_face_glows_and_hides_whiskers():
    scene, drawn = trial("rat_both_sides").scene, renderer("rat_both_sides")
    column, row = 355, 200  # px, between the eyes and the nose
    face = drawn.light(0)[row - 20 : row + 20, column - 20 : column + 20]
    assert 0.15 < face.mean() / scene.lights.level < 0.5
    passing = drawn.without_whiskers(0)[row - 20 : row + 20, column - 20 : column + 20]
    assert passing.mean() / scene.lights.level < 0.02
    sides = [name.split("_")[0] for name in scene.names]
    assert sides.count("left") == sides.count("right") == 12


def test_a_black_face_body_and_bar_are_dark():
    light = renderer("mouse_face_on_top").light(0)
    for row, column in ((40, 200), (300, 40), (350, 265)):  # face, body, bar
        assert light[row, column] < 10  # grey levels
    assert light[330, 450] > 100
