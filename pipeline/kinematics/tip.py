"""Where a whisker's tip is: the mean over many frames of what lies beyond the ends of its traces.

A trace ends where the thin tip drowns in the noise of its frame, or where a codec has erased it.
On average over the frames, the whisker is seen beyond: its thickness (`detection/line_end.py`)
falls as a cone's does, and then, at the tip, to nothing. A codec erases more of the tip in one
frame than in another, so that the mean fades out before the tip: how far before, the breadth of
this fading shows.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from pipeline.detection.line_end import PLACES_PX
from pipeline.kinematics.stations import Stations
from pipeline.numerics.runs import evenly
from whiskermodel.whisker import Whisker

MOST_ROWS = 1000  # whose ends are averaged
FEWEST_ROWS = 3  # in which a place along the whisker must be seen
SHARED_FRAMES = 2.0  # neighbouring frames have their errors in common
OUTLIER_SD = 3.0  # another whisker's, or dust's: cut to so many
BLUR_PX = 1.5  # of the tip: optics, and frames whose arc lengths differ
FADING_PX = np.geomspace(0.1, 20.0, 16)  # SD of what a codec erases
# mean of what a codec erases and the error of that, in such SDs; measured on rendered videos
ERASED, ERASED_SD = 0.8, 0.25
STEP_PX = 0.25
ROUNDING = float(np.finfo(np.float16).eps)  # of a thickness of 1 px, as it is kept
LEAST_PX = 10.0  # how far before the mean end the tip may be


class Tip(NamedTuple):
    """How far the tip is beyond the mean end of the traces, and the standard error of that [m]."""

    beyond: float
    se: float


def tip_beyond(places: Stations, whisker: Whisker) -> Tip | None:
    """Place of the tip of a whisker; None where its lines' ends are not known.

    places : rows whose trace ends near the tip
    """
    rows = evenly(len(places), MOST_ROWS)
    shift = (places.last[rows] - places.last.mean()) / places.pixel
    at, *seen = _mean_thickness(places.end_px[rows].astype(float), shift)
    if at.max(initial=0) <= 0:
        return None
    apex = (whisker.cone_length - whisker.length) / places.pixel
    tip, fading, weight = _fits(at, *seen, apex)
    beyond = weight @ tip
    se = np.sqrt(weight @ (tip - beyond) ** 2 + (ERASED_SD * weight @ fading) ** 2)
    return Tip(beyond * places.pixel, se * places.pixel)


def _mean_thickness(tail, shift):
    """Places from the mean end [px] where enough rows are seen, mean thickness there, its error.

    tail : (rows, places) thickness [px] about the end of each row, which is `shift` [px] beyond
        the mean
    """
    place = np.rint(PLACES_PX + shift[:, None]).astype(int)
    first = place.min(initial=0)
    table = np.full((len(tail), place.max(initial=0) - first + 1), np.nan)
    np.put_along_axis(table, place - first, tail, axis=1)
    seen = np.isfinite(table).sum(axis=0)
    kept = np.flatnonzero(seen >= FEWEST_ROWS)
    table, seen = table[:, kept], seen[kept]
    usual = np.nanmedian(table, axis=0)
    limit = OUTLIER_SD * 1.4826 * np.nanmedian(np.abs(table - usual), axis=0)
    table = np.clip(table, usual - limit, usual + limit)
    noise = np.sqrt(np.mean(np.nanvar(table, axis=0)) + ROUNDING**2) if len(kept) else np.nan
    return first + kept, np.nanmean(table, axis=0), noise * np.sqrt(SHARED_FRAMES / seen)


def _fits(at, thickness, error, apex):
    """Tips and breadths of fading [px] that may be, and their posterior weights; each (fits,).

    apex : of the cone, beyond the tip [px]. The thickness per length is eliminated.
    """
    tips = np.arange(-LEAST_PX, at[-1], STEP_PX)
    tip, fading = (each.ravel() for each in np.meshgrid(tips, FADING_PX, indexing="ij"))
    inside = tip[:, None] - at
    left = ndtr((inside - ERASED * fading[:, None]) / np.hypot(BLUR_PX, fading)[:, None])
    shape = np.maximum(inside + apex, 0.0) * left / error
    seen = thickness / error
    square = np.einsum("kj,kj->k", shape, shape)
    scale = np.maximum(shape @ seen, 0.0) / np.maximum(square, 1e-12)
    misfit = seen @ seen - 2 * scale * (shape @ seen) + scale**2 * square
    usual = max(misfit.min() / len(at), 1.0)
    weight = np.exp(-0.5 * (misfit - misfit.min()) / usual)
    return tip, fading, weight / weight.sum()
