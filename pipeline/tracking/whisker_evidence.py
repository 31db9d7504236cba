"""Whether the lines of a roster are whiskers': they taper towards a free end, and they move.

A wall, a table's edge and a scratch on the floor come out of something dark, too. They stand
still, and they get no thinner towards their ends, or have none in the picture.
"""

import numpy as np

from pipeline.detection import detect
from pipeline.scene.face import THICKER, far_over_near
from pipeline.tracking.line_ends import BORDER_PX

# a whisker's far third is thinner than its near one by more than this for each clue that it lacks;
# of 48 whiskers on three recordings 46 have 0.1 to 0.7, two that a body cuts short up to 1.1
THINNER = 0.6
MOVES_PX = 1.5  # off the line where it lay before: compression shakes still things by less
MOVED_LINES = 0.1  # part of the lines
OFTEN = 0.5  # part of the frames


def whisker_like(slots, n_frames: int, shape):
    """The slots that may be whiskers, and those refused.

    Parameters
    ----------
    slots : `Slot`s, with the lines that they were seen as
    n_frames : frames in which they were looked for
    shape : of the picture, (height, width)
    """
    likely = [_may_be_whisker(slot.samples, n_frames, shape) for slot in slots]
    pairs = list(zip(slots, likely, strict=True))
    return [s for s, good in pairs if good], [s for s, good in pairs if not good]


def _end_inside(lines, shape) -> np.ndarray:
    """Whether each line's far end lies inside the picture, (height, width)."""
    ends = np.array([line.points[-1] for line in lines])
    return np.all((ends > BORDER_PX) & (ends < np.array(shape[::-1]) - 1 - BORDER_PX), axis=1)


def _may_be_whisker(lines, n_frames, shape) -> bool:
    moves = _move(lines)
    free = [line for line, inside in zip(lines, _end_inside(lines, shape), strict=True) if inside]
    if not free:
        return moves
    ratios = np.array([far_over_near(line.thickness[: line.n]) for line in free])
    if not np.isfinite(ratios).any():
        return moves
    often = len(lines) >= OFTEN * n_frames
    lacking = (not moves) + (not often)
    return bool(np.nanmedian(ratios) < THICKER * THINNER**lacking)


def _move(lines) -> bool:
    """Whether some of the lines lie mostly beside the longest one."""
    longest = max(lines, key=lambda line: line.n)
    beside = [detect.shared_fraction(line, longest, MOVES_PX) < 0.5 for line in lines]
    return bool(np.mean(beside) >= MOVED_LINES)
