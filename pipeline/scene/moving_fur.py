"""Where the fur of the face moves: the skin, as it whisks, carries it out over the background.

Its edge and its hairs are as thin and dark as whiskers. But beside them it is dark, too, over a
breadth that no whisker has: together with the face, however little it has moved out.
"""

import numpy as np

from pipeline.scene.illumination import frame_gains
from pipeline.scene.masks import opened
from pipeline.session.parameters import SceneParams
from pipeline.session.quantities import pixels_in

MOST_FRAMES = 24  # that are looked at
ROOT_PX = 1.0  # a whisker and the face are broad together at its root, twice this far out


def moving_fur(background, frames, masked, pixels_per_mm, params: SceneParams) -> np.ndarray:
    """Return the pixels that something broader than whiskers darkens in some of the frames.

    Parameters
    ----------
    background : (height, width), the light without whiskers [grey]
    frames : uint8 (k, height, width)
    masked : bool (height, width), what is dark in all frames: it is left out
    pixels_per_mm : scale

    Returns
    -------
    bool (height, width)
    """
    few = frames[:: -(-len(frames) // MOST_FRAMES)]
    radius = 0.5 * pixels_in(params.fur_breadth_mm, 1e3 * pixels_per_mm)
    seldom = np.zeros(masked.shape)
    for frame, gain in zip(few, frame_gains(few), strict=True):
        light = (1 - params.fur_darkens) * gain * background
        seldom += opened((frame < light) | masked, radius) & ~masked
    return opened(seldom >= max(params.fur_moves_share * len(few), 1), ROOT_PX)
