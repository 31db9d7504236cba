"""Noise beside obstacles, where codecs make larger errors than elsewhere.

At the blurred edges of a rod, the errors of H.264 and MJPG are larger than expected from a pixel's
brightness, and they run along the edge as whiskers do. A faint whisker that comes out there must
not be continued along the rod. These errors are measured where nothing moves; where a whisker
moves, the codec follows it and errs less. So the noise is the geometric mean of both.
"""

import cv2
import numpy as np

from pipeline.scene.background import Background
from pipeline.scene.illumination import frame_gains

BANDS_PX = (2.0, 4.0, 6.0, 8.0, 12.0, 20.0)  # distances from obstacles, looked at apart
FEWEST_FRAMES = 8
FEWEST_PIXELS = 40
ORDINARY = 1.3  # ratio of variances that chance and the noise model's errors may bring
MEDIAN_OF_SQUARES = 0.455  # of a unit normal variable: whiskers that pass do not count


def noise_excess(background: Background, frames, obstacles, face) -> np.ndarray | None:
    """Return the ratio of the variance beside obstacles to that of the noise model.

    Parameters
    ----------
    background : of these frames, with its noise model
    frames : uint8 (k, height, width)
    obstacles, face : bool (height, width)

    Returns
    -------
    float32 (height, width), a ratio, 1 far from obstacles and where nothing is unusual; None where
    it would be 1 everywhere, or there are too few frames.
    """
    if len(frames) < FEWEST_FRAMES or not obstacles.any():
        return None
    clear = ~(obstacles | face)
    distance = cv2.distanceTransform((~obstacles).astype(np.uint8), cv2.DIST_L2, 5)
    near = clear & (distance <= BANDS_PX[-1])
    known = background.image[near]
    variance = background.noise_floor + background.noise_gain * np.maximum(known, 0)
    gains = frame_gains(frames)[:, None]
    squares = np.median((frames[:, near] / gains - known) ** 2, axis=0)
    ratio = squares / (MEDIAN_OF_SQUARES * np.maximum(variance, 0.25))
    excess = _by_distance(ratio, distance[near])
    if excess.max() <= ORDINARY:
        return None
    middles = np.convolve([0.0, *BANDS_PX], [0.5, 0.5], "valid")
    out = np.interp(distance, [*middles, BANDS_PX[-1]], [*excess, 1.0]).astype(np.float32)
    return np.where(out > ORDINARY, np.sqrt(out), np.float32(1.0))


def _by_distance(ratio, distance):
    """Median ratio in each band of distance, at least 1, float (bands,)."""
    band = np.searchsorted(BANDS_PX, distance)
    return np.array(
        [
            max(np.median(ratio[band == k]), 1.0) if (band == k).sum() >= FEWEST_PIXELS else 1.0
            for k in range(len(BANDS_PX))
        ]
    )
