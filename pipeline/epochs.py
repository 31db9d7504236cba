"""When large things move: a video cut into stretches in which all but the whiskers is still.

A pole on a motor comes in, stays and leaves; a paw reaches in. Frames are compared in cells of
CELL_MM: whiskers are too thin to darken a 2 × 2 block of them, everything else is not.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

CELL_MM = 0.2
LEAST_CELL_PX = 4
CHANGE = 0.3  # of the light: a cell that differs by more holds something else
FEWEST_SAMPLES = 3  # one after the other: a state that lasts shorter is something passing by
MOST_CHANGES = 0.25  # per sample; a face that never rests would cut a video to pieces


@dataclass(frozen=True)
class Stretch:
    """Frames [start, stop) of one state of the scene; `state` is None while it changes.

    `stop` is None for the last stretch: it ends with the video.
    """

    start: int
    stop: int | None
    state: int | None


class Cells:
    """Frames reduced to cells [grey], with flicker taken out, and their comparison."""

    def __init__(self, shape, pixels_per_mm: float):
        side = max(CELL_MM * pixels_per_mm, LEAST_CELL_PX)
        self.size = (max(round(shape[1] / side), 2), max(round(shape[0] / side), 2))
        self.light = None

    def of(self, frame: np.ndarray) -> np.ndarray:
        """Return the cells of a frame, float32, brought to the first frame's brightness."""
        cells = cv2.resize(frame, self.size, interpolation=cv2.INTER_AREA).astype(np.float32)
        level = max(float(np.percentile(cells[::3, ::3], 90)), 1.0)
        if self.light is None:
            self.light = level
        return cells * (self.light / level)

    def alike(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Tell whether no large thing differs between two frames' cells."""
        limit = CHANGE * self.light
        return not (_blocks(a - b > limit) or _blocks(b - a > limit))


def _blocks(changed):
    """Tell whether any 2 × 2 block has changed; one sign at a time, as a whisker that moves by
    a cell darkens one row and clears the next.
    """
    return bool((changed[1:, 1:] & changed[1:, :-1] & changed[:-1, 1:] & changed[:-1, :-1]).any())


def states_of(cells: list[np.ndarray], compare: Cells) -> np.ndarray:
    """Return the state of each sampled frame, int (k,), numbered from 0; −1 while things move.

    Frames belong to one state if no large thing differs, wherever they are in the video.
    """
    references, states = [], np.empty(len(cells), int)
    for i, cell in enumerate(cells):
        near = (s for s, reference in enumerate(references) if compare.alike(cell, reference))
        states[i] = next(near, len(references))
        if states[i] == len(references):
            references.append(cell)
    longest = _longest_runs(states)
    kept = np.flatnonzero(longest >= min(FEWEST_SAMPLES, longest.max()))
    number = np.full(len(longest), -1)
    number[kept] = np.arange(len(kept))
    states = number[states]
    changes = np.count_nonzero(np.diff(states[states >= 0]))
    if np.mean(states < 0) > 0.5 or changes > MOST_CHANGES * len(states):
        return np.zeros(len(cells), int)  # nothing ever rests: one scene is the best there is
    return states


def _longest_runs(states):
    """Longest run of consecutive samples of every state, int (states,)."""
    ends = np.flatnonzero(np.diff(states, append=-1))
    longest = np.zeros(states.max() + 1, int)
    np.maximum.at(longest, states[ends], np.diff(ends, prepend=-1))
    return longest


def stretches(video, indices, cells, states, compare: Cells) -> list[Stretch]:
    """Cut the video where its state changes, to the frame, by reading between two samples.

    Parameters
    ----------
    video : pipeline.video.Video
    indices, cells, states : the sampled frames' numbers, cells and states
    compare : Cells

    Something that passes by and leaves the state as it was makes no cut.
    """
    still = np.flatnonzero(states >= 0)
    out, start = [], 0
    for i, j in pairwise(still):
        if states[i] == states[j]:
            continue
        end, begin = _change(video, indices[i], indices[j], cells[i], cells[j], compare)
        out.append(Stretch(start, end, int(states[i])))
        if begin > end:
            out.append(Stretch(end, begin, None))
        start = begin
    return [*out, Stretch(start, None, int(states[still[-1]]))]


def _change(video, first, last, before, after, compare):
    """Frames [end, begin) between two still samples that are like neither."""
    end, begin = int(first) + 1, int(last)
    old, index = True, int(first)
    for index, frame in enumerate(video.frames(int(first), int(last) + 1), int(first)):
        cell = compare.of(frame)
        old = old and compare.alike(cell, before)
        if old:
            end = index + 1
        if not compare.alike(cell, after):
            begin = index + 1
    return end, min(max(begin, end), int(last))
