"""Errors of the stations that the picture's noise does not explain, learnt from free frames.

The errors that a codec makes differ from the noise of pixels: they grow less towards the thin tip,
and a picture that the codec has smoothed seems better than it is. The squared misfits of rods in
free frames are described by two terms: a multiple of the expected variance, which all fits allow
for, and a variance that is the same all along the whisker. Single stations may be shifted beside
(`lasting_errors`).
"""

import numpy as np
from scipy.optimize import nnls

from pipeline.forces import rod_fit
from pipeline.forces.lasting_errors import FEWEST_ROWS, lasting_variance, variance_factor
from pipeline.kinematics.stations import N_STATIONS, Stations, information_with, variance_of
from pipeline.numerics.robust import MAD_TO_SD
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

MOST_ROWS = 60
ROUNDS = 3  # of fits: the first rods rely on few stations, and miss these by too little


def with_observed_scatter(
    places: Stations, whisker: Whisker, curvature_at: float, free
) -> Stations:
    """Return the stations with what free frames show of their errors added to their own.

    `free`, bool (rows,): frames in which nothing touches the whisker.
    """
    rows = np.flatnonzero(free & np.isfinite(places.last))
    part = places.rows(rows[evenly(len(rows), MOST_ROWS)]).loaded()
    constant, lasting = 0.0, np.zeros(part.x.shape[1])
    spacing = whisker.length / (N_STATIONS - 1)
    for _ in range(ROUNDS):
        misfit = np.full((len(part), 2, part.x.shape[1]), np.nan)
        fit = rod_fit.fit_free(
            part.with_variance(constant + lasting), whisker, curvature_at, misfit
        )
        constant = _constant(misfit[:, 0], part.information, constant)
        information = information_with(part.information, constant)
        found = lasting_variance(misfit[:, 0], information, spacing)
        lasting = np.maximum(lasting, found / variance_factor(fit))
    return places.with_variance(constant + lasting)


def _constant(misfit, information, first):
    """The constant variance [m²], beside a multiple, at least 1, of the inverse `information`.

    misfit, information : (rows, stations) [m], [1/m²]
    first : a first value of the constant variance [m²], for the weights
    """
    square, expected = usual_misfit(misfit**2, variance_of(information))
    square, expected = (each[np.isfinite(square)] for each in (square, expected))
    if not len(square):
        return 0.0
    weight = 1 / (expected + first)
    parts = np.stack([expected * weight, weight * np.median(expected)], axis=1)
    multiple, constant = nnls(parts, square * weight)[0]
    return float(constant / max(multiple, 1.0) * np.median(expected))


def usual_misfit(square, expected):
    """Usual squared misfit and variance (2, stations) of (rows, stations); NaN where too few."""
    both = np.full((2, len(square) + 1, square.shape[1]), np.nan)  # one row at least
    both[:, :-1] = MAD_TO_SD**2 * square, expected
    both[:, ~np.isfinite(both).all(axis=0)] = np.nan
    count = np.isfinite(both[0]).sum(axis=0)
    both.sort(axis=1)
    middle = np.take_along_axis(both, np.stack([np.maximum(count - 1, 0), count])[None] // 2, 1)
    return np.where(count >= FEWEST_ROWS, middle.mean(axis=1), np.nan)
