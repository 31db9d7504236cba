"""When large things move: the video is cut into periods in which only whiskers move.

A pole on a motor comes in, stays and leaves; a paw reaches in. Frames are compared in cells of
`cell_mm`: whiskers are too thin to darken a block of 2 × 2 cells, all larger things do.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from pipeline.session.parameters import SceneParams

LEAST_CELL_PX = 4
LEAST_DISC_PX = 5  # broader than a whisker's picture
TYPICAL = 9  # frames whose median is what a state looks like
FEWEST_SAMPLES = 3  # one after the other: a state that lasts shorter is something passing by
MOST_KEPT = 48  # frames of one state
MOST_STATES = 24  # a video with more has none that lasts
MOST_CHANGES = 0.25  # per sample; a face that never rests would cut a video to pieces


@dataclass(frozen=True)
class Period:
    """Frames [start, stop) of one state of the scene; `state` is None while it changes.

    `stop` is None for the last one: it ends with the video.
    """

    start: int
    stop: int | None
    state: int | None


class Cells:
    """Frames reduced to cells [grey], with flicker taken out, and their comparison."""

    def __init__(self, shape, pixels_per_mm: float, params: SceneParams, part=None):
        self.part = part
        side = max(params.cell_mm * pixels_per_mm, LEAST_CELL_PX)
        self.change = params.change
        self.size = (max(round(shape[1] / side), 2), max(round(shape[0] / side), 2))
        self.light = None

    def of(self, frame: np.ndarray) -> np.ndarray:
        """Return the cells of a frame, float32, brought to the first frame's brightness."""
        frame = frame if self.part is None else self.part.shown(frame)
        cells = cv2.resize(frame, self.size, interpolation=cv2.INTER_AREA).astype(np.float32)
        level = max(float(np.percentile(cells[::3, ::3], 90)), 1.0)
        if self.light is None:
            self.light = level
        return cells * (self.light / level)

    def alike(self, a: np.ndarray, b: np.ndarray) -> bool:
        """Whether no large thing differs between two frames' cells."""
        limit = self.change * self.light
        return not (_blocks(a - b > limit) or _blocks(b - a > limit))


def _blocks(changed):
    """Whether any 2 × 2 block has changed; one sign at a time, as a whisker that moves by
    a cell darkens one row and clears the next.
    """
    return bool((changed[1:, 1:] & changed[1:, :-1] & changed[:-1, 1:] & changed[:-1, :-1]).any())


