"""Traces whose ends are seen as in a frame: the cone's thickness up to the tip, and noise."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.detection.line_end import PLACES_PX

FINE = 0.25  # px


def with_tip(places, whisker, beyond, erased_px=0.0, noise_px=0.02, blur_px=1.2, seed=0):
    """The places with ends as they look where the tip is `beyond` the mean end [m].

    erased_px : mean of the exponentially distributed length that a codec erases in each frame
    noise_px : of the thickness at each of the PLACES_PX
    """
    rng, px = np.random.default_rng(seed), places.pixel
    tip = (places.last.mean() + beyond - places.last) / px
    seen_to = tip - erased_px * rng.exponential(size=len(tip))
    at = np.arange(PLACES_PX[0] - 10, PLACES_PX[-1] + 10, FINE)
    apex = tip + (whisker.cone_length - whisker.length) / px
    slope = 2 * whisker.base_radius / whisker.cone_length  # px of thickness per px
    true = slope * (apex[:, None] - at) * (at < seen_to[:, None])
    blurred = gaussian_filter1d(true, blur_px / FINE, axis=1)
    thickness = np.array([np.interp(PLACES_PX, at, row) for row in blurred])
    thickness += noise_px * rng.standard_normal(thickness.shape)
    return replace(places, end_px=thickness.astype(np.float16))
