"""Which numbers are whiskers', and which only stand for lines of which that is not known.

Where names are not given, whiskers are numbered along the face, and behind them the lines that
belong to no known whisker: each number there stands for whatever lines needed room at one time.
Their confidence is low throughout.
"""

import re
from collections import defaultdict

import numpy as np
import pandas as pd

KNOWN = 0.5  # confidence in a name from which on it is known
SHORT = 4  # numbers in order are all named up to fewer than these
NUMBERED = re.compile(r"(.*)w(\d+)")  # w1, w2, …, or left_w1, left_w2, …


def nameless(names, confidence) -> set[str]:
    """The numbers of lines that are no known whisker's: those behind the last that is ever known.

    None where not one is: in a few frames nothing is learnt of how whiskers look.

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


def in_short(names) -> str:
    """Names with a comma between them, of many numbers in order only the first and the last.

    >>> in_short(["C1", "left_w1", "left_w2", "left_w3", "left_w4", "right_w1"])
    'C1, left_w1 to left_w4, right_w1'
    """
    runs = []
    for name in names:
        found = NUMBERED.fullmatch(name)
        number = (found[1], int(found[2])) if found else (name, None)
        last = runs[-1][-1][1] if runs else None
        if found and last == (number[0], number[1] - 1):
            runs[-1].append((name, number))
        else:
            runs.append([(name, number)])
    parts = []
    for run in runs:
        own = [name for name, _ in run]
        parts += own if len(own) < SHORT else [f"{own[0]} to {own[-1]}"]
    return ", ".join(parts)
