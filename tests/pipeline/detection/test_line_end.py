"""Thickness about the end of a trace, on pictures drawn from the exact profile."""

import numpy as np
import pytest
from scipy.special import ndtr

from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line
from pipeline.detection.line_end import INSIDE, PLACES_PX, end_thickness
from pipeline.detection.static_scene import StaticScene
from pipeline.session.parameters import DEFAULTS

LIGHT, BLUR = 150.0, 1.0  # grey levels, px
TIP = 300.0  # px
tolerance = 0.03  # px of thickness, without noise but for the rounding to grey levels


def seen(angle, short, hidden=None):
    """Thickness and its truth, of a whisker at `angle` whose trace ends `short` px from its tip.

    hidden : columns without light
    """
    y, x = np.mgrid[:400, :400]
    s = (x - 10) * np.cos(angle) + (y - 10) * np.sin(angle)
    off = (y - 10) * np.cos(angle) - (x - 10) * np.sin(angle)
    thick = np.maximum(1.5 - 1.3 * s / TIP, 0) * ndtr((TIP - s) / BLUR)
    shadow = 1 - thick * np.exp(-0.5 * (off / BLUR) ** 2) / np.sqrt(2 * np.pi) / BLUR
    none = np.zeros(x.shape, bool)
    obstacles = none.copy()
    obstacles[:, hidden or slice(0)] = True
    background = np.where(obstacles, 8, LIGHT).astype(np.float32)
    scene = StaticScene(background, 0.0, 1.0, none, obstacles, None, "left")
    line = Line.empty(600)
    line.n = int(TIP - short)
    line.sigma[:] = BLUR
    along = np.arange(line.n)
    line.x[: line.n], line.y[: line.n] = 10 + along * np.cos(angle), 10 + along * np.sin(angle)
    picture = ImageModel.from_scene(scene, DEFAULTS.detection).picture(
        np.rint(background * shadow).astype(np.uint8), 1.0
    )
    at = line.n - 1 + PLACES_PX
    true = np.maximum(1.5 - 1.3 * at / TIP, 0) * (at < TIP)
    return end_thickness(picture, line.values, line.n), true, at


def like(found, true):
    """The ratio of two thicknesses, by least squares."""
    return found @ true / (true @ true)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("short", [2, 20])
def test_a_whisker_is_as_thick_as_it_is_up_to_its_tip_and_beyond_its_trace(angle, short):
    found, true, at = seen(angle, short)
    far = np.abs(at - TIP) > 4  # px
    ratio = like(found[far], true[far])
    assert 0.6 < ratio < 3  # the profile is taken to be wider; the same all along the line
    assert np.abs(found / ratio - true)[far].max() < tolerance
    assert np.abs(found[at > TIP + 4]).max() < tolerance


def test_where_the_view_is_blocked_nothing_is_known():
    found, _, at = seen(0.0, 20, hidden=slice(300, 400))
    assert np.isnan(found[at > 300]).all()
    assert np.isfinite(found[at < 270]).all()


def test_a_line_that_is_shorter_than_what_is_measured_has_no_more():
    found, _, at = seen(0.0, TIP - INSIDE // 2)
    assert np.isnan(found[at < -0.5]).all()
    assert np.isfinite(found[at > 0.5]).all()
