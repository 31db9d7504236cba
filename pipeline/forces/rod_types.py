"""Named tuples for the fit of a rod: what goes in, row by row, and what comes out."""

from typing import NamedTuple

import numpy as np

# options of the compiled loops; without fastmath, which would sum in an order of its own
COMPILED = {"cache": True, "error_model": "numpy"}
OUTPUTS = (
    "force", "force_var", "gap", "gap_var", "gap_force_cov", "contact", "angle", "follicle_x",
    "follicle_y", "moment_per_force", "axial_per_force", "lateral_per_force",
    "curvature_per_force", "lever_at_curvature", "chi2", "moment_var", "axial_var",
    "lateral_var", "force_by_origin", "moment_by_origin", "axial_by_origin",
    "lateral_by_origin", "origin_pull", "origin_bend", "curvature", "curvature_var",
    "curvature_slope", "angle_var", "base_curvature",
)  # fmt: skip
OUTPUT_ROW = np.dtype([(name, np.float64) for name in OUTPUTS])  # `rod_fit.ShapeFit` explains


class Beam(NamedTuple):
    """A cone: length and cone length [m], flexural rigidity at the base [N m²]."""

    length: float
    cone_length: float
    rigidity: float


class Load(NamedTuple):
    """Side of the whisker that the pole is on (0: no load), and signed friction."""

    side: float
    friction: float


class Arc(NamedTuple):
    """Station k is at arc length k `spacing` + `origin` [m].

    `moved` is the part of the origin that was added after the rest shape was measured.
    """

    origin: float
    moved: float
    spacing: float


class Seen(NamedTuple):
    """Stations of one row: places [m] and information across the whisker [1/m²], 0 unseen."""

    x: np.ndarray
    y: np.ndarray
    information: np.ndarray


class Pole(NamedTuple):
    """Centre and radius [m]."""

    x: float
    y: float
    radius: float


class Prior(NamedTuple):
    """Rest shape of one row, as `rod_fit.RestPrior` has it, with its precision."""

    weights: np.ndarray
    drift: np.ndarray
    centre: float
    scale: float
    precision: np.ndarray
    by_origin: np.ndarray


class Problem(NamedTuple):
    """One row to be fitted."""

    seen: Seen
    arc: Arc
    beam: Beam
    load: Load
    pole: Pole


class Fitted(NamedTuple):
    """One fitted row: parameters, their covariance, reduced χ², place, rod, equations."""

    p: np.ndarray
    cov: np.ndarray
    chi2: float
    place: tuple
    rod: tuple
    sums: tuple


class Rows(NamedTuple):
    """Data of all rows, with the rows along the first axis; in metres.

    `drift`, `rest_cov` and `rest_by_origin`: of the `RestPrior`.
    """

    x: np.ndarray
    y: np.ndarray
    information: np.ndarray
    origin: np.ndarray
    moved: np.ndarray
    side: np.ndarray
    friction: np.ndarray
    pole_x: np.ndarray
    pole_y: np.ndarray
    nearest: np.ndarray
    drift: np.ndarray
    rest_cov: np.ndarray
    rest_by_origin: np.ndarray


class Setup(NamedTuple):
    """Values that are the same in all rows.

    `taper`: radius at the base [m] and its loss per length; `at`: arc length of the curvature
    [m]; `settled`: length of a step, in SD, after which the fit stops.
    """

    spacing: float
    beam: Beam
    taper: tuple
    pole_radius: float
    at: float
    settled: float


class Filled(NamedTuple):
    """Arrays for the results: OUTPUT_ROWs, rest shapes, their covariances, `by_rest`, misfit.

    `misfit` has no rows where it is not wanted.
    """

    table: np.ndarray
    rest: np.ndarray
    rest_cov: np.ndarray
    by_rest: np.ndarray
    misfit: np.ndarray
