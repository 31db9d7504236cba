"""Which round dark things are poles: not those at the animal, nor parts of something larger."""

import numpy as np
import pytest
from still_scene import scene_from_frames

from pipeline.scene.circle_fit import Pole
from pipeline.scene.pole_doubts import doubt
from pipeline.session.recording import Recording

SHAPE = (240, 320)
RADIUS = 7.0  # px
SCALE = 2 * RADIUS / 0.5  # px/mm
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
DISC = np.hypot(COLUMNS - 200, ROWS - 90) < RADIUS
POLE = Pole(200.0, 90.0, RADIUS, 0.8, 0.7, 0.02, 0.95)
NOTHING = np.zeros(SHAPE, bool)
ROD = (COLUMNS > 200) & (np.abs(ROWS - 90) < 5)
BLOCK = (((np.abs(COLUMNS - 200) < 5) & (ROWS > 90)) | (ROWS > 110)) & (COLUMNS > 140)


def why(dark, face_to=100):
    """What speaks against a round thing at (200, 90), beside a face at the left."""
    face = COLUMNS < face_to
    light = np.where(dark | DISC | face, 0.02, 1.0).astype(np.float32)
    return doubt(POLE, light, face)


def test_a_pole_is_not_doubted_with_its_rod_or_without():
    assert why(ROD) is None
    assert why(NOTHING) is None


def test_a_screw_on_something_larger_is_no_pole():
    assert why(BLOCK) == "a round end, but part of something larger"


def test_a_tuft_of_fur_at_the_face_is_no_pole():
    assert why(NOTHING, face_to=185) == "a dark spot, but part of the animal"


def in_scene(dark, pole_xy=None, face_to=100):
    face = COLUMNS < face_to
    light = np.where(dark | DISC | face, 10.0, 180.0)
    noise = np.random.default_rng(0).normal(0, 1.5, (8, *SHAPE))
    frames = np.clip(light + noise, 0, 255).astype(np.uint8)
    return scene_from_frames(frames, Recording(1000.0, SCALE, "left"), 0.5e-3, pole_xy)


@pytest.mark.slow
def test_a_scene_refuses_what_is_doubted_and_says_what_it_was():
    scene = in_scene(BLOCK)
    assert scene.pole is None
    x, y, reason = scene.refused_poles[0]
    assert np.hypot(x - 200, y - 90) < 0.3
    assert "part of something larger" in reason
    scene = in_scene(NOTHING)
    assert scene.pole is not None
    assert scene.refused_poles == ()


def test_a_person_is_believed():
    scene = in_scene(BLOCK, pole_xy=(200, 90))
    assert np.hypot(scene.pole.x_px[0] - 200, scene.pole.y_px[0] - 90) < 0.3
    assert scene.refused_poles == ()
