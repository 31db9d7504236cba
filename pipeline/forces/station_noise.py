"""What stations err by beside what the picture's noise explains, as free frames show it.

A codec's errors are no noise of pixels: they grow less towards the thin tip, and pictures that it
has smoothed seem the better for it. What rods miss stations by in free frames is a multiple of the
expected variance, which all fits allow for, and a variance that is the same all along the whisker.
"""

import numpy as np
from scipy.optimize import nnls

from pipeline.forces import rod_fit
from pipeline.forces.fur_bias import usual_misfit
from pipeline.kinematics.stations import Stations
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

MOST_ROWS = 60
ROUNDS = 3  # a rod that relies on few stations misses them by too little


def as_they_scatter(
    places: Stations, whisker: Whisker, curvature_at: float, free
) -> tuple[Stations, float]:
    """Return the stations, all with that constant error beside those they know of; the multiple.

    `free`, bool (rows,): frames in which nothing touches the whisker; without any it is 1.
    """
    rows = np.flatnonzero(free & np.isfinite(places.last))
    part = places.rows(rows[evenly(len(rows), MOST_ROWS)]).loaded()
    doubt, multiple = 0.0, 1.0
    for _ in range(ROUNDS):
        misfit = np.full((len(part), 2, part.x.shape[1]), np.nan)
        rod_fit.fit_free(part.doubted(doubt), whisker, curvature_at, misfit)
        doubt, multiple = _parts(misfit[:, 0], part.information, doubt)
    return places.doubted(doubt), multiple


def _parts(misfit, information, doubt):
    """Variance [m²] beside the inverse of `information`, and how many times that, at least 1, is.

    Both (rows, stations) as `misfit` [m]. `doubt` [m²]: what it is about, for the weights.
    """
    seen = information > 0
    expected = np.where(seen, 1 / np.where(seen, information, 1.0), np.nan)
    square, expected = usual_misfit(misfit**2, expected)
    square, expected = (each[np.isfinite(square)] for each in (square, expected))
    if not len(square):
        return 0.0, 1.0
    weight = 1 / (expected + doubt)
    parts = np.stack([expected * weight, weight * np.median(expected)], axis=1)
    multiple, constant = nnls(parts, square * weight)[0]
    multiple = max(float(multiple), 1.0)
    return float(constant / multiple * np.median(expected)), multiple
