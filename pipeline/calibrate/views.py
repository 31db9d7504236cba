"""Two views of a whisker that touches a pole: elevation, projection error, force in its own plane.

As the paper's Fig. 4, for every contact of the first view.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.calibrate.lines_3d import SpaceLine, path_row, space_line, unroll
from pipeline.calibrate.two_views import TwoViews, ViewsError
from pipeline.convert.results import lines_of_rows
from pipeline.detection.static_scene import PoleTrack
from pipeline.errors import counted
from pipeline.numerics.polyline import arc_along
from pipeline.tables.calibration_columns import VIEW_CONTACT_COLUMNS, VIEW_FRAME_COLUMNS
from pipeline.tables.columns import as_table

LEAST_TOGETHER = 0.5  # share of the first view's frames that both must show
APART_MM = 1.5  # between the ends that the views show, along the shared axis
FEWEST_TO_COMPARE = 30  # frames, for whether the views are in step
LARGEST_LAG = 20  # frames
CLEARER = 0.02  # correlation, by which another lag must be the better one


@dataclass(frozen=True)
class ViewsMeasurement:
    """What two views of one video show.

    Attributes
    ----------
    video, whisker : names
    frames : table of VIEW_FRAME_COLUMNS
    contacts : table of VIEW_CONTACT_COLUMNS
    lines : frame → SpaceLine
    """

    video: str
    whisker: str
    frames: pd.DataFrame
    contacts: pd.DataFrame
    lines: dict[int, SpaceLine]


def measure_views(first, second, views: TwoViews, name, analyse) -> ViewsMeasurement:
    """Combine a whisker's lines of two views, frame by frame.

    Parameters
    ----------
    first, second : `convert.results.VideoResults` of the same frames
    views : how they fit together
    name : the whisker's name in the first view
    analyse : `pipeline.run.analyse_lines`

    Raises
    ------
    ViewsError
        Where the views do not match, or share too little of the whisker.
    """
    table = first.of(name).set_index("frame", drop=False)
    lines = _space_lines(first, second, views, name, table)
    pole = first.pole()
    if pole is None:
        raise ViewsError(
            f"{first.name}: no pole was seen in the first view; give [pole] x_px, y_px in its "
            "session.toml, and run it again"
        )
    rows = [
        {"frame": frame, **_place_row(line, _pole_at(pole, frame), views.first_scale)}
        for frame, line in lines.items()
    ]
    frames = pd.DataFrame(rows).merge(
        table.reset_index(drop=True)[["frame", "time_s", "in_contact"]], on="frame", how="left"
    )
    frames = frames.assign(video=first.name, whisker=name)
    forces = _forces(first, lines, pole, name, views.first_scale, analyse)
    frames = as_table(frames.merge(forces, on="frame", how="left"), VIEW_FRAME_COLUMNS)
    own = first.contacts[first.contacts["whisker"] == name]
    contacts = [_contact_row(frames, each) for each in own.itertuples()]
    contacts = as_table(pd.DataFrame(contacts), VIEW_CONTACT_COLUMNS)
    return ViewsMeasurement(first.name, name, frames, contacts, lines)


def _space_lines(first, second, views, name, table):
    """The whisker in space in all frames in which both views show it: frame → SpaceLine."""
    ours = first.lines_of(name, fewest=10)
    theirs = second.lines_of(_name_in(second, name), fewest=10)
    places = table[["follicle_x_px", "follicle_y_px"]].dropna()
    both = sorted(set(ours) & set(theirs) & set(places.index))
    if len(both) < LEAST_TOGETHER * max(len(ours), 1):
        raise ViewsError(
            f"{first.name}: the whisker is followed in {counted(len(ours), 'frame')} of the first "
            f"view, and in {len(both)} of these in the second; do the two results belong together?"
        )
    _check_in_step(first.name, ours, theirs, views, both)
    found = {
        frame: space_line(views, ours[frame], theirs[frame], places.loc[frame].to_numpy(float))
        for frame in both
    }
    found = {frame: line for frame, line in found.items() if line is not None}
    if len(found) < LEAST_TOGETHER * len(both):
        raise ViewsError(
            f"{first.name}: along the axis that both views share, their whiskers overlap in "
            f"{len(found)} of {len(both)} frames; do the points belong to these views?"
        )
    return found


def _name_in(second, name):
    """The whisker's name in the second view: the same, or that of the only one."""
    if name in second.whiskers:
        return name
    if len(second.whiskers) == 1:
        return second.whiskers[0]
    raise ViewsError(
        f"{second.name}: the second view has no whisker {name}, but {', '.join(second.whiskers)}; "
        "give the whiskers the same names in both session.toml"
    )


