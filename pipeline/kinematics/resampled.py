"""Centrelines resampled at fixed arc lengths (`Stations`), and their distance from the pole."""

from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.detection.line_end import PLACES_PX
from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics.stations import N_STATIONS, Stations
from pipeline.numerics import polyline
from pipeline.session.parameters import KinematicsParams
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines

PART_ROWS = 100_000  # of a whisker, measured together: more than show how it lies and bends
POLE_BLURS_PX = 6.0  # from the pole's edge on: the trace is drawn towards the dark disc
END_FIT_PX = 12  # the last points, which give the direction of that continuation


class Lines(NamedTuple):
    """The lines of a chunk in flat arrays, for compiled code [px].

    Row k has the nodes `start[k]` to `start[k + 1]`; `x`, `y`, raw `offset` and `information` are
    one per node, `hidden` (length before the first node) and `whisker` one per row.
    """

    start: np.ndarray
    x: np.ndarray
    y: np.ndarray
    offset: np.ndarray
    information: np.ndarray
    hidden: np.ndarray
    whisker: np.ndarray

    @classmethod
    def of(cls, lines: Centrelines, hidden) -> "Lines":
        """Those of `lines`; `hidden` (rows,) [px]."""
        nodes = lines.x_px, lines.y_px, *lines.raw()
        # of one type each: compiled code is compiled again for every other one
        nodes = (np.ascontiguousarray(each, np.float64) for each in nodes)
        return cls(lines.offsets, *nodes, hidden, lines.whisker.astype(np.int64))


class _Whiskers(NamedTuple):
    """By whisker: distance between stations, length and radius at the base [px], and taper."""

    spacing: np.ndarray
    length: np.ndarray
    base_radius: np.ndarray
    taper: np.ndarray


class _Pole(NamedTuple):
    """Centre by row, y up, NaN where there is none, and radius [px].

    Nearer to the centre than `clear` the trace is not relied upon.
    """

    x: np.ndarray
    y: np.ndarray
    radius: float
    clear: float


class _Line(NamedTuple):
    """Nodes of one line, y up: place, arc length, raw offset [px], information [1/px²]."""

    x: np.ndarray
    y: np.ndarray
    s: np.ndarray
    offset: np.ndarray
    information: np.ndarray


class _Places(NamedTuple):
    """What is measured: x, y and information at the stations [px], and of the pole.

    `near` (rows, 6): first and last traced point, then what `_approach` finds.
    """

    x: np.ndarray
    y: np.ndarray
    information: np.ndarray
    near: np.ndarray


