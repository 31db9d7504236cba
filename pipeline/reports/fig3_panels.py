"""Drawing of the panels of Fig. 3, all in one figure, or each by itself.

Labels stand above the axes, where there are no data points.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd

from pipeline.reports.fig3_tables import ShownContact
from pipeline.reports.plot_style import ACCENT, BLACK, GREY, PALE
from pipeline.reports.session_numbers import PAPER
from pipeline.reports.whisker_styles import whisker_styles

DPI = 200
SIZE_IN, ONE_IN = (7.2, 5.6), (2.4, 2.4)
MARGINS = {
    "left": 0.075, "right": 0.99, "bottom": 0.085, "top": 0.9, "wspace": 0.38, "hspace": 0.6,
}  # fmt: skip
ONE_MARGINS = {"left": 0.25, "right": 0.97, "bottom": 0.18, "top": 0.8}
HEADER_PT, HEADER_LINE_PT, HEADER_GAP_PT, HEADER_LINES = 6.5, 8.4, 5, 3
LONGEST = 30  # letters of a name that is shown
STYLE = {
    "font.size": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
}
SHOWN_RANGE = (1.13, 1.28)  # heights of the two ranges over a histogram, of its highest bar


@dataclass(frozen=True)
class Content:
    """What is drawn: the panels' tables by letter, the numbers, and the contact or None."""

    panels: dict
    numbers: pd.DataFrame
    typical: ShownContact | None

    @property
    def recovered(self):
        """(quantity, statistic) → this session's number."""
        return self.numbers.set_index(["quantity", "statistic"])["recovered"]


def draw(content: Content):
    """Fig. 3 a–f as a matplotlib Figure."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=SIZE_IN, dpi=DPI)
        axes = figure.subplots(2, 3, gridspec_kw=MARGINS)
        for letter, axis in zip(PANELS, axes.flat, strict=True):
            _draw_panel(axis, letter, content, letter)
    return figure


def draw_one(content: Content, letter: str):
    """One panel as a matplotlib Figure."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=ONE_IN, dpi=DPI)
        _draw_panel(figure.subplots(gridspec_kw=ONE_MARGINS), letter, content)
    return figure


def _draw_panel(axis, letter, content, shown_letter=""):
    header = PANELS[letter](axis, content)
    above = {"xycoords": "axes fraction", "textcoords": "offset points", "va": "bottom"}
    indent, top = (11, HEADER_LINES) if shown_letter else (0, len(header))
    for k, (words, colour) in enumerate(header, 1):
        place = indent, HEADER_GAP_PT + (top - k) * HEADER_LINE_PT
        axis.annotate(words, (0, 1), place, fontsize=HEADER_PT, color=colour, **above)
    if shown_letter:
        place = -2, HEADER_GAP_PT + (HEADER_LINES - 1) * HEADER_LINE_PT - 1.5
        axis.annotate(letter, (0, 1), place, fontweight="bold", fontsize=10, **above)


def _empty(axis, text):
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color=GREY)
    axis.set(xticks=[], yticks=[])


def _name_of(typical) -> str:
    """The contact that panels a and b show."""
    contact = typical.contact
    video = str(contact["video"])
    if len(video) > LONGEST:
        video = f"{video[: LONGEST - 1]}…"
    return f"{video}\n{contact['whisker']}, contact {contact['contact']}"


def _panel_a(axis, content):
    """The whisker before, during and after a contact, one below the other; y as in the image."""
    table, typical = content.panels["a"], content.typical
    axis.set_axis_off()
    if table.empty:
        _empty(axis, "no contact to show")
        return []
    onset, offset = typical.contact["onset_frame"], typical.contact["offset_frame"]
    phase = np.where(table["frame"] < onset, 0, np.where(table["frame"] < offset, 1, 2))
    y = table[["y_mm", "follicle_y_mm"]]
    step = 1.15 * (y.max().max() - y.min().min()) + 0.5
    left = table["follicle_x_mm"].min()
    for number, name in enumerate(("before", "during", "after")):
        own = table[phase == number]
        _draw_lines(axis, own, typical, step * number)
        beside = own["follicle_y_mm"].median() if len(own) else table["follicle_y_mm"].median()
        axis.text(left - 0.7, beside + step * number, name, ha="right", va="center", fontsize=7)
    axis.set_aspect("equal")
    axis.invert_yaxis()
    bottom = y.max().max() + 2 * step + 1.0
    axis.plot([left, left + 2], [bottom, bottom], color=BLACK, lw=1.5)
    axis.text(left + 2.4, bottom, "2 mm", va="center", fontsize=7)
    axis.autoscale_view()
    return [(line, BLACK) for line in _name_of(typical).split("\n")]


