"""Whiskers that hardly move leave a shade in the background, which distorts later traces.

Where a whisker lies on the same pixels in most sample frames, as in a resting mouse, the
background behind it is never seen; it is filled in from beside the whisker. The first millimetre
of a moving whisker is left as it is: there it comes out of fur, which belongs to the background.
"""

from dataclasses import replace

import cv2
import numpy as np

from pipeline.detection.image_model import signed_distance
from pipeline.detection.static_scene import StaticScene
from pipeline.scene.illumination import fill
from pipeline.session.parameters import DEFAULTS

RESTS, MOSTLY = 0.8, 0.7  # of the sample frames: to call a whisker resting, and to fill in
CORE_PX, HALF_WIDTH_PX = 3.0, 4.0  # half-widths of a whisker: the dark part, and all of it
FEWEST_SAMPLES = 4


def behind_whiskers(epochs, templates, pixels_per_mm, params=DEFAULTS.tracking):
    """The epochs with backgrounds in which no resting whisker is left; `params` of the room."""
    scenes = {id(e.scene): e.scene for e in epochs if e.scene is not None}
    cleared = {
        key: without_resting_whiskers(scene, templates, pixels_per_mm, params)
        for key, scene in scenes.items()
    }
    return tuple(replace(e, scene=cleared.get(id(e.scene))) for e in epochs)


def without_resting_whiskers(
    scene: StaticScene, templates, pixels_per_mm, params=DEFAULTS.tracking
) -> StaticScene:
    """Return the scene with the background filled in where it is mostly behind resting whiskers.

    Parameters
    ----------
    scene : StaticScene
    templates : `registry.WhiskerTemplate`s, with the lines of the sample frames
    pixels_per_mm : scale
    params : the room's parameters
    """
    hidden = np.zeros(scene.background.shape, bool)
    covered = scene.face_mask | scene.obstacle_mask
    outside = signed_distance(scene.face_mask) / pixels_per_mm
    for template in templates:
        if len(template.samples) >= FEWEST_SAMPLES:
            still = _share_covered(template.samples, hidden.shape, CORE_PX) >= RESTS
            if (still & ~covered & (outside > params.resting_mm)).any():
                hidden |= _share_covered(template.samples, hidden.shape, HALF_WIDTH_PX) >= MOSTLY
    hidden &= ~covered & (outside > params.resting_fur_mm)
    if not hidden.any():
        return scene
    filled = fill(scene.background, hidden | covered)
    return replace(scene, background=np.where(hidden, filled, scene.background))


def _share_covered(lines, shape, half_width_px):
    """Part of the lines that cover each pixel, float (height, width)."""
    count = np.zeros(shape, np.float32)
    for line in lines:
        drawn = np.zeros(shape, np.uint8)
        points = np.round(16 * line.points).astype(np.int32)
        cv2.polylines(drawn, [points], False, 1, int(2 * half_width_px + 1), shift=4)
        count += drawn
    return count / len(lines)
