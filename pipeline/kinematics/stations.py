"""A whisker in every frame as places at fixed arc lengths, and its distance from the pole.

These are some hundred numbers per whisker and frame, so that a long video fits in memory. Metres,
y up, counter-clockwise positive.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from pipeline.scene.dust import INNER

N_STATIONS = 49  # over the whisker's length: 0.375 mm apart on a mouse's C2
BLOCK_ROWS = 2048  # whose places are held in memory at a time
# fields that are not one per row
SHARED = ("names", "spacing", "pole_radius", "pixel", "file", "added_variance")


@dataclass(frozen=True)
class Stations:
    """Every traced whisker and frame of a video (or a chunk of it) as places on a fixed grid.

    Attributes
    ----------
    names : the whiskers' names, which `whisker` indexes
    spacing : (names,) distance between stations [m]; station k is at arc length k·spacing
    frame, whisker : int (rows,)
    x, y : (rows, stations) [m]; NaN where nothing was measured
    information : (rows, stations) [1/m²], of the place across the whisker; 0 where not measured
    first, last : (rows,) arc length of the first and last traced point [m]
    origin : (rows,) [m] to add to all arc lengths, where it turns out that the first traced
        point is farther from the follicle than was thought
    pole_x, pole_y : (rows,) [m], NaN while the pole is not in view
    pole_radius : [m]
    pixel : size of one [m]; the points of a trace are so far apart
    distance : (rows,) whisker surface to pole surface [m], negative where they overlap
    nearest : (rows,) arc length of the point nearest to the pole [m]
    side : (rows,) +1 where the pole is on the side of the whisker's normal, −1; 0 without pole
    extended : (rows,) bool, the nearest point lies beyond the traced part
    interpolated : (rows,) bool, the codec made the frame out of frames before and after
    end_px : (rows, places) thickness about the last traced point [px], NaN where not known
    """

    names: tuple[str, ...]
    spacing: np.ndarray
    frame: np.ndarray
    whisker: np.ndarray
    x: np.ndarray
    y: np.ndarray
    information: np.ndarray
    first: np.ndarray
    last: np.ndarray
    origin: np.ndarray
    pole_x: np.ndarray
    pole_y: np.ndarray
    pole_radius: float
    pixel: float
    distance: np.ndarray
    nearest: np.ndarray
    side: np.ndarray
    extended: np.ndarray
    interpolated: np.ndarray
    end_px: np.ndarray

    def __len__(self):
        return len(self.frame)

    def not_interpolated(self, rows, enough) -> np.ndarray:
        """Those of `rows` (numbers) whose frames no codec interpolated; all, if not `enough`."""
        shown = rows[~self.interpolated[rows]]
        return shown if len(shown) >= enough else rows

    def of(self, name: str) -> "Stations":
        """Return the rows of one whisker, in the order of their frames."""
        rows = np.flatnonzero(self.whisker == self.names.index(name))
        rows = rows[np.argsort(self.frame[rows], kind="stable")]
        return self.rows(rows)

    def rows(self, rows) -> "Stations":
        """Return the given rows (indices, slice or mask)."""
        per_row = {
            f.name: getattr(self, f.name)[rows]
            for f in fields(self)
            if f.name not in SHARED and getattr(self, f.name) is not None
        }
        return replace(self, **per_row)

    def loaded(self) -> "Stations":
        """Return the same: here x, y and information are in memory already."""
        return self

    def with_variance(self, variance) -> "Stations":
        """Return the same with errors of `variance` (stations,) [m²] added to the known ones."""
        return replace(self, information=information_with(self.information, variance))


def information_with(information, variance):
    """Information (rows, stations) [1/m²] of places with an error of `variance` [m²] added."""
    return information / (1 + information * variance)


def variance_of(information) -> np.ndarray:
    """Variances (rows, stations) [m²] of places with `information` [1/m²]; NaN of unseen ones."""
    seen = information > 0
    return np.where(seen, 1 / np.where(seen, information, 1.0), np.nan)


def may_touch(places, near_m) -> np.ndarray:
    """Rows of `Stations` whose traced part is within `near_m` [m] of the pole, bool (rows,)."""
    with np.errstate(invalid="ignore"):
        return (places.side != 0) & (places.distance < near_m) & ~places.extended


def lies_across(places) -> np.ndarray:
    """Rows of `Stations` in which the whisker lies over the pole's inner half, bool (rows,).

    It must have been seen on both sides.
    """
    radius = places.pole_radius
    with np.errstate(invalid="ignore"):
        inner = places.distance < -(1 - INNER) * radius
        both = (places.first < places.nearest - radius) & (places.last > places.nearest + radius)
    return inner & both & ~places.extended
