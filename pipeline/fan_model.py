"""How the lines of every whisker look in a video, learned from all of its frames.

Whiskers whisk together: a whisker's place, angle and bend go with one number per frame, the
phase of the whisk. What is left beside that is small, and differs from whisker to whisker.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit

from pipeline.line_features import ANGLE, N_FEATURES

FARTHEST = 3.0  # standard deviations in one feature count as no more
UNSEEN = 0.5  # cost of a feature that a line does not show
SHIFTS = np.radians([0.0, -6.0, 6.0, -12.0, 12.0])  # of the phase, tried around the first guess
FEWEST = 12  # lines that tell how a feature goes with the phase
AT_ONCE = 20000  # rows, to keep memory small
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

    def fitted(self, features, whisker, phase) -> "FanModel":
        """The model of lines (rows, 6) of known whiskers (rows,) and phases (rows,)."""
        out = replace(self, middle=self.middle.copy(), slope=self.slope.copy(), sd=self.sd.copy())
        for k in range(len(self.middle)):
            own = whisker == k
            for j in range(N_FEATURES):
                y, p = features[own, j], phase[own]
                good = np.isfinite(y) & np.isfinite(p)
                if good.sum() >= FEWEST:
                    line = _robust_line(p[good], y[good], self.least_sd[j])
                    out.middle[k, j], out.slope[k, j], out.sd[k, j] = line
        return out

    def costs(self, features, phase) -> np.ndarray:
        """Minus log likelihood of lines (rows, 6) at phases (rows,) as every whisker."""
        phase = np.asarray(phase)
        out = np.empty((len(features), len(self.middle)))
        for first in range(0, len(features), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            out[part] = self._costs(features[part], phase[part])
        return out

    def _costs(self, features, phase):
        expected = self.middle + self.slope * phase[:, None, None]
        off = features[:, None, :] - expected
        off[..., ANGLE] = _wrapped(off[..., ANGLE])
        each = 0.5 * np.minimum((off / self.sd) ** 2, FARTHEST**2)
        each += np.log(self.sd / self.least_sd)
        strange = np.isfinite(features[:, None, :]) & ~np.isfinite(expected)
        each[strange] = 0.5 * FARTHEST**2
        return np.where(np.isfinite(each), each, UNSEEN).sum(axis=-1)

    def phases(self, features, starts, guess) -> np.ndarray:
        """Phase of every frame at which its lines, each by itself, look most like whiskers.

        starts : first row of every frame, and the number of rows
        guess : (frames,) phases to look around
        """
        counts = np.diff(starts)
        rows_of = np.repeat(np.arange(len(counts)), counts)
        total = np.array([
            np.add.reduceat(self.costs(features, (guess + s)[rows_of]).min(axis=1), starts[:-1])
            for s in SHIFTS
        ])  # fmt: skip
        phase = guess + SHIFTS[np.argmin(total, axis=0)]
        for _ in range(2):
            whisker = self.costs(features, phase[rows_of]).argmin(axis=1)
            phase = self.phases_of(features[:, ANGLE], whisker, starts)
        return phase

    def phases_of(self, angle, whisker, starts) -> np.ndarray:
        """Phase of every frame from its lines' angles (rows,) and names (rows,)."""
        slope = np.maximum(self.slope[whisker, ANGLE], LEAST_SLOPE)
        off = _wrapped(angle - self.middle[whisker, ANGLE]) / slope
        spans = pairwise(starts)
        return np.array([np.median(off[a:b]) for a, b in spans])


@njit(cache=True)
def _robust_line(x, y, least_sd):
    """Value at 0, slope, SD of y over x: least squares, what lies far off left out."""
    keep = np.ones(len(x), np.bool_)
    middle, slope, sd = 0.0, 0.0, least_sd
    for _ in range(6):
        u, v = x[keep], y[keep]
        spread = max(np.std(u), 1e-3)
        n, su, suu = len(u), u.sum(), (u * u).sum() + 0.02 * (0.05 / spread) ** 2 * len(u)
        sv, suv = v.sum(), (u * v).sum()
        slope = (n * suv - su * sv) / (n * suu - su * su)
        middle = (sv - slope * su) / n
        off = y - middle - slope * x
        sd = max(1.4826 * np.median(np.abs(off - np.median(off[keep]))), least_sd)
        again = np.abs(off) < 2.5 * sd
        if again.sum() < FEWEST // 2 or np.array_equal(again, keep):
            break
        keep = again
    return middle, slope, sd


def _wrapped(angle):
    return np.mod(angle + np.pi, 2 * np.pi) - np.pi
