import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from synthetic.micrograph import Micrograph, random_micrograph
from whiskermodel.whisker import Whisker

PLAIN = {"noise_sd": 0.0, "unevenness": 0.0, "dust_beside": 0}
FINE = 8  # samples per pixel and direction of the slow, plain way
GREY, CORNER = 1.5, 5.0  # grey levels by which the two ways may differ, and at the ends' corners


@pytest.mark.parametrize("curvature", [0.0, 250.0])
def test_picture_is_that_of_samples_inside_the_outline(curvature):
    whisker = Whisker(1e-3, 1.1e-3, 40e-6)
    micrograph = Micrograph(whisker, (curvature,), 100.0, 0.4, **PLAIN)
    picture = micrograph.picture()
    x, y, _, _, s = micrograph.centreline()
    radius = whisker.radius(s) * 1e5
    height, width = picture.shape
    v, u = (np.indices((height * FINE, width * FINE)) + 0.5) / FINE - 0.5
    inside = np.zeros(v.shape, bool)
    for k in range(len(x) - 1):  # the quadrilaterals between two nodes
        tx, ty = x[k + 1] - x[k], y[k + 1] - y[k]
        step = np.hypot(tx, ty)
        rows = slice(max(int((y[k] - 12) * FINE), 0), int((y[k] + 12) * FINE))
        columns = slice(max(int((x[k] - 12) * FINE), 0), int((x[k] + 12) * FINE))
        du, dv = u[rows, columns] - x[k], v[rows, columns] - y[k]
        along, across = (du * tx + dv * ty) / step, (dv * tx - du * ty) / step
        part = np.clip(along / step, 0, 1)
        reach = radius[k] + part * (radius[k + 1] - radius[k])
        inside[rows, columns] |= (along >= -0.05) & (along <= step) & (np.abs(across) <= reach)
    cover = gaussian_filter(inside.astype(float), micrograph.blur_px * FINE)
    cover = cover.reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    expected = micrograph.light * (1 - micrograph.opacity * cover)
    off = np.abs(picture - expected)
    rows, columns = np.indices(picture.shape)
    ends = [np.hypot(columns - x[k], rows - y[k]) < 8 for k in (0, -1)]
    assert off[~(ends[0] | ends[1])].max() < GREY
    assert off.max() < CORNER
    assert np.abs(np.mean(picture - expected)) < 0.02


def test_same_seed_same_picture_and_all_of_the_whisker_is_in_it():
    micrograph = random_micrograph(3, whisker=Whisker(4e-3, 4.4e-3, 30e-6), tiles=3)
    picture = micrograph.picture()
    np.testing.assert_array_equal(picture, micrograph.picture())
    x, y, *_ = micrograph.centreline()
    assert x.min() > 10
    assert y.min() > 10
    assert x.max() < picture.shape[1] - 10
    assert y.max() < picture.shape[0] - 10
