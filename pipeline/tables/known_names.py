"""Which numbers are whiskers, and which only stand for lines that could not be identified.

Where names are not given, whiskers are numbered along the face. Higher numbers are given to lines
that belong to no known whisker; such a number may stand for different lines at different times.
Their confidence is low throughout.
"""

import re
from collections import defaultdict
from itertools import groupby

import numpy as np
import pandas as pd

KNOWN = 0.5  # confidence from which on a name counts as known
SHORT = 4  # so many numbers in order, or more, are shortened to "w1 to w4"
NUMBERED = re.compile(r"(.*)w(\d+)")  # w1, w2, …, or left_w1, left_w2, …


def nameless(names, confidence) -> set[str]:
    """Numbers of lines that belong to no known whisker: those above the last that is ever known.

    No numbers where none is ever known: a few frames do not show how whiskers look.

    Parameters
    ----------
    names : of every line (lines,), as in frames.parquet or centrelines
    confidence : of every line (lines,), 0–1; NaN: not recorded
    """
    best = pd.Series(np.asarray(confidence, float)).groupby(np.asarray(names, object)).max()
    numbers = {name: found for name in best.index if (found := NUMBERED.fullmatch(name))}
    last = defaultdict(int)  # by side
    for name, found in numbers.items():
        if not best[name] < KNOWN:
            last[found[1]] = max(last[found[1]], int(found[2]))
    if not last:
        return set()
    return {name for name, found in numbers.items() if int(found[2]) > last[found[1]]}


def nameless_in(frames: pd.DataFrame) -> set[str]:
    """The same for rows of frames.parquet."""
    tracked = frames[frames["tracked"].astype(bool)]
    return nameless(tracked["whisker"], tracked["confidence"])


def never_shown(frames: pd.DataFrame) -> set[str]:
    """Those of `nameless_in` that touch nothing."""
    return nameless_in(frames) - set(frames["whisker"][frames["in_contact"].astype(bool)])


def in_short(names) -> str:
    """Names with commas between them; numbers come last, of many in order the first and the last.

    >>> in_short(["C2", "C1", "w1", "left_w2", "left_w1", "left_w4", "right_w1", "left_w3"])
    'C2, C1, w1, left_w1 to left_w4, right_w1'
    """
    names = list(names)
    parts = [name for name in names if not NUMBERED.fullmatch(name)]
    numbered = sorted(
        (found[1], int(found[2]), name) for name in names if (found := NUMBERED.fullmatch(name))
    )
    runs = groupby(enumerate(numbered), lambda each: (each[1][0], each[1][1] - each[0]))
    for _, run in runs:
        own = [name for _, (_, _, name) in run]
        parts += own if len(own) < SHORT else [f"{own[0]} to {own[-1]}"]
    return ", ".join(parts)
