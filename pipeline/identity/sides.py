"""The two sides of a face: rows of whiskers that point and turn in opposite directions."""

from dataclasses import dataclass

import numpy as np

from pipeline.identity.features import Dial, line_features
from pipeline.tracking import two_sides


@dataclass(frozen=True)
class Sides:
    """One row of whiskers, or two.

    Attributes
    ----------
    along : direction along the face, (x, y)
    cuts : place along the face [px] from which on a line is the second row's; none for one row
    dials : the `Dial` of each row
    names : prefix of the names in each row, such as "left_"; "" for one row
    """

    along: np.ndarray
    cuts: tuple[float, ...]
    dials: tuple[Dial, ...]
    names: tuple[str, ...]

    @classmethod
    def of(cls, templates, ruler, face_side, pixels_per_m, may_be_two, params) -> "Sides":
        """The rows in which the templates' whiskers stand."""
        along, outward = np.asarray(ruler.along, float), np.asarray(ruler.outward, float)
        cuts = two_sides.cuts_between(templates, along, params) if may_be_two else ()
        if not cuts:
            bases = np.array([template.base_xy for template in templates], float).reshape(-1, 2)
            dial = Dial.of(bases, along, outward, pixels_per_m, params)
            return cls(along, (), (dial,), ("",))
        dials = []
        for own in two_sides.sides_of(templates, along, cuts):
            across, out = two_sides.row_directions(own, outward)
            bases = np.array([template.base_xy for template in own])
            dials.append(Dial.of(bases, across, out, pixels_per_m, params))
        names = tuple(f"{name}_" for name in two_sides.side_names(face_side))
        return cls(along, cuts, tuple(dials), names)

    def features(self, lines):
        """Row of every line (lines,), from 0, and its features (lines, 6)."""
        first = lines.offsets[:-1]
        place = lines.x_px[first] * self.along[0] + lines.y_px[first] * self.along[1]
        row = two_sides.side_of(place, self.cuts)
        each = [line_features(lines, dial) for dial in self.dials]
        return row, np.choose(row[:, None], each)
