"""A whisker in space keeps its length, and both pictures show it where it is; dust on it too."""

from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest

from pipeline.session.session_file import read_session
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.staging import Setting
from synthetic.two_view_session import POINT_SE_PX, matched_points, render_two_views, true_rows
from synthetic.two_views import renderers, whisker_in_space

FRAMES = 60
LENGTH = 2e-4  # relative error of a length along the whisker
ELEVATION = np.deg2rad(6)  # change along the whisker up to the pole, at most


@pytest.fixture(scope="module")
def space():
    return whisker_in_space(Setting("two_views", 4, 0, np.random.default_rng(10), FRAMES))


def test_the_whisker_keeps_its_length(space):
    steps = np.sqrt(sum(np.diff(part, axis=1) ** 2 for part in space.places))
    np.testing.assert_allclose(steps.sum(axis=1), space.whisker.length, rtol=LENGTH)


def test_truth_has_elevation_and_path(space):
    true = true_rows(space)
    assert len(true) == space.contact.touching.sum() > 0
    at_base = np.rad2deg(space.tilt.elevation[true["frame"]])
    assert np.abs(true["elevation_deg"] - at_base).max() < np.rad2deg(ELEVATION)
    short = 1 - np.cos(np.deg2rad(true["elevation_deg"]))
    np.testing.assert_allclose(true["projection_error_percent"], 100 * short, atol=0.3)
    reach = np.hypot(
        space.motion.scene.pole.x - space.tilt.x, space.motion.scene.pole.y - space.tilt.y
    )
    shown = 1e-3 * true["apparent_path_mm"].to_numpy() / reach[true["frame"]]
    np.testing.assert_allclose(shown, 1, atol=0.03)


def test_both_pictures_show_the_whisker_where_it_is(space):
    for renderer in renderers(space, 3):
        light = renderer.light(20)
        x, y = (part[20, 100:300] for part in renderer.motion.centrelines(0))
        on = cv2.remap(light, *(p.astype(np.float32)[None] for p in (x, y)), cv2.INTER_LINEAR)[0]
        beside = cv2.remap(
            light, *(p.astype(np.float32)[None] for p in (x, y + 8)), cv2.INTER_LINEAR
        )[0]
        clear = beside > 100  # neither pole nor fur
        assert clear.sum() > 100
        assert (on[clear] < 0.9 * beside[clear]).all()


def test_the_pole_is_a_bar_in_the_second_picture(space):
    first, second = renderers(space, 3)
    pole = first.scene.pole
    x, y = space.second.project(*(np.full(2, p) for p in (pole.x, pole.y)), np.array([0, 2e-3]))
    light = second.light(0)
    for column, row in zip(x, y, strict=True):
        assert light[int(row), round(column)] < 15


def test_matched_points_are_the_same_points(space):
    still = replace(space.second, roll=0.0)
    whisker = type(space)(space.motion, space.tilt, still)
    points = matched_points(whisker, np.random.default_rng(0))
    along = points[:, 0] * np.cos(still.azimuth) - points[:, 1] * np.sin(still.azimuth)
    scales = still.camera.pixels_per_mm / space.motion.scene.camera.pixels_per_mm
    np.testing.assert_allclose(
        points[:, 2] - still.origin_px[0], along * scales, atol=6 * POINT_SE_PX
    )


@pytest.mark.slow
def test_both_views_in_one_picture(tmp_path):
    (path,) = render_two_views(tmp_path, "mirror", seed=2, trials=1, frames=25)
    shapes = []
    for name in ("first", "second"):
        left, top, right, bottom = read_session(tmp_path / f"{name}.toml").image.region_px
        shapes.append((right - left, bottom - top))
    capture = cv2.VideoCapture(str(path))
    assert capture.get(cv2.CAP_PROP_FRAME_HEIGHT) == sum(height for _, height in shapes)
    assert len(pd.read_csv(tmp_path / "points.csv")) >= 6
    assert {each.name for each in tmp_path.glob("[!.]*")} == {
        path.name, "first.toml", "second.toml", "points.csv", "truth",
    }  # fmt: skip
    assert (tmp_path / "truth" / path.stem / "views.csv").is_file()


def test_a_particle_sticks_to_the_whisker_until_it_falls_off():
    motion = make_trial("dust", 1, 0, FRAMES).motion
    hair = motion.scene.hairs[0]
    share = hair.particle.arc_length / hair.whisker.length
    falling = replace(hair, particle=replace(hair.particle, falls_off=30, aside=0.0))
    motion.scene = replace(motion.scene, hairs=(falling,))
    renderer = Renderer(motion.scene, motion)
    x, y = motion.centrelines(0)
    at = round(share * (x.shape[1] - 1))
    level = [renderer.light(k)[round(y[k, at]), round(x[k, at])] for k in (10, 29, 30, 50)]
    assert max(level[:2]) < 0.5 * min(level[2:])
