"""A line that something hides, or the border, is no whole whisker."""

import numpy as np
import pytest

from pipeline.detection.static_scene import StaticScene
from pipeline.scene.epochs import Epoch
from pipeline.session.parameters import DEFAULTS, DetectionParams
from pipeline.tracking import line_ends


def scene(**hidden):
    """A bright scene of 200 × 100 px with a face at the left; hidden: masks' rectangles."""
    masks = {"face_mask": np.zeros((100, 200), bool), "obstacle_mask": np.zeros((100, 200), bool)}
    masks["face_mask"][:, :20] = True
    background = np.full((100, 200), 180.0, np.float32)
    for rectangle in hidden.values():
        masks["obstacle_mask"][rectangle] = True
        background[rectangle] = 5.0
    return StaticScene(background, 0.1, 1.0, pole=None, face_side="left", **masks)


USUAL = DEFAULTS.detection
BODY = (slice(60, 100), slice(80, 200))


ENDS = {(120, 30): True, (120, 55): False, (190, 30): False, (60, 75): True, (-3, 50): False}


@pytest.mark.parametrize(("end", "whole"), ENDS.items())
def test_a_line_before_a_body_or_the_border_may_go_on(end, whole):
    tips_seen = line_ends.tips_seen(scene(body=BODY), USUAL)
    assert line_ends.whole(*np.array([end], float).T, tips_seen).tolist() == [whole]


def test_what_hides_it_at_some_time_counts():
    epochs = [Epoch(0, 9, scene()), Epoch(9, 12, None), Epoch(12, None, scene(body=BODY))]
    both = line_ends.tips_seen(epochs, USUAL)
    assert (both == line_ends.tips_seen(scene(body=BODY), USUAL)).all()


def test_a_bright_thing_hides_tips_where_the_settings_say_that_it_is_a_rim():
    rod = scene(body=BODY)
    rod.background[BODY] = 120.0
    assert line_ends.tips_seen(rod, USUAL)[80, 140]
    assert not line_ends.tips_seen(rod, DetectionParams(rim_px=100.0))[80, 140]
