"""How the lines of every whisker look in a video, learned from all of its frames.

All whiskers whisk together: the place, angle and bend of each one follow one number per frame, the
phase of the whisk. What this does not explain is small, and is modelled as a standard deviation
for each whisker and feature.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from pipeline.identity.features import ANGLE, N_FEATURES
from pipeline.numerics.angles import wrap_angle
from pipeline.numerics.robust import MAD_TO_SD

FARTHEST = np.array([3.0, 6.0, 3.0, 3.0, 3.0, 3.0])  # SDs: a larger deviation costs no more
MOST_SD = 1.5  # of the median whisker's SD: a wider one mixes several whiskers
UNSEEN = 0.5  # cost of a feature that a line does not show
FEWEST = 12  # lines needed to fit how a feature varies with the phase
ENOUGH = 600  # lines of a whisker that are fitted, spread over the video
BLOCK = 256  # rows that are looked at together
LEAST_SLOPE = 0.5  # of a whisker's angle with the phase


@dataclass(frozen=True)
class FanModel:
    """Per whisker and feature: value at phase 0, slope with the phase, standard deviation.

    Attributes
    ----------
    middle, slope, sd : (whiskers, features)
    least_sd : (features,)
    """

    middle: np.ndarray
    slope: np.ndarray
    sd: np.ndarray
    least_sd: np.ndarray

    def fitted(self, features, whisker, phase, weight) -> "FanModel":
        """The model of lines (rows, 6) of known whiskers, phases and weights, (rows,) each."""
        out = replace(self, middle=self.middle.copy(), slope=self.slope.copy(), sd=self.sd.copy())
        appearance = out.middle, out.slope, out.sd
        _fit(features, whisker, np.asarray(phase, float), weight, self.least_sd, *appearance)
        known = np.isfinite(out.middle).any(axis=1)
        most = MOST_SD * np.median(out.sd[known], axis=0) if known.any() else np.inf
        return replace(out, sd=np.minimum(out.sd, most))

    def costs(self, features, phase) -> np.ndarray:
        """Minus log likelihood of lines (rows, 6) at phases (rows,) as every whisker."""
        phase = np.asarray(phase, float)
        return _costs(features, phase, self.middle, self.slope, self.sd, self.least_sd)

    def phases_of(self, angle, whisker, starts) -> np.ndarray:
        """Phase of every frame, from the angles (rows,) and names (rows,) of its lines."""
        slope = np.maximum(self.slope[whisker, ANGLE], LEAST_SLOPE)
        off = wrap_angle(angle - self.middle[whisker, ANGLE]) / slope
        return medians(off, np.asarray(starts))


@njit(cache=True)
def medians(values, starts):
    """Median of each part of `values`, from one of the `starts` to the next, without NaN."""
    out = np.full(len(starts) - 1, np.nan)
    for k in range(len(out)):
        part = values[starts[k] : starts[k + 1]]
        part = part[~np.isnan(part)]
        if len(part):
            out[k] = np.median(part)
    return out


@njit(cache=True)
def _costs(features, phase, middle, slope, sd, least_sd):
    """Costs (rows, whiskers) as in `FanModel.costs`, of BLOCK rows at a time."""
    out, most = np.empty((len(features), len(middle))), 0.5 * FARTHEST**2
    wide, per_sd = np.log(sd / least_sd), 1.0 / sd
    values, off, cost = np.empty((N_FEATURES, BLOCK)), np.zeros(BLOCK), np.empty(BLOCK)
    for first in range(0, len(out), BLOCK):
        n = min(len(out) - first, BLOCK)
        for i in range(n):
            for j in range(N_FEATURES):
                values[j, i] = features[first + i, j]
        for k in range(len(middle)):
            cost[:] = 0.0
            for j in range(N_FEATURES):
                if np.isnan(middle[k, j]):  # never seen of this whisker
                    off[:] = 0.0
                    _add_costs(values[j], off, n, 0.0, most[j], most[j], cost)
                    continue
                _lay_off(values[j], phase[first:], n, middle[k, j], slope[k, j], off)
                if j == ANGLE:
                    _wrap(off, n)
                _add_costs(values[j], off, n, per_sd[k, j], wide[k, j], most[j], cost)
            for i in range(n):
                out[first + i, k] = cost[i]
    return out


@njit(cache=True)
def _lay_off(values, phase, n, middle, slope, off):
    """Fill `off` with the first `n` values less those of a whisker at these phases."""
    for i in range(n):
        off[i] = values[i] - middle - slope * phase[i]


@njit(cache=True)
def _wrap(off, n):
    """Bring the first `n` angles between −π and π, where any lies beyond."""
    beyond = 0
    for i in range(n):
        beyond += abs(off[i]) > np.pi
    if beyond > 0:
        for i in range(n):
            if abs(off[i]) > np.pi:
                off[i] = wrap_angle(off[i])


@njit(cache=True)
def _add_costs(values, off, n, per_sd, wide, most, cost):
    """Add the costs of the first `n` values, which deviate by `off`; UNSEEN where they are NaN."""
    for i in range(n):
        scaled = off[i] * per_sd
        square = 0.5 * (scaled * scaled)
        known = (square if square < most else most) + wide
        cost[i] += UNSEEN if np.isnan(values[i]) else known


@njit(cache=True)
def _fit(features, whisker, phase, weight, least_sd, middle, slope, sd):
    """Fill `middle`, `slope` and `sd`, (whiskers, 6), where enough lines are known."""
    for k in range(len(middle)):
        own = np.flatnonzero(whisker == k)
        own = own[:: 1 + len(own) // ENOUGH]
        for j in range(N_FEATURES):
            good = own[np.isfinite(features[own, j]) & np.isfinite(phase[own])]
            if len(good) >= FEWEST:
                line = _robust_line(phase[good], features[good, j], weight[good], least_sd[j])
                middle[k, j], slope[k, j], sd[k, j] = line


@njit(cache=True)
def weighted_median(values, weight):
    """Weighted median, by quickselect: the part that holds it is split again and again."""
    own, share = values.copy(), weight.copy()
    first, last, below, half = 0, len(own) - 1, 0.0, 0.5 * share.sum()
    while first < last:
        middle, i, j, under = own[(first + last) // 2], first, last, below
        while i <= j:
            while own[i] < middle:
                under += share[i]
                i += 1
            while own[j] > middle:
                j -= 1
            if i <= j:
                own[i], own[j], share[i], share[j] = own[j], own[i], share[j], share[i]
                under += share[i]
                i, j = i + 1, j - 1
        # values up to j are at most the pivot, from i on at least; one between equals it
        upto = under - share[i - 1] if i - 1 > j else under
        if upto >= half:
            last = j
        elif under >= half:
            return middle
        else:
            first, below = i, under
    return own[first]


@njit(cache=True)
def _robust_line(x, y, weight, least_sd):
    """Value at 0, slope and SD of y over x: weighted least squares without outliers."""
    keep, off = np.ones(len(x), np.bool_), np.empty(len(x))
    middle, slope, sd = 0.0, 0.0, least_sd
    for _ in range(6):
        mean, level, slope = _weighted_line(x, y, weight, keep)
        middle = level - slope * mean
        for i in range(len(x)):
            off[i] = y[i] - middle - slope * x[i]
        centre = weighted_median(off[keep], weight[keep])
        sd = max(MAD_TO_SD * weighted_median(np.abs(off - centre), weight), least_sd)
        again = np.abs(off) < 2.5 * sd
        if again.sum() < FEWEST // 2 or np.array_equal(again, keep):
            break
        keep = again
    return middle, slope, sd


@njit(cache=True)
def _weighted_line(x, y, weight, keep):
    """Weighted means of x and y, and slope of y over x, of the points to `keep`."""
    total, mean, level, square, both = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        if keep[i]:
            total += weight[i]
            mean += weight[i] * x[i]
            level += weight[i] * y[i]
    mean, level = mean / total, level / total
    for i in range(len(x)):
        if keep[i]:
            off = weight[i] / total * (x[i] - mean)
            square += off * (x[i] - mean)
            both += off * (y[i] - level)
    square = max(square, 1e-6)
    return mean, level, both / (square + 0.02 * 0.05**2 / square)
