"""Names in the picture of the page."""

import itertools

import numpy as np

from pipeline.curate.picture import SHOWN_PX, name_places
from pipeline.reports.drawing import View
from pipeline.reports.lettering import line_height, text_width

WIDTH, HEIGHT = 720, 500  # px


def test_names_of_a_crowd_stand_beside_their_tips_and_apart():
    view = View(0, 0, WIDTH, HEIGHT, SHOWN_PX / WIDTH)
    lines = {  # that end 3 px apart
        f"left_w{k}": np.column_stack(
            [np.linspace(100, 300, 50), np.linspace(200, 100 + 3 * k, 50)]
        )
        for k in range(8)
    }
    places = name_places(lines, view)
    high = line_height(view.letters) / view.zoom
    for (one, (x, y)), (_, (other_x, other_y)) in itertools.combinations(places.items(), 2):
        wide = text_width(one, view.letters) / view.zoom
        assert abs(x - other_x) > wide or abs(y - other_y) >= high - 1e-6
    x, y = places["left_w0"]
    assert np.hypot(x - 300, y - 100) < 2 * high  # px: beyond its tip


def test_without_lines_there_are_no_names():
    assert name_places({}, View(0, 0, WIDTH, HEIGHT, 1.0)) == {}
