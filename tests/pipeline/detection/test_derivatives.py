"""Derivatives by Gaussians: their kernels, and a picture's, beside sums over all pixels."""

import numpy as np
import pytest

from pipeline.detection import derivatives
from pipeline.numerics.rectangles import bounds


@pytest.mark.parametrize("scale", [1.0, 1.6, 2.5])
def test_kernels_differentiate(scale):
    g, g1, g2 = (k.astype(float) for k in derivatives.gaussian_kernels(scale))
    u = np.arange(len(g)) - len(g) // 2
    # convolution of x and x²: ∫ g' (x − u) du = 1, ∫ g'' (x − u)² du = 2
    assert (g1 * -u).sum() == pytest.approx(1, abs=0.02)
    assert (g2 * u**2).sum() == pytest.approx(2, abs=0.05)
    assert g.sum() == pytest.approx(1)


def naive(image, along_x, along_y):
    """The picture, mirrored beyond its edges, convolved with a kernel each way."""
    reach = len(along_x) // 2
    wide = np.pad(image.astype(float), reach, mode="reflect")
    rows = np.array([np.convolve(row, along_x, mode="valid") for row in wide])
    return np.array([np.convolve(column, along_y, mode="valid") for column in rows.T]).T


@pytest.mark.parametrize("scale", [1.1, 1.6])
@pytest.mark.parametrize("shape", [(23, 37), (40, 16)])
def test_derivatives_of_all_rows_are_the_convolutions(scale, shape):
    height, width = shape
    whole = np.random.default_rng(2).normal(size=(height + 5, width + 7)).astype(np.float32)
    part = np.s_[3 : 3 + height, 2 : 2 + width]
    image = whole[part]
    g, g1, g2 = derivatives.gaussian_kernels(scale)
    kernels = derivatives.halves((g, g1, g2))
    rows = derivatives.along_rows(whole, bounds(part, whole.shape), kernels)
    got = np.empty((5, *shape), np.float32)
    columns = np.arange(shape[1], dtype=np.int32)
    for row in range(shape[0]):
        derivatives.first_derivatives(rows, row, kernels, columns, got[0, row], got[1, row])
        derivatives.second_derivatives(rows, row, kernels, *got[2:, row])
    pairs = (g1, g), (g, g1), (g2, g), (g, g2), (g1, g1)
    for own, (along_x, along_y) in zip(got, pairs, strict=True):
        np.testing.assert_allclose(own, naive(image, along_x, along_y), atol=1e-5)
    some = derivatives.second_along_rows(rows, kernels, 3, 7)
    np.testing.assert_allclose(some, got[2][3::7, 3::7], atol=1e-5)
