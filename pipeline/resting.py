"""Whiskers that hardly move leave a shade in the background, which bends what is traced there.

Where a whisker lies on the same pixels in nearly all sample frames, as its base does in a mouse
that rests, the background cannot be seen; it is filled in from beside it.
"""

from dataclasses import replace

import cv2
import numpy as np

from pipeline.background import fill
from pipeline.records import StaticScene

ALWAYS = 0.7  # of the sample frames
HALF_WIDTH_PX = 4.0  # of a whisker with its blur
FEWEST_SAMPLES = 4


def without_resting_whiskers(scene: StaticScene, roster) -> StaticScene:
    """Return the scene with the background filled in where it is always behind a whisker.

    Parameters
    ----------
    scene : StaticScene
    roster : `tracing.Slot`s, with the lines of the sample frames
    """
    hidden = np.zeros(scene.background.shape, bool)
    for slot in roster:
        if len(slot.samples) >= FEWEST_SAMPLES:
            hidden |= _share_covered(slot.samples, hidden.shape) >= ALWAYS
    hidden &= ~scene.face_mask & ~scene.obstacle_mask
    if not hidden.any():
        return scene
    filled = fill(scene.background, hidden | scene.face_mask | scene.obstacle_mask)
    return replace(scene, background=np.where(hidden, filled, scene.background))


def _share_covered(lines, shape):
    """Part of the lines that cover each pixel, float (height, width)."""
    count = np.zeros(shape, np.float32)
    for line in lines:
        drawn = np.zeros(shape, np.uint8)
        points = np.round(16 * line.points).astype(np.int32)
        cv2.polylines(drawn, [points], False, 1, int(2 * HALF_WIDTH_PX + 1), shift=4)
        count += drawn
    return count / len(lines)
