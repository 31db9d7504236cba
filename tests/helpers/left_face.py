"""A scene with nothing but a dark face along the left edge of the picture."""

import numpy as np

from pipeline.detection.static_scene import StaticScene

DARK = 8.0  # grey level of the face


def scene_of_left_face(shape, edge, light, noise) -> StaticScene:
    """The face is left of column `edge`; light and the noise's SD in grey levels."""
    face = np.zeros(shape, bool)
    face[:, :edge] = True
    background = np.where(face, DARK, light).astype(np.float32)
    return StaticScene(background, 0.0, noise**2 + 1 / 12, face, np.zeros_like(face), None, "left")
