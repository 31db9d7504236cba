"""What the Janelia Whisker Tracker traced, as centrelines; and our centrelines as its files.

Of a tracked video NAME, `NAME.whiskers` holds the lines, `NAME.measurements` says which line is
which whisker and where it leaves the face, `NAME.bar`, where there is one, has the pole.
"""

from pathlib import Path

import numpy as np

from pipeline.convert import janelia_files as files
from pipeline.convert.results import frames_of, lines_of_rows
from pipeline.detection.static_scene import PoleTrack
from pipeline.errors import InputError, counted
from pipeline.kinematics.given_lines import is_place
from pipeline.numerics.polyline import arc_along
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.known_names import in_short

SUFFIX, TABLE_SUFFIX, BAR_SUFFIX = ".whiskers", ".measurements", ".bar"
FACE_AXIS = {"left": "y", "right": "y", "top": "x", "bottom": "x"}
SAME_PX = 1.0  # within which a line's end is where its measurements have it
FIT_DEGREE = 3  # of the polynomial that gives the tracker's angle and curvature


def read_tracked(path, settings, names=()) -> tuple[Centrelines, PoleTrack | None, int]:
    """Lines, pole and number of frames of a tracked video: its `.whiskers` and what is beside.

    Parameters
    ----------
    path : the `.whiskers` file
    settings : names of the whiskers, scale, thickness of the pole
    names : of the whiskers that the tracker calls 0, 1, 2, …; empty: those of the settings

    Raises
    ------
    InputError
        Where a file is missing or damaged, or there are more whiskers than names.
    """
    path = Path(path)
    table_path, bar_path = path.with_suffix(TABLE_SUFFIX), path.with_suffix(BAR_SUFFIX)
    segments = files.read_whiskers(path)
    if not table_path.is_file():
        raise InputError(
            f"{table_path}: no such file; it says which line is which whisker: let the tracker's "
            f"`measure` and `classify` write it beside {path.name}"
        )
    table = files.read_measurements(table_path)
    names = _names(table, tuple(names) or tuple(w.name for w in settings.whisker), table_path)
    bar = files.read_bar(bar_path) if bar_path.is_file() else np.empty((0, 3))
    try:
        frames = frames_of([*(s.frame for s in segments), *bar[:, 0]])
        if not is_place(bar[:, 1:]).all():
            raise ValueError("a pole outside any picture")
    except ValueError as error:
        raise InputError(
            f"{path}, {bar_path.name}: one of them is damaged ({error}): copy it again, or track "
            "it again"
        ) from None
    n_frames = 1 + int(frames.max(initial=-1))
    lines, elsewhere = named_lines(segments, table, names)
    if 2 * elsewhere > np.count_nonzero(table.label >= 0):
        raise InputError(
            f"{table_path}: is not of the lines in {path.name}: {elsewhere} of those that it "
            "calls whiskers are elsewhere, or not there; let the tracker's `measure` and "
            "`classify` write it anew"
        )
    return lines, pole_of(bar, settings, n_frames), n_frames


def _names(table, names, path):
    """The whiskers' names, in the order of the tracker's labels."""
    count = int(table.label.max(initial=-1)) + 1
    if count == 0:
        raise InputError(f"{path}: no line is labelled a whisker; run `classify` and try again")
    if count > len(table):
        raise InputError(
            f"{path}: has whiskers 0 to {count - 1} in {counted(len(table), 'row')}: it is "
            "damaged; copy it again, or let `classify` write it anew"
        )
    if not names:
        return tuple(f"w{i + 1}" for i in range(count))
    if count > len(names):
        raise InputError(
            f"{path}: has whiskers 0 to {count - 1}, but there are names for {len(names)} "
            f"({in_short(names)}): add [[whisker]] tables to session.toml, or give --names"
        )
    return names


def named_lines(segments, table: files.Measurements, names) -> tuple[Centrelines, int]:
    """The segments that are whiskers, follicle side → tip, the longest of each in every frame.

    Also how many rows of the table are of lines that are elsewhere, or not there: it was made
    before the lines were traced again.
    """
    by_number = {(s.frame, s.number): s for s in segments}
    best, elsewhere = {}, 0
    for row in np.flatnonzero(table.label >= 0):
        segment = by_number.get((int(table.frame[row]), int(table.segment[row])))
        points = None if segment is None else _from_follicle(segment, table.follicle[row])
        if points is None:
            elsewhere += 1
            continue
        key = int(table.frame[row]), int(table.label[row])
        if key not in best or len(points) > len(best[key]):
            best[key] = points
    keys = sorted(best)
    return lines_of_rows(names, keys, [best[key] for key in keys]), elsewhere


def _from_follicle(segment, follicle):
    """Points (n, 2) of a segment from the follicle on; None where it has no end there."""
    points = np.column_stack([segment.x, segment.y])
    for each in (points, points[::-1]):
        if len(each) and np.hypot(*(each[0] - follicle)) < SAME_PX:
            return each
    return None


