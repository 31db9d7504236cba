"""Whether whiskers are dark on a light ground, or bright on a dark one."""

import cv2
import numpy as np

from pipeline.detection import ridges
from pipeline.detection.curves import length
from pipeline.scene.background import median_over_time
from pipeline.scene.scale import working_scale

THICKEST_MM = 0.4  # thicker lines are no whiskers
EVERY = 4  # pixel, to see what is ground
CLEARLY = 1.5  # times as much evidence is needed for bright lines
SHORTEST = 0.1  # of the picture's size: shorter lines may be gleams
FEWEST_FRAMES = 3  # with fewer, everything may be a whisker


def whiskers_are_bright(frames: np.ndarray, pixels_per_mm: float) -> bool:
    """Whether the long thin lines that move are brighter than what is beside them.

    A moving line is thin both in its frame and in the difference of that frame from the usual one.
    In this difference there are neither things that stand still, whatever light falls on them, nor
    gaps between lines. Where nothing moves, all lines count.

    Parameters
    ----------
    frames : uint8 (k, height, width), some from the whole video, without margins
    pixels_per_mm : scale of the image
    """
    size = 2 * round(0.5 * THICKEST_MM * working_scale(frames.shape[1:], pixels_per_mm)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    smooth = [cv2.GaussianBlur(frame, (0, 0), 1.0) for frame in frames]
    hats = [[cv2.morphologyEx(each, kind, disc) for kind in _HATS] for each in smooth]
    border = np.ones(frames.shape[1:], bool)  # what lies along it may be the camera's doing
    border[size:-size, size:-size] = False
    if len(frames) >= FEWEST_FRAMES:
        usual = cv2.GaussianBlur(median_over_time(frames).astype(np.float32), (0, 0), 1.0)
        changes = [_change(each, usual, size) for each in smooth]
        moved = [
            [np.minimum(hat, each) for hat, each in zip(pair, (-change, change), strict=True)]
            for pair, change in zip(hats, changes, strict=True)
        ]
        dark, bright = _lengths(moved, border)
        if dark or bright:
            return bright > CLEARLY * dark
    few = np.median(frames[:, 1::EVERY, 1::EVERY], axis=0)
    if few.mean() <= np.median(few):
        return False  # most of the picture is ground, and it is light: things are darker
    dark, bright = _lengths(hats, border)
    return bright > CLEARLY * dark


_HATS = (cv2.MORPH_BLACKHAT, cv2.MORPH_TOPHAT)


def _change(frame, usual, size):
    """Difference of a frame from the usual one, without what neighbours within `size` share."""
    change = frame - usual
    shared = cv2.medianBlur(np.ascontiguousarray(change[size // 2 :: size, size // 2 :: size]), 5)
    return change - cv2.resize(shared, change.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _lengths(hats, border) -> tuple[float, float]:
    """Length of the long dark and bright lines off the border in some frames [px].

    `hats`: of each frame, how much darker and how much brighter a pixel is than those beside it
    """
    shortest = SHORTEST * np.sqrt(border.size)
    kinds = zip(*hats, strict=True)
    return tuple(sum(_line_length(hat, border, shortest) for hat in kind) for kind in kinds)


def _line_length(hat, border, shortest_px) -> float:
    """Length of the long lines in a picture of thin things [px]."""
    hat = np.where(border, 0, np.maximum(hat, 0)).astype(np.float32)
    noise = np.full(hat.shape, max(float(hat.mean()), 1.0) / 255, np.float32)
    curves = ridges.curves_of(hat / 255, noise).each()
    return float(sum(each for each in map(length, curves) if each > shortest_px))
