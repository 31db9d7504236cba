"""Motion → the tables that `run` writes, filled with what is true.

`centrelines.parquet`, `frames.parquet`, `contacts.csv` have exactly the columns of the results;
`visibility.parquet` holds what only the truth knows.
"""

from pathlib import Path

import numpy as np
import pandas as pd
from numba import njit
from scipy.optimize import curve_fit

from pipeline.tables.centrelines import Centrelines, write_centrelines
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS, Column, as_table, empty_table
from pipeline.tables.files import write_csv, write_frames, write_rows
from synthetic.strips import step_table
from synthetic.touches import unit_half_gaussian
from synthetic.vibration import true_moments
from whiskermodel.response import Response

VISIBILITY_COLUMNS = (
    Column("frame", "int32", "", "frame number, from 0"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("first_visible_mm", "float64", "mm", "arc length at which it leaves the fur"),
    Column("last_visible_mm", "float64", "mm", "arc length at which it leaves the picture"),
    Column("slipping", "bool", "", "first frame after slipping past the pole"),
    Column("contrast", "list<float32>", "grey", "darkness of each point of the centreline"),
)

_IN_THE_FUR = 0.5  # share of the light below which fur counts as solid


def centreline_table(motion) -> Centrelines:
    """True centrelines, follicle → tip, of all whiskers: rows ordered by frame, then whisker."""
    names, n = motion.scene.names, len(motion)
    lines = [motion.centrelines(h) for h in range(len(names))]
    x, y = (np.concatenate(parts, axis=1).ravel() for parts in zip(*lines, strict=True))
    frame, whisker = np.divmod(np.arange(n * len(names)), len(names))
    lengths = np.tile([x.shape[1] for x, _ in lines], n)
    exact = np.zeros(len(x), np.float32)
    return Centrelines.of_points(names, frame, whisker, lengths, (x, y), se_px=exact)


def frame_table(motion, arc_length: float = 5.5e-3) -> pd.DataFrame:
    """True frames table; curvature at `arc_length` [m]. Standard errors are missing values."""
    parts = [_frames_of(motion, h, arc_length) for h in range(len(motion.hairs))]
    table = pd.concat(parts).sort_values("frame", kind="stable").reset_index(drop=True)
    return as_table(table, FRAME_COLUMNS)


def _frames_of(motion, h, arc_length):
    contact, hair = motion.hairs[h].contact, motion.scene.hairs[h]
    n = len(contact)
    s = np.array([arc_length])
    curvature = motion.curvature(h, s)[:, 0]
    rest = (s[:, None] ** np.arange(len(hair.intrinsic_curvature))) @ hair.intrinsic_curvature
    x, y = motion.scene.to_pixels(contact.base_x, contact.base_y)
    return pd.DataFrame(
        {
            "frame": np.arange(n),
            "time_s": np.arange(n) / motion.scene.camera.frames_per_second,
            "whisker": hair.whisker.name,
            "tracked": True,
            "follicle_x_px": x,
            "follicle_y_px": y,
            "base_angle_deg": np.rad2deg(contact.base_angle),
            "curvature_per_m": curvature,
            "rest_curvature_per_m": np.full(n, rest[0]),
            "curvature_change_per_m": curvature - rest[0],
            "pole_distance_mm": 1e3 * pole_distance(motion, h),
            "in_contact": contact.touching,
            "contact_arc_length_mm": 1e3 * contact.contact_arc_length,
            "contact_force_uN": 1e6 * contact.contact_force,
            "axial_force_uN": 1e6 * contact.axial_force,
            "lateral_force_uN": 1e6 * contact.lateral_force,
            "base_moment_nN_m": 1e9 * contact.base_moment,
        }
    )


def pole_distance(motion, h) -> np.ndarray:
    """Least distance of the whisker's surface from the pole's [m], (frames,).

    Zero in contact, NaN while the pole is out of view; negative where a whisker out of the
    pole's plane passes in front of it.
    """
    contact, hair, pole = motion.hairs[h].contact, motion.scene.hairs[h], motion.scene.pole
    out = np.full(len(contact), np.nan)
    if pole is None:
        return out
    x, y = motion.centrelines(h)
    scale = motion.scene.camera.pixels_per_m
    radius = scale * hair.whisker.radius(np.linspace(0, hair.whisker.length, x.shape[1]))
    place = motion.scene.to_pixels(motion.pole_x, motion.pole_y)
    _least_gap(out, x, y, radius, *place)
    return np.where(contact.touching, 0.0, out / scale - pole.radius)


@njit(cache=True)
def _least_gap(gap, x, y, radius, px, py):
    """Least distance of a point from the surface of a strip in every frame; NaN stays."""
    for i in range(len(gap)):
        if not np.isfinite(px[i]):
            continue
        least = np.inf
        for k in range(x.shape[1] - 1):
            dx, dy = x[i, k + 1] - x[i, k], y[i, k + 1] - y[i, k]
            ex, ey = px[i] - x[i, k], py[i] - y[i, k]
            along = min(max((ex * dx + ey * dy) / (dx * dx + dy * dy), 0.0), 1.0)
            distance = np.hypot(ex - along * dx, ey - along * dy)
            least = min(least, distance - radius[k] - along * (radius[k + 1] - radius[k]))
        gap[i] = least


def contact_table(motion, video: str) -> pd.DataFrame:
    """True contacts of all whiskers: stretches of frames in which the rod touches."""
    rows = []
    for h, moving in enumerate(motion.hairs):
        touching = moving.contact.touching
        response = Response(motion.scene.hairs[h].whisker)
        edges = np.flatnonzero(np.diff(touching.astype(np.int8), prepend=0, append=0))
        # a whisker that slips and at once touches from the other side makes two contacts
        cuts = [s for s in moving.slips if s and touching[s - 1] and s < len(touching)]
        starts = np.sort(np.concatenate([edges[::2], [c for c in cuts if touching[c]]]))
        stops = np.sort(np.concatenate([edges[1::2], [c for c in cuts if touching[c]]]))
        pairs = zip(starts.astype(int), stops.astype(int), strict=True)
        for number, (onset, offset) in enumerate(pairs, 1):
            rows.append(_contact_row(motion, h, response, video, number, onset, offset))
    if not rows:
        return empty_table(CONTACT_COLUMNS)
    return as_table(pd.DataFrame(rows), CONTACT_COLUMNS)


def _contact_row(motion, h, response, video, number, onset, offset):
    contact = motion.hairs[h].contact.take(slice(onset, offset))
    rate = motion.scene.camera.frames_per_second
    force = contact.contact_force
    peak = int(np.argmax(force))
    place, moment = contact.contact_arc_length[peak], _largest(contact.base_moment)
    slip = offset in motion.hairs[h].slips
    return {
        "video": video,
        "whisker": motion.scene.hairs[h].whisker.name,
        "contact": number,
        "onset_frame": onset,
        "offset_frame": offset,
        "onset_s": onset / rate,
        "duration_ms": 1e3 * (offset - onset) / rate,
        "peak_force_uN": 1e6 * force[peak],
        "mean_force_uN": 1e6 * force.mean(),
        "impulse_uN_ms": 1e9 * force.sum() / rate,
        "peak_base_moment_nN_m": 1e9 * moment,
        "peak_axial_force_uN": 1e6 * _largest(contact.axial_force),
        "contact_arc_length_mm": 1e3 * place,
        **_pulse(np.arange(onset, offset) / rate, 1e6 * force),
        **true_moments(response, place, force, 1 / rate, moment > 0, slip),
        "slip": slip,
        "flags": _cut_flag(onset, offset, len(motion)),
    }


def _largest(signed):
    return signed[np.argmax(np.abs(signed))]


def _cut_flag(onset, offset, n):
    """A contact that the video's start or end cuts off."""
    cut = {"starts_before": onset == 0, "ends_after": offset == n}
    return ";".join(flag for flag, applies in cut.items() if applies)


def _pulse(t, force):
    """Half-Gaussian that comes nearest to the true force [µN] at times `t` [s]."""
    names = ("pulse_peak_uN", "pulse_duration_ms", "pulse_centre_s", "pulse_r2")
    if len(t) < 4:
        return dict.fromkeys(names, np.nan)
    ms = 1e3 * (t - t[0])
    start = (force.max(), len(t) * (ms[1] - ms[0]), 0.5 * ms[-1])
    try:
        (peak, duration, centre), _ = curve_fit(_half_gaussian, ms, force, start)
    except RuntimeError:
        return dict.fromkeys(names, np.nan)
    missing = ((force - _half_gaussian(ms, peak, duration, centre)) ** 2).sum()
    r2 = 1 - missing / max(((force - force.mean()) ** 2).sum(), 1e-30)
    return dict(zip(names, (peak, abs(duration), t[0] + 1e-3 * centre, r2), strict=True))


def _half_gaussian(t, peak, duration, centre):
    """A half-Gaussian touch's force, zero before and after it."""
    return np.maximum(peak * unit_half_gaussian((t - centre) / duration), 0.0)


# What only the truth knows -------------------------------------------------------------------


def visibility_table(motion, renderer, lines: Centrelines) -> pd.DataFrame:
    """Visible part of every whisker and frame, and the contrast of every point.

    `renderer` is the Renderer of the same motion; `lines` its centreline_table.
    """
    rows = [_visibility(motion, renderer, lines, row) for row in range(len(lines))]
    return pd.DataFrame(rows, columns=[c.name for c in VISIBILITY_COLUMNS])


def _visibility(motion, renderer, lines, row):
    h, frame = int(lines.whisker[row]), int(lines.frame[row])
    hair, camera = motion.scene.hairs[h], motion.scene.camera
    x, y = lines.row(row).T
    s = np.linspace(0, hair.whisker.length, len(x))
    inside = (x > -0.5) & (x < camera.width - 0.5) & (y > -0.5) & (y < camera.height - 0.5)
    column = np.clip(np.rint(x), 0, camera.width - 1).astype(int)
    line = np.clip(np.rint(y), 0, camera.height - 1).astype(int)
    light = renderer.without_whiskers(frame)[line, column]
    share = renderer.opened(frame)[line, column] / renderer.background[line, column]
    early = s < max(3 * motion.scene.face.hidden_length, 2e-3)
    hidden = np.flatnonzero(early & (share < _IN_THE_FUR))
    last_hidden = hidden[-1] if len(hidden) else 0
    darkness = hair.opacity * _peak_cover(hair.whisker.radius(s) * camera.pixels_per_m, camera)
    return (
        frame,
        hair.whisker.name,
        1e3 * s[last_hidden],
        1e3 * s[inside].max() if inside.any() else np.nan,
        frame in motion.hairs[h].slips,
        np.where(inside, light * darkness, 0.0).astype(np.float32),
    )


def _peak_cover(radius_px, camera):
    """Light share taken on the centreline of a strip along an image axis."""
    _, table, reach, per_px = step_table(camera.blur_px)
    distance = np.arange(table.shape[1]) / per_px - reach
    step = table[0].astype(float)
    return np.interp(radius_px, distance, step) - np.interp(-radius_px, distance, step)


def hidden_length(visibility: pd.DataFrame, whisker: str) -> float:
    """Median arc length [m] at which a whisker leaves the fur."""
    return 1e-3 * float(visibility.loc[visibility.whisker == whisker, "first_visible_mm"].median())


def write_truth(folder, motion, renderer, video: str, arc_length: float = 5.5e-3) -> None:
    """Write all truth tables of one video to `folder`, by the columns of the results."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lines = centreline_table(motion)
    write_centrelines(folder / "centrelines.parquet", lines)
    write_frames(folder / "frames.parquet", frame_table(motion, arc_length))
    visibility = visibility_table(motion, renderer, lines)
    write_rows(folder / "visibility.parquet", visibility, VISIBILITY_COLUMNS)
    write_csv(folder / "contacts.csv", contact_table(motion, video), CONTACT_COLUMNS)
