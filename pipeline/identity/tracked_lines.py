"""The lines of a whole video by frame and track, without names."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.identity.features import ANGLE
from pipeline.identity.limits import Limits


@dataclass(frozen=True)
class TrackedLines:
    """A video's lines, ordered by frame and track.

    Attributes
    ----------
    features : float64 (rows, 6) as in `line_features`
    frame, track : int64 (rows,)
    limits : the room's parameters
    """

    features: np.ndarray
    frame: np.ndarray
    track: np.ndarray
    limits: Limits

    @cached_property
    def starts(self):
        """First row of every frame, and the number of rows."""
        return np.searchsorted(self.frame, np.arange(self.frame[-1] + 2))

    @cached_property
    def along(self):
        """Every frame's rows in their order along the face, counted from its first (rows,)."""
        order = np.lexsort((self.features[:, ANGLE], self.frame))
        return order - self.starts[self.frame]

    @cached_property
    def pieces(self):
        """Rows ordered by track and frame (rows,), and where unbroken pieces begin and end."""
        order = np.lexsort((self.frame, self.track))
        broken = (np.diff(self.track[order]) != 0) | (np.diff(self.frame[order]) != 1)
        ends = np.flatnonzero(broken) + 1
        return order, np.append(0, ends), np.append(ends, len(order))

    @cached_property
    def before(self):
        """Row of the same track in the frame before (rows,), −1 for none."""
        return row_before(self.frame, self.track)

    def backwards(self) -> tuple["TrackedLines", np.ndarray]:
        """The same lines with time reversed, and which of the rows each of theirs is (rows,)."""
        frame = self.frame[-1] - self.frame
        rows = np.lexsort((self.track, frame))
        return TrackedLines(self.features[rows], frame[rows], self.track[rows], self.limits), rows


def row_before(frame, track) -> np.ndarray:
    """Row of the same track in the frame before, (rows,), −1 for none."""
    order = np.lexsort((frame, track))
    on = (np.diff(track[order]) == 0) & (np.diff(frame[order]) == 1)
    out = np.full(len(frame), -1)
    out[order[1:][on]] = order[:-1][on]
    return out
