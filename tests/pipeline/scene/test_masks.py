"""Openings by discs, against scikit-image's."""

import cv2
import numpy as np
import pytest
from skimage.measure import label
from skimage.morphology import isotropic_dilation, isotropic_opening

from pipeline.scene.masks import dilated, opened, opened_beyond_border, regions


def blobs(seed):
    noise = np.random.default_rng(seed).normal(size=(120, 160)).astype(np.float32)
    return cv2.GaussianBlur(noise, (0, 0), 3 + seed) > 0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("radius", [1, 2, 3])
def test_openings_and_dilations_are_those_of_scikit_image(seed, radius):
    mask = blobs(seed)
    assert opened(mask, radius).any()
    assert np.array_equal(opened(mask, radius), isotropic_opening(mask, radius))
    assert np.array_equal(dilated(mask, radius), isotropic_dilation(mask, radius))


def test_nothing_is_left_where_no_disc_fits():
    bars = np.zeros((60, 60), bool)
    bars[20:25] = True
    assert not opened(bars, 4).any()
    assert np.array_equal(opened_beyond_border(bars, 4), bars)  # the border cuts no end off
    assert not opened_beyond_border(bars, 8).any()


def test_regions_touch_by_sides_or_corners():
    mask = blobs(1)
    found, known = regions(mask), label(mask)
    assert found.max() == known.max()
    assert len(np.unique(np.stack([found, known]).reshape(2, -1), axis=1).T) == found.max() + 1