def measure_stations(
    centrelines: Centrelines,
    recording: Recording,
    whiskers,
    hidden_lengths,
    pole: PoleTrack | None = None,
    interpolated=frozenset(),
    *,
    params: KinematicsParams,
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
    params : the room's parameters

    Returns
    -------
    Stations
    """
    _check_lengths(centrelines.names, whiskers, hidden_lengths)
    scale = recording.pixels_per_m
    spacing = np.array([w.length for w in whiskers]) / (N_STATIONS - 1)
    pole_x, pole_y, pole_radius = pole_rows = pole_in_rows(pole, centrelines.frame)
    x, y, information, near = _measure_px(
        centrelines, whiskers, hidden_lengths, spacing, pole_rows, scale, params
    )
    return Stations(
        names=centrelines.names,
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
        pixel=1 / scale,
        distance=near[:, 2] / scale,
        nearest=near[:, 3] / scale,
        side=np.nan_to_num(near[:, 4]).astype(np.int64),
        extended=near[:, 5] == 1,
        interpolated=np.array([f in interpolated for f in centrelines.frame.tolist()], bool),
        end_px=_ends(centrelines),
    )


def _ends(centrelines):
    """Thickness about the end of each row, (rows, places)."""
    if centrelines.end_px is None:
        return np.full((len(centrelines), len(PLACES_PX)), np.nan, np.float16)
    return centrelines.end_px


def _check_lengths(names, whiskers, hidden_lengths):
    if len(whiskers) != len(names) or len(hidden_lengths) != len(names):
        raise ValueError(
            f"whiskers and hidden_lengths must have one entry per name {names}, "
            f"got {len(whiskers)} and {len(hidden_lengths)}"
        )


def _measure_px(centrelines, whiskers, hidden_lengths, spacing, pole_rows, scale, params):
    """`_Places` of every row."""
    rows = len(centrelines)
    pole_x, pole_y, pole_radius = pole_rows
    places = _Places(*np.full((3, rows, N_STATIONS), np.nan), np.full((rows, 6), np.nan))
    hidden = centrelines.hidden_of(np.asarray(hidden_lengths, float) * scale)
    length, radius, cone = (
        np.array([getattr(w, name) for w in whiskers], float)
        for name in ("length", "base_radius", "cone_length")
    )
    _measure_rows(
        Lines.of(centrelines, hidden),
        _Whiskers(spacing * scale, length * scale, radius * scale, radius / cone),
        _Pole(pole_x, -pole_y, pole_radius, pole_radius + POLE_BLURS_PX),
        1e-3 * params.station_skip_mm * scale,
        1e-3 * params.extension_mm * scale,
        places,
    )
    return places


def pole_in_rows(pole, frame):
    """Pole centre per row and its radius [px]; NaN where there is none."""
    if pole is None:
        return np.full(len(frame), np.nan), np.full(len(frame), np.nan), 0.0
    x, y = pole.at(frame)
    return np.asarray(x, float), np.asarray(y, float), float(pole.radius_px)


@njit(cache=True)
def _measure_rows(lines, whiskers, pole, skip, extension, places):
    near = places.near
    for row in range(len(lines.start) - 1):
        a, b = lines.start[row], lines.start[row + 1]
        places.information[row, :] = 0.0
        if b - a < 2 * END_FIT_PX + 1:
            continue
        w, hidden = lines.whisker[row], lines.hidden[row]
        x, y = lines.x[a:b], -lines.y[a:b]
        s = _arc_lengths(x, y, hidden)
        line = _Line(x, y, s, lines.offset[a:b], lines.information[a:b])
        near[row, 0], near[row, 1] = s[0], s[-1]
        px, py = pole.x[row], pole.y[row]
        own = places.x[row], places.y[row], places.information[row]
        _bin(line, hidden + skip, whiskers.spacing[w], px, py, pole.clear, own)
        if not np.isnan(px):
            more = min(max(whiskers.length[w] - s[-1], 0.0), extension)
            cone = whiskers.base_radius[w], whiskers.taper[w]
            _approach(line, more, px, py, pole.radius, cone, near[row, 2:])


@njit(cache=True)
def _arc_lengths(x, y, first):
    s = np.empty(len(x))
    polyline.arc_lengths(x, y, len(x), s)
    return s + first


@njit(cache=True)
def _bin(line, start, spacing, px, py, clear, out):
    """Weighted mean of the raw points around every station, moved along the whisker to it.

    Fills `out`: x, y and information, each (stations,).
    """
    x, y, s, info = line.x, line.y, line.s, line.information
    out_x, out_y, out_information = out
    n = len(out_x)
    points = np.empty((5, len(x)))
    _raw_places(x, y, line.offset, points)
    raw_x, raw_y, tangent_x, tangent_y, kappa = (
        points[0], points[1], points[2], points[3], points[4],
    )  # fmt: skip
    total, sum_x, sum_y, sum_s = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    sum_s2, sum_tx, sum_ty, sum_kappa = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    per_station, clear2 = 1 / spacing, clear * clear
    for i in range(len(x)):
        k = int(s[i] * per_station + 0.5)
        if not (start <= s[i] and 0 <= k < n and info[i] > 0):  # nor where one of them is NaN
            continue
        if (x[i] - px) ** 2 + (y[i] - py) ** 2 < clear2:
            continue
        weight = info[i]
        total[k] += weight
        sum_x[k] += weight * raw_x[i]
        sum_y[k] += weight * raw_y[i]
        sum_s[k] += weight * s[i]
        sum_s2[k] += weight * s[i] * s[i]
        sum_tx[k] += weight * tangent_x[i]
        sum_ty[k] += weight * tangent_y[i]
        sum_kappa[k] += weight * kappa[i]
    for k in range(n):
        if total[k] > 0:
            each = 1 / total[k]
            s_mean, tx, ty = sum_s[k] * each, sum_tx[k] * each, sum_ty[k] * each
            along = k * spacing - s_mean
            # the mean of points on an arc lies inside of it
            inside = sum_kappa[k] * each * (sum_s2[k] * each - s_mean**2 - along**2) / 2
            out_x[k] = sum_x[k] * each + along * tx + inside * ty
            out_y[k] = sum_y[k] * each + along * ty - inside * tx
            out_information[k] = total[k]


@njit(cache=True, error_model="numpy")
def _raw_places(x, y, offset, points):
    """Fill `points` (5, n): unsmoothed place of every point, unit tangent and curvature."""
    n = len(x)
    rx, ry, tx, ty, kappa = points[0], points[1], points[2], points[3], points[4]
    tx[0], ty[0] = x[1] - x[0], y[1] - y[0]
    tx[n - 1], ty[n - 1] = x[n - 1] - x[n - 2], y[n - 1] - y[n - 2]
    before_x, before_y, after_x, after_y = x[: n - 2], y[: n - 2], x[2:], y[2:]
    inner_x, inner_y = tx[1 : n - 1], ty[1 : n - 1]
    for i in range(n - 2):
        inner_x[i], inner_y[i] = after_x[i] - before_x[i], after_y[i] - before_y[i]
    for i in range(n):
        norm = 1 / np.sqrt(tx[i] * tx[i] + ty[i] * ty[i] + 1e-18)
        tx[i], ty[i] = tx[i] * norm, ty[i] * norm
        rx[i], ry[i] = x[i] - offset[i] * ty[i], y[i] + offset[i] * tx[i]
    _curvatures(x, y, kappa)


@njit(cache=True, error_model="numpy")
def _curvatures(x, y, out):
    """Curvature of the line over END_FIT_PX points either side of each; at its ends, the last."""
    n, reach = len(x), END_FIT_PX
    inner = out[reach : n - reach]
    first_x, first_y, last_x, last_y = (
        x[: n - 2 * reach],
        y[: n - 2 * reach],
        x[2 * reach :],
        y[2 * reach :],
    )
    middle_x, middle_y = x[reach : n - reach], y[reach : n - reach]
    for i in range(n - 2 * reach):
        ax, ay = middle_x[i] - first_x[i], middle_y[i] - first_y[i]
        bx, by = last_x[i] - middle_x[i], last_y[i] - middle_y[i]
        a, b = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
        inner[i] = 2 * (ax * by - ay * bx) / (a * b * (a + b))
    out[:reach] = inner[0]
    out[n - reach :] = inner[-1]


@njit(cache=True, error_model="numpy")
def _approach(line, more, px, py, pole_radius, cone, out):
    """Least distance between the surfaces, its arc length, the pole's side, whether untraced."""
    x, y, s = line.x, line.y, line.s
    base_radius, taper = cone
    n, m = len(x), len(x) - 1 - END_FIT_PX
    best = np.inf
    norm = more / np.sqrt((x[-1] - x[m]) ** 2 + (y[-1] - y[m]) ** 2)
    beyond_x, beyond_y = norm * (x[-1] - x[m]), norm * (y[-1] - y[m])
    for i in range(n):
        last = i == n - 1
        ex, ey = (beyond_x, beyond_y) if last else (x[i + 1] - x[i], y[i + 1] - y[i])
        away, length = (px - x[i]) ** 2 + (py - y[i]) ** 2, more if last else s[i + 1] - s[i]
        if away > (best + pole_radius + base_radius + length) ** 2 or not length > 0:
            continue  # no point of the piece can be nearer
        t = min(max(((px - x[i]) * ex + (py - y[i]) * ey) / (length * length), 0.0), 1.0)
        dx, dy = px - x[i] - t * ex, py - y[i] - t * ey
        at = s[i] + t * length
        gap = np.sqrt(dx * dx + dy * dy) - pole_radius - max(base_radius - taper * at, 0.0)
        if gap < best:
            best = gap
            out[0], out[1] = gap, at
            out[2] = 1.0 if ex * dy - ey * dx >= 0 else -1.0
            out[3] = 1.0 if last else 0.0
