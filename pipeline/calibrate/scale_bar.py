"""The scale bar in a micrograph: a long thin box of one grey level, along the picture's sides."""

import numpy as np
from skimage.measure import label, regionprops

from pipeline.calibrate.find_whisker import NoWhiskerError

EVEN = 0.02  # share of the grey levels' range that a bar varies by
SOLID = 0.95  # share of its box that it fills
LEAST_PX, LEAST_ASPECT = 30, 4.0
LENGTH_SE_PX = 0.4  # of a bar that ends at whole pixels


def scale_bar_px(image) -> float:
    """Length [px] of the scale bar in a picture (height, width).

    Raises
    ------
    NoWhiskerError
        Where there is none, or more than one of different lengths.
    """
    low, high = float(image.min()), float(image.max())
    near = EVEN * max(high - low, 1.0)
    lengths = sorted(
        length
        for level in (low, high)
        for region in regionprops(label(np.abs(image - level) <= near))
        for length in _bar_lengths(region)
    )
    if not lengths:
        raise NoWhiskerError(
            "shows no scale bar: expected a straight bar of pure black or white along the "
            "picture's side; give --pixels-per-mm instead"
        )
    if lengths[-1] > 1.05 * lengths[0]:
        raise NoWhiskerError(
            f"shows bars of {lengths[0]} to {lengths[-1]} px: expected one scale bar; give "
            "--pixels-per-mm instead"
        )
    return float(lengths[-1])


def _bar_lengths(region):
    """The length of a region if it is a bar."""
    top, left, bottom, right = region.bbox
    height, width = bottom - top, right - left
    long, thin = max(height, width), min(height, width)
    if long >= LEAST_PX and thin >= 2 and long >= LEAST_ASPECT * thin and region.extent >= SOLID:
        yield long
