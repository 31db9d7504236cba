"""Runs of consecutive frames in which a condition holds, parts and samples of long recordings."""

from itertools import pairwise

import numpy as np


def runs_of_true(mask) -> list[tuple[int, int]]:
    """Half-open (start, stop) of every run of True in the bool `mask` (frames,)."""
    change = np.diff(np.concatenate([[False], np.asarray(mask, bool), [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def runs_around(ring) -> np.ndarray:
    """Start and length of every run of True on a bool ring (n,), in order around it; (runs, 2).

    >>> runs_around([True, False, True, True]).tolist()
    [[2, 3]]
    """
    first = int(np.argmin(ring))
    runs = np.array(runs_of_true(np.roll(ring, -first)), int).reshape(-1, 2)
    return np.column_stack([(runs[:, 0] + first) % len(ring), runs[:, 1] - runs[:, 0]])


def differences(values, frame, order) -> np.ndarray:
    """Differences of an `order` of values (rows,) where order + 1 frames follow each other.

    frame : their numbers, ascending

    Those that are NaN are left out.

    >>> differences([0, 1, 4, 9, 25], [0, 1, 2, 3, 5], 2)
    array([2., 2.])
    """
    frame, change = np.asarray(frame), np.diff(np.asarray(values, float), order)
    return change[(frame[order:] - frame[:-order] == order) & np.isfinite(change)]


def evenly(count: int, most: int) -> np.ndarray:
    """At most `most` of the numbers below `count`, evenly spread from the first to the last.

    >>> evenly(9, 3)
    array([0, 4, 8])
    """
    return np.unique(np.linspace(0, count - 1, most).astype(int)) if count else np.empty(0, int)


def spread(count: int) -> list[int]:
    """The numbers below `count`, in an order of which every beginning is evenly spread.

    >>> spread(9)
    [0, 4, 8, 2, 6, 1, 3, 5, 7]
    """
    steps = [2**k + 1 for k in range(1, max(count, 2).bit_length() + 1)]
    return list(dict.fromkeys(i for most in steps for i in evenly(count, most).tolist()))


def parts(count: int, most: int) -> list[slice]:
    """Return slices of much the same length, at most `most`, that make up ``range(count)``.

    >>> parts(5, 2)
    [slice(0, 2, None), slice(2, 3, None), slice(3, 5, None)]
    """
    ends = np.linspace(0, count, -(-count // most) + 1).round().astype(int).tolist()
    return [slice(start, stop) for start, stop in pairwise(ends)]
