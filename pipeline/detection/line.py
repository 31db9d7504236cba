"""A line in one frame, and room to work on it."""

from dataclasses import dataclass

import numpy as np

from pipeline.detection import line_profile

START_SIGMA_PX = 1.1


class Workspace:
    """Scratch arrays for lines of up to `limit` nodes, allocated once."""

    def __init__(self, limit: int):
        self.limit = limit
        self.sums = np.zeros((line_profile.N_SUMS, limit))
        self.work = np.zeros((12, limit))
        self.cap = np.zeros(limit)
        self.band = np.zeros((limit, 4))
        self.rhs = np.zeros(limit)


@dataclass
class Line:
    """A traced whisker in one frame; arrays have `limit` places, of which `n` are in use.

    `information` and `score` are those of the offset at the final nodes (profiles.py);
    `thickness` is the absorbance integrated across the line [px], NaN where unknown;
    `longest` the largest number of nodes that it may have.
    """

    x: np.ndarray
    y: np.ndarray
    amplitude: np.ndarray
    sigma: np.ndarray
    information: np.ndarray
    score: np.ndarray
    thickness: np.ndarray
    n: int = 0
    quality: float = 0.0
    longest: float = np.inf

    @classmethod
    def empty(cls, limit: int) -> "Line":
        """Return a line with no nodes and room for `limit`."""
        arrays = [np.zeros(limit) for _ in range(7)]
        arrays[3][:] = START_SIGMA_PX
        return cls(*arrays)

    def copy(self) -> "Line":
        """Return an independent copy."""
        arrays = (self.x, self.y, self.amplitude, self.sigma)
        arrays += (self.information, self.score, self.thickness)
        return Line(*(a.copy() for a in arrays), self.n, self.quality, self.longest)

    @property
    def points(self) -> np.ndarray:
        """Nodes in use, (n, 2)."""
        return np.column_stack([self.x[: self.n], self.y[: self.n]])
