"""Plots for notebooks and papers: each takes an `ax`, and returns it."""

import pandas as pd

from pipeline.numerics.runs import runs_of_true
from pipeline.reports.whisker_styles import COLOURS, style_of
from pipeline.tables.centrelines import check_table
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS

LINES = 60  # centrelines that are drawn, if no step is given
Z95 = 1.96
MARKERS = "o^sDvPX*"
SHADE = "#d9d9d9"


def plot_course(frames: pd.DataFrame, column="contact_force_uN", whisker=None, ax=None):
    """Draw a column of frames.parquet over time, with its 95 % interval; contacts are shaded.

    Parameters
    ----------
    frames : rows of frames.parquet
    column : what is drawn
    whisker : one name, or several; None: all
    ax : matplotlib axes to draw on; None: the current ones
    """
    _check_columns(frames, column)
    names = _chosen(frames, whisker)
    ax = ax or _current_axes()
    for k, name in enumerate(names):
        rows = frames[frames["whisker"] == name].sort_values("frame")
        colour, style = style_of(k).colour, style_of(k).line
        time, value = rows["time_s"].to_numpy(), rows[column].to_numpy(float)
        ax.plot(time, value, color=colour, ls=style, lw=1, label=name)
        if (error := _error_column(column)) in rows:
            half = Z95 * rows[error].to_numpy(float)
            ax.fill_between(time, value - half, value + half, color=colour, alpha=0.25, lw=0)
        if len(names) == 1:
            _shade(ax, time, rows["in_contact"].to_numpy(bool))
    ax.set(xlabel="time (s)", ylabel=label_of(column))
    if len(names) > 1:
        ax.legend(frameon=False)
    return ax


def plot_centrelines(centrelines: pd.DataFrame, ax=None, step=None):
    """Draw traced lines in image coordinates, y down, a colour per whisker.

    Parameters
    ----------
    centrelines : rows of centrelines.parquet
    ax : matplotlib axes to draw on; None: the current ones
    step : every how many frames; None: some 60 of each whisker
    """
    check_table(centrelines)
    ax = ax or _current_axes()
    for k, (name, rows) in enumerate(centrelines.groupby("whisker", sort=False)):
        style = style_of(k)
        every = step or max(1, len(rows) // LINES)
        for i, (x, y) in enumerate(zip(rows["x_px"][::every], rows["y_px"][::every], strict=True)):
            label = "" if i else str(name)
            ax.plot(x, y, color=style.colour, ls=style.line, lw=0.6, alpha=0.6, label=label)
    ax.set(xlabel="x (px)", ylabel="y (px)", aspect="equal")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    if centrelines["whisker"].nunique() > 1:
        ax.legend(frameon=False)
    return ax


def plot_contacts(contacts: pd.DataFrame, x="duration_ms", y="peak_force_uN", ax=None):
    """Draw a point per contact, one column of contacts.csv against another.

    Parameters
    ----------
    contacts : rows of contacts.csv
    x, y : columns
    ax : matplotlib axes to draw on; None: the current ones
    """
    _check_columns(contacts, x, y)
    ax = ax or _current_axes()
    for k, (name, rows) in enumerate(contacts.groupby("whisker", sort=False)):
        ax.plot(rows[x], rows[y], _marker(k), ms=4, color=style_of(k).colour, label=str(name))
    ax.set(xlabel=label_of(x), ylabel=label_of(y))
    if contacts["whisker"].nunique() > 1:
        ax.legend(frameon=False)
    return ax


def _marker(number: int) -> str:
    """The shape of a whisker's points: they have no dashes."""
    return MARKERS[number // len(COLOURS) % len(MARKERS)]


def label_of(column) -> str:
    """A column's name and unit in words.

    >>> label_of("contact_force_uN"), label_of("vibration_ratio")
    ('contact force (µN)', 'vibration ratio')
    """
    units = {c.name: c.unit for c in (*CONTACT_COLUMNS, *FRAME_COLUMNS)}
    unit = units.get(column, "")
    ending = "_" + unit.replace("µ", "u").replace("1/", "per_").replace(" ", "_")
    words = column.removesuffix(ending).replace("_", " ") if unit else column.replace("_", " ")
    return f"{words} ({unit})" if unit else words


def _error_column(column) -> str:
    """The column of a column's standard error, whether it exists or not."""
    if column.endswith("_deg"):
        return f"{column.removesuffix('_deg')}_se_deg"
    return f"{column}_se"


def _check_columns(table, *columns):
    """ValueError where a column is not there, or holds no numbers."""
    known = table.select_dtypes(["number", "bool"]).columns
    for column in columns:
        if column not in known:
            raise ValueError(f"column must be one of {', '.join(known)}, got {column!r}")


def _chosen(frames, whisker) -> list:
    names = list(dict.fromkeys(frames["whisker"]))
    wanted = names if whisker is None else [whisker] if isinstance(whisker, str) else list(whisker)
    for name in wanted:
        if name not in names:
            raise ValueError(f"whisker must be one of {', '.join(names)}, got {name!r}")
    return wanted


def _shade(ax, time, touching):
    """Shade the frames in contact."""
    for onset, offset in runs_of_true(touching):
        end = time[min(offset, len(time) - 1)]
        ax.axvspan(time[onset], end, color=SHADE, lw=0, zorder=0)


def _current_axes():
    import matplotlib.pyplot as plt

    return plt.gca()
