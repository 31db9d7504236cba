"""Runs of consecutive frames in which a condition holds."""

import numpy as np


def stretches(mask) -> list[tuple[int, int]]:
    """Half-open (start, stop) of every run of True in the bool `mask` (frames,)."""
    change = np.diff(np.concatenate([[False], np.asarray(mask, bool), [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))
