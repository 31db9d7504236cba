"""Even margins around a picture are left out; even parts of the picture are not."""

import numpy as np
import pytest

from pipeline.scene.picture_part import BLURRED_PX, within_margins

HEIGHT, WIDTH, WIDE = 120, 160, 20


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def picture(rng, light=180.0):
    """A face along the left, black and even at the border; noise, and light that falls off."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    image = light - 0.3 * rows + rng.normal(0, 2, (6, HEIGHT, WIDTH))
    image[:, columns < 30 + 8 * np.sin(rows / 9)] = 0
    return np.clip(image, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_a_margin_is_left_out_with_its_blurred_edge(rng, grey):
    frames = np.pad(picture(rng), ((0, 0), (WIDE, WIDE), (0, WIDE)), constant_values=grey)
    part = within_margins(frames)
    low = WIDE + BLURRED_PX
    assert part.box == (slice(low, WIDE + HEIGHT - BLURRED_PX), slice(0, WIDTH - BLURRED_PX))
    assert part.used[low:-low, :-low].all()
    assert part.used.sum() == (HEIGHT - 2 * BLURRED_PX) * (WIDTH - BLURRED_PX)


def test_an_even_face_or_ground_is_no_margin(rng):
    assert within_margins(picture(rng)) is None
    assert within_margins(picture(rng, light=400.0)) is None  # saturated
    assert within_margins(np.invert(picture(rng, light=400.0))) is None
    assert within_margins(np.zeros((2, HEIGHT, WIDTH), np.uint8)) is None


@pytest.mark.parametrize(("edge_px", "is_margin"), [(0.3, True), (1.5, False), (4.0, False)])
def test_a_straight_dark_face_is_no_margin_as_its_edge_is_soft(rng, edge_px, is_margin):
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    light = 25 + (155 - 0.3 * rows) / (1 + np.exp(-(columns - 40) / edge_px))
    noise = rng.normal(0, 0.005, (6, HEIGHT, WIDTH)) * light
    part = within_margins(np.rint(light + noise).astype(np.uint8))
    assert (part is not None) == is_margin
