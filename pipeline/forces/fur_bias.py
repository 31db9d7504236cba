"""Bias of the first visible part of a whisker, which fur and face shift alike in every frame.

Still fur and the face's shadow draw the first millimetre of a trace aside by up to some tenths of
a pixel: by the same wherever the whisker lies alike, so that no mean over frames removes it, and
often by the opposite when it touches, which looks like bending. The elastic rod shows it: fitted
to what lies farther out, and continued towards the face, it must meet what was measured there, as
well as fit and noise allow. Where it does not, the stations count less, in all frames.

The outermost step of what is judged is too far out for fur: what it is missed by more than
expected (a codec's noise runs along the line; the rest shape is no polynomial) is expected nearer
to the face, too. What is found fades outwards over a step: the stations just beyond, which no
longer stand out, are drawn aside, too.
A bias counts as the noise of which it is the share that lasts.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.forces import rod_fit
from pipeline.kinematics.stations import Stations
from pipeline.numerics.robust import MAD_TO_SD
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

FUR_CLINGS_M = 0.4e-3  # first visible part that is not used
STEP_M = 0.4e-3  # or a station's, where these lie farther apart
STEPS = 3  # are judged; the last is the outermost
MOST_ROWS = 40  # of free frames, and as many of touching ones
FEWEST_ROWS = 10  # of each
SURE = 4.0  # times the variance that is expected
# of a station's noise, in the mean of a whole video (measured, rendered ones)
LASTING_SHARE = 0.15


def without_bias(
    places: Stations, whisker: Whisker, curvature_at: float, angle, time, free, rest_prior, near_m
) -> Stations:
    """Return the stations with the information of biased ones near the face as it is.

    Parameters
    ----------
    places : rows of one whisker in the order of their frames
    angle, time : (rows,) base angle [rad] and time [s]
    free : bool (rows,), frames to learn the rest shape from
    rest_prior : function of (stations, angle, time, free) that returns a `RestPrior` or None
    near_m : whisker to pole [m], of frames that may touch
    """
    rows = _sample(places, free, angle, near_m)
    if len(rows) == 0:
        return places
    part, angle, time, free = places.rows(rows).loaded(), angle[rows], time[rows], free[rows]
    spacing = part.spacing[part.whisker[0]]
    arc, width = np.arange(part.x.shape[1]) * spacing, max(STEP_M, spacing)
    step = np.floor((arc - np.nanmedian(part.first) - FUR_CLINGS_M) / width)
    held = replace(part, information=np.where(step >= STEPS, part.information, 0.0))
    prior = rest_prior(held, angle, time, free)
    if prior is None:
        return places
    square, expected = _misfits(held, part.information, whisker, curvature_at, prior)
    found = [usual_misfit(square[kind], expected[kind]) for kind in (free, ~free)]
    usual = _usual([each[:, step == STEPS - 1] for each in found])
    doubt = np.where(step < STEPS - 1, _bias(found, usual), 0.0) / LASTING_SHARE**2
    doubt = np.maximum.accumulate(doubt[::-1])[::-1]  # the nearer to the face the more fur
    fading = np.exp(2 * arc / width)  # whose reach has no sharp end: a step farther out, an e-th
    doubt = np.maximum.accumulate(doubt * fading) / fading
    return places.doubted(doubt) if doubt.any() else places


def _sample(places, free, angle, near_m):
    """Numbers of free and of touching rows, spread over the video; none where none touch."""
    with np.errstate(invalid="ignore"):
        near = (places.side != 0) & (places.distance < near_m) & ~places.extended & ~free
    out = []
    for kind in (near, free):
        own = np.flatnonzero(kind & np.isfinite(angle) & np.isfinite(places.first))
        if len(own) < FEWEST_ROWS:
            return np.empty(0, int)
        own = places.rather_shown(own, MOST_ROWS)
        out.append(own[evenly(len(own), MOST_ROWS)])
    return np.sort(np.concatenate(out))


def _misfits(held, information, whisker, curvature_at, prior):
    """Squared misfits of the stations and their variance, (rows, stations) [m²] each.

    NaN where nothing was measured, or no rod could be fitted.
    """
    misfit = np.full((len(held), 2, held.x.shape[1]), np.nan)
    fit = rod_fit.fit_loaded(held, whisker, curvature_at, prior, misfit=misfit)
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.fmax(fit["chi2"], 1.0)[:, None] / information
    return misfit[:, 0] ** 2, misfit[:, 1] + np.where(np.isfinite(own), own, np.nan)


def usual_misfit(square, expected):
    """Usual squared misfit and variance (2, stations) of (rows, stations); NaN where too few."""
    both = np.stack([MAD_TO_SD**2 * square, expected])
    known = np.isfinite(both).all(axis=0)
    both[:, ~known] = np.nan
    middle = np.stack([pd.DataFrame(each).median() for each in both])
    return np.where(known.sum(axis=0) >= FEWEST_ROWS, middle, np.nan)


def _usual(found):
    """How many times larger than expected squared misfits are, at least 1."""
    ratios = np.concatenate([square / expected for square, expected in found])
    ratios = ratios[np.isfinite(ratios)]
    return max(1.0, float(np.median(ratios))) if len(ratios) else 1.0


def _bias(found, usual):
    """Variance [m²] (stations,) of what is common to all rows, mean of the kinds in `found`."""
    known, total = 0, 0.0
    for square, expected in found:
        more = np.where(square > SURE * usual * expected, square - usual * expected, 0.0)
        seen = np.isfinite(square)
        known, total = known + seen, total + np.where(seen, more, 0.0)
    return total / np.maximum(known, 1)
