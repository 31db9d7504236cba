"""A frame together with what lines in it are fitted with."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.detection.image_model import ImageModel, Picture
from pipeline.detection.line import Workspace
from pipeline.detection.tracing_options import TracingOptions


@dataclass(frozen=True)
class Frame:
    """One frame in which lines are looked for and fitted.

    Attributes
    ----------
    image : uint8 (height, width)
    model : `ImageModel` of the static scene; known lines may be held in its background
    gain : brightness of the frame over that of the background
    options : lengths in pixels, and parameters
    workspace : room for the fit of a line
    """

    image: np.ndarray
    model: ImageModel
    gain: float
    options: TracingOptions
    workspace: Workspace

    @cached_property
    def picture(self) -> Picture:
        """The frame for compiled code."""
        return self.model.picture(self.image, self.gain)
