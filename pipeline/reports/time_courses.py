"""Time courses of one video for the page, one below the other, with contacts shaded.

A curve is an SVG path in a box of WIDE × HIGH, which the page stretches to any width. Words are
not part of it, so that they have the same size on a telephone and on paper.
"""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pandas as pd

from pipeline.reports.overlay import PLAYBACK_RATE
from pipeline.reports.whisker_styles import Style, whisker_styles
from pipeline.tables import files
from pipeline.tables.known_names import KNOWN, nameless_in

WIDE, HIGH = 1000, 100
MOST_POINTS = 900  # of a curve; a longer one is thinned to its extremes
TICKS, TIME_TICKS = 3, 6
EDGE = 10  # % of a panel at top and bottom, where a tick's number would meet the next panel's
MARGIN = 0.13  # of a panel's range, left free: with it, the number of a base line is beyond EDGE
RARE = 0.2  # % of the values at either end that may lie beyond the panel
AROUND_FRAMES = 15  # of the overlay, shown before and after a contact
LEAST_WIDTH = 3.0  # of a contact, as it is drawn, so that it can be hit
UNKNOWN = Style("#b4b2ae", ())  # where it is not known which whisker a line is
QUANTITIES = (  # column of frames.parquet, name, unit
    ("base_angle_deg", "angle", "°"),
    ("curvature_change_per_m", "curvature change", "1/m"),
    ("contact_force_uN", "force", "µN"),
    ("base_moment_nN_m", "base moment", "nN m"),
)
LOADS = ("force", "base moment")
COLUMNS = [
    "frame", "time_s", "whisker", "tracked", "confidence", *(column for column, *_ in QUANTITIES),
]  # fmt: skip


@dataclass(frozen=True)
class Panel:
    """One quantity: `ticks` are (from the top [%], text), `paths` (`Style`, SVG path)."""

    name: str
    unit: str
    ticks: list
    paths: list


@dataclass(frozen=True)
class Shown:
    """A contact: place in the box, `lane` (from the top), `link` ("": none), `words`."""

    left: float
    width: float
    lane: int
    link: str
    words: str


@dataclass(frozen=True)
class Courses:
    """All of one video: `ticks` are (from the left [%], text).

    `whiskers` are (name, `Style`), `lanes` those of them that touch; `unknown` is the style where
    it is not known which whisker a line is, None where it always is.
    """

    video: str
    whiskers: list
    lanes: list
    panels: list
    contacts: list
    ticks: list
    has_overlay: bool
    unknown: Style | None = None


def read_courses(results, video) -> pd.DataFrame:
    """The frames of one video with what is drawn of them; no rows where there are none."""
    path = Path(results) / video / "frames.parquet"
    return files.read_frames(path, COLUMNS) if path.is_file() else pd.DataFrame(columns=COLUMNS)


def time_courses(frames: pd.DataFrame, contacts: pd.DataFrame, video, overlay="") -> Courses:
    """Angle, curvature change, force and base moment of all whiskers of a video.

    Parameters
    ----------
    frames : rows of `read_courses`, not empty
    contacts : the video's rows of contacts.csv
    overlay : where its overlay lies, seen from the page; "": there is none
    """
    names = list(dict.fromkeys(frames["whisker"]))
    never = nameless_in(frames) - set(contacts["whisker"])
    styles = whisker_styles(name for name in names if name not in never)
    time = frames["time_s"].to_numpy()
    span = time.min(), max(time.max(), time.min() + 1e-9)
    curves = dict(iter(frames.groupby("whisker", sort=False)))
    panels = [
        _panel(column, name, unit, curves, styles, span)
        for column, name, unit in QUANTITIES
        if _is_drawn(name, frames[column].to_numpy(float))
    ]
    touching = [name for name in names if name in set(contacts["whisker"])]
    shown = [_shown(row, span, touching, overlay) for row in contacts.to_dict("records")]
    times = _ticks(*span, TIME_TICKS)
    ticks = [(100 * (t - span[0]) / (span[1] - span[0]), f"{t:g}") for t in times]
    lanes = [(name, styles[name]) for name in touching]
    doubtful = frames["tracked"].astype(bool) & (frames["confidence"] < KNOWN)
    unknown, whiskers = UNKNOWN if doubtful.any() else None, list(styles.items())
    return Courses(video, whiskers, lanes, panels, shown, ticks, bool(overlay), unknown)


def _is_drawn(name, values) -> bool:
    """Whether there is anything to see: without touches, loads are 0 throughout."""
    known = np.isfinite(values)
    return bool(known.any() and (name not in LOADS or values[known].any()))


