"""Frames that are not what the camera saw: damaged, repeated, black, missing; in sentences."""

import re
from itertools import pairwise

import numpy as np

from pipeline.numerics.runs import runs_of_true

SHOWN = 6  # stretches of frames that a sentence names
MOST_COPIES = 5  # of each picture, by a converter; a codec changes a still one at key frames only
MOST = 0.5  # more repeated frames than this part: nothing moves, and there is no noise
MOST_GAPS = 0.05  # more gaps than this part: the times are uneven, nothing is missing
EVERY = 32  # rows, of which one is looked at first
NEAR = 16  # frames: of so many one behind the other, some have not come late
SURE = 0.6  # of a frame's time, and more, is a frame that is missing
BLACK = 20  # grey levels of 255: nothing in a black frame is brighter


class FrameFaults:
    """What is wrong with single frames of a video, found in one pass over it.

    Attributes
    ----------
    damaged : set of frame numbers, which may go beyond the last frame
    repeated, black : lists of frame numbers
    gaps : list of (frame, number of frames that are missing before it)
    coarse : whether the gaps' numbers are the least: of times that are too coarse to count
    said : the decoder's first words on damage
    """

    def __init__(self):
        self.damaged = set()
        self.repeated, self.black, self.gaps, self.coarse = [], [], [], False
        self.said = ""
        self.count = 0
        self._before = self._few = None

    def see(self, image) -> None:
        """Look at the next frame."""
        few = image[::EVERY].copy()
        before, self._before = self._before, image
        few_before, self._few = self._few, few
        if self.count in self.damaged:
            pass  # is said already
        elif is_black(image):
            self.black.append(self.count)
        elif before is not None and np.array_equal(few, few_before):
            self.repeated += [self.count] if np.array_equal(image, before) else []
        self.count += 1

    def sentences(self):
        """Yield what a person should know."""
        if self.damaged:
            said = f" (the decoder: {self.said})" if self.said else ""
            damaged = np.minimum(list(self.damaged), self.count - 1)
            yield (
                f"damaged at or near {_frames(damaged)}{said}: copy the video again; until "
                "then trust no contact there"
            )
        if self._copied():
            yield (
                f"{self.count} frames show only {self.count - len(self.repeated)} pictures: a "
                "converter has repeated them, and by the camera's frame rate all times are too "
                "long; convert the video again without changing its frame rate"
            )
        elif self.repeated and len(self.repeated) < MOST * self.count:
            repeat = "repeats" if len(self.repeated) == 1 else "repeat"
            yield f"{_frames(self.repeated)} {repeat} the one before: were frames dropped?"
        if self.black and len(self.black) < self.count:
            yield f"{_frames(self.black)} black: no whisker can be seen there"
        if self.gaps and len(self.gaps) < max(MOST_GAPS * self.count, 2):
            missing = sum(number for _, number in self.gaps)
            least = "at least " if self.coarse else ""
            yield (
                f"{least}{missing} missing by the file's own times, before "
                f"{_frames([at for at, _ in self.gaps])}: later times are too early"
            )

    def _copied(self) -> bool:
        """Whether each picture is there about as often, and more than once."""
        pictures = np.setdiff1d(np.arange(self.count), self.repeated)
        copies = np.diff(pictures)
        usual = np.median(copies) if len(copies) > 1 else 0
        return bool(2 <= usual <= MOST_COPIES and copies.max() <= usual + 1)


def is_black(image) -> bool:
    """Whether nothing can be seen in a frame, uint8 (height, width)."""
    return int(image[::EVERY].max()) < BLACK and int(image.max()) < BLACK


def missing_numbers(names) -> list[int]:
    """Numbers that a series of file names, in order, leaves out, by the last number in each.

    >>> missing_numbers(["a_01.png", "a_02.png", "a_04.png", "a_05.png"])
    [3]
    """
    found = [re.findall(r"\d+", name.rsplit(".", 1)[0]) for name in names]
    if not all(found):
        return []
    numbers = [int(each[-1]) for each in found]
    steps = [b - a for a, b in pairwise(numbers)]
    usual = int(np.median(steps)) if steps else 0
    if usual < 1 or any(step < 0 or step % usual for step in steps):
        return []
    gaps = [(a, b) for a, b in pairwise(numbers) if b - a > usual]
    if len(gaps) > max(MOST_GAPS * len(numbers), 2):
        return []  # no series
    return [number for a, b in gaps for number in range(a + usual, min(b, a + 10_000), usual)]


def renumbered(stems) -> list[int]:
    """Where the last number in a series of names begins again as at first, as of two cameras.

    >>> renumbered(["cam1_07", "cam1_08", "cam2_07", "cam2_08"])
    [2]
    """
    parts = [re.fullmatch(r"(.*?)(\d+)\D*", stem) for stem in stems]
    if not all(parts):
        return []
    series = [(k, part[1], int(part[2])) for k, part in enumerate(parts)]
    return [k for (_, a, _), (k, b, n) in pairwise(series) if a != b and n == series[0][2]]


def missing_by_times(times, resolution) -> tuple[list[tuple[int, int]], bool]:
    """By the times [s] at which frames came, (frame, number of frames that are missing before it).

    One that only came late is followed by others that came sooner one after the other, so that
    the least delay of some frames is compared with that of as many before. Where times are given
    to a `resolution` [s] near to a frame's time, or coarser, so much of a delay may be rounding:
    the numbers are the least then, which is returned, too. Few times tell nothing.

    >>> missing_by_times(np.r_[0:0.04:0.002, 0.044:0.2:0.002], 1e-6)
    ([(20, 2)], False)
    """
    times = np.asarray(times)
    if len(times) < 4 * NEAR:
        return [], False
    spans = times[NEAR:] - times[:-NEAR]
    usual = np.sort(spans)[len(spans) // 2]
    step = spans[np.abs(spans - usual) * NEAR <= SURE * usual].mean() / NEAR if usual > 0 else 0.0
    if step <= 0:
        return [], False
    coarse = bool(SURE * step < resolution)
    rounding = resolution if coarse else 0.0
    late, gaps = times - step * np.arange(len(times)), []
    for at in np.flatnonzero(np.diff(times) > (1 + SURE) * step) + 1:
        lost = late[at : at + NEAR].min() - late[max(at - NEAR, 0) : at].min()
        missing = int((lost - rounding) / step + 1 - SURE)
        if missing > 0:
            gaps.append((int(at), missing))
            late[at:] -= round(lost / step) * step if coarse else missing * step
    return gaps, coarse


def _frames(numbers) -> str:
    """Frame numbers as words: "frame 3", "frames 3–5, 9 and 12 others"."""
    runs = runs_of_true(np.bincount(list(numbers)))
    shown = ", ".join(f"{a}–{b - 1}" if b - a > 1 else f"{a}" for a, b in runs[:SHOWN])
    others = sum(b - a for a, b in runs[SHOWN:])
    more = f" and {others} others" if others else ""
    return f"frame{'s' if len(set(numbers)) > 1 else ''} {shown}{more}"
