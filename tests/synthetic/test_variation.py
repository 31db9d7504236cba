"""A varied picture shows the same motion, and no two are alike."""

import numpy as np
import pytest

from synthetic.presets import make_trial
from synthetic.truth import contact_table, frame_table
from synthetic.variation import PIXELS_PER_MM, varied_motion

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def motion():
    return make_trial("noisy", 2, 0, 120).motion


@pytest.mark.parametrize("seed", range(4))
def test_the_motion_stays(motion, seed):
    varied = varied_motion(motion, np.random.default_rng(seed))
    assert contact_table(varied, "v").equals(contact_table(motion, "v"))
    one, other = frame_table(varied), frame_table(motion)
    for column in ("base_angle_deg", "curvature_per_m", "contact_force_uN"):
        np.testing.assert_array_equal(one[column], other[column])
    # from the drawn points, which lie a pixel apart
    np.testing.assert_allclose(one["pole_distance_mm"], other["pole_distance_mm"], atol=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_the_field_of_view_stays(motion, seed):
    before, camera = (
        motion.scene.camera,
        varied_motion(motion, np.random.default_rng(seed)).scene.camera,
    )
    assert PIXELS_PER_MM[0] <= camera.pixels_per_mm <= PIXELS_PER_MM[1]
    for size, known in ((camera.width, before.width), (camera.height, before.height)):
        assert size % 2 == 0
        mm = size / camera.pixels_per_mm
        assert mm == pytest.approx(known / before.pixels_per_mm, abs=2 / camera.pixels_per_mm)


def test_no_two_are_alike(motion):
    scenes = [varied_motion(motion, np.random.default_rng(seed)).scene for seed in range(12)]
    assert len({scene.camera.pixels_per_mm for scene in scenes}) == 12
    assert {scene.codec.name for scene in scenes} == {"ffv1", "h264", "mjpeg"}