def _panel(column, name, unit, curves, styles, span) -> Panel:
    values = _of_known_whiskers(column, curves.values())
    low, high = np.nanpercentile(values, [RARE, 100 - RARE])
    low, high = min(low, high - 1e-6), max(high, low + 1e-6)
    if name == "force":
        low, high = 0.0, np.nanmax(values) or 1.0
    low, high = low - MARGIN * (high - low), high + MARGIN * (high - low)
    below, above = [], []
    for whisker, rows in curves.items():
        doubtful = rows["confidence"] < KNOWN
        unknown, known = (
            _path(rows["time_s"], rows[column].where(shown), span, (low, high))
            for shown in (doubtful, ~doubtful)
        )
        below += [(UNKNOWN, unknown)] if unknown else []
        above += [(styles[whisker], known)] if whisker in styles else []
    return Panel(name, unit, _places(low, high), below + above)


def _of_known_whiskers(column, curves) -> np.ndarray:
    """Values of lines of which it is known which whisker they are; all where it never is.

    Other lines, such as fur and shadows, may have any angle, and would leave the whiskers' courses
    little height.
    """
    table = pd.concat(curves)
    known = table.loc[~(table["confidence"] < KNOWN), column]
    return (known if known.notna().any() else table[column]).to_numpy(float)


def _places(low, high) -> list:
    """(from the top [%], text) of the ticks of a panel: two or more, to tell the scale."""
    for count in range(TICKS, 3 * TICKS):
        values = _ticks(low, high, count)
        places = [(100 * (high - v) / (high - low), _short(v)) for v in values]
        ticks = [place for place in places if EDGE < place[0] < 100 - EDGE]
        if len(ticks) > 1:
            break
    return ticks


def _path(time, values, span, limits) -> str:
    """SVG path of a curve, broken where it is not known."""
    time, values = thinned(time.to_numpy(float), values.to_numpy(float))
    x = WIDE * (time - span[0]) / (span[1] - span[0])
    y = HIGH * (limits[1] - values) / (limits[1] - limits[0])
    known = np.isfinite(y)
    starts = known & ~np.concatenate([[False], known[:-1]])
    return "".join(
        f"{'M' if start else 'L'}{a:.1f} {b:.1f}"
        for a, b, start in zip(x[known], y[known], starts[known], strict=True)
    )


def thinned(time, values, most: int = MOST_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """A curve (n,) of at most `most` points, or about so; of every few the extremes are kept."""
    n = len(values)
    if n <= most:
        return time, values
    step = -(-2 * n // most)
    kept = n // step * step
    parts = np.where(np.isfinite(values[:kept]), values[:kept], np.nan).reshape(-1, step)
    low = np.fmin.reduce(parts, axis=1)
    high = np.fmax.reduce(parts, axis=1)
    rising = parts[:, -1] >= parts[:, 0]
    pairs = np.where(rising[:, None], np.c_[low, high], np.c_[high, low])
    times = np.c_[time[:kept:step], time[step // 2 : kept : step]]
    return np.append(times.ravel(), time[kept:]), np.append(pairs.ravel(), values[kept:])


def _shown(row, span, names, overlay) -> Shown:
    onset, end = row["onset_s"], row["onset_s"] + 1e-3 * row["duration_ms"]
    left, width = (WIDE * v / (span[1] - span[0]) for v in (onset - span[0], end - onset))
    words = f"{row['whisker']}, contact {row['contact']}: frames {row['onset_frame']} to "
    words += f"{row['offset_frame']}, {row['duration_ms']:.3g} ms"
    if np.isfinite(row["peak_force_uN"]):
        words += f", peak {row['peak_force_uN']:.3g} µN"
    link = overlay and overlay_link(overlay, row["onset_frame"], row["offset_frame"])
    wider = max(LEAST_WIDTH - width, 0)
    return Shown(left - wider / 2, width + wider, names.index(row["whisker"]), link, words)


def overlay_link(overlay, onset: int, offset: int) -> str:
    """Address of a stretch of an overlay (a media fragment [s]), with some frames around it."""
    if not overlay.endswith(".mp4"):
        return quote(overlay)
    first, last = max(onset - AROUND_FRAMES, 0), offset + AROUND_FRAMES
    return f"{quote(overlay)}#t={first / PLAYBACK_RATE:.2f},{last / PLAYBACK_RATE:.2f}"


def _ticks(low, high, count) -> list[float]:
    """Round numbers within limits."""
    from matplotlib.ticker import MaxNLocator

    locator = MaxNLocator(count, steps=[1, 2, 5, 10])
    return [v for v in locator.tick_values(low, high) if low <= v <= high]


def _short(value) -> str:
    return f"{value:.4g}".replace("-", "−")