def pole_of(bar, settings, n_frames) -> PoleTrack | None:
    """The pole from frame to frame; where a frame has no line, that of the one before holds."""
    if not len(bar):
        return None
    bar = bar[np.argsort(bar[:, 0], kind="stable")]
    at = np.searchsorted(bar[:, 0], np.arange(max(n_frames, 1)), side="right") - 1
    x, y = bar[np.maximum(at, 0), 1:].T
    radius = 0.5 * settings.pole.diameter_mm * settings.recording.pixels_per_mm
    return PoleTrack(x, y, radius)


# --- ours as theirs ----------------------------------------------------------------------


def write_tracked(folder, video) -> list[Path]:
    """Write a video's centrelines as the three files of a tracked one; return their paths.

    Whiskers are labelled 0, 1, 2, … in the order of session.toml; every line is a whisker's. The
    thickness is the picture of the whisker's dimensions, 0 where these are not known; the score is
    the confidence.
    """
    paths = [Path(folder) / f"{video.name}{s}" for s in (SUFFIX, TABLE_SUFFIX, BAR_SUFFIX)]
    segments = list(_segments(video))
    files.write_whiskers(paths[0], segments)
    pole = video.pole()
    files.write_measurements(paths[1], measured(segments, video.settings.recording.face, pole))
    if pole is None:
        return paths[:2]
    known = np.flatnonzero(np.isfinite(pole.x_px))
    files.write_bar(paths[2], np.column_stack([known, pole.x_px[known], pole.y_px[known]]))
    return paths


def _segments(video):
    """Every centreline as a segment, by frame; its number is the whisker's."""
    lines, names = video.lines(), list(video.whiskers)
    confidence = video.frames.set_index(["frame", "whisker"])["confidence"]
    number = np.array([names.index(name) for name in lines.names], int)[lines.whisker]
    for row in np.lexsort([number, lines.frame]):
        points, name = lines.row(row), names[number[row]]
        frame = int(lines.frame[row])
        sure = np.full(len(points), confidence.get((frame, name), np.nan), np.float32)
        thick = _thickness(points, video, name)
        yield files.Segment(int(number[row]), frame, *points.T, thick, sure)


def _thickness(points, video, name):
    """Diameter of the whisker at its points [px]; 0 where its dimensions are not known."""
    given = {w.name: w for w in video.settings.whisker}.get(name)
    if given is None or given.si() is None:
        return np.zeros(len(points), np.float32)
    whisker, scale = given.si(), video.settings.recording.si().pixels_per_m
    s = given.hidden_length + arc_along(points) / scale
    radius = whisker.base_radius * np.maximum(1 - s / whisker.cone_length, 0)
    return (2 * radius * scale).astype(np.float32)


def measured(segments, face: str, pole: PoleTrack | None = None) -> files.Measurements:
    """The tracker's measurements of segments that begin at the follicle.

    Angle and curvature are those of a cubic through the points. The angle [°] is from the face's
    axis: of +y towards +x where the face is at the left or right, of +x towards +y else; the
    curvature [1/px] is its mean over the line, positive where the whisker turns from +x to +y.
    """
    axis = FACE_AXIS[face]
    rows = [[*_shape(s, axis), *_distance(s, pole)] for s in segments]
    values = np.array(rows, float).reshape(len(segments), 8 if pole is None else 9)
    return files.Measurements(
        frame=np.array([s.frame for s in segments], np.int32),
        segment=np.array([s.number for s in segments], np.int32),
        label=np.array([s.number for s in segments], np.int32),
        values=values,
        velocity=np.zeros_like(values),
        velocity_known=np.zeros(len(segments), bool),
        face=_face_centre(segments, face),
        face_axis=axis,
    )


def _shape(segment, axis):
    """The eight measures of one segment."""
    x, y = segment.x.astype(float), segment.y.astype(float)
    length = arc_along(np.column_stack([x, y]))
    t = length / length[-1]
    fits = [np.polynomial.Polynomial.fit(t, v, FIT_DEGREE) for v in (x, y)]
    (dx, dy), (ddx, ddy) = ([fit.deriv(k)(t) for fit in fits] for k in (1, 2))
    curvature = (dx * ddy - dy * ddx) / (dx**2 + dy**2) ** 1.5
    mean = np.sum(curvature * np.append(t[1], np.diff(t)))
    along, across = (dx[0], dy[0]) if axis == "x" else (dy[0], dx[0])
    angle = np.degrees(np.arctan2(across, along))
    return length[-1], np.median(segment.score), angle, mean, x[0], y[0], x[-1], y[-1]


def _distance(segment, pole):
    """Distance of the nearest point to the pole's centre [px], nothing where there is no pole."""
    if pole is None:
        return ()
    x, y = pole.at(segment.frame)
    return (np.hypot(segment.x - x, segment.y - y).min(),)


def _face_centre(segments, face):
    """About where the face's centre is, off the picture's side with the face [px]."""
    far = [(s.x.max(), s.y.max()) for s in segments] or [(0, 0)]
    width, height = np.max(far, axis=0)
    x = {"left": -0.5, "right": 1.5}.get(face, 0.5) * width
    y = {"top": -0.5, "bottom": 1.5}.get(face, 0.5) * height
    return int(x), int(y)
