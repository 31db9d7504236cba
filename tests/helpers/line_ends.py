"""Traces whose ends are seen as in a frame: the cone's thickness up to the tip, and noise."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.detection.line_end import PLACES_PX

FINE = 0.25  # px
BLOCK_PX = 8  # of a codec
LASTING = 5  # frames over which a codec leaves a block as it was


def with_tip(places, whisker, beyond, least_px=0.0, noise_px=0.02, blur_px=1.2, seed=0):
    """The places with ends as they look where the tip is `beyond` the mean end [m].

    least_px : thickness that a block of the picture must hold on average for a codec to show it,
        itself the mean of an exponential distribution
    noise_px : of the thickness at each of the PLACES_PX
    """
    rng, px = np.random.default_rng(seed), places.pixel
    tip = (places.last.mean() + beyond - places.last) / px
    at = np.arange(PLACES_PX[0] - 10, PLACES_PX[-1] + 10, FINE)
    apex = tip + (whisker.cone_length - whisker.length) / px
    slope = 2 * whisker.base_radius / whisker.cone_length  # px of thickness per px
    true = slope * (apex[:, None] - at) * (at < tip[:, None])
    if least_px:
        true = _compressed(true, least_px, rng)
    blurred = gaussian_filter1d(true, blur_px / FINE, axis=1)
    thickness = np.array([np.interp(PLACES_PX, at, row) for row in blurred])
    thickness += noise_px * rng.standard_normal(thickness.shape)
    return replace(places, end_px=thickness.astype(np.float16))


def _compressed(thickness, least_px, rng):
    """What a codec shows of the thickness (rows, places), whose blocks lie anywhere."""
    size = round(BLOCK_PX / FINE)
    out = np.zeros_like(thickness)
    for k, row in enumerate(thickness):
        blocks = np.arange(len(row)) + rng.integers(size)
        means = np.bincount(blocks // size, row) / size
        if k % LASTING == 0:
            least = least_px * rng.exponential(size=len(row))
        out[k] = row * (means > least[: len(means)])[blocks // size]
    return out
