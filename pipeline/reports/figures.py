"""The paper's Fig. 3 a–f from a results folder, with the numbers behind it as CSV."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.scene import pole_runs
from pipeline.session.session_file import Settings, read_session
from pipeline.tables import centrelines, files
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import CONTACT_COLUMNS
from whiskermodel.force_profiles import half_gaussian

GREY, BLACK, ACCENT = "#a8a8a8", "#111111", "#c8472b"
BEFORE_AFTER_MS = 25.0  # shown around the touch
LINES_SHOWN = 24  # centrelines in panel a
DPI = 200
MARGINS = {
    "left": 0.075, "right": 0.99, "bottom": 0.1, "top": 0.94, "wspace": 0.38, "hspace": 0.42,
}  # fmt: skip

# Hires, Efros & Svoboda 2013, Results: 12,417 contacts of mouse C2 whiskers.
PAPER = {
    ("contacts", "number"): 12417,
    ("peak force", "5 %"): 1.8,
    ("peak force", "median"): 16.1,
    ("peak force", "mean"): 19.6,
    ("peak force", "95 %"): 44.4,
    ("duration", "5 %"): 5.0,
    ("duration", "median"): 16.0,
    ("duration", "mean"): 30.9,
    ("duration", "95 %"): 113.0,
    ("peak force and duration", "r²"): 0.368,
}
UNITS = {"peak force": "µN", "duration": "ms"}


@dataclass(frozen=True)
class ShownTouch:
    """One touch with all that panels a and b show of it.

    `frames` are the rows of frames.parquet of its whisker from before to after; `centrelines`
    those frames' centrelines; `pole` its (x, y, radius) [px] or None.
    """

    contact: pd.Series
    frames: pd.DataFrame
    centrelines: Centrelines
    settings: Settings
    pole: tuple[float, float, float] | None


def write_fig3(results, truth=None) -> list[Path]:
    """Write figures/fig3.png, .svg, fig3.csv and a CSV per panel into a results folder.

    Parameters
    ----------
    results : folder of `whiskerforce run`
    truth : folder of truth tables of `whiskerforce synth`; None: the `truth` folder beside the
        videos, if there is one

    Returns
    -------
    The files written.

    Raises
    ------
    ValueError
        If `results` is no results folder.
    """
    results = Path(results)
    contacts = read_contacts(results)
    true_contacts = read_truth(results, truth)
    touch = typical_touch(results, contacts)
    folder = results / "figures"
    folder.mkdir(exist_ok=True)
    panels = {
        "a": _panel_a_table(touch),
        "b": _panel_b_table(touch),
        "c": diameters(results),
        "d": histogram(contacts["peak_force_uN"], 2.0, "peak_force_uN"),
        "e": histogram(contacts["duration_ms"], 5.0, "duration_ms"),
        "f": contacts[["video", "whisker", "contact", "duration_ms", "peak_force_uN"]],
    }
    written = []
    for letter, table in panels.items():
        written.append(folder / f"fig3{letter}.csv")
        _write(written[-1], table)
    numbers = fig3_numbers(contacts, true_contacts)
    _write(folder / "fig3.csv", numbers)
    _save(draw(panels, numbers, touch), folder)
    return [folder / f"fig3.{suffix}" for suffix in ("png", "svg", "csv")] + written


def _write(path, table):
    """Write a CSV, numbers with six digits; pandas' own writer takes three times as long."""
    columns = [
        [f"{v:.6g}" if v == v else "" for v in values] if values.dtype.kind == "f" else values
        for _, values in table.items()
    ]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(zip(*columns, strict=True))
    files.write_text(path, text.getvalue())


