"""Whether whiskers are dark on a light ground, or bright on a dark one."""

import cv2
import numpy as np

from pipeline.detection import ridges
from pipeline.detection.curves import length
from pipeline.numerics.robust import robust_sd
from pipeline.scene.scale import working_scale

THICKEST_MM = 0.4  # thicker lines are no whiskers
EVERY = 4  # pixel, to see what is ground
CLEARLY = 1.5  # times as much evidence is needed for bright lines
SHORTEST = 0.1  # of the picture's size: shorter lines may be gleams
MOVED_SD, MOVED_GREY = 5.0, 2.0  # by more than so many SD and grey levels, a pixel has changed
FEWEST_FRAMES = 3  # with fewer, everything may be a whisker


def whiskers_are_bright(frames: np.ndarray, pixels_per_mm: float) -> bool:
    """Whether the long thin lines that move are brighter than what is beside them.

    Where none moves, all of them count.

    Parameters
    ----------
    frames : uint8 (k, height, width), some from the whole video, without margins
    pixels_per_mm : scale of the image
    """
    size = 2 * round(0.5 * THICKEST_MM * working_scale(frames.shape[1:], pixels_per_mm)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    few = np.median(frames[:, 1::EVERY, 1::EVERY], axis=0)
    if few.mean() <= np.median(few):
        return False  # most of the picture is ground, and it is light: things are darker
    usual = np.median(frames, axis=0).astype(np.float32)
    smooth = [cv2.GaussianBlur(frame, (0, 0), 1.0) for frame in frames]
    hats = [[cv2.morphologyEx(each, kind, disc) for kind in _HATS] for each in smooth]
    inside = np.zeros(usual.shape, bool)  # what lies along the border may be the camera's doing
    inside[size:-size, size:-size] = True
    if len(frames) >= FEWEST_FRAMES:
        dark, bright = _lengths(hats, [inside & _moved(each, usual) for each in smooth])
        if dark or bright:
            return bright > CLEARLY * dark
    dark, bright = _lengths(hats, [inside] * len(hats))
    return bright > CLEARLY * dark


_HATS = (cv2.MORPH_BLACKHAT, cv2.MORPH_TOPHAT)


def _moved(frame, usual):
    """Pixels that differ from the usual frame by more than noise, bool (height, width)."""
    change = np.abs(frame - usual)
    sd = robust_sd(change[::3, ::3], about=0.0)
    return change > MOVED_SD * sd + MOVED_GREY


def _lengths(hats, masks) -> tuple[float, float]:
    """Length of the long dark and bright lines in the masked parts of some frames [px]."""
    shortest = SHORTEST * np.sqrt(masks[0].size)
    kinds = zip(*hats, strict=True)
    return tuple(
        sum(
            _line_length(np.where(where, hat, 0), shortest)
            for hat, where in zip(kind, masks, strict=True)
        )
        for kind in kinds
    )


def _line_length(hat, shortest_px) -> float:
    """Length of the long lines in a picture of thin things [px]."""
    noise = np.full(hat.shape, max(float(hat.mean()), 1.0) / 255, np.float32)
    curves = ridges.curves_of(hat.astype(np.float32) / 255, noise).each()
    return float(sum(each for each in map(length, curves) if each > shortest_px))
