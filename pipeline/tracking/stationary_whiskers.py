"""Whiskers that hardly move leave a shade in the background, which distorts later traces.

Where a whisker lies on the same pixels in most sample frames, as in a resting mouse, the
background behind it is never seen; it is filled in from beside the whisker. The first millimetre
of a moving whisker is left as it is: there it comes out of fur, which belongs to the background.

What is darker there than the whisker's shade before and behind, as a speck of dust, stays. Taken
away, it would be seen in every frame, as a part of the whisker.
"""

from dataclasses import replace

import cv2
import numpy as np
from scipy.ndimage import maximum_filter, median_filter

from pipeline.detection.image_model import signed_distance
from pipeline.detection.static_scene import StaticScene
from pipeline.scene.illumination import fill

RESTS, MOSTLY = 0.8, 0.7  # of the sample frames: to call a whisker resting, and to fill in
CORE_PX, WIDE_PX = 7, 9  # of a whisker: the dark part, and all; OpenCV draws lines 2 px wider
FEWEST_SAMPLES = 4  # frames: in fewer, a whisker may lie still by chance
LONG_PX = 61  # along a line: dust is shorter than half of it
DARKER = 1.5  # times the usual shade: something else


def behind_whiskers(epochs, templates, pixels_per_mm, params):
    """The epochs with backgrounds in which no resting whisker is left; `params` of the room."""
    scenes = {id(e.scene): e.scene for e in epochs if e.scene is not None}
    cleared = {
        key: without_resting_whiskers(scene, templates, pixels_per_mm, params)
        for key, scene in scenes.items()
    }
    return tuple(replace(e, scene=cleared.get(id(e.scene))) for e in epochs)


def without_resting_whiskers(scene: StaticScene, templates, pixels_per_mm, params) -> StaticScene:
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
    templates = [each for each in templates if len(each.samples) >= FEWEST_SAMPLES]
    for template in templates:
        still = _share_covered(template.samples, hidden.shape, CORE_PX) >= RESTS
        if (still & ~covered & (outside > params.resting_mm)).any():
            hidden |= _share_covered(template.samples, hidden.shape, WIDE_PX) >= MOSTLY
    hidden &= ~covered & (outside > params.resting_fur_mm)
    if not hidden.any():
        return scene
    shade = fill(scene.background, hidden | covered) - scene.background
    shade = np.where(hidden, shade, 0)
    most = DARKER * _usual_shade(shade, hidden, templates)
    beside = maximum_filter(covered, WIDE_PX)  # a pole's edge is filled in as well as can be
    shade = np.where(beside, shade, np.minimum(shade, most))
    return replace(scene, background=scene.background + shade)


def _usual_shade(shade, hidden, templates):
    """How dark whiskers' shades are about their lines, before and behind each place, an image."""
    usual, deepest = np.zeros_like(shade), maximum_filter(shade, WIDE_PX)
    for template in templates:
        longest = max(template.samples, key=lambda line: len(line.points))
        x, y = np.rint(longest.points).astype(int).T
        inside = (x >= 0) & (y >= 0) & (x < shade.shape[1]) & (y < shade.shape[0])
        x, y = x[inside], y[inside]
        x, y = x[hidden[y, x]], y[hidden[y, x]]
        if len(x):
            along = median_filter(deepest[y, x], LONG_PX)
            np.maximum.at(usual, (y, x), along)
    return maximum_filter(usual, 2 * WIDE_PX)


def _share_covered(lines, shape, width_px):
    """Part of the lines that cover each pixel, float (height, width)."""
    count = np.zeros(shape, np.float32)
    for line in lines:
        drawn = np.zeros(shape, np.uint8)
        points = np.round(16 * line.points).astype(np.int32)
        cv2.polylines(drawn, [points], False, 1, width_px, shift=4)
        count += drawn
    return count / len(lines)
