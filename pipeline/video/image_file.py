"""Images in files."""

import cv2
import numpy as np

from pipeline.video.decoder_log import silent_opencv


def read_image(path, flags=cv2.IMREAD_UNCHANGED) -> np.ndarray | None:
    """The image in a file, as `decoded`; None also where the file cannot be opened."""
    try:
        return decoded(np.fromfile(path, np.uint8), flags)  # imread cannot open every Unicode path
    except OSError:
        return None


def decoded(data, flags=cv2.IMREAD_UNCHANGED) -> np.ndarray | None:
    """The image, (height, width) or BGR, in the bytes of a file; None where they hold none."""
    try:
        with silent_opencv():
            return cv2.imdecode(data, flags) if len(data) else None
    except cv2.error:  # a size beyond all bounds
        return None
