"""The static scene as lines are measured before it: what counts as an edge."""

import cv2
import numpy as np
import pytest

from pipeline.detection import line_fit
from pipeline.detection.image_model import ImageModel
from pipeline.detection.static_scene import StaticScene
from pipeline.session.parameters import DEFAULTS

HEIGHT, WIDTH = 120, 200  # px


@pytest.mark.parametrize(
    ("first_y", "last_y", "clear"),
    [(-3, -3, False), (0, 0, False), (3, 3, True), (-40, 80, True), (100, 140, True)],
    ids=["beyond", "on the last pixels", "beside", "into the picture", "out of it"],
)
@pytest.mark.parametrize("across", [False, True], ids=["top", "left"])
def test_a_line_along_the_pictures_border_is_at_an_edge(first_y, last_y, clear, across):
    """A mouse's recording is dark in its uppermost rows, and a line was traced 3 px above them."""
    shape = (WIDTH, HEIGHT) if across else (HEIGHT, WIDTH)
    light, nothing = np.full(shape, 200, np.float32), np.zeros(shape, bool)
    model = ImageModel.from_scene(
        StaticScene(light, 0.0, 1.0, nothing, nothing, None, "left"), DEFAULTS.detection
    )
    places = [np.linspace(40.0, 160.0, 150), np.linspace(float(first_y), float(last_y), 150)]
    x, y = places[::-1] if across else places
    assert line_fit.is_clear(x, y, len(x), model.off_edges) == clear


@pytest.mark.parametrize(
    ("first_x", "last_x", "clear"),
    [(80, 80, False), (84, 84, False), (95, 95, True), (60, 100, True), (50, 160, True)],
    ids=["on the rim", "beside it", "off it", "across it", "across the whole"],
)
def test_a_line_along_a_thing_that_lets_light_through_is_at_an_edge(first_x, last_x, clear):
    """In a rat's recording a line ran along its cheek's pale fur, through which light comes."""
    thing, nothing = np.zeros((2, HEIGHT, WIDTH), bool)
    thing[:, 80:130] = True
    light = cv2.GaussianBlur(np.where(thing, 100, 200).astype(np.float32), (0, 0), 6.0)
    model = ImageModel.from_scene(
        StaticScene(light, 0.0, 4.0, nothing, thing, None, "left"), DEFAULTS.detection
    )
    assert model.weight[60, 100] > 0  # light passes
    x, y = np.linspace(float(first_x), float(last_x), 90), np.linspace(15.0, 105.0, 90)
    assert line_fit.is_clear(x, y, len(x), model.off_edges) == clear
