"""How the follicle moves in and out of the face, from a particle that sticks to the whisker.

The particle keeps its distance from the follicle along the whisker. So the follicle lies that far
from the particle, along the whisker continued into the face. Whether the follicle gives way
to force shows in its motion during contacts, against the change of curvature.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import linregress, t

from pipeline.calibrate.particle import ParticlePath, follow_particle
from pipeline.calibrate.thickness import ThicknessMap, map_thickness
from pipeline.numerics.polyline import arc_along, places_along
from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import differences
from pipeline.tables.calibration_columns import DUST_CONTACT_COLUMNS
from pipeline.tables.columns import as_table

BASE_MM = 3.0  # of the visible whisker, by which it is continued into the face
TRIM_PX = 4  # first points, which fur may shift
BESIDE = 3  # frames that are averaged before a contact, and about its largest bend
THIRD_DIFFERENCE = np.sqrt(20.0)  # SD of third differences of white noise, in its SD
FEWEST_CONTACTS = 4
HIDDEN_SE_MM = 0.3  # error of the hidden length


@dataclass(frozen=True)
class FollicleMotion:
    """What a particle on one whisker of one video shows.

    Attributes
    ----------
    video, whisker : names
    frames : table of DUST_COLUMNS
    contacts : table of DUST_CONTACT_COLUMNS
    seen, particle : the whisker's thickness map, and the particle's place in it
    particle_mm : its distance from the follicle along the whisker, for the hidden length given
    """

    video: str
    whisker: str
    frames: pd.DataFrame
    contacts: pd.DataFrame
    seen: ThicknessMap
    particle: ParticlePath
    particle_mm: float

    @property
    def radial_range_mm(self) -> float:
        """How far the follicle moves in the whole video."""
        return float(np.ptp(self.frames["radial_mm"].dropna()))


@dataclass(frozen=True)
class Slope:
    """Follicle motion against curvature change, over contacts.

    Attributes
    ----------
    n : contacts
    slope, low, high : mm per 1/m, and its 95 % interval
    r, r_low, r_high : correlation, likewise
    """

    n: int
    slope: float
    low: float
    high: float
    r: float
    r_low: float
    r_high: float


def measure_follicle_motion(video, name, near_mm=None) -> FollicleMotion:
    """Follow the particle on a whisker, and compute the follicle's place from it.

    Parameters
    ----------
    video : `convert.results.VideoResults`
    name : the whisker's name
    near_mm : rough distance of the particle from the follicle; None: it is searched for

    Raises
    ------
    NoParticleError
        Where no particle can be followed.
    """
    scale = video.settings.recording.pixels_per_mm
    table = video.of(name)
    known = table[table["tracked"]]
    follicle = known[["follicle_x_px", "follicle_y_px"]].mean().to_numpy()
    seen = map_thickness(video, name, follicle, scale)
    if near_mm is not None and len(seen.frame):
        near_mm -= np.hypot(*(seen.lines[0][0] - follicle)) / scale
    particle = follow_particle(seen, scale, near_mm)
    hidden = _hidden_px(video.settings, name, seen, follicle)
    axis = np.deg2rad(known["base_angle_deg"].median())
    places = _follicles(seen, particle, hidden, scale)
    frames = _frame_rows(places, particle, table, axis, scale)
    contacts = video.contacts[video.contacts["whisker"] == name]
    rows = as_table(
        pd.DataFrame([contact_row(frames, each) for each in contacts.itertuples()]),
        DUST_CONTACT_COLUMNS,
    )
    at = float(np.nanmedian(places["particle_px"])) / scale
    frames = frames.assign(video=video.name, whisker=name)
    return FollicleMotion(video.name, name, frames, rows, seen, particle, at)


def _hidden_px(settings, name, seen, follicle):
    """Length of the whisker before the first traced point [px], from session.toml or the video."""
    given = {w.name: w.hidden_length_mm for w in settings.whisker}
    if given.get(name) is not None:
        return given[name] * settings.recording.pixels_per_mm
    return float(np.median([np.hypot(*(line[0] - follicle)) for line in seen.lines]))


def _follicles(seen, particle, hidden, scale) -> pd.DataFrame:
    """Place of the particle and of the follicle [px] in each row; y up."""
    rows = [
        (*places_along(line, [start + place])[0], start + place)  # NaN where it is not seen
        for line, start, place in zip(seen.lines, seen.start_px, particle.place_px, strict=True)
    ]
    length = np.nanmedian([row[2] for row in rows]) + hidden
    follicles = [
        _follicle(line, row[2], length, BASE_MM * scale)
        for line, row in zip(seen.lines, rows, strict=True)
    ]
    x, y, along = np.array(rows).T
    fx, fy, turn = np.array(follicles).T
    return pd.DataFrame(
        {
            "frame": seen.frame, "particle_x_px": x, "particle_y_px": y, "x": fx, "y": fy,
            "particle_px": np.where(np.isfinite(along), length, np.nan), "turn": turn,
        }
    )  # fmt: skip


def _follicle(line, along, length, base_px):
    """The follicle [px] `length` before the particle, and the whisker's direction there.

    The line is continued as an arc of a circle from its first `base_px`.
    """
    if not np.isfinite(along):
        return np.nan, np.nan, np.nan
    arc = arc_along(line)
    back = along - length  # arc length of the follicle, usually before the first point
    near = (arc >= arc[min(TRIM_PX, len(arc) - 4)]) & (arc <= max(base_px, arc[TRIM_PX + 4]))
    middle = arc[near].mean()
    x, y = (np.polyfit(arc[near] - middle, part[near], 2) for part in line.T)
    turn = np.arctan2(y[1], x[1])
    bend = 2 * (x[1] * y[0] - y[1] * x[0]) / np.hypot(x[1], y[1]) ** 3
    way = back - middle
    chord = way * np.sinc(bend * way / 2 / np.pi)
    direction = turn + bend * way / 2
    return (
        x[2] + chord * np.cos(direction),
        y[2] + chord * np.sin(direction),
        -(turn + bend * way),
    )


def _frame_rows(places, particle, table, axis, scale) -> pd.DataFrame:
    """Rows of DUST_COLUMNS of one whisker and video."""
    out = places[["frame", "particle_x_px", "particle_y_px"]].copy()
    x, y = places["x"] - places["x"].median(), -(places["y"] - places["y"].median())
    out["radial_mm"] = (x * np.cos(axis) + y * np.sin(axis)) / scale
    turned = places["turn"] - axis
    path = np.hypot(particle.se_px / scale, HIDDEN_SE_MM * (np.cos(turned) - 1))
    out["radial_mm_se"] = np.maximum(path, _jitter(out["radial_mm"], places["frame"]))
    columns = ["frame", "time_s", "in_contact", "curvature_change_per_m"]
    return out.merge(table[columns], on="frame", how="left")


def _jitter(value, frame):
    """SD of the noise from frame to frame, by third differences of neighbouring frames."""
    third = differences(value, frame, 3)
    return float(robust_sd(third, about=0.0)) / THIRD_DIFFERENCE if len(third) > 9 else np.nan


def contact_row(frames, contact) -> dict:
    """A row of DUST_CONTACT_COLUMNS: what the follicle does during one contact."""
    inside = frames[frames["frame"].between(contact.onset_frame, contact.offset_frame - 1)]
    before = frames["frame"].between(contact.onset_frame - BESIDE, contact.onset_frame - 1)
    row = {"video": contact.video, "whisker": contact.whisker, "contact": contact.contact}
    bend = inside["curvature_change_per_m"]
    radial = inside["radial_mm"]
    if not (bend.notna() & radial.notna()).any():
        return row
    peak = int(bend.abs().idxmax())
    about = frames.loc[max(peak - BESIDE // 2, 0) : peak + BESIDE // 2, "radial_mm"]
    return row | {
        "curvature_change_per_m": bend[peak],
        "radial_change_mm": about.mean() - frames.loc[before, "radial_mm"].mean(),
        "radial_range_mm": radial.max() - radial.min(),
    }


def slope_of(contacts: pd.DataFrame) -> Slope | None:
    """Radial change against the size of the curvature change, over contacts; None: too few."""
    names = ["curvature_change_per_m", "radial_change_mm"]
    known = contacts.dropna(subset=names)
    n = len(known)
    bend, change = known[names[0]].abs(), known[names[1]]
    if n < FEWEST_CONTACTS or bend.std() == 0:
        return None
    fit = linregress(bend, change)
    half = t.ppf(0.975, n - 2) * fit.stderr
    z, wide = np.arctanh(np.clip(fit.rvalue, -0.999999, 0.999999)), 1.96 / np.sqrt(n - 3)
    return Slope(
        n, fit.slope, fit.slope - half, fit.slope + half, fit.rvalue, np.tanh(z - wide),
        np.tanh(z + wide),
    )  # fmt: skip
