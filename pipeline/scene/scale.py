"""The scale that separates thin from thick in a scene: near the picture's own.

The scale in session.toml may be wrong by a factor of two, or not be measured yet. Results in mm
must follow it, but not the decision which pixels are face, fur or whisker. Pictures of whisking
animals show a field of about FIELD_MM: lengths in the scene use the scale that follows from this.
"""

import numpy as np

FIELD_MM = 22.2  # square root of the area that a picture shows, at the most
CLOSEST = 1.6  # times as near may the camera be


def working_scale(shape, pixels_per_mm: float) -> float:
    """Return the scale [px/mm] for lengths in the scene.

    Parameters
    ----------
    shape : height and width of the picture [px]
    pixels_per_mm : as session.toml gives it
    """
    usual = scale_of(shape, FIELD_MM)
    return float(np.clip(pixels_per_mm, usual, CLOSEST * usual))


def scale_of(shape, field_mm: float) -> float:
    """Return the scale [px/mm] of a picture (height, width) that shows field_mm × field_mm."""
    return float(np.sqrt(shape[0] * shape[1]) / field_mm)
