"""Which names are whiskers', and which only stand for lines of which that is not known.

Where names are not given, every line has one; but the confidence of a line that belongs to no
known whisker is low throughout, and others of another time may have the same name.
"""

import numpy as np
import pandas as pd

KNOWN = 0.5  # confidence in a name from which on it is known


def nameless(names, confidence) -> set[str]:
    """The names of lines that are never known to be a whisker's.

    Parameters
    ----------
    names : of every line (lines,), as in frames.parquet or centrelines
    confidence : of every line (lines,), 0–1; NaN: not recorded
    """
    most = pd.Series(np.asarray(confidence, float)).groupby(np.asarray(names, object)).max()
    return set(most.index[most < KNOWN])


def nameless_in(frames: pd.DataFrame) -> set[str]:
    """The same for rows of frames.parquet."""
    tracked = frames[frames["tracked"].astype(bool)]
    return nameless(tracked["whisker"], tracked["confidence"])