class Survey:
    """Sampled frames sorted into states as they come.

    Frames belong to one state if no large thing differs, wherever they are in the video. Of each
    state only some full frames are kept, evenly spread, so that memory does not grow with the
    length of the video. Of a `PicturePart`, only what is in it counts.
    """

    def __init__(self, shape, pixels_per_mm: float, params: SceneParams, part=None):
        self.part = part
        self.compare = Cells(shape, pixels_per_mm, params, part)
        size = max(2 * round(0.5 * params.cell_mm * pixels_per_mm) + 1, LEAST_DISC_PX)
        self._disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        self.indices, self.cells = [], []
        self._states, self._references, self._kept = [], [], []

    def add(self, index: int, frame: np.ndarray) -> None:
        """Take the next sampled frame, uint8 (height, width), with its number in the video."""
        frame = frame if self.part is None else self.part.shown(frame)
        cells = self.compare.of(frame)
        alike = (s for s, r in enumerate(self._references) if self.compare.alike(cells, r))
        state = next(alike, len(self._references))
        if state == len(self._references) < MOST_STATES:
            self._references.append(cells)
            self._kept.append(_Kept())
        state = min(state, MOST_STATES - 1)  # so many states are none; see `settled`
        self._kept[state].add((index, frame))
        self._states.append(state)
        self.indices.append(index)
        self.cells.append(cells.astype(np.float16))

    def settled(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the state of each sample, and frames of each state.

        Returns
        -------
        states : int (k,), numbered from 0; −1 while things move
        frames : for each state, uint8 (n, height, width)
        """
        states = self._most_similar()
        of_sample = dict(zip(self.indices, states, strict=True))
        items = [item for kept in self._kept for item in kept.items]
        held = np.bincount([of_sample[i] for i, _ in items], minlength=len(self._references))
        longest = np.where(held, _longest_runs(states, len(self._references)), 0)
        kept = np.flatnonzero(longest >= min(FEWEST_SAMPLES, longest.max()))
        number = np.full(len(longest), -1)
        number[kept] = np.arange(len(kept))
        states = number[states]
        changes = np.count_nonzero(np.diff(states[states >= 0]))
        if np.mean(states < 0) > 0.5 or changes > MOST_CHANGES * len(states):
            # nothing ever rests: one scene is the best there is
            return np.zeros(len(states), int), [_stacked(items)]
        of_state = [[item for item in items if of_sample[item[0]] == k] for k in kept]
        if np.any(states != states[0]):
            of_state = [self._at_rest(some, states) for some in of_state]
        return states, [_stacked(some) for some in of_state]

    def _at_rest(self, items, states) -> list:
        """Return the items of one state with everything in place; the others get −1 in `states`.

        A thing that has nearly come to rest may differ by less than the cells resolve.
        """
        frames = [frame for _, frame in items]
        typical = _typical(frames).astype(np.uint8)
        limit = self.compare.change * self.compare.light
        resting, moving = [], []
        for index, frame in items:
            moved = (cv2.absdiff(frame, typical) > limit).astype(np.uint8)
            moves = cv2.morphologyEx(moved, cv2.MORPH_OPEN, self._disc).any()
            (moving if moves else resting).append((index, frame))
        if len(resting) <= len(moving):
            return items
        states[np.isin(self.indices, [index for index, _ in moving])] = -1
        return resting

    def _most_similar(self) -> np.ndarray:
        """Return the state of each sample, int (k,): of those possible, the most similar.

        In the first frame of a state, a thing may not quite have come to rest. Compared with that
        frame alone, later ones could be assigned to the wrong state. So each state is represented
        by the median of its frames, and states that look alike are joined.
        """
        states = np.array(self._states)
        looks = {}
        for state in range(len(self._references)):
            own = [self.cells[k] for k in np.flatnonzero(states == state)]
            look = _typical(own).astype(np.float32)
            if not any(self.compare.alike(look, known) for known in looks.values()):
                looks[state] = look
        for k, cells in enumerate(self.cells):
            alike = [s for s, look in looks.items() if self.compare.alike(cells, look)]
            if alike:
                apart = [np.abs(looks[s] - cells).mean() for s in alike]
                states[k] = alike[int(np.argmin(apart))]
        return states

    def sample(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Return up to `n` of the full frames kept, evenly chosen, whatever their state.

        Returns
        -------
        indices : int64 (k,), ascending
        frames : uint8 (k, height, width)
        """
        items = sorted((i for kept in self._kept for i in kept.items), key=lambda item: item[0])
        chosen = np.unique(np.linspace(0, len(items) - 1, n).round().astype(int))
        indices, frames = zip(*(items[k] for k in chosen), strict=True)
        return np.array(indices, np.int64), np.stack(frames)


class _Kept:
    """Every k-th of the (index, frame) added, k doubling whenever there are too many."""

    def __init__(self):
        self.items, self._stride, self._count = [], 1, 0

    def add(self, item):
        """Keep an (index, frame) if it is its turn."""
        if self._count % self._stride == 0:
            self.items.append(item)
            if len(self.items) > MOST_KEPT:
                self.items = self.items[::2]
                self._stride *= 2
        self._count += 1


def _stacked(items):
    """The frames of (index, frame), at most MOST_KEPT of them, uint8 (n, height, width)."""
    return np.stack([frame for _, frame in items[:: -(-len(items) // MOST_KEPT)]])


def _typical(frames):
    """Return the median of the frames, of at most TYPICAL of them."""
    return np.median(frames[:: 1 + len(frames) // TYPICAL], axis=0)


def _longest_runs(states, n):
    """Longest run of consecutive samples of each of `n` states, int (n,)."""
    ends = np.flatnonzero(np.diff(states, append=-1))
    longest = np.zeros(n, int)
    np.maximum.at(longest, states[ends], np.diff(ends, prepend=-1))
    return longest


def periods(video, survey: Survey, states, in_place, settled_frames: int) -> list[Period]:
    """Cut the video where its state changes, to the frame, by reading between two samples.

    Parameters
    ----------
    video : pipeline.video.open.Video
    survey : of its samples
    states : their states, as `survey.settled` gives them
    in_place : for each state, a function of a frame that checks more finely than the cells do
        whether all is where it belongs in that state (the pole)
    settled_frames : a state counts from the frame on after which it lasts at least so long

    There is no cut where something passes by and leaves the state as it was.
    """
    still = np.flatnonzero(states >= 0)
    out, start = [], 0
    for i, j in pairwise(still):
        if states[i] == states[j]:
            continue
        checks = [in_place[states[k]] for k in (i, j)]
        end, begin = _change(video, survey, (i, j), checks, settled_frames)
        out.append(Period(start, end, int(states[i])))
        if begin > end:
            out.append(Period(end, begin, None))
        start = begin
    return [*out, Period(start, None, int(states[still[-1]]))]


def _change(video, survey, samples, in_place, settled_frames):
    """Frames [end, begin) between two samples at rest in which the scene is like neither."""
    first, last = (survey.indices[k] for k in samples)
    cells = [survey.cells[k].astype(np.float32) for k in samples]
    end, begin = first + 1, None
    for index, frame in enumerate(video.frames(first, last + 1), first):
        present = survey.compare.of(frame)
        old, new = (
            survey.compare.alike(present, known) and check(frame)
            for known, check in zip(cells, in_place, strict=True)
        )
        if old and begin is None:
            end = index + 1
        if not new:
            begin = None
        elif begin is None and not old:
            begin = index
        if begin is not None and index - begin >= settled_frames:
            break
    return end, last if begin is None else begin
