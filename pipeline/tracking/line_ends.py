"""Whether a line ends at the tip of its whisker: not at the border, nor where it is hidden."""

import cv2
import numpy as np

from pipeline.detection.image_model import ImageModel
from pipeline.scene.epochs import as_epochs
from pipeline.session.parameters import DetectionParams

BORDER_PX = 12  # a line that ends nearer to the border may go on beyond it


def tips_seen(scene, params: DetectionParams) -> np.ndarray:
    """Pixels where a line's end is the whisker's tip, bool (height, width): nothing near hides it.

    scene : StaticScene, or the video's epochs; what is hidden in one of them counts
    """
    scenes = [epoch.scene for epoch in as_epochs(scene) if epoch.scene]
    seen = np.all([ImageModel.from_scene(each, params).weight > 0 for each in scenes], axis=0)
    framed = cv2.copyMakeBorder(seen.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    return cv2.distanceTransform(framed, cv2.DIST_L2, 5)[1:-1, 1:-1] > BORDER_PX


def whole(x_px, y_px, tips_seen) -> np.ndarray:
    """Whether lines that end at these places show their whiskers to the tip.

    tips_seen : what the function of that name returns; None: everywhere
    """
    if tips_seen is None:
        return np.ones(np.shape(x_px), bool)
    x, y = (np.rint(each).astype(int) for each in (x_px, y_px))
    height, width = tips_seen.shape
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return inside & tips_seen[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
