"""The tables behind the panels of Fig. 3, and the contact that panels a and b show."""

import contextlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.scene import pole_runs
from pipeline.session.schema import Settings
from pipeline.session.session_file import SettingsError, read_session
from pipeline.tables import centrelines, files
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.run_record import read_pole
from whiskermodel.force_profiles import half_gaussian

BEFORE_AFTER_MS = 25.0  # shown around the contact
LINES_SHOWN = 24  # centrelines in panel a
LEAST_BINS = 4  # that hold most contacts: as wide bins as that, not wider


@dataclass(frozen=True)
class ShownContact:
    """One contact with all that panels a and b show of it.

    `frames` are the rows of frames.parquet of its whisker from before to after; `centrelines`
    those frames' centrelines; `pole` its (x, y, radius) [px] or None.
    """

    contact: pd.Series
    frames: pd.DataFrame
    centrelines: Centrelines
    settings: Settings
    pole: tuple[float, float, float] | None


def panel_tables(results, contacts, typical) -> dict[str, pd.DataFrame]:
    """The tables of panels a to f, by letter; `typical` as of `typical_contact`."""
    return {
        "a": _panel_a_table(typical),
        "b": _panel_b_table(typical),
        "c": diameters(results),
        "d": histogram(contacts["peak_force_uN"], "peak_force_uN"),
        "e": histogram(contacts["duration_ms"], "duration_ms", frame_ms(contacts)),
        "f": contacts[["video", "whisker", "contact", "duration_ms", "peak_force_uN"]],
    }


def diameters(results) -> pd.DataFrame:
    """Diameter along every distinct whisker of a session."""
    whiskers = {}
    for path in sorted(Path(results).glob("*/frames.parquet")):
        with contextlib.suppress(SettingsError):  # of a video that is left out
            for given in read_session(path.with_name("session.toml")).whisker:
                if given.si() is not None:
                    whiskers.setdefault(given, given.si())
    rows = []
    for number, (given, whisker) in enumerate(whiskers.items(), 1):
        at = np.linspace(0, whisker.length, 37)
        rows.append(
            pd.DataFrame(
                {
                    "whisker": f"{number} {given.name}",
                    "arc_length_mm": 1e3 * at,
                    "diameter_um": 2e6 * whisker.radius(at),
                }
            )
        )
    columns = ["whisker", "arc_length_mm", "diameter_um"]
    return pd.concat(rows) if rows else pd.DataFrame(columns=columns)


def frame_ms(contacts) -> float:
    """Time between frames [ms], of which all durations are multiples; 0 without contacts."""
    frames = contacts["offset_frame"] - contacts["onset_frame"]
    return float((contacts["duration_ms"] / frames).median()) if len(contacts) else 0.0


def bin_width(values, step=0.0) -> float:
    """Width of a histogram's bins by the number and the spread of the values.

    After Freedman & Diaconis, as the nearest 1, 2 or 5 times a power of ten, and a multiple of
    `step`.
    """
    spread = np.subtract(*np.percentile(values, [75, 25])) if len(values) else 0.0
    wanted = 2 * spread / max(len(values), 1) ** (1 / 3)
    if len(values):
        wanted = min(wanted, np.percentile(values, 95) / LEAST_BINS)
    if wanted <= 0:
        return step or 1.0
    choices = [m * 10.0**e for e in range(-3, 5) for m in (1, 2, 5)]
    width = min(choices, key=lambda choice: abs(np.log(choice / wanted)))
    return step * max(round(width / step), 1) if step else width


def histogram(values, name: str, step=0.0) -> pd.DataFrame:
    """Counts in bins from zero up: name_from, name_to, contacts; `step` as in `bin_width`."""
    values = values.dropna().to_numpy()
    width = bin_width(values, step)
    top = max(values.max(initial=0.0), width)
    edges = np.arange(0, np.ceil(top / width) + 1.5) * width
    counts, edges = np.histogram(values, edges)
    return pd.DataFrame({f"{name}_from": edges[:-1], f"{name}_to": edges[1:], "contacts": counts})


NOT_THERE = {  # by option
    "video": "no video of this name has contacts",
    "whisker": "no whisker of this name has contacts",
    "contact": "no contact of this number is",
}


