"""How thick a whisker looks along its centreline, in every frame of a video.

Arc length is measured from a circle about the mean follicle, so that it does not depend on how far
into the fur the line was traced.
"""

from dataclasses import dataclass
from itertools import islice

import cv2
import numpy as np

from pipeline.numerics.polyline import arc_along
from pipeline.session.content import check_video
from pipeline.video import open_video

REACH_MM, LEAST_REACH_PX = 0.36, 6.0  # across the whisker, each way
DARK = 0.6  # of the usual light beside the whisker: something else lies there


@dataclass(frozen=True)
class ThicknessMap:
    """A whisker straightened out, frame after frame.

    Attributes
    ----------
    frame : int (rows,) frames in which it was traced
    lines : the centreline of each row (points, 2) [px], follicle side → tip
    start_px : (rows,) arc length along each line of the circle
    thickness : (rows, places) share of light absorbed, summed across [px]; place k is k px beyond
        the circle; NaN where it cannot be seen
    picture : the video's frame of the first row
    """

    frame: np.ndarray
    lines: list[np.ndarray]
    start_px: np.ndarray
    thickness: np.ndarray
    picture: np.ndarray | None = None


def map_thickness(video, name, follicle, pixels_per_mm) -> ThicknessMap:
    """Measure the thickness of a whisker in all frames in which it was traced.

    Parameters
    ----------
    video : `convert.results.VideoResults`
    name : the whisker's name
    follicle : its mean place [px]
    """
    rows = video.lines_of(name, fewest=4)
    if not rows:
        return ThicknessMap(np.empty(0, int), [], np.empty(0), np.empty((0, 0)))
    distance = {frame: np.hypot(*(line - follicle).T) for frame, line in rows.items()}
    radius = np.quantile([d[0] for d in distance.values()], 0.95) + 1.0
    reach = max(REACH_MM * pixels_per_mm, LEAST_REACH_PX)
    found, first = [], None
    check_video(video.folder, video.path)
    with open_video(video.path) as pictures:
        for frame, picture in enumerate(islice(pictures.lent(), max(rows) + 1)):
            start = _crossing(rows.get(frame), distance.get(frame), radius)
            if start is not None:
                line = rows[frame]
                first = picture.copy() if first is None else first
                found.append((frame, line, start, _along(picture, line, start, reach)))
    frames, kept, starts, courses = zip(*found, strict=True) if found else ((), (), (), ())
    return ThicknessMap(
        np.array(frames, int), list(kept), np.array(starts), _padded(courses), first
    )


def _crossing(line, distance, radius):
    """Arc length [px] at which a line leaves the circle; None where it does not."""
    if line is None or not distance.max() > radius:
        return None
    last = int(np.flatnonzero(distance <= radius).max(initial=-1))
    if last < 0:
        return None
    arc = arc_along(line)
    part = (radius - distance[last]) / (distance[last + 1] - distance[last])
    return float(arc[last] + part * (arc[last + 1] - arc[last]))


def _along(picture, line, start, reach):
    """Thickness [px] at every px of a line beyond `start`."""
    arc = arc_along(line)
    at = np.arange(start, arc[-1], 1.0)
    across = np.arange(-reach, reach + 0.5)
    x, y = (np.interp(at, arc, part) for part in line.T)
    turn = np.arctan2(np.gradient(y), np.gradient(x)) if len(at) > 1 else np.zeros(len(at))
    px = x[:, None] - across * np.sin(turn)[:, None]
    py = y[:, None] + across * np.cos(turn)[:, None]
    light = cv2.remap(
        picture.astype(np.float32), px.astype(np.float32), py.astype(np.float32),
        cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1e3,
    )  # fmt: skip
    return _taken(light)


def _taken(light):
    """Share of the light absorbed at each place, summed across; NaN where it is dark beside it."""
    sides = light[:, :2].mean(axis=1), light[:, -2:].mean(axis=1)
    beside = np.minimum(*sides)
    usual = np.median(beside)
    level = np.linspace(*sides, light.shape[1]).T
    with np.errstate(all="ignore"):
        taken = (1 - light / level).sum(axis=1)
    return np.where((beside > DARK * usual) & (light.min(axis=1) >= 0), taken, np.nan)


def _padded(courses):
    """Courses of different lengths as one array, NaN beyond their ends."""
    out = np.full((len(courses), max(map(len, courses), default=0)), np.nan)
    for row, course in zip(out, courses, strict=True):
        row[: len(course)] = course
    return out
