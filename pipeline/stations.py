"""Centrelines boiled down to places at fixed arc lengths, and to their distance from the pole.

A chunk of centrelines goes in, some sixty numbers per whisker and frame come out, so that the
mechanics of a long video fits in memory. Metres, y up, counter-clockwise positive.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numba import njit

from pipeline.records import Centrelines, PoleTrack, Recording
from whiskermodel.whisker import Whisker

N_STATIONS = 73  # over the whisker's length: 0.25 mm apart on a mouse's C2
FUR_CLINGS_M = 0.4e-3  # first visible part that is not used
POLE_BLURS_PX = 6.0  # from the pole's edge on: the trace is drawn towards the dark disc
LONGEST_EXTENSION_M = 1.5e-3  # a trace that ends before the tip is continued straight this far
SHARED = ("names", "spacing", "pole_radius", "file")  # fields that are not one per row
END_FIT_PX = 12  # the last points, which give the direction of that continuation


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
    distance : (rows,) whisker surface to pole surface [m], negative where they overlap
    nearest : (rows,) arc length of the point nearest to the pole [m]
    side : (rows,) +1 where the pole is on the side of the whisker's normal, −1; 0 without pole
    extended : (rows,) bool, the nearest point lies beyond the traced part
    interpolated : (rows,) bool, the codec made the frame out of frames before and after
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
    distance: np.ndarray
    nearest: np.ndarray
    side: np.ndarray
    extended: np.ndarray
    interpolated: np.ndarray

    def __len__(self):
        return len(self.frame)

    def rather_shown(self, rows, enough) -> np.ndarray:
        """Those of `rows` (numbers) whose frames no codec made up; all, where not `enough` are."""
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
        """Return the same with x, y and information in memory, as here they are."""
        return self


def nominal_whisker(name: str, visible_length: float, hidden_length: float) -> Whisker:
    """Return a stand-in of mouse-like proportions for a whisker whose dimensions are unknown.

    Contacts can be told with it (they do not depend on its stiffness), forces cannot.
    """
    length = 1.03 * visible_length + hidden_length
    radius = 37e-6 * length / 18e-3
    return Whisker(length=length, cone_length=length / 0.95, base_radius=radius, name=name)


def measure_stations(
    centrelines: Centrelines,
    recording: Recording,
    whiskers,
    hidden_lengths,
    pole: PoleTrack | None = None,
    interpolated=frozenset(),
) -> Stations:
    """Places at fixed arc lengths, and distance to the pole, of every row of `centrelines`.

    Parameters
    ----------
    centrelines : a chunk or all of a video
    recording : scale
    whiskers : one `Whisker` per name in `centrelines.names`
    hidden_lengths : follicle to first visible point, one per name [m]; used where the
        centrelines do not bring their own
    pole : centre per frame number (or one for all), radius; None where there is none
    interpolated : numbers of the frames that the codec made out of others, as `Video` has them

    Returns
    -------
    Stations
    """
    names = centrelines.names
    if len(whiskers) != len(names) or len(hidden_lengths) != len(names):
        raise ValueError(
            f"whiskers and hidden_lengths must have one entry per name {names}, "
            f"got {len(whiskers)} and {len(hidden_lengths)}"
        )
    scale = recording.pixels_per_m
    spacing = np.array([w.length for w in whiskers]) / (N_STATIONS - 1)
    pole_x, pole_y, pole_radius = pole_rows = _pole_rows(pole, centrelines.frame)
    x, y, information, near = _measure_px(
        centrelines, whiskers, hidden_lengths, spacing, pole_rows, scale
    )
    return Stations(
        names=names,
        spacing=spacing,
        frame=np.asarray(centrelines.frame, np.int64),
        whisker=np.asarray(centrelines.whisker, np.int64),
        x=x / scale,
        y=y / scale,
        information=np.nan_to_num(information) * scale**2,
        first=near[:, 0] / scale,
        last=near[:, 1] / scale,
        origin=np.zeros(len(centrelines)),
        pole_x=pole_x / scale,
        pole_y=-pole_y / scale,
        pole_radius=pole_radius / scale,
        distance=near[:, 2] / scale,
        nearest=near[:, 3] / scale,
        side=np.nan_to_num(near[:, 4]).astype(np.int64),
        extended=near[:, 5] == 1,
        interpolated=np.array([f in interpolated for f in centrelines.frame.tolist()], bool),
    )


def _measure_px(centrelines, whiskers, hidden_lengths, spacing, pole_rows, scale):
    """Stations' x, y and information, (rows, stations) each, and `near` of every row [px].

    `near` (rows, 6): first and last traced point, then what `_approach` tells of the pole.
    """
    rows = len(centrelines)
    pole_x, pole_y, pole_radius = pole_rows
    x, y, information = np.full((3, rows, N_STATIONS), np.nan)
    near = np.full((rows, 6), np.nan)
    radii = np.array([[w.base_radius, w.base_radius / w.cone_length] for w in whiskers])
    _measure_rows(
        centrelines.offsets,
        *_raw_points(centrelines),
        *(np.ascontiguousarray(c, float) for c in (centrelines.x_px, -centrelines.y_px)),
        centrelines.whisker.astype(np.int64),
        centrelines.hidden_of(np.asarray(hidden_lengths, float) * scale),
        spacing * scale,
        np.array([w.length for w in whiskers]) * scale,
        radii * np.array([scale, 1.0]),
        pole_x,
        -pole_y,
        pole_radius,
        pole_radius + POLE_BLURS_PX,
        FUR_CLINGS_M * scale,
        LONGEST_EXTENSION_M * scale,
        x,
        y,
        information,
        near,
    )
    return x, y, information, near


def _pole_rows(pole, frame):
    """Pole centre per row and its radius [px]; NaN where there is none."""
    if pole is None:
        return np.full(len(frame), np.nan), np.full(len(frame), np.nan), 0.0
    at = np.minimum(frame, len(pole.x_px) - 1)
    return (
        np.asarray(pole.x_px, float)[at],
        np.asarray(pole.y_px, float)[at],
        float(pole.radius_px),
    )


def _raw_points(centrelines):
    """Unsmoothed offset along the normal [px] and its information [1/px²] of every point."""
    if centrelines.offset_px is None:
        se = np.maximum(centrelines.se_px.astype(float), 1e-3)
        return np.zeros(len(centrelines.x_px)), 1 / se**2
    return centrelines.offset_px.astype(float), centrelines.information.astype(float)


@njit(cache=True)
def _measure_rows(
    offsets, offset, info, xs, ys, whisker, hidden, spacing, length, radii, pole_x, pole_y,
    pole_radius, clear, skip, extension, out_x, out_y, out_information, near,
):  # fmt: skip
    for row in range(len(offsets) - 1):
        a, b = offsets[row], offsets[row + 1]
        out_information[row, :] = 0.0
        if b - a < 2 * END_FIT_PX + 1:
            continue
        w = whisker[row]
        x, y = xs[a:b], ys[a:b]
        s = _arc_lengths(x, y, hidden[row])
        near[row, 0], near[row, 1] = s[0], s[-1]
        px, py = pole_x[row], pole_y[row]
        _bin(
            x, y, s, offset[a:b], info[a:b], hidden[row] + skip, spacing[w], px, py, clear,
            out_x[row], out_y[row], out_information[row],
        )  # fmt: skip
        if not np.isnan(px):
            more = min(max(length[w] - s[-1], 0.0), extension)
            _approach(x, y, s, more, px, py, pole_radius, radii[w, 0], radii[w, 1], near[row, 2:])


@njit(cache=True)
def _arc_lengths(x, y, first):
    s = np.empty(len(x))
    s[0] = first
    for i in range(1, len(x)):
        s[i] = s[i - 1] + np.hypot(x[i] - x[i - 1], y[i] - y[i - 1])
    return s


@njit(cache=True)
def _bin(x, y, s, offset, info, start, spacing, px, py, clear, out_x, out_y, out_information):
    """Weighted mean of the raw points around every station, moved along the whisker to it."""
    n = len(out_x)
    sums = np.zeros((n, 8))  # information, x, y, s, tangent, s², curvature
    for i in range(len(x)):
        k = int(s[i] / spacing + 0.5)
        if s[i] < start or k >= n or not info[i] > 0:
            continue
        if (x[i] - px) ** 2 + (y[i] - py) ** 2 < clear * clear:
            continue
        p, q = max(i - 1, 0), min(i + 1, len(x) - 1)
        tx, ty = x[q] - x[p], y[q] - y[p]
        norm = max(np.hypot(tx, ty), 1e-9)
        tx, ty = tx / norm, ty / norm
        rx, ry = x[i] - offset[i] * ty, y[i] + offset[i] * tx
        kappa = _curvature(x, y, i)
        for j, value in enumerate((1.0, rx, ry, s[i], tx, ty, s[i] ** 2, kappa)):
            sums[k, j] += info[i] * value
    for k in range(n):
        total = sums[k, 0]
        if total > 0:
            mean = sums[k] / total
            along = k * spacing - mean[3]
            # points of an arc lie, in the mean, inside of it
            inside = mean[7] * (mean[6] - mean[3] ** 2 - along**2) / 2
            out_x[k] = mean[1] + along * mean[4] + inside * mean[5]
            out_y[k] = mean[2] + along * mean[5] - inside * mean[4]
            out_information[k] = total


@njit(cache=True)
def _curvature(x, y, i):
    """Curvature of the line over END_FIT_PX points either side of point `i`."""
    i = min(max(i, END_FIT_PX), len(x) - 1 - END_FIT_PX)
    ax, ay = x[i] - x[i - END_FIT_PX], y[i] - y[i - END_FIT_PX]
    bx, by = x[i + END_FIT_PX] - x[i], y[i + END_FIT_PX] - y[i]
    a, b = np.hypot(ax, ay), np.hypot(bx, by)
    return 2 * (ax * by - ay * bx) / (a * b * (a + b))


@njit(cache=True)
def _approach(x, y, s, more, px, py, pole_radius, base_radius, taper, out):
    """Least distance between the surfaces, its arc length, the pole's side, beyond the trace?"""
    n = len(x)
    best = np.inf
    for i in range(n):
        if i < n - 1:
            ex, ey = x[i + 1] - x[i], y[i + 1] - y[i]
        else:
            m = n - 1 - END_FIT_PX
            norm = np.hypot(x[i] - x[m], y[i] - y[m])
            ex, ey = more * (x[i] - x[m]) / norm, more * (y[i] - y[m]) / norm
        squared = ex * ex + ey * ey
        if squared <= 0:
            continue
        t = min(max(((px - x[i]) * ex + (py - y[i]) * ey) / squared, 0.0), 1.0)
        dx, dy = px - x[i] - t * ex, py - y[i] - t * ey
        at = s[i] + t * np.sqrt(squared)
        gap = np.hypot(dx, dy) - pole_radius - max(base_radius - taper * at, 0.0)
        if gap < best:
            best = gap
            out[0], out[1] = gap, at
            out[2] = 1.0 if ex * dy - ey * dx >= 0 else -1.0
            out[3] = 1.0 if i == n - 1 else 0.0
