"""A dark disc where no whisker is: nothing can touch it."""

from contextlib import ExitStack

import numpy as np
import pytest

from pipeline import analyse
from pipeline.app.init import findings, look_at
from pipeline.scene.scale import FIELD_MM, scale_of
from synthetic.encode import video_suffix, write_video
from synthetic.scene import Codec

LOSSLESS = Codec("ffv1")
DISC_PX = 160.0, 100.0
RADIUS_PX = 5.0
WIDTH, HEIGHT = 240, 180  # px
AS_DRAWN = 0.5  # px


@pytest.fixture(scope="module")
def frames():
    """A face at the left and a round end beside it, in noise; uint8 (frames, height, width)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    away = np.hypot(x - DISC_PX[0], y - DISC_PX[1]) - RADIUS_PX
    picture = np.where(x < 30, 25.0, 25 + 155 * np.clip(0.5 + away, 0, 1))
    noise = np.random.default_rng(3).normal(0, 2, (24, HEIGHT, WIDTH))
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def settings(**pole):
    recording = {"frames_per_second": 1000, "pixels_per_mm": 2 * RADIUS_PX / 0.5, "face": "left"}
    return {"recording": recording, "pole": {"diameter_mm": 0.5, **pole}}


def test_no_disc_is_a_pole_where_no_whisker_may_touch_it(frames):
    found = analyse(frames, settings())
    assert found.pole is None
    assert "a dark disc, but no whisker to touch it (at 160, 100 px)" in found.messages[0]


def test_a_pole_that_a_person_has_shown_is_kept(frames):
    found = analyse(frames, settings(x_px=DISC_PX[0], y_px=DISC_PX[1]))
    place = found.pole.x_px[0], found.pole.y_px[0]
    np.testing.assert_allclose(place, DISC_PX, atol=AS_DRAWN)


def test_it_gives_no_scale(frames, tmp_path):
    video = tmp_path / f"disc{video_suffix(LOSSLESS)}"
    write_video(video, iter(frames), LOSSLESS)
    with ExitStack() as opened:
        document, _ = findings({video.name: look_at(video, opened)})
    assert "x_px" not in document["pole"]
    assert document["recording"]["pixels_per_mm"] == round(scale_of((HEIGHT, WIDTH), FIELD_MM), 2)
