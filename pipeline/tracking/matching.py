"""Which line is which whisker, by where it leaves the face, its angle, thickness and length.

Whiskers whisk together: between two frames all angles change by about the same amount, which is
estimated first. The remaining differences are compared whisker by whisker, and lines are assigned
to whiskers so that all together fit best.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import linear_sum_assignment

from pipeline.detection.line import Line
from pipeline.detection.static_scene import OUTWARD
from pipeline.detection.tracing_options import TracingOptions
from pipeline.numerics.angles import wrap_angle

THICKNESS_SD, LENGTH_SD = 0.35, 0.35  # of their logarithms
FARTHEST = 3.0  # standard deviations in one feature count as no more
MISFIT = 10.0  # a line less like a whisker than this (sum of squares) is another one
SHIFTS = np.radians(np.arange(-60, 61, 4))  # tried changes of all angles
MOST_TRIED = 4  # of them, for which lines are assigned
SHIFT_SD = np.radians(30.0)  # of the common change
PLACE, ANGLE, THICKNESS, LENGTH = range(4)


@dataclass(frozen=True)
class Ruler:
    """Directions of the face and lengths in pixels, with which lines get their signatures."""

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
                # something may hide a tip: a line that is too short is less odd than one that is
                # too long
                if k == LENGTH and off < 0:
                    off *= 0.5
                square = off * off
                if k >= THICKNESS:
                    square = min(square, FARTHEST**2 / 2)
                if not np.isnan(square):
                    total += square
            for s in range(len(shifts)):
                left = wrap_angle(turn - shifts[s])
                out[s, i, j] = total + (left / sd[ANGLE]) ** 2
    return out


@dataclass(frozen=True)
class Match:
    """Assignment of lines to whiskers.

    Attributes
    ----------
    pairs : numbers (line, whisker)
    misfit : of each pair, as in `misfits`
    shift : of all angles [rad]
    gain : how much better this fits than no pair at all
    """

    pairs: list
    misfit: np.ndarray
    shift: float
    gain: float


def match(seen, known, sd) -> Match:
    """Assign lines to whiskers so that all fit best, at the best common shift of their angles.

    The larger the shift, the better they must fit.
    """
    best = Match([], np.empty(0), 0.0, -np.inf)
    if not len(seen) or not len(known):
        return best
    # only the most promising shifts are tried, by an upper bound: as if lines could share whiskers
    nearest = misfits(seen, known, sd, SHIFTS).min(axis=-1)
    most = (MISFIT - np.minimum(nearest, MISFIT)).sum(axis=-1)
    most -= (SHIFTS / SHIFT_SD) ** 2
    for shift in SHIFTS[np.argsort(-most, kind="stable")[:MOST_TRIED]]:
        for _ in range(2):
            found = _assigned(seen, known, sd, shift)
            if found.gain > best.gain:
                best = found
            if not found.pairs:
                break
            lines, whiskers = np.array(found.pairs).T
            shift = _common_turn(seen[lines], known[whiskers])
    return best


def _assigned(seen, known, sd, shift) -> Match:
    cost = misfits(seen, known, sd, [shift])[0]
    lines, whiskers = linear_sum_assignment(np.minimum(cost, MISFIT))
    keep = cost[lines, whiskers] < MISFIT
    lines, whiskers = lines[keep], whiskers[keep]
    chosen = cost[lines, whiskers]
    pairs = list(zip(lines, whiskers, strict=True))
    return Match(pairs, chosen, shift, _gain(chosen, shift))


def _gain(misfit, turn) -> float:
    return float((MISFIT - np.minimum(misfit, MISFIT)).sum() - (turn / SHIFT_SD) ** 2)


def _common_turn(seen, known) -> float:
    """Median change of angle from `known` to `seen`, row by row [rad]."""
    turn = seen[:, ANGLE] - known[:, ANGLE]
    return float(np.median(wrap_angle(turn)))