def _save(figure, folder):
    """Save fig3.png and fig3.svg, its text as text.

    The canvases are asked directly: `savefig` draws everything once more beforehand.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    with files.whole_file(folder / "fig3.png") as temporary:
        FigureCanvasAgg(figure).print_png(temporary)
    with (
        files.whole_file(folder / "fig3.svg") as temporary,
        mpl.rc_context({"svg.fonttype": "none"}),
    ):
        FigureCanvasSVG(figure).print_svg(temporary)


# --- reading -----------------------------------------------------------------------------


def read_contacts(results) -> pd.DataFrame:
    """contacts.csv of a results folder; ValueError if there is none."""
    path = Path(results) / "contacts.csv"
    if not path.is_file():
        raise ValueError(
            f"{results}: no contacts.csv in it; expected a results folder of `whiskerforce run`"
        )
    return files.read_csv(path, CONTACT_COLUMNS)


def read_truth(results, truth=None) -> pd.DataFrame | None:
    """True contacts of the videos of a results folder, None where they are not known.

    `video` is the name of the results folder of each. `truth` as in `write_fig3`.
    """
    inputs = files.read_json(Path(results) / "run.json", {}).get("inputs", {})
    parts = []
    for video, state in inputs.items():
        path = Path(state["path"])
        places = [Path(truth)] if truth else [p / "truth" for p in list(path.parents)[:2]]
        for place in places:
            table = place / path.stem / "contacts.csv"
            if state["frames"] and table.is_file():
                parts.append(files.read_csv(table, CONTACT_COLUMNS).assign(video=video))
                break
    return pd.concat(parts, ignore_index=True) if parts else None


def diameters(results) -> pd.DataFrame:
    """Diameter along every distinct whisker of a session."""
    whiskers = {}
    for path in sorted(Path(results).glob("*/session.toml")):
        for given in read_session(path).whisker:
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


# --- numbers -----------------------------------------------------------------------------


def statistics(contacts: pd.DataFrame) -> dict:
    """The numbers the paper gives of its contacts, keyed as in `PAPER`."""
    out = {("contacts", "number"): len(contacts)}
    for what, column in (("peak force", "peak_force_uN"), ("duration", "duration_ms")):
        values = contacts[column].dropna().to_numpy()
        some = len(values) > 0
        low, middle, high = np.percentile(values, [5, 50, 95]) if some else [np.nan] * 3
        out[what, "5 %"], out[what, "median"], out[what, "95 %"] = low, middle, high
        out[what, "mean"] = values.mean() if some else np.nan
    out["peak force and duration", "r²"] = r_squared(
        contacts["duration_ms"], contacts["peak_force_uN"]
    )
    return out


def r_squared(x, y) -> float:
    """Squared correlation of two columns, NaN with fewer than three pairs."""
    both = np.isfinite(x) & np.isfinite(y)
    if both.sum() < 3 or np.ptp(x[both]) == 0 or np.ptp(y[both]) == 0:
        return np.nan
    return float(np.corrcoef(x[both], y[both])[0, 1] ** 2)


def fig3_numbers(contacts, true_contacts=None) -> pd.DataFrame:
    """Recovered, published and (where there is one) true statistics side by side."""
    recovered = statistics(contacts)
    true = statistics(true_contacts) if true_contacts is not None else {}
    rows = [
        {
            "quantity": what,
            "statistic": which,
            "unit": UNITS.get(what, ""),
            "recovered": recovered[what, which],
            "truth": true.get((what, which), np.nan),
            "paper": published,
        }
        for (what, which), published in PAPER.items()
    ]
    return pd.DataFrame(rows)


def histogram(values, width: float, name: str) -> pd.DataFrame:
    """Counts in bins of `width` from zero up: name_from, name_to, contacts."""
    values = values.dropna().to_numpy()
    top = max(values.max(initial=0.0), width)
    edges = np.arange(0, np.ceil(top / width) + 1.5) * width
    counts, edges = np.histogram(values, edges)
    return pd.DataFrame({f"{name}_from": edges[:-1], f"{name}_to": edges[1:], "contacts": counts})


# --- the touch of panels a and b ---------------------------------------------------------


def typical_touch(results, contacts) -> ShownTouch | None:
    """The contact nearest to the medians of force and duration that a half-Gaussian fits well.

    None where there is no contact with a force.
    """
    usable = contacts[np.isfinite(contacts["pulse_r2"]) & (contacts["peak_force_uN"] > 0)]
    if usable.empty:
        return None
    measures = np.log(usable[["peak_force_uN", "duration_ms"]].to_numpy())
    off = np.abs(measures - np.median(measures, axis=0)).sum(axis=1)
    off += 3 * (1 - usable["pulse_r2"].to_numpy()) + 2.0 * (usable["flags"] != "").to_numpy()
    return load_touch(results, usable.iloc[int(np.argmin(off))])


def load_touch(results, contact) -> ShownTouch:
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
    return ShownTouch(
        contact,
        files.read_frames(folder / "frames.parquet", filters=inside),
        centrelines.read_centrelines(folder / "centrelines.parquet", filters=inside),
        settings,
        pole_runs.pole_at(files.read_json(folder / "run.json", {}), int(contact["onset_frame"])),
    )


def _panel_a_table(touch) -> pd.DataFrame:
    """Centrelines of about LINES_SHOWN frames, long: frame, in_contact, x_mm, y_mm."""
    columns = ["frame", "in_contact", "x_mm", "y_mm", "follicle_x_mm", "follicle_y_mm"]
    if touch is None:
        return pd.DataFrame(columns=columns)
    lines, scale = touch.centrelines, touch.settings.recording.pixels_per_mm
    shown = range(0, len(lines), max(len(lines) // LINES_SHOWN, 1))
    points = [lines.row(i)[::4] / scale for i in shown]
    if not points:
        return pd.DataFrame(columns=columns)
    frames = np.repeat(lines.frame[shown], [len(each) for each in points])
    at = touch.frames.set_index("frame").loc[frames]
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


def _panel_b_table(touch) -> pd.DataFrame:
    """Force of the same touch and its half-Gaussian against time from its onset."""
    if touch is None:
        return pd.DataFrame(columns=["time_ms", "force_uN", "in_contact", "pulse_uN"])
    frames, contact = touch.frames, touch.contact
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


# --- drawing -----------------------------------------------------------------------------


def draw(panels, numbers, touch):
    """Fig. 3 a–f as a matplotlib Figure."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    style = {
        "font.size": 8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.8,
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=(7.2, 4.8), dpi=DPI)
        axes = figure.subplots(2, 3, gridspec_kw=MARGINS)
        lookup = numbers.set_index(["quantity", "statistic"])["recovered"]
        _draw_a(axes[0, 0], panels["a"], touch)
        _draw_b(axes[0, 1], panels["b"], panels["a"], touch)
        _draw_c(axes[0, 2], panels["c"])
        _draw_histogram(axes[1, 0], panels["d"], lookup, "peak force", "µN")
        _draw_histogram(axes[1, 1], panels["e"], lookup, "duration", "ms")
        _draw_f(axes[1, 2], panels["f"], lookup)
        for letter, axis in zip("abcdef", axes.flat, strict=True):
            axis.set_title(letter, loc="left", fontweight="bold", fontsize=10)
    return figure


