"""Where no line need be fitted: along known lines, and where a fit has just led to nothing.

Nearly all ridges of a frame whose whiskers are followed lead to what is known, or to what was no
whisker a moment ago, and the fits are what takes time.
"""

import numpy as np
from numba import njit

MOSTLY = 0.5  # part of a curve that lies where nothing is to be fitted
REMEMBERED = 1  # searches after which what led to nothing is still left out


class Tried:
    """Pixels near to known lines, and to curves of which nothing came in the last searches.

    shape : height and width of a frame [px]; near_px : how far such pixels reach
    """

    def __init__(self, shape, near_px: float):
        self.shape, self.reach = shape, round(near_px)
        self.search = self.looks = 0
        self.known = np.zeros(shape, np.int32)  # the last look with a known line, per pixel
        self.until, self.pending = {}, []  # by scale: the last search without a fit, per pixel

    def look(self, lines, first: bool) -> None:
        """A frame is looked at, for the first time or once more, beside known lines."""
        self.search += first
        self.looks += 1
        for line in lines:
            _mark(self.known, line.x[: line.n], line.y[: line.n], self.reach, self.looks)
        self.pending.clear()

    def in_vain(self, scale, curve) -> bool:
        """Whether a curve (n, 2) found at a scale runs mostly where nothing is to be fitted."""
        now = self.looks, self.search
        return _share(self.known, self._until(scale), now, curve) > MOSTLY

    def note(self, scale, curve) -> None:
        """Nothing came of a curve, in this look."""
        self.pending.append((scale, curve))

    def remember(self) -> None:
        """Nothing new was found in this look: with no other neighbours it will be the same."""
        for scale, curve in self.pending:
            _mark(
                self._until(scale), curve[:, 0], curve[:, 1], self.reach, self.search + REMEMBERED
            )

    def _until(self, scale):
        return self.until.setdefault(scale, np.zeros(self.shape, np.int32))


@njit(cache=True)
def _share(known, until, now, curve):
    """Part of the points of a curve (n, 2) on pixels of this look's lines or left out as yet."""
    height, width = until.shape
    look, search = now
    count = 0
    for k in range(len(curve)):
        column, row = int(curve[k, 0] + 0.5), int(curve[k, 1] + 0.5)
        if 0 <= row < height and 0 <= column < width:
            count += known[row, column] == look or until[row, column] >= search
    return count / max(len(curve), 1)


@njit(cache=True)
def _mark(pixels, x, y, reach, number):
    """Set the pixels within `reach` of points, in rows and columns, to a number."""
    height, width = pixels.shape
    for k in range(len(x)):
        column, row = int(x[k] + 0.5), int(y[k] + 0.5)
        for i in range(max(row - reach, 0), min(row + reach + 1, height)):
            for j in range(max(column - reach, 0), min(column + reach + 1, width)):
                pixels[i, j] = number
