"""How near traced lines come to the true centrelines of a rendered session.

Only centrelines are compared, so it serves other programs' lines as well as the project's own.
Lengths along and across a whisker are image pixels.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numba import njit

from pipeline.tables.centrelines import Centrelines

NEAR_PX = 2.0  # farther than this from the whisker, a traced point is on something else
COVER_PX = 1.5  # a bit of whisker with no traced point this near along it is not covered
MOSTLY = 0.5  # part of a traced line that must lie on a whisker to be a trace of it
SCORES = ("nearest", "length_px", "on", "rms_px", "worst_px", "overrun_px")  # as of `LineScores`


@dataclass(frozen=True)
class Truth:
    """True centrelines of one video, follicle → tip, and which of their points can be seen.

    Attributes
    ----------
    lines : Centrelines, rows ordered by frame
    seen : bool (points,)
    """

    lines: Centrelines
    seen: np.ndarray

    def rows_of(self, frame: int) -> range:
        """Rows of one frame."""
        first, last = np.searchsorted(self.lines.frame, [frame, frame + 1])
        return range(int(first), int(last))


def visible_truth(
    lines: Centrelines, visibility: pd.DataFrame, pixels_per_mm: float, noise_sd: float
) -> Truth:
    """Join true centrelines and their visibility table (synthetic.truth) into a `Truth`.

    A point can be seen where it is out of the fur, in the picture, and darker than the noise's
    standard deviation `noise_sd` [grey levels]: fainter ends can hardly be seen.

    Raises ValueError where the two do not have the same rows.
    """
    names = np.asarray(lines.names, object)[lines.whisker]
    same = len(visibility) == len(lines) and (
        np.array_equal(visibility["frame"], lines.frame)
        and np.array_equal(visibility["whisker"].to_numpy(object), names)
    )
    if not same:
        raise ValueError(
            "visibility must have a row for each of the centrelines' frames and whiskers, in "
            f"their order; got {len(visibility)} rows for {len(lines)} centrelines"
        )
    seen = np.empty(len(lines.x_px), bool)
    first_px = visibility["first_visible_mm"].to_numpy() * pixels_per_mm
    for row, contrast in enumerate(visibility["contrast"]):
        part = slice(lines.offsets[row], lines.offsets[row + 1])
        x, y = lines.x_px[part], lines.y_px[part]
        arc = np.concatenate([[0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        seen[part] = (np.asarray(contrast) > noise_sd) & (arc >= first_px[row])
    return Truth(lines, seen)


@njit(cache=True)
def project(x, y, true_x, true_y, distance, node, along):
    """Project points onto a smooth line given by nodes about 1 px apart.

    Fills, per point, the signed normal distance [px] (positive on the left of the line followed
    towards its end, as seen on the screen), the nearest node, and the way along the line from
    that node [px] — beyond an end this is more than half a step.
    """
    n = len(true_x)
    for i in range(len(x)):
        best = 0
        least = np.inf
        for j in range(n):
            d = (x[i] - true_x[j]) ** 2 + (y[i] - true_y[j]) ** 2
            if d < least:
                least = d
                best = j
        a = max(best - 1, 0)
        b = min(best + 1, n - 1)
        tx = true_x[b] - true_x[a]
        ty = true_y[b] - true_y[a]
        chord = np.sqrt(tx * tx + ty * ty)
        tx /= chord
        ty /= chord
        dx = x[i] - true_x[best]
        dy = y[i] - true_y[best]
        u = dx * tx + dy * ty
        v = dx * ty - dy * tx  # left of (tx, ty) on a screen whose y runs down
        # the line bends away from its tangent by v = κ u²/2, κ from the three nodes
        bend = 0.0
        if 0 < best < n - 1:
            before = (true_x[a] - true_x[best]) * ty - (true_y[a] - true_y[best]) * tx
            after = (true_x[b] - true_x[best]) * ty - (true_y[b] - true_y[best]) * tx
            bend = 4.0 * (before + after) / (chord * chord)
        distance[i] = v - 0.5 * bend * u * u
        node[i] = best
        along[i] = u


@dataclass(frozen=True)
class LineScores:
    """Traced lines beside the truth.

    Attributes
    ----------
    rows : table, a row per traced line: `frame`, `whisker` (its name), `nearest` (the true
        whisker that it lies on, "" for none), `length_px`, `on` (part of its points within
        NEAR_PX of its nearest whisker), `rms_px`, `worst_px` over its visible points,
        `overrun_px` (way beyond the whisker's tip)
    whiskers : table, a row per true whisker and frame: `frame`, `whisker`, `visible_px`,
        `covered` (part of the visible length that lines lying on it cover), `pieces`
    distance_px : (points,) of all visible points of lines that lie on a whisker, signed
    node : (points,) the truth's point nearest to each of them
    """

    rows: pd.DataFrame
    whiskers: pd.DataFrame
    distance_px: np.ndarray
    node: np.ndarray


def score_lines(result: Centrelines, truth: Truth) -> LineScores:
    """Compare traced lines with the truth, each with the true whisker that it lies on.

    Points that project onto hidden or invisible parts of a whisker count for nothing; points
    farther than NEAR_PX from the whisker do count in the distances.
    """
    names = np.asarray(result.names, object)[result.whisker]
    true_names = np.asarray(truth.lines.names, object)[truth.lines.whisker]
    covered = np.zeros(len(truth.seen), bool)
    pieces = np.zeros(len(truth.lines), int)
    rows, distances, nodes = [], [np.empty(0)], [np.empty(0, np.int64)]
    for i in range(len(result)):
        points = result.row(i).astype(float)
        best = _nearest_whisker(points, truth, truth.rows_of(result.frame[i]))
        nearest = ""
        if best is not None and best.on >= MOSTLY:
            nearest = true_names[best.row]
            pieces[best.row] += 1
            _cover(covered, truth.lines.offsets[best.row : best.row + 2], best)
            distances.append(best.distance[best.counts])
            nodes.append(truth.lines.offsets[best.row] + best.node[best.counts])
        rows.append((int(result.frame[i]), names[i], *_score(points, best, nearest)))
    return LineScores(
        pd.DataFrame(rows, columns=["frame", "whisker", *SCORES]),
        _coverage(truth, true_names, covered, pieces),
        np.concatenate(distances),
        np.concatenate(nodes),
    )


def _score(points, best, nearest):
    """`SCORES` of one traced line; `nearest`: name of the whisker that it lies on, "" for none."""
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    on = 0.0 if best is None else best.on
    if not nearest:
        return nearest, length, on, np.nan, np.nan, 0.0
    seen = best.distance[best.counts]
    worst = np.abs(seen).max() if len(seen) else np.nan
    return nearest, length, on, rms(seen), worst, best.overrun


@dataclass(frozen=True)
class _Projection:
    """One traced line on one true whisker; `counts` marks points at its visible part."""

    row: int
    distance: np.ndarray
    node: np.ndarray
    along: np.ndarray
    counts: np.ndarray
    on: float

    @property
    def overrun(self):
        """Way that the traced line runs beyond the whisker's tip [px]."""
        return float(max(self.along.max() - 0.5, 0.0))


def _nearest_whisker(points, truth: Truth, rows) -> _Projection | None:
    """Projection onto the whisker that most points are near to; None if no point is near any."""
    found = [_project_row(points, truth, row) for row in rows]
    best = max(found, key=lambda p: (p.on, -np.median(np.abs(p.distance))), default=None)
    return best if best is not None and best.on > 0 else None


def _project_row(points, truth: Truth, row) -> _Projection:
    part = slice(truth.lines.offsets[row], truth.lines.offsets[row + 1])
    n = len(points)
    distance, node, along = np.empty(n), np.empty(n, np.int64), np.empty(n)
    line = truth.lines.x_px[part].astype(float), truth.lines.y_px[part].astype(float)
    project(points[:, 0].copy(), points[:, 1].copy(), *line, distance, node, along)
    inside = np.abs(along) < 1.0
    near = (np.abs(distance) < NEAR_PX) & inside
    return _Projection(row, distance, node, along, truth.seen[part][node] & inside, near.mean())


def _cover(covered, edges, line: _Projection) -> None:
    """Mark the nodes of one true whisker that a traced line passes, in place."""
    near = np.abs(line.distance) < NEAR_PX
    place = line.node[near] + line.along[near]
    n = edges[1] - edges[0]
    for shift in np.arange(-int(COVER_PX), int(COVER_PX) + 1):
        k = np.rint(place).astype(int) + shift
        covered[edges[0] + k[(k >= 0) & (k < n)]] = True


def _coverage(truth: Truth, names, covered, pieces) -> pd.DataFrame:
    """Visible length and covered part of every true whisker in every frame."""
    both = truth.seen & covered
    starts = truth.lines.offsets[:-1]
    visible = np.add.reduceat(truth.seen.astype(int), starts) if len(starts) else np.empty(0)
    reached = np.add.reduceat(both.astype(int), starts) if len(starts) else np.empty(0)
    with np.errstate(invalid="ignore"):
        part = reached / visible
    return pd.DataFrame(
        {
            "frame": truth.lines.frame,
            "whisker": names,
            "visible_px": visible,
            "covered": part,
            "pieces": pieces,
        }
    )


def line_figures(scores: LineScores, frames: int, shortest_px: float = 0.0) -> dict:
    """Sum up `LineScores` of a video of `frames` frames.

    Returns
    -------
    dict of `median_px`, `rms_px`, `p95_px`, `bias_px` over all visible points of lines on a
    whisker; `covered` (mean part of the visible length), `covered_80` (part of whiskers and
    frames of which ≥ 80 % is covered), `identity_errors` (lines that lie on another whisker
    than they are called), `strayed` (lines with > 5 % of their points off the whisker),
    `false_per_frame` (lines on no whisker), `long_false_per_frame` (of these, those longer
    than `shortest_px`), `overrun_px` (95th percentile).
    """
    d, rows = np.abs(scores.distance_px), scores.rows
    false = rows["nearest"] == ""
    trace = rows[~false]
    seen = scores.whiskers[scores.whiskers["visible_px"] > 0]
    return {
        "median_px": _percentile(d, 50),
        "rms_px": rms(d),
        "p95_px": _percentile(d, 95),
        "bias_px": float(scores.distance_px.mean()) if len(d) else np.nan,
        "covered": float(seen["covered"].mean()) if len(seen) else np.nan,
        "covered_80": float((seen["covered"] >= 0.8).mean()) if len(seen) else np.nan,
        "identity_errors": int((trace["nearest"] != trace["whisker"]).sum()),
        "strayed": int((trace["on"] < 0.95).sum()),
        "false_per_frame": false.sum() / max(frames, 1),
        "long_false_per_frame": (false & (rows["length_px"] > shortest_px)).sum() / max(frames, 1),
        "overrun_px": _percentile(trace["overrun_px"], 95),
    }


def rms(values) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else np.nan


def _percentile(values, q) -> float:
    return float(np.percentile(values, q)) if len(values) else np.nan
