"""A camera that shakes: the shift of each frame against one of them.

Whiskers are recognised by their motion. Under a shaking camera everything moves, and streaks on a
wall look like a row of whiskers. So the frames are shifted back first. The shift is that of the
steepest edges: by phase correlation of a small picture, then by robust least squares (Lucas &
Kanade 1981), in which things that move by themselves, such as whiskers, hardly count.
"""

import cv2
import numpy as np

FINE_PX, BROAD_PX = 1.0, 4.0  # edges are seen between these blurs: they bear no flicker
SMALLER = 4  # the small picture's reduction
LEAST_EDGES_PX = 20000  # pixels with the steepest edges
MARGIN_PX = 12  # that may have left the picture
MOST_PX = 20  # no camera shakes by more
STEPS = 6  # of the least squares
MISFIT = 2.0  # medians: what fits much worse hardly counts (Geman & McClure 1987)
TINY = 1e-3  # grey levels
SHAKES_PX = 0.5  # root mean square: less blurs nothing
BETTER = 0.7  # of the misfit is left when a shaking picture is shifted back; 0.98–1.1 of others


class Still:
    """One frame, uint8 (height, width), as the one to which all others are shifted back."""

    def __init__(self, frame: np.ndarray):
        edges = _edges(frame)
        along = ((1, 0), (0, 1))
        slopes = np.stack([cv2.Sobel(edges, cv2.CV_32F, *xy, scale=1 / 8) for xy in along])
        steep = np.hypot(*slopes)
        margin = min(MARGIN_PX, min(frame.shape) // 4)
        steep[:margin] = steep[-margin:] = steep[:, :margin] = steep[:, -margin:] = 0
        chosen = np.argsort(steep, axis=None)[-min(LEAST_EDGES_PX, steep.size // 4) :]
        self._y, self._x = (each.astype(np.float32) for each in np.divmod(chosen, frame.shape[1]))
        self._values = edges.ravel()[chosen]
        # of a shift in x, in y, and of other light
        self._effects = np.vstack([slopes.reshape(2, -1)[:, chosen], self._values])
        self._small = _smaller(edges)

    def shift(self, frame: np.ndarray) -> tuple[np.ndarray, float]:
        """Shift of a frame to the right and down, (2,) [px], and the misfit that is left.

        That is the mean misfit of the edges over the one without a shift.
        """
        edges = _edges(frame)
        first, _ = cv2.phaseCorrelate(self._small, _smaller(edges))
        shift = SMALLER * np.array(first)
        if np.hypot(*shift) > MOST_PX:
            shift = np.zeros(2)
        for _ in range(STEPS):
            misfit = self._misfit(edges, shift)
            usual = MISFIT * np.median(np.abs(misfit)) + TINY
            weighted = self._effects / (1 + (misfit / usual) ** 2) ** 2
            found = np.linalg.lstsq(weighted @ self._effects.T, weighted @ misfit, rcond=None)[0]
            shift = shift - found[:2]
        before, after = (np.abs(self._misfit(edges, each)).mean() for each in (np.zeros(2), shift))
        return shift, float(after / (before + TINY))

    def steady(self, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The frame shifted back, uint8 (height, width), and its shift, as in `shift`."""
        shift, _ = self.shift(frame)
        return _shifted(frame, -shift), shift

    def _misfit(self, edges, shift):
        x, y = self._x + np.float32(shift[0]), self._y + np.float32(shift[1])
        return cv2.remap(edges, x[None], y[None], cv2.INTER_LINEAR)[0] - self._values


def still_of(frames: np.ndarray) -> Still | None:
    """The reference frame, amid the others, if the camera shakes; None if it is at rest.

    frames : uint8 (k, height, width)
    """
    first = Still(frames[0])
    found = [first.shift(frame) for frame in frames[1:]]
    if not found:
        return None
    shifts, misfits = np.array([shift for shift, _ in found]), [misfit for _, misfit in found]
    away = np.hypot(*(shifts - np.median(shifts, axis=0)).T)
    if np.sqrt(np.mean(away**2)) < SHAKES_PX or np.median(misfits) > BETTER:
        return None
    return Still(frames[1 + np.argmin(away)])


def _edges(frame):
    grey = frame.astype(np.float32)
    return cv2.GaussianBlur(grey, (0, 0), FINE_PX) - cv2.GaussianBlur(grey, (0, 0), BROAD_PX)


def _smaller(image):
    return cv2.resize(image, None, fx=1 / SMALLER, fy=1 / SMALLER, interpolation=cv2.INTER_AREA)


def _shifted(frame, by):
    move = np.float32([[1, 0, by[0]], [0, 1, by[1]]])
    size = frame.shape[::-1]
    return cv2.warpAffine(
        frame, move, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
