"""Why a round dark disc is no pole: it is at the animal, or part of something larger."""

import numpy as np

from pipeline.scene.circle_fit import Pole, ray_points, rays
from pipeline.scene.masks import distance_from

OFF_THE_ANIMAL = 5.0  # radii, at least, between a pole's centre and the animal
OFF_SHARE = 0.04  # of the picture's size, at least: fur reaches so far
FREE_AROUND = 0.55  # share of the circle around a pole that its rod leaves free
UNEVEN = 0.03  # share of a wide circle that may be hidden beyond what the rod hides near by
NEAR, MIDDLE, FAR = 1.5, 2.0, 5.0  # radii of the circles that are looked at
BRIGHT = 0.5  # of the light that passes elsewhere


def doubt(pole: Pole, transmission, animal) -> str | None:
    """Return the reason to doubt a pole, or None.

    Parameters
    ----------
    pole : a measured disc
    transmission : float32 (height, width), share of the light that passes
    animal : bool (height, width), face and body with their fur

    At the animal, tufts of fur look like poles. Around a pole only its rod hides the light, and
    covers less of a wider circle; other things cover more of it.
    """
    x, y = round(pole.x_px), round(pole.y_px)
    off = max(OFF_THE_ANIMAL * pole.radius_px, OFF_SHARE * np.sqrt(animal.size))
    if animal.any() and distance_from(animal)[y, x] < off:
        return "a dark spot, but part of the animal"
    near, middle, far = (_light_around(pole, transmission, animal, r) for r in (NEAR, MIDDLE, FAR))
    if near > FREE_AROUND and far > middle - UNEVEN:
        return None
    return "a round end, but part of something larger"


def _light_around(pole, transmission, animal, reach) -> float:
    """Bright share of a circle of `reach` radii about the pole, off the animal; 1 for none."""
    height, width = transmission.shape
    circle = ray_points(pole.x_px, pole.y_px, rays(), np.array([reach * pole.radius_px + 2]))
    x, y = (np.rint(each[:, 0]).astype(int) for each in circle)
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    x, y = x[inside], y[inside]
    bright = transmission[y, x] > BRIGHT
    bright = bright[~animal[y, x]]
    return float(bright.mean()) if len(bright) else 1.0
