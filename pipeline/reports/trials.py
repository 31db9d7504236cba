"""Contacts over the trials of a session: a raster, and the mean force from their onsets on."""

import numpy as np
import pandas as pd

from pipeline.reports import plot_style
from pipeline.reports.whisker_styles import whisker_styles

BEFORE_MS, AFTER_MS = 20.0, 80.0  # of the onset, averaged
STEP_MS = 1.0
HIGHEST_IN, LEAST_IN = 4.2, 1.9  # of the raster
TRIAL_IN = 0.16
LEGEND_COLUMNS, LINE_IN = 3, 0.19  # of the whiskers' names above it
MOST_WHISKERS = 6  # whose mean forces are drawn


def raster(videos, contacts: pd.DataFrame, styles=None) -> dict | None:
    """Raster of each processed video's contacts, from its first one on; None without any.

    `videos` are names, in the order of the trials; `styles` as for `draw_raster`.
    """
    videos = list(videos)
    if len(videos) < 2 or contacts.empty:
        return None
    counts = contacts["video"].value_counts().reindex(videos, fill_value=0).to_numpy()
    return {
        "plot": plot_style.svg(draw_raster(videos, contacts, styles)),
        "mean": counts.mean(),
        "least": int(counts.min()),
        "most": int(counts.max()),
        "none": int((counts == 0).sum()),
    }


def draw_raster(videos, contacts, styles=None):
    """A bar for every contact, a row for every trial, time from the trial's first contact.

    `styles`: whisker → `Style`, of all whiskers in the session; None: of those that touch.
    """
    from matplotlib.collections import LineCollection

    styles = styles or whisker_styles(contacts["whisker"])
    names = [name for name in styles if name in set(contacts["whisker"])]
    start = 1e3 * (contacts["onset_s"] - contacts.groupby("video")["onset_s"].transform("min"))
    rows = contacts["video"].map({name: k + 1 for k, name in enumerate(videos)})
    lanes = contacts["whisker"].map({name: k for k, name in enumerate(names)})
    y = rows + (lanes - (len(names) - 1) / 2) * 0.8 / len(names)
    bars = np.stack([np.c_[start, y], np.c_[start + contacts["duration_ms"], y]], axis=1)
    height = float(np.clip(0.8 + TRIAL_IN * len(videos) * len(names), LEAST_IN, HIGHEST_IN))
    figure, axis = plot_style.axes(height, top=0.3 if len(names) > 1 else 0.1)
    thick = 0.62 * 72 * (height - 0.8) / len(videos) / len(names)
    axis.add_collection(
        LineCollection(bars, colors=[styles[name].colour for name in contacts["whisker"]],
                       linewidths=float(np.clip(thick, 0.4, 7)), capstyle="butt",
                       rasterized=len(contacts) > 3000)
    )  # fmt: skip
    axis.set(xlabel="time from the trial's first contact (ms)", ylabel="trial",
             xlim=(-0.01 * bars[..., 0].max(), 1.02 * bars[..., 0].max()),
             ylim=(len(videos) + 0.6, 0.4))  # fmt: skip
    axis.yaxis.get_major_locator().set_params(integer=True)
    if len(names) > 1:
        _name_whiskers(axis, {name: styles[name] for name in names})
    return figure


def _name_whiskers(axis, styles):
    """The whiskers' names above a plot, in their colours."""
    axis.legend(
        handles=[
            axis.plot([], [], color=style.colour, lw=3, label=name)[0]
            for name, style in styles.items()
        ],
        loc="lower right", bbox_to_anchor=(1, 1), ncols=min(len(styles), MOST_WHISKERS),
        frameon=False, fontsize=9, handlelength=0.8, columnspacing=1.0, borderaxespad=0.1,
    )  # fmt: skip


class OnsetAverage:
    """Mean force around the onsets of contacts, whisker by whisker, video after video."""

    def __init__(self):
        self.time_ms = np.arange(-BEFORE_MS, AFTER_MS + STEP_MS / 2, STEP_MS)
        self._forces = {}  # whisker → [(times,), …], one for every contact

    def add(self, frames: pd.DataFrame, contacts: pd.DataFrame) -> None:
        """Take in a video: rows of frames.parquet and of contacts.csv."""
        for name, own in contacts.groupby("whisker", sort=False):
            rows = frames[frames["whisker"] == name]
            time, force = (rows[c].to_numpy(float) for c in ("time_s", "contact_force_uN"))
            if len(time) < 2 or not np.isfinite(force).any():
                continue
            for onset in own["onset_s"]:
                at = onset + 1e-3 * self.time_ms
                course = np.interp(at, time, force, left=np.nan, right=np.nan)
                self._forces.setdefault(str(name), []).append(course)

    def draw(self, styles=None):
        """Mean and standard error over the contacts; None where there are none with a force.

        `styles` as for `draw_raster`.
        """
        if not self._forces:
            return None
        styles, names = styles or whisker_styles(self._forces), list(self._forces)[:MOST_WHISKERS]
        lines = -(-len(names) // LEGEND_COLUMNS)
        figure, axis = plot_style.axes(2.7 + LINE_IN * lines, top=0.1 + LINE_IN * lines)
        for name in names:
            self._draw_one(axis, name, styles[name])
        axis.axvline(0, color=plot_style.GREY, lw=0.8, ls=":")
        axis.set(xlabel="time from contact onset (ms)", ylabel="force (µN)",
                 xlim=(-BEFORE_MS, AFTER_MS))  # fmt: skip
        axis.set_ylim(bottom=0)
        axis.legend(loc="lower right", bbox_to_anchor=(1, 1), frameon=False, fontsize=9,
                    ncols=LEGEND_COLUMNS, handlelength=1.2, columnspacing=1.0,
                    borderaxespad=0.1)  # fmt: skip
        return figure

    def _draw_one(self, axis, name, style):
        forces = pd.DataFrame(np.array(self._forces[name]))
        mean, error = forces.mean(), forces.sem().fillna(0.0)  # of one contact
        axis.fill_between(self.time_ms, np.maximum(mean - error, 0), mean + error,
                          color=style.colour, alpha=0.25, lw=0)  # fmt: skip
        axis.plot(
            self.time_ms,
            mean,
            color=style.colour,
            ls=style.line,
            lw=1.5,
            label=f"{name}, n = {len(forces)}",
        )
