"""Lines beside the whiskers that a person has followed by eye in some frames of a video.

Labels are a JSON list of frames: `video` (the file's name without its ending), `frame`, `whiskers`
(each with `kind`, clear or faint, and `xy`, points [px] from base to tip); if need be, `ignore`
(polygons in which nothing is judged) and `unjudged` (points of hairs that count neither as found
nor as wrong).
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import pages

KINDS = ("clear", "faint")
LEAST_PX = 60.0  # of a line: shorter ones are not judged
NEAR_PX = 2.5
BASE_PX = 15.0  # of a label, in the fur: not judged
FOUND = 0.6  # of the rest of a label, along one line
JUDGED_POINTS = 30  # of a line outside of the ignored polygons, about 1 px apart
RIGHT = 0.5  # of these, along a label
TINY = 1e-12  # px²: two points at one place


@dataclass(frozen=True)
class LabelledFrame:
    """Whiskers by eye in one frame; all points (n, 2) are x, y [px].

    whiskers : (kind, points) of each
    unjudged : points of each hair beside them
    ignored : corners of each polygon
    """

    frame: int
    whiskers: tuple
    unjudged: tuple = ()
    ignored: tuple = ()


@dataclass
class Score:
    """What is found and what is wrong in the labelled frames of one video.

    found : by kind, whether each whisker is found
    wrong : number of wrong lines, per frame
    distances : from the labels' points to the line along each [px], where that is near
    """

    found: dict = field(default_factory=lambda: {kind: [] for kind in KINDS})
    wrong: list = field(default_factory=list)
    distances: list = field(default_factory=list)

    def cells(self) -> list[str]:
        """Clear and faint whiskers found, wrong lines a frame, median distance [px]."""
        found = [of(sum(each), len(each)) for each in self.found.values()]
        wrong = np.mean(self.wrong) if self.wrong else np.nan
        away = np.median(self.distances) if self.distances else np.nan
        return [*found, pages.cell("{:.2f}", wrong), pages.cell("{:.2f}", away)]


def of(part, whole) -> str:
    """Counts with their share, e.g. "19 of 20 (95%)"; a dash where there is nothing."""
    return f"{part} of {whole} ({part / whole:.0%})" if whole else "–"


def read_labels(path) -> dict[str, list[LabelledFrame]]:
    """The labelled frames of every video, by the video's stem.

    Raises ValueError where the file is no such list.
    """
    try:
        entries = json.loads(Path(path).read_text("utf-8"))
        frames = [(entry["video"], _labelled(entry)) for entry in entries]
    except KeyError as error:
        raise ValueError(f"{path}: a frame without {error}; expected {_EXPECTED}") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}; expected {_EXPECTED}") from None
    videos = dict.fromkeys(video for video, _ in frames)
    return {video: [frame for name, frame in frames if name == video] for video in videos}


_EXPECTED = "a JSON list of frames with video, frame and whiskers (kind, xy)"


def _labelled(entry) -> LabelledFrame:
    whiskers = tuple((each["kind"], _points(each["xy"])) for each in entry["whiskers"])
    unknown = {kind for kind, _ in whiskers} - set(KINDS)
    if unknown:
        raise ValueError(f"kind {', '.join(map(repr, unknown))}: expected {' or '.join(KINDS)}")
    others = (tuple(map(_points, entry.get(key, ()))) for key in ("unjudged", "ignore"))
    return LabelledFrame(int(entry["frame"]), whiskers, *others)


def _points(values) -> np.ndarray:
    points = np.array(values, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
        raise ValueError(f"points of shape {points.shape}, expected pairs x, y, two at least")
    return points


def lines_of(lines) -> dict[int, list[np.ndarray]]:
    """The points of all lines of some `Centrelines`, by frame."""
    found = {}
    for row, frame in enumerate(lines.frame):
        points = lines.row(row).astype(float)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) > 1:
            found.setdefault(int(frame), []).append(points)
    return found


def score(labelled, lines: dict[int, list[np.ndarray]]) -> Score:
    """Lines, by frame, beside the `LabelledFrame`s of the same video."""
    result = Score()
    for each in labelled:
        judged = [p for p in lines.get(each.frame, ()) if arc_length(p)[-1] > LEAST_PX]
        judged = [evenly_spaced(points) for points in judged]
        for kind, whisker in each.whiskers:
            share, away = along_one_line(whisker, judged)
            result.found[kind].append(share >= FOUND)
            result.distances.extend(away)
        result.wrong.append(sum(is_wrong(points, each) for points in judged))
    return result


def along_one_line(whisker, lines) -> tuple[float, np.ndarray]:
    """Share of a label, beyond its base, along the line that follows it longest.

    Returns the share and the distances [px] of the points along that line.
    """
    points = evenly_spaced(whisker)
    points = points[arc_length(points) >= BASE_PX]
    best, distances = 0.0, np.empty(0)
    for line in lines:
        away = distance(points, line)
        near = away <= NEAR_PX
        if near.mean() > best:
            best, distances = near.mean(), away[near]
    return best, distances


def is_wrong(line, labelled: LabelledFrame) -> bool:
    """Whether a line goes along no label, where enough of it can be judged."""
    judged = line[~within(line, labelled.ignored)]
    if len(judged) < JUDGED_POINTS:
        return False
    labels = [points for _, points in labelled.whiskers] + list(labelled.unjudged)
    away = [np.full(len(judged), np.inf), *(distance(judged, label) for label in labels)]
    return (np.min(away, axis=0) <= NEAR_PX).mean() < RIGHT


def within(points, polygons) -> np.ndarray:
    """Whether each point lies in one of the polygons, or on its edge."""
    inside = np.zeros(len(points), bool)
    for corners in polygons:
        outline = np.asarray(corners, np.float32)[:, None]
        sides = [cv2.pointPolygonTest(outline, (x, y), False) for x, y in points.tolist()]
        inside |= np.array(sides) >= 0
    return inside


def arc_length(points) -> np.ndarray:
    """Arc length [px] from the first point to each."""
    return np.append(0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))


def evenly_spaced(points) -> np.ndarray:
    """Points about 1 px of arc length apart on a polyline, from end to end."""
    arc = arc_length(points)
    at = np.linspace(0, arc[-1], max(int(arc[-1]) + 1, 2))
    return np.column_stack([np.interp(at, arc, each) for each in points.T])


def distance(points, line) -> np.ndarray:
    """Distance [px] of each of the points (n, 2) to a polyline (m, 2)."""
    start, step = line[:-1], np.diff(line, axis=0)
    size = (step**2).sum(axis=1) + TINY
    offset = points[:, None] - start
    part = np.clip((offset * step).sum(axis=2) / size, 0, 1)
    offset = offset - part[..., None] * step
    return np.hypot(offset[..., 0], offset[..., 1]).min(axis=1)
