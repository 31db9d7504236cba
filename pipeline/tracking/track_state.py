"""The state of one tracked line, and the prediction of its line in the next frame."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from pipeline.detection.line import Line
from pipeline.tracking import row_rotation


@dataclass
class Track:
    """The state of one line: where it is, None once it is lost, and where it was before.

    `whole` : the last line of which nothing hid the tip
    `turn` : its predicted turn beyond its last motion [rad], and how far behind its base it turns
        [px]
    `number`, `age` : of the track; frames in which it was followed
    `expected` : the line in this frame as the turn of its row predicts it
    `given_up` : the line that was found last, but that no whisker has, mostly by its base
    """

    line: Line | None = None
    before: Line | None = None
    whole: Line | None = None
    turn: tuple[float, float] = (0.0, 0.0)
    number: int = 0
    age: int = 0
    expected: Line | None = None
    given_up: Line | None = None

    def take(self, line: Line | None, before: Line | None = None) -> None:
        """Continue with another line."""
        self.line, self.before, self.given_up = line, before, None

    def turned_to(self, line: Line) -> float:
        """Turn of a line since the one before [rad], NaN where there is none."""
        return np.nan if self.before is None else row_rotation.turned(line, self.before)

    def lose(self) -> None:
        """Give the line up: it is not seen in this frame."""
        self.line = None


def predicted(track: Track, with_velocity: bool) -> Line:
    """Return a copy of the line at its predicted place, moved on by its last motion."""
    line = moved_on(track.line, track.before if with_velocity else None)
    if track.turn[0]:
        row_rotation.turn_line(line, *track.turn)
    return line


def moved_on(line: Line, before: Line | None) -> Line:
    """Return a copy moved on as the line has moved since `before`, without what was measured."""
    values = np.empty(line.values.shape)
    moving = before is not None and before.n > 20
    known = before if moving else line
    _move_on(line.values, line.n, known.values, known.n if moving else 0, values)
    return Line(values, line.n, line.quality)


@njit(cache=True)
def _move_on(values, n, before, m, moved):
    """Fill `moved` with places, absorbance and half-width of a moved line; all as in `Line`.

    It moves as it has since it had the `m` nodes `before`; not at all where `m` is 0.
    """
    x, y, amplitude, sigma = values[0], values[1], values[2], values[3]
    new_x, new_y, new_amplitude, new_sigma = moved[0], moved[1], moved[2], moved[3]
    for i in range(n):  # loops: copying slices takes three times as long
        new_x[i], new_y[i] = x[i], y[i]
    for i in range(len(amplitude)):
        new_amplitude[i], new_sigma[i] = amplitude[i], sigma[i]
    if m > 0:
        advance(new_x, new_y, n, before[0], before[1], m)


@njit(cache=True)
def advance(x, y, n, before_x, before_y, m):
    """Add the motion since the frame before to the nodes, smoothed over ±20 nodes, in place."""
    half = 20
    count = min(n, m)
    sx = np.empty(count + 1)
    sy = np.empty(count + 1)
    sx[0] = 0.0
    sy[0] = 0.0
    for i in range(count):
        sx[i + 1] = sx[i] + x[i] - before_x[i]
        sy[i + 1] = sy[i] + y[i] - before_y[i]
    for i in range(n):
        k = min(i, count - 1)
        reach = min(half, k, count - 1 - k)
        width = 2 * reach + 1
        dx = (sx[k + reach + 1] - sx[k - reach]) / width
        dy = (sy[k + reach + 1] - sy[k - reach]) / width
        x[i] += dx
        y[i] += dy
