"""Errors of the stations that the picture's noise does not explain, learnt from free frames.

The errors that a codec makes differ from the noise of pixels: they grow less towards the thin tip,
and a picture that the codec has smoothed seems better than it is. The squared misfits of rods in
free frames are described by two terms: a multiple of the expected variance, which all fits allow
for, and a variance that is the same all along the whisker.
"""

import numpy as np
from scipy.optimize import nnls

from pipeline.forces import rod_fit
from pipeline.forces.fur_bias import usual_misfit
from pipeline.kinematics.stations import Stations
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

MOST_ROWS = 60
ROUNDS = 3  # of fits: the first rods rely on few stations, and miss these by too little


def as_they_scatter(places: Stations, whisker: Whisker, curvature_at: float, free) -> Stations:
    """Return the stations with the constant variance added to their own.

    `free`, bool (rows,): frames in which nothing touches the whisker.
    """
    rows = np.flatnonzero(free & np.isfinite(places.last))
    part = places.rows(rows[evenly(len(rows), MOST_ROWS)]).loaded()
    doubt = 0.0
    for _ in range(ROUNDS):
        misfit = np.full((len(part), 2, part.x.shape[1]), np.nan)
        rod_fit.fit_free(part.doubted(doubt), whisker, curvature_at, misfit)
        doubt = _parts(misfit[:, 0], part.information, doubt)
    return places.doubted(doubt)


def _parts(misfit, information, doubt):
    """The constant variance [m²], beside a multiple, at least 1, of the inverse `information`.

    misfit, information : (rows, stations) [m], [1/m²]
    doubt : a first value of the constant variance [m²], for the weights
    """
    seen = information > 0
    expected = np.where(seen, 1 / np.where(seen, information, 1.0), np.nan)
    square, expected = usual_misfit(misfit**2, expected)
    square, expected = (each[np.isfinite(square)] for each in (square, expected))
    if not len(square):
        return 0.0
    weight = 1 / (expected + doubt)
    parts = np.stack([expected * weight, weight * np.median(expected)], axis=1)
    multiple, constant = nnls(parts, square * weight)[0]
    return float(constant / max(multiple, 1.0) * np.median(expected))
