"""Bias of the first visible part of a whisker, which fur and face shift alike in every frame.

Still fur and the face's shadow shift the first millimetre of a trace by up to some tenths of a
pixel. The shift is the same whenever the whisker lies at the same place, so that no mean over
frames removes it, and it often has the opposite sign in touch, where it looks like bending. The
elastic rod reveals it: fitted to the stations farther out and continued towards the face, it
should meet those near the face within the errors of fit and noise. Where it does not, these
stations count less, in all frames.

The first part of the whisker is judged in steps. The outermost step is too far out for fur: an
excess of its misfit (a codec's noise is alike along the line; the rest shape is no polynomial) is
expected nearer to the face, too. A bias is taken to fade out beyond the step in which it is found,
since the next stations are also shifted, if too little to stand out.
A bias is treated as noise: the noise whose lasting share it would be.
"""

from dataclasses import replace

import numpy as np

from pipeline.forces import rod_fit
from pipeline.forces.whisker_rows import WhiskerRows
from pipeline.kinematics.stations import Stations
from pipeline.numerics.robust import MAD_TO_SD
from pipeline.numerics.runs import evenly

FUR_CLINGS_M = 0.4e-3  # length of the first visible part, which is not judged
STEP_M = 0.4e-3  # or a station's, where these lie farther apart
STEPS = 3  # are judged; the last is the outermost
MOST_ROWS = 120  # of free frames, and as many of touching ones
FEWEST_ROWS = 10  # of each
SURE = 2.0  # times the variance that is expected
# of a station's noise, in the mean of a whole video (measured, rendered ones)
LASTING_SHARE = 0.15


def without_bias(own: WhiskerRows, near_m: float) -> Stations:
    """Return the stations; biased ones near the face have less information.

    near_m : whisker to pole [m], of frames that may touch
    """
    places, rows = own.places, _sample(own, near_m)
    if len(rows) == 0:
        return places
    own = own.rows(rows)
    part, free = own.places, own.free
    spacing = part.spacing[part.whisker[0]]
    arc, width = np.arange(part.x.shape[1]) * spacing, max(STEP_M, spacing)
    step = np.floor((arc - np.nanmedian(part.first) - FUR_CLINGS_M) / width)
    held = replace(part, information=np.where(step >= STEPS, part.information, 0.0))
    own = replace(own, places=held)
    model = own.rest_shape()
    if model is None:
        return places
    square, expected, multiple = _misfits(own, part.information, own.rest_prior(model))
    found = [usual_misfit(square[kind], expected[kind]) for kind in (free, ~free)]
    usual = _usual([each[:, step == STEPS - 1] for each in found])
    bias = np.where(step < STEPS - 1, _bias(found, usual), 0.0)
    doubt = bias / LASTING_SHARE**2 / multiple  # which later fits will multiply again
    doubt = np.maximum.accumulate(doubt[::-1])[::-1]  # never less towards the face
    fading = np.exp(2 * arc / width)  # the bias has no sharp end: its SD falls by e in a step
    doubt = np.maximum.accumulate(doubt * fading) / fading
    return places.doubted(doubt) if doubt.any() else places


def _sample(own, near_m):
    """Numbers of free and of touching rows, spread over the video; none if one kind is missing."""
    places, free = own.places, own.free
    with np.errstate(invalid="ignore"):
        near = (places.side != 0) & (places.distance < near_m) & ~places.extended & ~free
    out = []
    for kind in (near, free):
        rows = np.flatnonzero(kind & np.isfinite(own.angle) & np.isfinite(places.first))
        if len(rows) < FEWEST_ROWS:
            return np.empty(0, int)
        rows = places.rather_shown(rows, MOST_ROWS)
        out.append(rows[evenly(len(rows), MOST_ROWS)])
    return np.sort(np.concatenate(out))


def _misfits(own, information, prior):
    """Squared misfits of the stations and their variance, (rows, stations) [m²] each.

    NaN where nothing was measured, or no rod could be fitted. And how many times larger than said
    the stations' variances usually are, as χ² shows, at least 1.
    """
    misfit = np.full((len(own.places), 2, own.places.x.shape[1]), np.nan)
    fit = rod_fit.fit_loaded(own.places, own.whisker, own.curvature_at, prior, misfit=misfit)
    multiple = np.fmax(fit["chi2"], 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = multiple[:, None] / information
    expected = misfit[:, 1] + np.where(np.isfinite(noise), noise, np.nan)
    return misfit[:, 0] ** 2, expected, np.median(multiple)


def usual_misfit(square, expected):
    """Usual squared misfit and variance (2, stations) of (rows, stations); NaN where too few."""
    both = np.full((2, len(square) + 1, square.shape[1]), np.nan)  # one row at least
    both[:, :-1] = MAD_TO_SD**2 * square, expected
    both[:, ~np.isfinite(both).all(axis=0)] = np.nan
    count = np.isfinite(both[0]).sum(axis=0)
    both.sort(axis=1)
    middle = np.take_along_axis(both, np.stack([np.maximum(count - 1, 0), count])[None] // 2, 1)
    return np.where(count >= FEWEST_ROWS, middle.mean(axis=1), np.nan)


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
