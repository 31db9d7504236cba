"""Frames that are in memory already, or mapped into it, as a video."""

from pathlib import Path

import cv2
import numpy as np

from pipeline.errors import VideoError
from pipeline.video.image_stacks import ImageStack, grey

NAME = Path("array of frames")


class ArrayVideo(ImageStack):
    """An array of frames (n, height, width), uint8 or uint16; with a last axis of 3, RGB."""

    def __init__(self, frames):
        shape = np.shape(frames)
        if len(shape) not in (3, 4) or 0 in shape:
            raise VideoError(
                NAME,
                f"has the shape {shape}: expected (frames, height, width), or these and 3 colours",
                0,
            )
        self._frames = frames
        super().__init__(NAME, shape[0])

    def _image(self, index):
        return grey(np.asarray(self._frames[index]), NAME, index, cv2.COLOR_RGB2GRAY)
