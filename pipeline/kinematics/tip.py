"""Where a whisker's tip is: the mean over many frames of what lies beyond the ends of its traces.

A trace ends where the thin tip drowns in the noise of its frame, or where a codec has erased it.
On average over the frames, the whisker is seen beyond: its thickness (`detection/line_end.py`)
falls as a cone's does, and then, at the tip, to nothing. The thinner a whisker is, the more of it
a codec erases, at other places in every frame: towards the tip the mean is thinner than a cone,
but it still ends at the tip.

Where a codec shows little of the tip, a mean that ends early may end at the tip or where the codec
shows nothing more. How it erases is not known well enough to tell these apart: the tip's standard
error grows with the odds that the last of it is erased.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular, toeplitz
from scipy.ndimage import binary_dilation
from scipy.special import ndtr

from pipeline.detection.line_end import PLACES_PX
from pipeline.kinematics.stations import Stations
from pipeline.numerics.robust import MAD_TO_SD, column_medians
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

MOST_ROWS = 1000  # whose ends are averaged
FEWEST_ROWS = 3  # in which a place along the whisker must be seen
STRETCHES = 10  # of time, which have no errors in common
MORE = 1.01  # of the variance, so that the covariance can be inverted
LEAST_SHARED = 1.0  # of the sum of squares, one for each place: frames may be all the same
OUTLIER_SD = 3.0  # another whisker's, or dust's: cut to so many
BEFORE = 5  # places before one, than which it is not thicker
BESIDE = 3  # places that another thing reaches to, since it is blurred and ends scatter
APART_PX = PLACES_PX[1] - PLACES_PX[0]
BLUR_PX = 1.5  # of the tip: optics, and frames whose arc lengths differ
# share of the thickness that a codec shows: 1 − exp(−(distance from the apex/FAINT_PX)^POWERS)
FAINT_PX = np.geomspace(4.0, 100.0, 24)
POWERS = 1, 2, 3
LAST_PX = 4.0  # before the tip: the middle of a codec's block of 8 px that ends there
BY_ODDS_PX = 2.0  # of the tip's standard error, per odds that a codec erases the last of it
STEP_PX = 0.1
UNLIKELY = 300.0  # times the usual square: misfit beyond the least of a tip that is surely wrong
EDGE_SE_PX = 0.1  # of the tip's place, where nothing else is uncertain, from rendered videos
ROUNDING = float(np.finfo(np.float16).eps)  # of a thickness of 1 px, as it is kept
LEAST_PX = 10.0  # how far before the mean end the tip may be


class Tip(NamedTuple):
    """How far the tip is beyond the mean end of the traces, and the standard error of that [m]."""

    beyond: float
    se: float


def tip_beyond(places: Stations, whisker: Whisker) -> Tip | None:
    """Place of the tip of a whisker; None where its lines' ends are not known.

    places : rows whose trace ends near the tip, in the order of their frames
    """
    rows = evenly(len(places), MOST_ROWS)
    shift = (places.last[rows] - places.last.mean()) / places.pixel
    at, thickness = _side_by_side(places.end_px[rows].astype(float), shift)
    if at.max(initial=0) <= 0:
        return None
    apex = (whisker.cone_length - whisker.length) / places.pixel
    mean = np.nanmean(thickness, axis=0)
    covariance = _covariance(thickness - mean)
    own = _tapering(mean, np.sqrt(np.diag(covariance)))
    if at[own].max(initial=0) <= 0:  # something lies over all that is beyond
        return None
    tip, weight = _fits(at[own], mean[own], covariance[np.ix_(own, own)], apex)
    of_tip, of_share = weight.sum(axis=1), weight.sum(axis=0)
    beyond = of_tip @ tip
    unseen = BY_ODDS_PX**2 * (of_share @ _odds_erased(apex) ** 2)
    se = np.sqrt(of_tip @ (tip - beyond) ** 2 + unseen + EDGE_SE_PX**2)
    return Tip(beyond * places.pixel, se * places.pixel)


def _side_by_side(tail, shift):
    """Places from the mean end [px] where enough rows are seen, thickness there (rows, places).

    tail : (rows, places) thickness [px] about the end of each row, which is `shift` [px] beyond
        the mean
    """
    own = PLACES_PX + shift[:, None]
    place = np.rint(own / APART_PX).astype(int)
    first = place.min(initial=0)
    table = np.full((len(tail), place.max(initial=0) - first + 1), np.nan)
    np.put_along_axis(table, place - first, tail, axis=1)
    kept = np.flatnonzero(np.isfinite(table).sum(axis=0) >= FEWEST_ROWS)
    table = table[:, kept]
    usual = column_medians(table)
    limit = OUTLIER_SD * MAD_TO_SD * column_medians(np.abs(table - usual))
    at = APART_PX * (first + kept) + np.mean(own - APART_PX * place)
    return at, np.clip(table, usual - limit, usual + limit)


def _tapering(thickness, se):
    """At which places (in order from the base) the mean thickness is the whisker's own, bool.

    It tapers: what is thicker than the places before lies upon it in most frames, and reaches to
    the places beside.
    """
    own = np.ones(len(thickness), bool)
    for k, each in enumerate(thickness):
        before = thickness[:k][own[:k]][-BEFORE:]
        own[k] = len(before) < BEFORE or each < np.sort(before)[BEFORE // 2] + OUTLIER_SD * se[k]
    return ~binary_dilation(~own, iterations=BESIDE)


def _covariance(left):
    """Covariance of the means (places, places), from what is left of them (rows, places).

    The correlation depends on how far places are apart. It is that of sums over stretches of
    time, since errors last over frames, a codec's most of all.
    """
    seen, squares = np.isfinite(left).sum(axis=0), np.nansum(left**2, axis=0)
    usual = squares.sum() / seen.sum()
    sd = np.sqrt((squares + FEWEST_ROWS * usual) / (seen + FEWEST_ROWS) + ROUNDING**2)
    part = np.nan_to_num(left / sd) / np.sqrt(seen)
    sums = [each.sum(axis=0) for each in np.array_split(part, STRETCHES)]
    shared = sum(np.correlate(each, each, "full")[len(seen) - 1 :] for each in sums)
    shared *= STRETCHES / (STRETCHES - 1)
    shared[0] = MORE * max(shared[0], np.sum(part**2), LEAST_SHARED)
    return toeplitz(shared) / len(seen) * np.outer(sd, sd) / np.sqrt(np.outer(seen, seen))


def _fits(at, thickness, covariance, apex):
    """Tips [px] that may be (tips,), and the posterior weights (tips, shares).

    A column for each of the shares that a codec may show, those of `_odds_erased`.

    apex : of the cone, beyond the tip [px]. The thickness per length is eliminated.
    """
    whiten = solve_triangular(np.linalg.cholesky(covariance), np.eye(len(at)), lower=True)
    seen = whiten @ thickness
    tips = np.arange(-LEAST_PX, at[-1], APART_PX)
    misfit, usual = _misfits(tips, APART_PX, at, whiten, seen, apex)
    likely = tips[misfit.min(axis=1) < misfit.min() + UNLIKELY * usual]  # finer steps about these
    first, end = max(likely[0] - APART_PX, tips[0]), min(likely[-1] + APART_PX, at[-1])
    tips = np.arange(first, end, STEP_PX)
    misfit, usual = _misfits(tips, STEP_PX, at, whiten, seen, apex)
    weight = np.exp(-0.5 * (misfit - misfit.min()) / usual)
    return tips, weight / weight.sum()


def _misfits(tips, step, at, whiten, seen, apex):
    """Squared misfits (tips, shares) of whiskers with these tips, `step` [px] apart.

    And the usual square of one place, at least 1.
    `seen` is the thickness, and `whiten` what makes its errors independent, of variance one.
    """
    # places are whole steps apart: each shape is computed once, and seen shifted from each place
    shift = np.rint((at[-1] - at) / step).astype(int)
    inside = tips[0] - at[-1] + step * np.arange(len(tips) + shift[0])
    cone = np.maximum(inside + apex, 0.0)
    shapes = (cone * ndtr(inside / BLUR_PX))[:, None] * -np.expm1(-_shares(cone))
    shape = shapes[shift[:, None] + np.arange(len(tips))].reshape(len(at), -1)
    along, square = seen @ whiten @ shape, ((whiten @ shape) ** 2).sum(axis=0)
    scale = np.maximum(along, 0.0) / np.maximum(square, 1e-12)
    misfit = (seen @ seen - 2 * scale * along + scale**2 * square).reshape(len(tips), -1)
    return misfit, max(misfit.min() / len(at), 1.0)


def _shares(distance):
    """(Distance from the apex/FAINT_PX)^POWERS, (distances, shares): of what a codec shows."""
    return np.hstack([(distance[:, None] / FAINT_PX) ** power for power in POWERS])


def _odds_erased(apex):
    """Odds (shares,) that a codec erases the whisker LAST_PX before its tip."""
    shares = _shares(np.array([apex + LAST_PX]))[0]
    return np.exp(-shares) / -np.expm1(-shares)
