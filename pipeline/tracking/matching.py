"""Which line is which whisker, by where it leaves the face, its angle, thickness and length.

Whiskers whisk together: between two frames all angles change by about the same, which is found
out first. What remains is compared whisker by whisker, and the lines are given out so that all
together fit best.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import linear_sum_assignment

from pipeline.detection.detect import TracingOptions
from pipeline.detection.line import Line
from pipeline.numerics.angles import wrapped

OUTWARD = {"left": (1, 0), "right": (-1, 0), "top": (0, 1), "bottom": (0, -1)}
THICKNESS_SD, LENGTH_SD = 0.35, 0.35  # of their logarithms
FARTHEST = 3.0  # standard deviations in one feature count as no more
MISFIT = 10.0  # a line less like a whisker than this (sum of squares) is another one
WEIGHT = 0.1  # of one look's evidence: errors last for some looks
FRESH = 0.7  # log-odds of the same, at least, where a whisker is found beside another
DOUBT = 1.0  # log-odds, below which it is known who is who
FORGETTING = 0.985  # per look
SURE = 6.0  # log-odds that two whiskers have changed places, to put them back
STEP_LIMIT = 15.0  # log-odds that one frame can bring
FEWEST_BESIDE = 2  # present neighbours from which the place of an absent whisker is inferred
PRIOR_FRAMES = 2  # weight of the general standard deviations beside those of the samples
SHIFTS = np.radians(np.arange(-60, 61, 4))  # tried changes of all angles
MOST_TRIED = 4
SHIFT_SD = np.radians(30.0)
PLACE, ANGLE, THICKNESS, LENGTH = range(4)


@dataclass(frozen=True)
class Ruler:
    """What turns lines into signatures: the face's directions and lengths in pixels."""

    along: np.ndarray
    outward: np.ndarray
    pivot_px: float
    order_px: float
    base_px: int
    sd: np.ndarray

    @classmethod
    def of(cls, face_side: str, options: TracingOptions) -> "Ruler":
        """For a face on one side of the picture."""
        outward = np.array(OUTWARD[face_side], float)
        along = np.abs(outward[::-1])
        hidden = np.median(options.hidden_px) if options.hidden_px else None
        params, px = options.params.tracking, options.px
        angle_sd = np.radians(params.angle_sd_deg)
        sd = np.array([max(px(params.place_sd_mm), 2.0), angle_sd, THICKNESS_SD, LENGTH_SD])
        pivot = px(params.pivot_mm) if hidden is None else hidden
        base = int(max(px(params.base_chord_mm), 20))
        return cls(along, outward, float(pivot), px(params.base_order_mm), base, sd)

    def signature(self, line: Line) -> np.ndarray:
        """Place along the face [px], angle [rad], logs of thickness and length [px]."""
        n = min(line.n - 1, self.base_px)
        base = np.array([line.x[0], line.y[0]])
        chord = np.array([line.x[n], line.y[n]]) - base
        chord /= max(np.hypot(*chord), 1e-9)
        pivot = base - self.pivot_px * chord
        angle = np.arctan2(chord @ self.along, chord @ self.outward)
        thickness = line.thickness[min(10, n // 2) : max(line.n // 2, n)]
        thickness = thickness[np.isfinite(thickness)]
        thick = max(np.median(thickness), 0.02) if len(thickness) else np.nan
        return np.array([pivot @ self.along, angle, np.log(thick), np.log(line.n)])

    def order_place(self, signature) -> float:
        """Place along the face a little outside of the fur, where whiskers lie in order [px]."""
        return float(signature[PLACE] + (self.pivot_px + self.order_px) * np.sin(signature[ANGLE]))

    def signatures(self, lines) -> np.ndarray:
        """One row per line, (lines, 4)."""
        return np.array([self.signature(line) for line in lines]).reshape(-1, 4)


def misfits(seen, known, sd, shifts=(0.0,)) -> np.ndarray:
    """How unlike every line is to every whisker, (shifts, lines, whiskers): a sum of squares.

    seen, known : signatures (lines, 4), (whiskers, 4)
    sd : (4,) their standard deviations
    shifts : changes of all angles since `known` [rad]
    """
    return _misfits(*(np.asarray(a, float) for a in (seen, known, sd, shifts)))


@njit(cache=True)
def _misfits(seen, known, sd, shifts):
    out = np.zeros((len(shifts), len(seen), len(known)))
    for i in range(len(seen)):
        for j in range(len(known)):
            total, turn = 0.0, 0.0
            for k in range(4):
                off = (seen[i, k] - known[j, k]) / sd[k]
                if k == ANGLE:
                    turn = off * sd[k]
                    continue
                # something may hide a tip: a short line is less strange than a long one
                if k == LENGTH and off < 0:
                    off *= 0.5
                square = off * off
                if k >= THICKNESS:
                    square = min(square, FARTHEST**2 / 2)
                if not np.isnan(square):
                    total += square
            for s in range(len(shifts)):
                left = wrapped(turn - shifts[s])
                out[s, i, j] = total + (left / sd[ANGLE]) ** 2
    return out


@dataclass(frozen=True)
class Match:
    """Lines given to whiskers: pairs (line, whisker), their misfits, the shift of all angles."""

    pairs: list
    misfit: np.ndarray
    shift: float
    gain: float


def match(seen, known, sd, shifts=SHIFTS, middle=0.0) -> Match:
    """Give lines to whiskers so that all fit best, with the common shift that suits them most.

    `shifts` [rad] are tried around `middle`; a shift far from it must be worth it.
    """
    best = Match([], np.empty(0), middle, -np.inf)
    if not len(seen) or not len(known):
        return best
    tried = middle + np.asarray(shifts)
    # as if a whisker could have several lines: what comes to nothing even so is not tried
    nearest = misfits(seen, known, sd, tried).min(axis=-1)
    hope = (MISFIT - np.minimum(nearest, MISFIT)).sum(axis=-1)
    hope -= ((tried - middle) / SHIFT_SD) ** 2
    for shift in tried[np.argsort(-hope, kind="stable")[:MOST_TRIED]]:
        for _ in range(2):
            found = _assigned(seen, known, sd, shift, middle)
            if found.gain > best.gain:
                best = found
            if not found.pairs:
                break
            lines, whiskers = np.array(found.pairs).T
            shift = common_turn(seen[lines], known[whiskers])
    return best


def _assigned(seen, known, sd, shift, middle) -> Match:
    cost = misfits(seen, known, sd, [shift])[0]
    lines, whiskers = linear_sum_assignment(np.minimum(cost, MISFIT))
    keep = cost[lines, whiskers] < MISFIT
    lines, whiskers = lines[keep], whiskers[keep]
    chosen = cost[lines, whiskers]
    pairs = list(zip(lines, whiskers, strict=True))
    return Match(pairs, chosen, shift, _gain(chosen, shift - middle))


def _gain(misfit, turn) -> float:
    return float((MISFIT - np.minimum(misfit, MISFIT)).sum() - (turn / SHIFT_SD) ** 2)


def common_turn(seen, known) -> float:
    """Median change of angle from `known` to `seen`, row by row [rad]."""
    turn = seen[:, ANGLE] - known[:, ANGLE]
    return float(np.median(wrapped(turn)))


def crowded(signatures, options: TracingOptions) -> bool:
    """Whether whiskers stand so close that they hide each other, or pass for each other."""
    if len(signatures) < 3:
        return False
    gaps = np.diff(np.sort([signature[PLACE] for signature in signatures]))
    return bool(np.median(gaps) < options.px(options.params.tracking.crowded_mm))


class PairEvidence:
    """Log-odds, for every two neighbours, that each is on the other's line.

    Two whiskers differ in place, angle, thickness and length, as they did when both were seen in
    a sample frame.

    Parameters
    ----------
    samples : per whisker, dict of sample frame → signature (4,)
    ruler : the signatures' standard deviations
    """

    def __init__(self, samples: list[dict], ruler: Ruler, options: TracingOptions):
        n = len(samples)
        self.mean, self.sd, self.pull = np.zeros((3, n, n, 4))
        for i in range(n):
            for j in range(i):
                mean, spread = _difference(samples[i], samples[j], ruler.sd)
                self.mean[i, j], self.mean[j, i] = mean, -mean
                self.sd[i, j] = self.sd[j, i] = np.sqrt(np.diag(spread))
                pull = np.linalg.solve(spread, mean)
                self.pull[i, j], self.pull[j, i] = pull, -pull
        near = np.abs(self.mean[..., PLACE]) < options.px(options.params.tracking.neighbours_mm)
        self.near = near & ~np.eye(n, dtype=bool)
        self.sd[~self.near] = 1.0
        self.log_odds = np.where(self.near, -2 * FRESH, -SURE)
        self.since = np.zeros((n, n), int)

    def look(self, frame: int, seen, found=()) -> list[tuple[int, int, int]]:
        """Take the signatures (whiskers, 4) of a frame, NaN where absent.

        Where one of two whiskers is absent, the other may be on its line. `found`: whiskers that
        were found anew in this frame; what was thought of them does not count any more.

        Returns
        -------
        (one, other, since) of whiskers that have changed places, and from which frame on
        """
        both = self._both(seen)
        step = WEIGHT * np.clip(both + self._one(seen), -STEP_LIMIT, STEP_LIMIT) * self.near
        self.log_odds = np.clip(FORGETTING * self.log_odds + step, -SURE, 2 * SURE)
        self.log_odds[~self.near] = -SURE
        self.since[(step < 0) & (self.log_odds < 0)] = frame
        for k in found:
            self.log_odds[k] = self.log_odds[:, k] = np.clip(both[k], -SURE, SURE) - FRESH
            self.since[k] = self.since[:, k] = frame
        self.log_odds[~self.near] = -SURE
        swaps = []
        limit = np.full(len(seen), SURE)
        limit[list(found)] = FRESH
        limits = np.minimum(limit[:, None], limit[None, :])
        while ((self.log_odds - limits).max(initial=-1.0)) >= 0:
            i, j = np.unravel_index(np.argmax(self.log_odds - limits), self.near.shape)
            swaps.append((int(i), int(j), int(self.since[i, j])))
            self.log_odds[[i, j], :] = self.log_odds[:, [i, j]] = -FRESH
            self.log_odds[~self.near] = -SURE
            self.since[i, j] = self.since[j, i] = frame
        return swaps

    def _both(self, seen):
        """Log-odds of a frame where both are present: their difference has the other's sign.

        A difference far from both means a bad line, whichever whisker it belongs to.
        """
        apart = seen[:, None, :] - seen[None, :, :]
        most = np.abs(self.mean) + self.sd
        return np.nansum(-2 * np.clip(apart, -most, most) * self.pull, axis=-1)

    def _one(self, seen):
        """Log-odds where one is absent: the other is where the absent one should be."""
        out = np.zeros(self.near.shape)
        present = np.isfinite(seen[:, ANGLE])
        for i, j in zip(*np.nonzero(self.near & present[:, None] & ~present), strict=True):
            beside = self.near[j] & present
            beside[i] = False
            if beside.sum() < FEWEST_BESIDE:
                continue
            own, other = (
                np.nanmedian(seen[beside] + self.mean[k, beside], axis=0) for k in (i, j)
            )
            sd = self.sd[i, j]
            gain = 0.5 * (((seen[i] - own) / sd) ** 2 - ((seen[i] - other) / sd) ** 2)
            out[i, j] = out[j, i] = np.nansum(gain)
        return out

    def doubtful(self) -> np.ndarray:
        """Whiskers of which it is not known whether they are on another's line, bool."""
        return (self.log_odds > -DOUBT).any(axis=1)


def _difference(one: dict, other: dict, sd):
    """Mean (4,) and covariance (4, 4) of the difference of two whiskers' signatures."""
    general = np.diag(2 * np.square(sd))
    apart = np.array([one[f] - other[f] for f in sorted(set(one) & set(other))]).reshape(-1, 4)
    apart = apart[np.isfinite(apart).all(axis=1)]
    if len(apart) < 3:
        medians = [np.nanmedian(list(each.values()), axis=0) for each in (one, other)]
        return np.nan_to_num(medians[0] - medians[1]), 2 * general
    off = apart - apart.mean(axis=0)
    spread = (off.T @ off + PRIOR_FRAMES * general) / (len(apart) + PRIOR_FRAMES)
    spread[THICKNESS:] *= 2.0  # both are unreliable where whiskers lie upon each other
    spread[:, THICKNESS:] *= 2.0
    return apart.mean(axis=0), spread