def _draw_lines(axis, table, typical, down):
    """Centrelines, follicle dots and pole of one phase, moved `down` [mm]."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    starts = np.flatnonzero(table["frame"].diff().to_numpy())
    points = np.column_stack([table["x_mm"], table["y_mm"] + down])
    colours = np.where(table["in_contact"], BLACK, PALE)[starts]
    axis.add_collection(LineCollection(np.split(points, starts[1:]), colors=colours, lw=0.6))
    dots = table.drop_duplicates("frame")
    axis.plot(dots["follicle_x_mm"], dots["follicle_y_mm"] + down, ".", color=BLACK, ms=2.5)
    if typical.pole is not None:
        x, y, radius = np.array(typical.pole) / typical.settings.recording.pixels_per_mm
        axis.add_patch(Circle((x, y + down), radius, color=ACCENT, lw=0, zorder=3))


def _panel_b(axis, content):
    """The force of the same contact, and its half-Gaussian."""
    table, shown, typical = content.panels["b"], content.panels["a"], content.typical
    axis.set_xlabel("time from onset (ms)")
    axis.set_ylabel("contact force (µN)")
    if table.empty:
        _empty(axis, "no contact to show")
        return []
    axis.plot(table["time_ms"], table["force_uN"], color=PALE, lw=1)
    touching = table["force_uN"].where(table["in_contact"])
    axis.plot(table["time_ms"], touching, color=BLACK, lw=1.2)
    pulse = table[table["pulse_uN"] > 0]
    axis.plot(pulse["time_ms"], pulse["pulse_uN"], "--", color=ACCENT, lw=1.4)
    header = [("line: measured; dashed: half-Gaussian", BLACK)]
    if not shown.empty:
        frames = typical.frames["frame"].isin(shown.loc[shown["in_contact"], "frame"]).to_numpy()
        axis.plot(table["time_ms"][frames], table["force_uN"][frames], ".", color=BLACK, ms=4)
        header.append(("dots: the frames that a shows in black", BLACK))
    axis.set_ylim(top=1.06 * max(np.nanmax(table["force_uN"]), pulse["pulse_uN"].max(), 1e-3))
    return header


def _panel_c(axis, content):
    """Diameters of the whiskers as session.toml gives them."""
    table = content.panels["c"]
    axis.set_xlabel("distance from follicle (mm)")
    axis.set_ylabel("diameter (µm)")
    if table.empty:
        _empty(axis, "no whisker dimensions given")
        return []
    styles = whisker_styles(label.split(" ", 1)[1] for label in table["whisker"])
    for label, whisker in table.groupby("whisker"):
        name = label.split(" ", 1)[1]
        known = name in axis.get_legend_handles_labels()[1]
        axis.plot(whisker["arc_length_mm"], whisker["diameter_um"], lw=0.8,
                  color=styles[name].colour, ls=styles[name].line,
                  label=None if known else name)  # fmt: skip
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    if len(styles) > 1:  # below the lines there is nothing
        axis.legend(loc="lower left", frameon=False, fontsize=6.5, handlelength=1.2,
                    labelspacing=0.2)  # fmt: skip
    return [("from session.toml, not measured", BLACK)]


def _histogram(axis, content, letter, what, unit):
    """Histogram, and over it this session's median and 5–95 % range beside the paper's."""
    table, recovered = content.panels[letter], content.recovered
    start, end = table.iloc[:, 0], table.iloc[:, 1]
    axis.bar(start, table["contacts"], end - start, align="edge", color=PALE, edgecolor="white",
             linewidth=0.3)  # fmt: skip
    axis.set_xlabel(
        f"{'peak contact force' if what == 'peak force' else 'contact duration'} ({unit})"
    )
    axis.set_ylabel("contacts")
    if not table["contacts"].any():
        _empty(axis, "no contacts with a force" if what == "peak force" else "no contacts")
        return []
    top, header = max(table["contacts"].max(), 1), []
    rows = ((ACCENT, "paper", PAPER.get), (BLACK, "this session", recovered.get))
    for height, (colour, label, get) in zip(SHOWN_RANGE, rows, strict=True):
        low, middle, high = (get((what, each)) for each in ("5 %", "median", "95 %"))
        axis.plot([low, high], [height * top] * 2, color=colour, lw=1)
        axis.plot([middle], [height * top], "o", color=colour, ms=3.5)
        if np.isfinite(high):
            header.append((f"{label}: {middle:.3g} ({low:.3g}–{high:.3g}) {unit}", colour))
    header += [("dot and line: median (5–95 %)", BLACK)]
    axis.set_xlim(0, 1.02 * max(float(end.iloc[-1]), PAPER[what, "95 %"]))
    axis.set_ylim(top=1.36 * top)
    axis.yaxis.get_major_locator().set_params(integer=True)
    return [*header[-2::-1], header[-1]]


def _panel_f(axis, content):
    """Peak force against duration."""
    table = content.panels["f"].dropna()
    axis.set_xlabel("contact duration (ms)")
    axis.set_ylabel("peak contact force (µN)")
    if table.empty:
        _empty(axis, "no contacts with a force")
        return []
    size = float(np.clip(60 / np.sqrt(len(table)), 1, 8))
    axis.plot(
        table["duration_ms"],
        table["peak_force_uN"],
        ".",
        color=BLACK,
        ms=size,
        mew=0,
        alpha=0.6 if len(table) > 300 else 0.9,
        rasterized=len(table) > 3000,
    )
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
    r2, header = content.recovered["peak force and duration", "r²"], f"n = {len(table)}"
    if not np.isfinite(r2):
        return [(header, BLACK)]
    line = np.polyfit(table["duration_ms"], table["peak_force_uN"], 1)
    x = np.array([0, table["duration_ms"].max()])
    axis.plot(x, np.polyval(line, x), color=ACCENT, lw=1)
    return [(f"{header}, r² = {r2:.3f} (paper: 0.368)", BLACK), ("line: least squares", ACCENT)]


PANELS = {
    "a": _panel_a,
    "b": _panel_b,
    "c": _panel_c,
    "d": partial(_histogram, letter="d", what="peak force", unit="µN"),
    "e": partial(_histogram, letter="e", what="duration", unit="ms"),
    "f": _panel_f,
}