# --- the contact of panels a and b ---------------------------------------------------------


def chosen(contacts, video=None, whisker=None, contact=None) -> pd.DataFrame:
    """The contacts of a video, a whisker, a number; ValueError where there is none such."""
    wanted = {"video": video, "whisker": whisker, "contact": contact}
    for column, value in wanted.items():
        if value is None:
            continue
        there = contacts[column].unique()
        contacts = contacts[contacts[column] == value]
        if contacts.empty:
            some = ", ".join(str(each) for each in there[:12])
            more = ", …" if len(there) > 12 else ""
            raise ValueError(
                f"--{column} {value}: {NOT_THERE[column]} in contacts.csv; give one of {some}"
                + more
            )
    return contacts


def typical_contact(results, contacts) -> ShownContact | None:
    """The contact nearest to the medians of force and duration that a half-Gaussian fits well.

    None where there is no contact with a force.
    """
    usable = contacts[np.isfinite(contacts["pulse_r2"]) & (contacts["peak_force_uN"] > 0)]
    if usable.empty:
        return None
    measures = np.log(usable[["peak_force_uN", "duration_ms"]].to_numpy())
    off = np.abs(measures - np.median(measures, axis=0)).sum(axis=1)
    off += 3 * (1 - usable["pulse_r2"].to_numpy()) + 2.0 * (usable["flags"] != "").to_numpy()
    return load_contact(results, usable.iloc[int(np.argmin(off))])


def load_contact(results, contact) -> ShownContact:
    """Read the frames and centrelines around one row of contacts.csv."""
    folder = Path(results) / contact["video"]
    settings = read_session(folder / "session.toml")
    margin = round(1e-3 * BEFORE_AFTER_MS * settings.recording.frames_per_second)
    first, last = contact["onset_frame"] - margin, contact["offset_frame"] + margin
    inside = [
        ("whisker", "==", contact["whisker"]),
        ("frame", ">=", int(first)),
        ("frame", "<", int(last)),
    ]
    return ShownContact(
        contact,
        files.read_frames(folder / "frames.parquet", filters=inside),
        centrelines.read_centrelines(folder / "centrelines.parquet", filters=inside),
        settings,
        pole_runs.pole_at(read_pole(folder), int(contact["onset_frame"])),
    )


def _panel_a_table(typical) -> pd.DataFrame:
    """Centrelines of about LINES_SHOWN frames, long: frame, in_contact, x_mm, y_mm."""
    columns = ["frame", "in_contact", "x_mm", "y_mm", "follicle_x_mm", "follicle_y_mm"]
    if typical is None:
        return pd.DataFrame(columns=columns)
    lines, scale = typical.centrelines, typical.settings.recording.pixels_per_mm
    shown = range(0, len(lines), max(len(lines) // LINES_SHOWN, 1))
    points = [lines.row(i)[::4] / scale for i in shown]
    if not points:
        return pd.DataFrame(columns=columns)
    frames = np.repeat(lines.frame[shown], [len(each) for each in points])
    at = typical.frames.set_index("frame").loc[frames]
    x, y = np.concatenate(points).T
    return pd.DataFrame(
        {
            "frame": frames,
            "in_contact": at["in_contact"].to_numpy(bool),
            "x_mm": x,
            "y_mm": y,
            "follicle_x_mm": at["follicle_x_px"].to_numpy() / scale,
            "follicle_y_mm": at["follicle_y_px"].to_numpy() / scale,
        }
    )


def _panel_b_table(typical) -> pd.DataFrame:
    """Force of the same contact and its half-Gaussian against time from its onset."""
    if typical is None:
        return pd.DataFrame(columns=["time_ms", "force_uN", "in_contact", "pulse_uN"])
    frames, contact = typical.frames, typical.contact
    duration = 1e-3 * contact["pulse_duration_ms"]
    pulse = half_gaussian(
        frames["time_s"].to_numpy(),
        duration,
        contact["pulse_peak_uN"],
        contact["pulse_centre_s"] - duration / 2,
    )
    return pd.DataFrame(
        {
            "time_ms": 1e3 * (frames["time_s"] - contact["onset_s"]),
            "force_uN": frames["contact_force_uN"],
            "in_contact": frames["in_contact"],
            "pulse_uN": pulse,
        }
    )
