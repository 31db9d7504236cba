"""The noise estimated beside a rod, in pictures whose noise is known."""

import numpy as np
import pytest

from pipeline.detection.image_model import ImageModel
from pipeline.detection.static_scene import StaticScene
from pipeline.scene.background import estimate_background
from pipeline.scene.codec_noise import noise_excess
from pipeline.session.parameters import DEFAULTS

SCALE, LIGHT, DARK, SD = 25.0, 180.0, 15.0, 2.0  # px/mm, grey
ROD = np.s_[:, 200:214]
EXCESS = 0.15  # relative error of a ratio of standard deviations
TRIPLED = 3.0


def scene(edge_noise, whisker=False, seed=0, n=32):
    """Frames (n, 240, 400) with a rod beside which the SD is `edge_noise` times SD; obstacles."""
    rng = np.random.default_rng(seed)
    image = np.full((240, 400), LIGHT)
    image[ROD] = DARK
    sd = np.full(image.shape, SD)
    sd[:, 192:222] = edge_noise * SD
    frames = image + sd * rng.normal(size=(n, *image.shape))
    if whisker:
        for k, frame in enumerate(frames):
            frame[(100 + k) % 240 - 2 : (100 + k) % 240 + 2] *= 0.4
    obstacles = np.zeros(image.shape, bool)
    obstacles[ROD] = True
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8), obstacles


def excess_of(frames, obstacles):
    background = estimate_background(frames, SCALE, DEFAULTS.scene)
    return background, noise_excess(background, frames, obstacles, np.zeros(obstacles.shape, bool))


def test_even_noise_has_no_excess():
    assert excess_of(*scene(1.0))[1] is None


@pytest.mark.parametrize("whisker", [False, True])
def test_the_geometric_mean_of_model_and_measurement(whisker):
    _, excess = excess_of(*scene(TRIPLED, whisker))
    assert excess[:, 192:198].mean() == pytest.approx(TRIPLED, rel=EXCESS)  # of variances
    far = 2 * 16  # px, two of a codec's blocks
    assert np.all(excess[:, : 200 - far] == 1)
    assert np.all(excess[:, 214 + far :] == 1)


def test_few_frames_show_nothing():
    assert excess_of(*scene(TRIPLED, n=5))[1] is None


def test_pixels_there_count_less():
    frames, obstacles = scene(TRIPLED)
    background, excess = excess_of(frames, obstacles)
    face = np.zeros(obstacles.shape, bool)
    noise = background.noise_gain, background.noise_floor
    still = StaticScene(background.image, *noise, face, obstacles, None, "left")
    even = ImageModel.from_scene(still, DEFAULTS.detection).weight
    uneven = ImageModel.from_scene(
        StaticScene(background.image, *noise, face, obstacles, None, "left", excess),
        DEFAULTS.detection,
    ).weight
    ratio = even[:, 192:198].sum() / uneven[:, 192:198].sum()
    assert ratio == pytest.approx(TRIPLED, rel=EXCESS)
    assert np.array_equal(even[:, :170], uneven[:, :170])
