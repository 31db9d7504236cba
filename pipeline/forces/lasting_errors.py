"""Stations that lie off the rods in all frames alike, by errors that no mean over frames removes.

Fur and the face's shadow shift the first visible part of a whisker by up to some tenths of a
pixel, the pole's edge shifts what lies beside it, dust and hairs what lies upon them. Such a shift
is the same whenever the whisker lies at the same place, and another one in touch than in free
frames, where it looks like bending. So each kind of frames is judged by itself: in the mean of its
frames, the stations should lie on a smooth curve within the errors of that mean. Those that lie
farther off count less, in all frames: their shift is treated as noise, the noise whose lasting
share it would be.
"""

import numpy as np

from pipeline.forces import rod_fit
from pipeline.forces.whisker_rows import WhiskerRows
from pipeline.kinematics.stations import N_STATIONS, Stations, may_touch, variance_of
from pipeline.numerics.robust import MAD_TO_SD, column_medians
from pipeline.numerics.runs import evenly

SURE_SD = 4.0  # standard errors of the mean, of the usual size, beyond which a station is shifted
# of a station's noise, in the mean of a whole video (measured, rendered ones)
LASTING_SHARE = 0.15
MOST_SHARE = 0.25  # of the stations may be shifted
MOST_ROWS = 120  # of free frames, and as many of touching ones
FEWEST_ROWS = 10  # of each, and of those that show a station
FEWEST_STATIONS = 12
DEGREE = rod_fit.N_REST + 1  # of the smooth curve: what rest shape and pose can follow
FADES_M = 0.4e-3  # length over which a shift falls by e
LEAST_FREEDOM = 0.02  # of a station's squared error, that a fit leaves of it


def with_lasting_errors(own: WhiskerRows, near_m: float) -> Stations:
    """Return the stations, with less information where touching frames show that they are shifted.

    near_m : whisker to pole [m], of frames that may touch
    """
    places, rows = own.places, _sample(own, near_m)
    own = own.rows(rows)
    model = own.rest_shape()
    if model is None:
        return places
    part, touching = own.places, ~own.free
    misfit = np.full((len(part), 2, part.x.shape[1]), np.nan)
    prior = own.rest_prior(model)
    fit = rod_fit.fit_loaded(part, own.whisker, own.curvature_at, prior, misfit=misfit)
    spacing = own.whisker.length / (N_STATIONS - 1)
    shifts = lasting_variance(misfit[touching, 0], part.information[touching], spacing)
    return places.with_variance(shifts / variance_factor(fit)) if shifts.any() else places


def variance_factor(fit: rod_fit.ShapeFit) -> float:
    """By how much fits multiply all variances where misfits exceed them; 1: not at all.

    A variance that is added to the known ones has to be divided by it, to count as what it is.
    """
    chi2 = fit["chi2"][np.isfinite(fit["chi2"])]
    return max(float(np.median(chi2)), 1.0) if len(chi2) else 1.0


def _sample(own, near_m):
    """Numbers of free and of touching rows, spread over the video; none if one kind is missing."""
    places, free = own.places, own.free
    out = []
    for kind in (may_touch(places, near_m) & ~free, free):
        rows = np.flatnonzero(kind & np.isfinite(own.angle) & np.isfinite(places.first))
        if len(rows) < FEWEST_ROWS:
            return np.empty(0, int)
        rows = places.not_interpolated(rows, MOST_ROWS)
        out.append(rows[evenly(len(rows), MOST_ROWS)])
    return np.sort(np.concatenate(out))


def lasting_variance(misfit, information, spacing):
    """Variance (stations,) [m²] of the noise that has the shifts of stations as lasting share.

    Zero where a station is not shifted, or where that cannot be judged.

    Parameters
    ----------
    misfit : (rows, stations) from the rods, across the whisker [m]; NaN where not seen
    information : (rows, stations) [1/m²]
    spacing : of the stations [m]
    """
    seen = np.isfinite(misfit) & (information > 0)
    shift, count = np.zeros(seen.shape[1]), seen.sum(axis=0)
    known = np.flatnonzero(count >= FEWEST_ROWS)
    if len(known) >= FEWEST_STATIONS:
        misfit = np.where(seen, misfit, np.nan)[:, known]
        variance = np.where(seen, variance_of(information), np.nan)[:, known]
        se = np.sqrt(column_medians(variance) / count[known])
        shift[known] = _shifts(known / len(shift), np.nanmean(misfit, axis=0), se)
        shift[: known[0]] = shift[known[0]]  # seldom seen: deeper in the fur
    return (_fading(shift, spacing) / LASTING_SHARE) ** 2


def _fading(shift, spacing):
    """The largest shift (stations,) that reaches each station [m]: it has no sharp end.

    The stations beside one that is shifted are shifted, too, if too little to stand out.
    """
    arc = spacing * np.arange(len(shift))
    reach = np.exp(-np.abs(arc[:, None] - arc) / FADES_M)
    return (reach * np.abs(shift)).max(axis=1)


def _shifts(place, mean, se):
    """How far stations lie off a smooth curve through the others, 0 where by chance; all (n,).

    The one that is surely the farthest off is left out, then the next: one shifted station draws
    the curve towards itself, most of all at the ends, and its neighbours seem to be shifted.
    """
    design = np.polynomial.legendre.legvander(2 * place - 1, DEGREE) / se[:, None]
    seen, used = mean / se, np.ones(len(place), bool)
    for _ in range(int(MOST_SHARE * len(place))):
        q, r = np.linalg.qr(design[used])
        curve = np.linalg.solve(r, q.T @ seen[used])
        left = (seen - design @ curve)[used]
        square = left**2 / np.maximum(1 - (q**2).sum(axis=1), LEAST_FREEDOM)
        usual = max(MAD_TO_SD**2 * np.median(square), 1.0)
        worst = np.argmax(square)
        if square[worst] < SURE_SD**2 * usual:
            break
        used[np.flatnonzero(used)[worst]] = False
    return np.where(used, 0.0, (seen - design @ curve) * se)
