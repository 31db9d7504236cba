"""The two sides of a face: rows of whiskers that grow apart, and turn against each other."""

from dataclasses import dataclass

import numpy as np

from pipeline.identity.features import Dial, line_features
from pipeline.session.parameters import DEFAULTS

FEWEST = 3  # whiskers on a side
NAMES = {"top": ("left", "right"), "bottom": ("left", "right")}
UPRIGHT = ("upper", "lower")


@dataclass(frozen=True)
class Sides:
    """One row of whiskers, or two.

    Attributes
    ----------
    along : direction along the face, (x, y)
    cuts : place along the face [px] from which on a line is the second row's; none for one row
    dials : the `Dial` of each row
    names : what the whiskers of each row are called, less their number
    """

    along: np.ndarray
    cuts: tuple[float, ...]
    dials: tuple[Dial, ...]
    names: tuple[str, ...]

    @classmethod
    def of(
        cls, roster, ruler, face_side, pixels_per_m, may_be_two, params=DEFAULTS.identity
    ) -> "Sides":
        """The rows in which a roster's whiskers stand.

        Two, where their bases are in two groups far apart that grow away from each other.
        """
        bases = np.array([slot.base_xy for slot in roster], float).reshape(-1, 2)
        along, outward = np.asarray(ruler.along, float), np.asarray(ruler.outward, float)
        ahead = _directions(roster)
        cut = _cut(bases @ along, ahead, params) if may_be_two else None
        if cut is None:
            dial = Dial.of(bases, along, outward, pixels_per_m, params)
            return cls(along, (), (dial,), ("w",))
        second = bases @ along > cut
        dials = []
        for own in (~second, second):
            out = ahead[own].mean(axis=0)
            out /= np.hypot(*out)
            across = np.array([out[1], -out[0]])
            across *= -np.sign(outward @ across or 1.0)  # from the snout to the back of the head
            dials.append(Dial.of(bases[own], across, out, pixels_per_m, params))
        names = tuple(f"{name}_w" for name in NAMES.get(face_side, UPRIGHT))
        return cls(along, (cut,), tuple(dials), names)

    def features(self, lines):
        """Row of every line (lines,), from 0, and its features (lines, 6)."""
        first = lines.offsets[:-1]
        place = lines.x_px[first] * self.along[0] + lines.y_px[first] * self.along[1]
        row = np.searchsorted(self.cuts, place) if self.cuts else np.zeros(len(place), int)
        each = [line_features(lines, dial) for dial in self.dials]
        return row, np.choose(row[:, None], each)


def _directions(roster):
    """Unit vectors (whiskers, 2) from base to tip, of each whisker's sample lines."""
    chords = [np.sum([line.points[-1] - line.points[0] for line in s.samples], 0) for s in roster]
    chords = np.array(chords, float).reshape(-1, 2)
    return chords / np.maximum(np.hypot(*chords.T), 1e-9)[:, None]


def _cut(places, ahead, params) -> float | None:
    """Middle of the gap between two sides, None where there is one side only."""
    order = np.argsort(places)
    inner = range(FEWEST, len(places) - FEWEST + 1)
    gaps = {k: places[order[k]] - places[order[k - 1]] for k in inner}
    if not gaps or max(gaps.values()) < params.side_gap * np.ptp(places):
        return None
    k = max(gaps, key=gaps.get)
    one, other = (ahead[part].mean(axis=0) for part in (order[:k], order[k:]))
    cosine = one @ other / max(np.hypot(*one) * np.hypot(*other), 1e-9)
    if cosine > np.cos(np.radians(params.sides_apart_deg)):
        return None
    return float(places[order[k - 1 : k + 1]].mean())
