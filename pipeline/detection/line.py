"""A line in one frame, and room to work on it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection import line_profile
from pipeline.numerics import bsplines

START_SIGMA_PX = 1.1
LONGEST = 1.6  # times the picture's diagonal: no line is longer


class Scratch(NamedTuple):
    """What a fit measures at the nodes of a line, and room to work; (nodes,) each but for four.

    Attributes
    ----------
    normal_x, normal_y : unit normals
    amplitude, baseline, amplitude_se : absorbance, error of the background, error of the former
    information, score : of the offset
    offset : along the normals [px]
    smooth_x, smooth_y : spline coefficients of the line
    cap : largest believable absorbance
    misfit : χ² per degree of freedom, 1 to `MOST_MISFIT` (line_profile.py)
    rhs : of the spline's normal equations, `band` (nodes, 4)
    room : (2, nodes), to resample in
    spacing : between the splines' knots [px], the same at all nodes
    at_nodes : (4, nodes), as in `bsplines.basis_at_nodes`
    sums : (N_SUMS, nodes), as in `cross_sections.accumulate`
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
    misfit: np.ndarray
    rhs: np.ndarray
    band: np.ndarray
    room: np.ndarray
    spacing: np.ndarray
    at_nodes: np.ndarray
    sums: np.ndarray


@njit(cache=True)
def scratch_of(room):
    """The `Scratch` in the room of a `Workspace`."""
    s, limit = room, room.shape[1]
    band = s[13:17].reshape(limit, 4)
    return Scratch(
        s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11], s[12], band,
        s[17:19], s[19], s[20:24], s[24:],
    )  # fmt: skip


class Workspace:
    """Room to work on lines of up to `limit` nodes, allocated once: one array, as in `Line`.

    spacing : between the knots of their splines [px]
    """

    def __init__(self, limit: int, spacing: float):
        self.limit = limit
        self.room = np.zeros((24 + line_profile.N_SUMS, limit))
        scratch = scratch_of(self.room)
        scratch.spacing[:] = spacing
        scratch.at_nodes[:] = bsplines.basis_at_nodes(limit, spacing)

    @classmethod
    def for_picture(cls, shape, spacing: float) -> "Workspace":
        """Room for the lines in a picture (height, width)."""
        return cls(int(LONGEST * np.hypot(*shape)), spacing)


class Nodes(NamedTuple):
    """Arrays of a `Line`, for compiled code."""

    x: np.ndarray
    y: np.ndarray
    amplitude: np.ndarray
    sigma: np.ndarray
    information: np.ndarray
    score: np.ndarray
    thickness: np.ndarray


@njit(cache=True)
def nodes_of(values):
    """The `Nodes` in the values of a `Line`."""
    v = values
    return Nodes(v[0], v[1], v[2], v[3], v[4], v[5], v[6])


@dataclass
class Line:
    """A traced whisker in one frame: `values` (7, limit), of which the first `n` are in use.

    Its rows are the arrays of `Nodes`, which are attributes of the line as well; handing one array
    over to compiled code takes a tenth of the time of seven. `information` and `score` are those
    of the offset at the final nodes (line_profile.py); `thickness` is the absorbance integrated
    across the line [px], NaN where unknown; `end` what `line_end.end_thickness` returns, None
    where that is not measured.
    """

    values: np.ndarray
    n: int = 0
    quality: float = 0.0
    end: np.ndarray | None = None

    def __post_init__(self):
        (
            self.x, self.y, self.amplitude, self.sigma,
            self.information, self.score, self.thickness,
        ) = self.values  # fmt: skip

    @classmethod
    def empty(cls, limit: int) -> "Line":
        """Return a line with no nodes and room for `limit`."""
        line = cls(np.zeros((7, limit)))
        line.sigma[:] = START_SIGMA_PX
        return line

    def copy(self) -> "Line":
        """Return an independent copy."""
        return Line(self.values.copy(), self.n, self.quality)

    def shortened(self) -> "Line":
        """Return a copy of the nodes in use alone, without room for more."""
        return Line(self.values[:, : self.n].copy(), self.n, self.quality)

    @property
    def points(self) -> np.ndarray:
        """Nodes in use, (n, 2)."""
        return np.column_stack([self.x[: self.n], self.y[: self.n]])
