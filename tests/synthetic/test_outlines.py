"""Polygons in the picture: distances, edges, light that shapes let pass."""

import numpy as np
import pytest

from synthetic.outlines import along_outline, distance_from_outline, rounded, shape_transmission
from synthetic.scene import Camera, Scene, Shape

exact = 1e-9  # px
blur_tolerance = 1e-6  # share of the light

SCENE = Scene(Camera(width=60, height=40, pixels_per_mm=10.0))
SQUARE_PX = ((10, 10), (30, 10), (30, 25), (10, 25))
SQUARE = tuple((x / 1e4, -y / 1e4) for x, y in SQUARE_PX)


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_distance_is_signed_and_exact(corners):
    distance = distance_from_outline(SCENE, corners)
    assert distance.shape == (40, 60)
    assert distance[17, 12] == pytest.approx(-2, abs=exact)  # row, column
    assert distance[17, 35] == pytest.approx(5, abs=exact)
    assert distance[6, 33] == pytest.approx(5, abs=exact)  # 3, 4 from the corner


@pytest.mark.parametrize("corners", [SQUARE, SQUARE[::-1]])
def test_normals_point_outwards(corners):
    x, y, normal, length = along_outline(SCENE, corners)
    assert length == pytest.approx(70, abs=exact)
    distance = distance_from_outline(SCENE, corners)
    out_x, out_y = x + 3 * np.cos(normal), y - 3 * np.sin(normal)
    away = (np.abs(x - 20) < 8) | (np.abs(y - 17.5) < 5)  # from the corners
    reached = distance[np.rint(out_y[away]).astype(int), np.rint(out_x[away]).astype(int)]
    assert reached == pytest.approx(3, abs=0.5)  # px


def test_a_shape_lets_its_share_pass_inside_half_at_the_edge_all_outside():
    passing = shape_transmission(SCENE, Shape(SQUARE, 0.2, 1.0))
    assert passing[17, 20] == pytest.approx(0.2, abs=blur_tolerance)
    assert passing[17, 10] == pytest.approx(0.6, abs=blur_tolerance)
    assert passing[17, 50] == pytest.approx(1.0, abs=blur_tolerance)


def test_rounding_cuts_corners_and_keeps_the_middle():
    cut = rounded(SQUARE, 2)
    assert len(cut) == 16
    distance = distance_from_outline(SCENE, cut)
    assert distance[11, 11] > 0 > distance[17, 20]


def test_shapes_of_too_few_corners_are_refused():
    with pytest.raises(ValueError, match="corners must be 3 corners or more"):
        Shape(SQUARE[:2])
