"""Frames of rendered trials, drawn once for all videos that show them."""

from functools import cache

import numpy as np

from synthetic.presets import make_trial
from synthetic.render import Renderer


@cache
def rendered_frames(preset, count) -> np.ndarray:
    """The first frames of a trial of a preset, uint8 (count, height, width), read only."""
    trial = make_trial(preset, 3, 0)
    renderer = Renderer(trial.scene, trial.motion)
    images = np.array([renderer.frame(i) for i in range(count)])
    images.setflags(write=False)
    return images
