"""Where objects in focus meet: a whisker and the pole, two whiskers.

There the product of what they let pass is formed on a finer grid before it is blurred, as a lens
does it.
"""

import numpy as np
from numba import njit

from synthetic.strips import Strip, absorb, blank, cover_disc, cover_strip, step_table

TILE = 16  # px, tiles in which meeting objects are composed
_SUBPIXELS = 8
_FINE_BLUR = 0.05  # share of the blur before objects are multiplied: touching edges stay apart
POLE_TRANSMISSION = 0.01


class FinePatch:
    """Composes objects on a grid of sub-pixels over one tile, then blurs to pixels."""

    def __init__(self, blur):
        self.blur = blur
        rest = np.sqrt(1 - _FINE_BLUR**2) * blur * _SUBPIXELS
        self.margin = int(np.ceil(4 * rest / _SUBPIXELS)) + 1
        self.size = (TILE + 2 * self.margin) * _SUBPIXELS
        self.steps = step_table(_FINE_BLUR * blur * _SUBPIXELS)
        self.filter = _to_pixels(self.size, self.margin, rest)
        self.cover, self.touched = blank(self.size, self.size)
        self.clear = np.ones((self.size, self.size), np.float32)
        self.disc, self.tiles = None, {}

    def transmission(self, left, top, strips, opacities, disc):
        """Light that passes all objects together, float32 (tile, tile)."""
        through = self._behind_disc(left, top, disc).copy()
        for strip, opacity in zip(strips, opacities, strict=True):
            fine = self._to_fine(strip, left, top)
            if fine is None:
                continue
            count = cover_strip(self.cover, self.touched, fine, self.steps)
            absorb(through, self.cover, self.touched, count, opacity)
        return self.filter @ through @ self.filter.T

    def _behind_disc(self, left, top, disc):
        """Light that passes the disc alone, kept while it stands still."""
        if self.disc != disc:
            self.disc, self.tiles = disc, {}
        if disc is None:
            return self.clear
        if (left, top) not in self.tiles:
            cover = np.zeros_like(self.clear)
            x, y = self._place(disc[0], left), self._place(disc[1], top)
            cover_disc(cover, x, y, disc[2] * _SUBPIXELS, self.steps)
            passes = 1 - (1 - POLE_TRANSMISSION) * cover
            self.tiles[left, top] = passes if cover.any() else self.clear
        return self.tiles[left, top]

    def _place(self, x, start):
        return (x - (start - self.margin) + 0.5) * _SUBPIXELS - 0.5

    def _to_fine(self, strip, left, top):
        """Return the nodes of a strip near the tile, in sub-pixels; None where there are none."""
        x, y, angle, curvature, radius, smear = strip
        first, last = _part_near(x, y, left, top, self.margin + 4)
        if last < 0:
            return None
        part = slice(max(first - 1, 0), last + 2)
        return Strip(
            self._place(x[part], left),
            self._place(y[part], top),
            angle[part],
            curvature[part] / _SUBPIXELS,
            radius[part] * _SUBPIXELS,
            smear[part] * _SUBPIXELS,
        )


@njit(cache=True)
def _part_near(x, y, left, top, reach):
    """First and last of the points that are within `reach` of a tile; −1, −1 without one."""
    first = last = -1
    for k in range(len(x)):
        if left - reach < x[k] < left + TILE + reach and top - reach < y[k] < top + TILE + reach:
            first = k if first < 0 else first
            last = k
    return first, last


def _to_pixels(size, margin, blur):
    """Matrix (tile, size) that blurs sub-pixels (SD `blur` of them) and averages to pixels."""
    centre = (np.arange(TILE * _SUBPIXELS) + margin * _SUBPIXELS)[:, None]
    kernel = np.exp(-0.5 * ((np.arange(size) - centre) / blur) ** 2)
    kernel /= kernel.sum(1, keepdims=True)
    return kernel.reshape(TILE, _SUBPIXELS, size).mean(1).astype(np.float32)


def meeting_tiles(shape, strips, disc, reach):
    """(top, left) of the tiles in which objects in focus come within 2 `reach` of each other."""
    lines = [(x[::2], y[::2], 0.0) for x, y, *_ in strips]
    if disc is not None:
        lines.append((np.array([disc[0]]), np.array([disc[1]]), disc[2]))
    meeting = np.zeros((-(-shape[0] // TILE), -(-shape[1] // TILE)), np.bool_)
    for k, (x, y, _) in enumerate(lines[: len(strips)]):
        for x2, y2, radius in lines[k + 1 :]:
            _mark_meeting(meeting, x, y, x2, y2, radius, reach)
    return np.argwhere(meeting) * TILE


@njit(cache=True)
def _mark_meeting(meeting, x, y, x2, y2, radius, reach):
    """Mark tiles near those points of a line where it is near another of half-width `radius`."""
    rows, columns = meeting.shape
    far = (radius + 2 * reach) ** 2
    for k in range(len(x)):
        near = False
        for m in range(len(x2)):
            if (x[k] - x2[m]) ** 2 + (y[k] - y2[m]) ** 2 < far:
                near = True
                break
        if not near:
            continue
        first_row = max(int(np.floor((y[k] - reach) / TILE)), 0)
        last_row = min(int(np.floor((y[k] + reach) / TILE)), rows - 1)
        first = max(int(np.floor((x[k] - reach) / TILE)), 0)
        last = min(int(np.floor((x[k] + reach) / TILE)), columns - 1)
        for j in range(first_row, last_row + 1):
            for i in range(first, last + 1):
                meeting[j, i] = True
