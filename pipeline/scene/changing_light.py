"""Light that changes in time, and gradually across the picture, as under a moving shadow.

The picture is divided into cells, each compared with its usual light. Light and shadows change
gradually: where neighbouring cells differ, or most of the light is gone, an object has moved.
"""

import cv2
import numpy as np

from pipeline.scene.illumination import spread

CELLS = 40  # across the picture
LEAST_CELL_PX = 6  # in which whiskers and noise average out
EVERY = 3  # pixel, either way, is enough to know a cell's light
LIT = 0.3  # of the brightest cells: darker ones are things
EDGE = 0.05  # of the light, from the median of the cells around: more is the edge of something
DIMMED = 0.4  # of the light: with less, some thing is before it
SMOOTH = 1.5  # cells (SD)
LEAST_CHANGE = 0.03  # of the light, root mean square: up to 0.02 where it is steady
LEFT = 0.5  # of all changes, after light is taken out: 0.04 to 0.25 where they are of light
FEWEST_FRAMES = 3  # to know what is usual

_SQUARE = np.ones((3, 3), np.uint8)


class UsualLight:
    """The usual light of some frames; other frames are corrected to it.

    Parameters
    ----------
    frames : uint8 (k, height, width)
    used : bool (height, width), pixels that are looked at; None: all
    """

    def __init__(self, frames: np.ndarray, used: np.ndarray | None = None):
        height, width = frames.shape[1:]
        side = max(np.sqrt(height * width) / CELLS, LEAST_CELL_PX)
        self._size = max(round(width / side), 2), max(round(height / side), 2)
        cells = np.median([self._cells(frame) for frame in frames], axis=0)
        lit = cells > LIT * np.percentile(cells, 95)
        if used is not None:
            lit &= self._cells(used.astype(np.float32)) == 1
        self._usual, self.lit = np.maximum(cells, 1), lit

    def evened(self, frame: np.ndarray) -> np.ndarray:
        """The frame in the usual light, except for its overall brightness, uint8."""
        share = self.carried(*self.seen(frame))
        more = cv2.resize(1 / share, frame.shape[::-1], interpolation=cv2.INTER_LINEAR)
        return cv2.multiply(frame, more, dtype=cv2.CV_8U)

    def carried(self, now: np.ndarray, known: np.ndarray) -> np.ndarray:
        """The light over the usual one as in `seen`, carried on to all cells, float32 per cell."""
        if not known.any():
            return np.ones_like(now)
        first = spread(now, known, SMOOTH)
        smoothed_away = spread(now / first, known, SMOOTH)
        return first * smoothed_away

    def seen(self, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A frame's cells over the usual ones, float32, and in which that is light, bool."""
        now = self._cells(frame) / self._usual
        if not self.lit.any():
            return now, self.lit
        now /= max(np.median(now[self.lit]), 1e-3)
        now = np.where(self.lit, now, spread(now, self.lit, SMOOTH))
        even = np.abs(now - cv2.medianBlur(now, 5)) < EDGE
        known = self.lit & even & (now > DIMMED) & (now < 1 / DIMMED)
        return now, cv2.morphologyEx(known.astype(np.uint8), cv2.MORPH_OPEN, _SQUARE) > 0

    def _cells(self, image):
        few = np.ascontiguousarray(image[EVERY // 2 :: EVERY, EVERY // 2 :: EVERY])
        return cv2.resize(few, self._size, interpolation=cv2.INTER_AREA).astype(np.float32)


def usual_light(frames: np.ndarray, used: np.ndarray | None = None) -> UsualLight | None:
    """The usual light of a video in which light changes slowly across the picture; else None.

    frames : uint8 (k, height, width), some from the whole video
    used : bool (height, width), pixels that are looked at; None: all
    """
    usual = UsualLight(frames, used)
    if len(frames) < FEWEST_FRAMES or not usual.lit.any():
        return None
    now, known = (np.array(each) for each in zip(*map(usual.seen, frames), strict=True))
    if _change(now, known) < LEAST_CHANGE:
        return None
    shares = np.array([usual.carried(*each) for each in zip(now, known, strict=True)])
    everywhere = np.broadcast_to(usual.lit, now.shape)
    explained = _change(now / shares, everywhere) < LEFT * _change(now, everywhere)
    return usual if explained else None


def _change(cells, where) -> float:
    """Root mean square of how much cells (k, rows, columns) differ from what is usual there."""
    change = (cells - np.median(cells, axis=0))[where]
    return float(np.sqrt(np.mean(change**2))) if change.size else 0.0
