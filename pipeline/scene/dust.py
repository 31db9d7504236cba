"""A round dark spot that whiskers pass over without bending is not a pole.

Dust on a window may look like the end of a pole. A whisker that lies across it, seen on both
sides, is not bent by it; nor is one that passes in front of or behind a pole.
"""

import cv2
import numpy as np

from pipeline.numerics.runs import runs_around
from pipeline.scene.background import DARK_SD, DARK_SHARE
from pipeline.scene.circle_fit import N_RAYS, ray_points, rays
from pipeline.scene.illumination import frame_gains

INNER = 0.5  # radii about the centre: no whisker that touches a pole is seen to lie there
RING = 1.4, 1.5  # radii, and px beyond, at which a whisker is looked for; edges are blurred
THICK_PX = (0.0, 1.0, 2.0)  # distances that are averaged
WIDEST = 30  # of the rays; more is no whisker
FEWEST = 2  # frames: one may be a mistake


def is_passed_over(x, y, radius, background, noise, frames) -> bool:
    """Whether whiskers cross the inner half of a disc at (x, y) of `radius` [px].

    A whisker shows at two places on a circle about the disc: opposite each other where it passes
    over the disc, nearer together where it is bent by it or stays beside.

    Parameters
    ----------
    x, y, radius : the disc [px]
    background : float32 (height, width), without whiskers
    noise : (floor, gain) of a pixel's variance [grey²], [grey]
    frames : uint8 (k, height, width)
    """
    ring = RING[0] * radius + RING[1]
    px, py = ray_points(x, y, rays(), ring + np.array(THICK_PX))
    middle = ring + np.mean(THICK_PX)

    def light(image):
        return cv2.remap(image, px, py, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).mean(1)

    known = light(background)
    variance = (noise[0] + noise[1] * np.maximum(known, 0)) / len(THICK_PX)
    limit = np.maximum(DARK_SHARE * known, DARK_SD * np.sqrt(variance))
    crossed = 0
    for frame, gain in zip(frames, frame_gains(frames), strict=True):
        spots = _spots(light(frame) / max(gain, 1e-3) < known - limit)
        if len(spots) == 2:
            apart = (spots[1] - spots[0]) * 2 * np.pi / N_RAYS
            crossed += middle * abs(np.cos(apart / 2)) < INNER * radius
    return crossed >= FEWEST


def _spots(dark):
    """Middles of the runs of True on a ring, none where one of them is too wide for a whisker."""
    starts, widths = runs_around(dark).T
    return [] if widths.max(initial=0) > WIDEST else list(starts + 0.5 * (widths - 1))