def _empty(axis, text):
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color=GREY)


def _draw_a(axis, table, touch):
    """The whisker before, during and after a touch, one below the other; y as in the image."""
    axis.set_axis_off()
    if table.empty:
        _empty(axis, "no contact to show")
        return
    onset, offset = touch.contact["onset_frame"], touch.contact["offset_frame"]
    phase = np.where(table["frame"] < onset, 0, np.where(table["frame"] < offset, 1, 2))
    y = table[["y_mm", "follicle_y_mm"]]
    step = 1.15 * (y.max().max() - y.min().min()) + 0.5
    left, middle = table["follicle_x_mm"].min(), table["y_mm"].median()
    for number, name in enumerate(("before", "during", "after")):
        _draw_lines(axis, table[phase == number], touch, step * number)
        axis.text(left - 0.7, middle + step * number, name, ha="right", va="center", fontsize=7)
    axis.set_aspect("equal")
    axis.invert_yaxis()
    bottom = y.max().max() + 2 * step + 0.8
    axis.plot([left, left + 2], [bottom, bottom], color=BLACK, lw=1.5)
    axis.text(left + 2.3, bottom, "2 mm", va="center", fontsize=7)


def _draw_lines(axis, table, touch, down):
    """Centrelines, follicle dots and pole of one phase, moved `down` [mm]."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    starts = np.flatnonzero(table["frame"].diff().to_numpy())
    points = np.column_stack([table["x_mm"], table["y_mm"] + down])
    colours = np.where(table["in_contact"], BLACK, GREY)[starts]
    axis.add_collection(LineCollection(np.split(points, starts[1:]), colors=colours, lw=0.6))
    dots = table.drop_duplicates("frame")
    axis.plot(dots["follicle_x_mm"], dots["follicle_y_mm"] + down, ".", color=BLACK, ms=2.5)
    if touch.pole is not None:
        x, y, radius = np.array(touch.pole) / touch.settings.recording.pixels_per_mm
        axis.add_patch(Circle((x, y + down), radius, color=ACCENT, lw=0, zorder=3))


def _draw_b(axis, table, shown, touch):
    axis.set_xlabel("time from onset (ms)")
    axis.set_ylabel("contact force (µN)")
    if table.empty:
        _empty(axis, "no contact to show")
        return
    axis.plot(table["time_ms"], table["force_uN"], color=GREY, lw=1)
    touching = table["force_uN"].where(table["in_contact"])
    axis.plot(table["time_ms"], touching, color=BLACK, lw=1.2, label="measured")
    if not shown.empty:
        frames = touch.frames["frame"].isin(shown.loc[shown["in_contact"], "frame"]).to_numpy()
        axis.plot(table["time_ms"][frames], table["force_uN"][frames], ".", color=BLACK, ms=4)
    pulse = table[table["pulse_uN"] > 0]
    axis.plot(pulse["time_ms"], pulse["pulse_uN"], color=ACCENT, lw=1, label="half-Gaussian")
    axis.legend(frameon=False, fontsize=7, loc="upper left", handlelength=1.2)
    axis.set_ylim(top=1.35 * max(np.nanmax(table["force_uN"]), 1e-3))


def _draw_c(axis, table):
    axis.set_xlabel("distance from follicle (mm)")
    axis.set_ylabel("diameter (µm)")
    if table.empty:
        _empty(axis, "no whisker dimensions given")
        return
    for _, whisker in table.groupby("whisker"):
        axis.plot(whisker["arc_length_mm"], whisker["diameter_um"], color=BLACK, lw=0.8)
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)


def _draw_histogram(axis, table, lookup, what, unit):
    """Histogram with this session's median and 5–95 % range beside the paper's."""
    start, end = table.iloc[:, 0], table.iloc[:, 1]
    axis.bar(start, table["contacts"], end - start, align="edge", color=GREY)
    axis.set_xlabel(
        f"{'peak contact force' if what == 'peak force' else 'contact duration'} ({unit})"
    )
    axis.set_ylabel("contacts")
    top = max(table["contacts"].max(), 1)
    rows = ((BLACK, "here", lookup.get), (ACCENT, "paper", PAPER.get))
    for height, (colour, label, get) in zip((1.34, 1.12), rows, strict=True):
        low, middle, high = (get((what, each)) for each in ("5 %", "median", "95 %"))
        axis.plot([low, high], [height * top] * 2, color=colour, lw=1)
        axis.plot([middle], [height * top], "o", color=colour, ms=3.5)
        if np.isfinite(high):
            text = f" {label}\n {low:.3g}–{high:.3g}"
            axis.text(high, height * top, text, color=colour, va="center", fontsize=6)
    axis.set_xlim(0, 1.35 * max(float(end.iloc[-1]) / 1.35, PAPER[what, "95 %"], high))
    axis.set_ylim(top=1.45 * top)
    axis.yaxis.get_major_locator().set_params(integer=True)


def _draw_f(axis, table, lookup):
    axis.set_xlabel("contact duration (ms)")
    axis.set_ylabel("peak contact force (µN)")
    table = table.dropna()
    if table.empty:
        _empty(axis, "no contacts")
        return
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
    r2 = lookup["peak force and duration", "r²"]
    if np.isfinite(r2):
        line = np.polyfit(table["duration_ms"], table["peak_force_uN"], 1)
        x = np.array([0, table["duration_ms"].max()])
        axis.plot(x, np.polyval(line, x), color=ACCENT, lw=1)
        text = f"r² = {r2:.3f} (paper 0.368)\nn = {len(table)}"
        axis.text(0.97, 0.03, text, ha="right", va="bottom", transform=axis.transAxes, fontsize=7)
    axis.set_xlim(left=0)
    axis.set_ylim(bottom=0)
