"""A face at the left and an apparatus, with three whiskers that turn, in even light."""

import cv2
import numpy as np

HEIGHT, WIDTH, SCALE = 240, 320, 14.0  # px, px/mm


def turning_whiskers(n, seed=1):
    """Frames with noise, not rounded to grey levels yet: float64 (n, height, width)."""
    rng = np.random.default_rng(seed)
    frames = []
    for phase in np.linspace(0, 6, n):
        image = np.full((HEIGHT, WIDTH), 150, np.uint8)
        image[:, :60] = image[:100, 250:] = 20
        for y in (120, 160, 200):
            angle = 0.1 + 0.2 * np.sin(phase)
            tip = 60 + 120 * np.cos(angle), y + 120 * np.sin(angle)
            cv2.line(image, (56, y), tuple(map(round, tip)), 110, 1, cv2.LINE_AA)
        frames.append(cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, 1.5, image.shape))
    return np.stack(frames)


def grey(frames):
    """The frames as a camera gives them, uint8."""
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)
