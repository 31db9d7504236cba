"""Fur that comes and goes is known by its breadth, and whiskers are none."""

import cv2
import numpy as np

from pipeline.detection.image_model import ImageModel
from pipeline.detection.static_scene import StaticScene
from pipeline.scene.moving_fur import moving_fur
from pipeline.session.parameters import DEFAULTS

SHAPE = (120, 160)
SCALE = 20.0  # px/mm
LIGHT = 150
AT_EDGE_PX = 4


def frames_of(fur_to, n=20):
    """A dark face at x < 30 whose fur reaches to x = fur_to in every fourth frame; a whisker."""
    frames = np.full((n, *SHAPE), LIGHT, np.uint8)
    for k, frame in enumerate(frames):
        frame[:, :30] = 10
        if k % 4 == 0:
            frame[20:80, 30:fur_to] = 60
        cv2.line(frame, (30, 100), (150, 60 + 2 * k), 40, 3)
    return frames, np.arange(SHAPE[1]) < 30 + np.zeros((SHAPE[0], 1))


def found(fur_to):
    frames, face = frames_of(fur_to)
    return moving_fur(np.full(SHAPE, LIGHT, np.float32), frames, face, SCALE, DEFAULTS.scene), face


def test_moving_fur_is_found_where_it_is():
    fur, _ = found(fur_to=46)
    there = np.zeros(SHAPE, bool)
    there[20:80, 30:46] = True
    assert (fur & there).sum() > 0.9 * there.sum()
    away = cv2.dilate(there.astype(np.uint8), np.ones((2 * AT_EDGE_PX + 1,) * 2)) == 0
    assert not (fur & away).any()


def test_skin_that_moves_out_by_less_than_fur_is_broad_is_moving_fur():
    out = 6  # px; fur is at least 8 px broad, but behind it is the face
    fur, _ = found(fur_to=30 + out)
    there = np.zeros(SHAPE, bool)
    there[20:80, 30 : 30 + out] = True
    assert (fur & there).sum() > 0.9 * there.sum()
    assert not (fur & ~cv2.dilate(there.astype(np.uint8), np.ones((3, 3))).astype(bool)).any()


def test_whiskers_are_no_fur():
    fur, _ = found(fur_to=30)
    assert not fur.any()


def test_two_whiskers_side_by_side_are_no_fur_at_low_resolution():
    frames, face = frames_of(fur_to=30)
    for frame in frames[::4]:
        for y in (20, 23):  # 3 px wide each, as whiskers are at any resolution
            cv2.line(frame, (30, y), (120, y), 40, 3)
    light = np.full(SHAPE, LIGHT, np.float32)
    for px_per_mm in (8.0, 12.0, SCALE):
        assert not moving_fur(light, frames, face, px_per_mm, DEFAULTS.scene).any()


def test_no_line_is_clear_on_moving_fur():
    fur, face = found(fur_to=46)
    none = np.zeros(SHAPE, bool)
    scene = StaticScene(
        np.where(face, 10, LIGHT).astype(np.float32), 0.0, 1.0, face, none, None, "left",
        moving_fur=fur,
    )  # fmt: skip
    clear = ImageModel.from_scene(scene, DEFAULTS.detection).off_edges > 0
    assert not clear[fur].any()
    assert clear[~face & ~fur].any()
