"""A line in one frame, and room to work on it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.detection import line_profile

START_SIGMA_PX = 1.1


class Scratch(NamedTuple):
    """What a fit measures at the nodes of a line, and room to work; (nodes,) each but for three.

    Attributes
    ----------
    normal_x, normal_y : unit normals
    amplitude, baseline, amplitude_se : absorbance, error of the background, error of the former
    information, score : of the offset
    offset : along the normals [px]
    smooth_x, smooth_y : spline coefficients of the line
    cap : largest believable absorbance
    rhs : of the spline's normal equations, `band` (nodes, 4)
    room : (2, nodes), to resample in
    sums : (N_SUMS, nodes), as of `cross_sections.accumulate`
    """

    normal_x: np.ndarray
    normal_y: np.ndarray
    amplitude: np.ndarray
    baseline: np.ndarray
    amplitude_se: np.ndarray
    information: np.ndarray
    score: np.ndarray
    offset: np.ndarray
    smooth_x: np.ndarray
    smooth_y: np.ndarray
    cap: np.ndarray
    rhs: np.ndarray
    band: np.ndarray
    room: np.ndarray
    sums: np.ndarray


class Workspace:
    """Scratch arrays for lines of up to `limit` nodes, allocated once."""

    def __init__(self, limit: int):
        self.limit = limit
        band, room = np.zeros((limit, 4)), np.zeros((2, limit))
        sums = np.zeros((line_profile.N_SUMS, limit))
        self.scratch = Scratch(*np.zeros((12, limit)), band, room, sums)


class Nodes(NamedTuple):
    """Arrays of a `Line`, for compiled code."""

    x: np.ndarray
    y: np.ndarray
    amplitude: np.ndarray
    sigma: np.ndarray
    information: np.ndarray
    score: np.ndarray
    thickness: np.ndarray


@dataclass
class Line:
    """A traced whisker in one frame; arrays have `limit` places, of which `n` are in use.

    `information` and `score` are those of the offset at the final nodes (line_profile.py);
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
        return Line(*(a.copy() for a in self.nodes), self.n, self.quality, self.longest)

    @property
    def nodes(self) -> Nodes:
        """All arrays."""
        return Nodes(
            self.x, self.y, self.amplitude, self.sigma, self.information, self.score,
            self.thickness,
        )  # fmt: skip

    @property
    def points(self) -> np.ndarray:
        """Nodes in use, (n, 2)."""
        return np.column_stack([self.x[: self.n], self.y[: self.n]])