def _check_in_step(video, ours, theirs, views, both):
    """ViewsError where the whisker's ends lie or move differently in the other view."""
    lines = [(views.along_first(ours[f]), views.in_second(theirs[f])[0]) for f in both]
    starts, ends = (np.array([(a[k], b[k]) for a, b in lines]).T for k in (0, -1))
    apart = np.median(np.abs(starts[0] - starts[1]))
    if apart > APART_MM:
        raise ViewsError(
            f"{video}: the whisker leaves the face {apart:.1f} mm apart in the two views, along "
            "the axis that they share; do the points belong to these views, and is the first one "
            "the view from above?"
        )
    lag = _lag(*ends) if len(both) >= FEWEST_TO_COMPARE else 0
    if lag:
        raise ViewsError(
            f"{video}: the second view is {abs(lag)} frame{'s' * (abs(lag) > 1)} "
            f"{'late' if lag > 0 else 'early'}; cut the videos so that their frames belong "
            "together"
        )


def _lag(first, second) -> int:
    """Frames by which the second course is late, where another lag fits clearly better."""
    reach = min(LARGEST_LAG, len(first) // 4)
    moves = [np.diff(course) for course in (first, second)]
    if min(move.std() for move in moves) == 0:
        return 0
    fit = {}
    for lag in range(-reach, reach + 1):
        a = moves[0][max(-lag, 0) : len(moves[0]) - max(lag, 0)]
        b = moves[1][max(lag, 0) : len(moves[1]) - max(-lag, 0)]
        fit[lag] = np.corrcoef(a, b)[0, 1]
    best = max(fit, key=fit.get)
    return best if fit[best] > fit[0] + CLEARER and fit[best] > 0.5 else 0


def _pole_at(pole: PoleTrack, frame):
    """The pole [px] in a frame, None while it is away."""
    place = np.array(pole.at(frame))
    return place if np.isfinite(place).all() else None


def _place_row(line, pole, scale) -> dict:
    """Columns of the path to the pole in one frame."""
    if pole is None:
        return {}
    nearest = int(np.argmin(np.hypot(*(line.first - pole).T)))
    return path_row(line, arc_along(line.first)[nearest], scale)


def _forces(first, lines, pole, name, scale, analyse) -> pd.DataFrame:
    """Force from the first view alone and in the whisker's own plane, computed in the same way."""
    n = first.n_frames
    unrolled = {frame: unroll(line, _pole_at(pole, frame), scale) for frame, line in lines.items()}
    tracks = np.full((2, n), np.nan)
    for frame, (_, place) in unrolled.items():
        if place is not None:
            tracks[:, frame] = place
    flat = {frame: line.first[1:] for frame, line in lines.items()}
    own = {frame: line for frame, (line, _) in unrolled.items()}
    seen = np.isfinite(tracks[0])
    still = np.array([_pole_at(pole, f) if seen[f] else (np.nan, np.nan) for f in range(n)]).T
    parts = []
    for which, rows, places in (("first_view", flat, still), ("own_plane", own, tracks)):
        keys = [(frame, 0) for frame in rows]
        track = PoleTrack(*places, pole.radius_px)
        done = analyse(lines_of_rows([name], keys, list(rows.values())), first.settings, track, n)
        names = {"contact_force_uN": f"{which}_force_uN"}
        names["contact_force_uN_se"] = f"{which}_force_uN_se"
        parts.append(done.frames.set_index("frame")[list(names)].rename(columns=names))
    return pd.concat(parts, axis=1).reset_index()


def _contact_row(frames, contact) -> dict:
    """A row of VIEW_CONTACT_COLUMNS: medians over the frames of one contact."""
    inside = frames[frames["frame"].between(contact.onset_frame, contact.offset_frame - 1)]
    row = {"video": contact.video, "whisker": contact.whisker, "contact": contact.contact}
    known = inside.dropna(subset=["true_path_mm"])
    if not len(known):
        return row
    medians = known.median(numeric_only=True)
    columns = [c for c in medians.index if c.endswith(("_deg", "_mm", "_percent", "_se"))]
    row |= {c: medians[c] for c in columns if not c.startswith(("first_view", "own_plane"))}
    forces = inside[["first_view_force_uN", "own_plane_force_uN"]].dropna()
    forces = forces[(forces > 0).all(axis=1)]
    if not len(forces):
        return row
    flat, own = forces.max()
    sums = forces.sum()
    return row | {
        "first_view_peak_uN": flat,
        "own_plane_peak_uN": own,
        "force_effect_percent": 100 * (sums.iloc[1] / sums.iloc[0] - 1),
    }
