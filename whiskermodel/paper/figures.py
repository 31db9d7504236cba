"""Drawings of the paper's model figures from the numbers of `paper`; needs matplotlib."""

from functools import wraps

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter

from whiskermodel.paper import figure_data
from whiskermodel.whisker import mouse_c2, rat_c2

INK, GREY, BLUE, ORANGE, GREEN = "#222222", "#8a8a8a", "#0072b2", "#d55e00", "#009e73"
SEQUENCE = ("#3b1f6b", "#2f6aa8", "#1f9e89", "#7cb342", "#e0a100")
ON_ANY_GROUND = [withStroke(linewidth=2.2, foreground="#000000c0")]  # a dark rim for light ink
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.edgecolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.1,
    "svg.hashsalt": "whiskerforce",
    "svg.fonttype": "none",
}


def save(path, figure, kind):
    """Write `figure` to `path` as "png" or "svg", the same bytes for the same figure."""
    metadata = {"Date": None} if kind == "svg" else {"Software": None}
    with matplotlib.rc_context(STYLE):
        figure.savefig(path, format=kind, dpi=150, metadata=metadata)
    figure.set_layout_engine("none")  # arranged once is enough


def _figure(width, height, title):
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.suptitle(title, fontsize=11, fontweight="bold", x=0.01, ha="left")
    return figure


def _styled(draw):
    """Run a drawing function under the house style."""

    @wraps(draw)
    def styled(*content):
        with matplotlib.rc_context(STYLE):
            return draw(*content)

    return styled


def _panel(axes, letter, words=""):
    """Put the panel's letter, the paper's where it has one, before its title."""
    axes.set_title(words)
    axes.annotate(letter, (0, 1), (-4, 6), xycoords="axes fraction", textcoords="offset points",
                  fontweight="bold", fontsize=10, ha="right", va="baseline")  # fmt: skip


def _zero(axes):
    axes.axhline(0, color=GREY, linewidth=0.6, zorder=0)


def _outline(axes, whisker, contacts=(), colours=(INK,)):
    """The whisker from the side, its thickness drawn 30-fold, with arrows where it is touched."""
    x = np.linspace(0, whisker.length, 100)
    half = 30 * whisker.radius(x) * figure_data.MILLI
    axes.fill_between(x * figure_data.MILLI, -half, half, color="#c9b79c", linewidth=0)
    for contact, colour in zip(contacts, colours, strict=False):
        at, reach = contact * figure_data.MILLI, 30 * whisker.base_radius * figure_data.MILLI
        arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6}
        edge = 30 * float(whisker.radius(contact)) * figure_data.MILLI
        axes.annotate("", (at, edge), (at, edge + 1.6 * reach), arrowprops=arrow)
    axes.set(xlabel="from the follicle (mm)", yticks=[], xlim=(-0.5, whisker.length * 1e3 + 1))
    axes.set_ylim(-45 * whisker.base_radius * 1e3, 100 * whisker.base_radius * 1e3)
    axes.spines["left"].set_visible(False)


# Modes and ring-down --------------------------------------------------------------------------


@_styled
def draw_fig2(table):
    """The three lowest modes and their first three derivatives."""
    figure = _figure(10, 9.5, "Fig. 2  The three lowest modes of a cylinder and of a cone")
    columns = ("displacement", "slope", "curvature", "third_derivative")
    rows = (("fixed", 0.0), ("fixed", 1.0), ("pinned", 0.0), ("pinned", 1.0))
    axes = figure.subplots(4, 4, sharex=True)
    for k, (row, (boundary, taper)) in enumerate(zip(axes, rows, strict=True)):
        here = (table["boundary"] == boundary) & (table["taper"] == taper)
        for i, (panel, column) in enumerate(zip(row, columns, strict=True), 1):
            _mode_curves(panel, table, here, column)
            _panel(panel, f"{'ab'[k // 2]}{i + 4 * (k % 2)}")
        row[0].set_ylabel(f"{boundary}\n{'cone' if taper else 'cylinder'}", fontsize=10)
    for panel, title in zip(axes[0], ("φ", "φ′", "φ″", "φ‴"), strict=True):
        panel.set_title(title, fontsize=12, loc="center")
    for panel in axes[-1]:
        panel.set_xlabel("x / L")
    handles, labels = axes[3, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=4)
    return figure


def _mode_curves(panel, table, here, column):
    """Three modes; dotted in the paper's basis where that is another curve."""
    x, y = table["x_over_length"], table[column]
    for mode, colour in ((1, BLUE), (2, GREEN), (3, ORANGE)):
        for paper_basis in (True, False):
            pick = here & (table["mode"] == mode) & ((table["basis"] == "paper") == paper_basis)
            if paper_basis:
                label = "the paper's basis" if mode == 1 else None
                panel.plot(x[pick], y[pick], ":", color=colour, linewidth=0.9, label=label)
            else:
                panel.plot(x[pick], y[pick], color=colour, label=f"mode {mode}")
    converged = np.abs(y[here & (table["basis"] != "paper")]).max()
    low, high = panel.get_ylim()
    # the paper's pinned basis swings far beyond in its derivatives
    panel.set_ylim(max(low, -1.5 * converged), min(high, 1.5 * converged))
    _zero(panel)


@_styled
def draw_fig5(traces, fits):
    """Simulated slips with their fits, and the fitted damping and frequency."""
    figure = _figure(
        10, 3.6, "Fig. 5  Ring-down after a slip (simulated; published means in grey)"
    )
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.7, 1, 1))
    pick = traces["slip"] == 1
    time, curvature = traces["time_ms"][pick], traces["curvature_change_per_m"][pick]
    first = {name: fits[name][0] for name in ("damping_per_s", "angular_frequency_rad_per_s")}
    left.plot(time, curvature, "o", color=INK, markersize=3.5, label="film, 1000 frames/s")
    left.plot(*_fitted_curve(time, traces["fitted_per_m"][pick], first), color=ORANGE, label="fit")
    _zero(left)
    left.set(xlabel="after the slip (ms)", ylabel="curvature change at 6 mm (1/m)")
    _panel(left, "b")
    left.legend()
    for panel, letter, name, label, mean, spread in (
        (middle, "c1", "angular_frequency_rad_per_s", "angular frequency (rad/s)", 938, 27),
        (right, "c2", "damping_per_s", "damping (1/s)", 215, 45),
    ):
        _intervals(panel, fits, name)
        panel.axhspan(mean - spread, mean + spread, color=GREY, alpha=0.25, linewidth=0)
        panel.axhline(mean, color=GREY, linewidth=1)
        panel.set(xlabel="slip", ylabel=label)
        _panel(panel, letter)
    return figure


def _fitted_curve(time, fitted, first):
    """The fit between the frames: exact, since it obeys a three-term recursion of its own."""
    d, p = first["damping_per_s"], first["angular_frequency_rad_per_s"]
    fine = np.linspace(0, time[-1], 600)
    t = np.stack(
        [np.exp(-d * s) * trig(p * s) for s in (time * 1e-3,) for trig in (np.cos, np.sin)]
    )
    amplitudes = np.linalg.lstsq(t.T, fitted, rcond=None)[0]
    s = fine * 1e-3
    swing = amplitudes[0] * np.cos(p * s) + amplitudes[1] * np.sin(p * s)
    return fine, np.exp(-d * s) * swing


def _intervals(panel, fits, name):
    value = fits[name]
    bars = [value - fits[f"{name}_low"], fits[f"{name}_high"] - value]
    panel.errorbar(fits["slip"], value, bars, fmt="o", color=BLUE, markersize=4, capsize=2.5)
    panel.set_xticks(fits["slip"])


# Displacement ---------------------------------------------------------------------------------


@_styled
def draw_fig6(motions):
    """Force; steady displacement; whole and vibrational displacement for both ends."""
    figure = _figure(10.5, 8.5, "Fig. 6  Displacement of the whisker, 20 µN contact at 9 mm")
    axes = figure.subplots(4, 3, height_ratios=(0.6, 1.2, 1.2, 1.2))
    fixed = motions[0]
    force = axes[0, 0]
    force.plot(fixed.time * figure_data.MILLI, fixed.force * figure_data.MICRO, color=INK)
    force.set(ylabel="force (µN)", xlabel="time (ms)", xlim=(0, 40))
    _panel(force, "a", "force")
    for panel in (axes[0, 1], axes[0, 2], axes[2, 0]):
        panel.axis("off")
    _space_time(axes[1, 0], fixed, fixed.steady, 2.0)
    _panel(axes[1, 0], "b1", "steady")
    _shapes(axes[3, 0], fixed, fixed.steady)
    _panel(axes[3, 0], "b2", "steady shapes, every ms")
    for k, (column, motion) in enumerate(zip(axes.T[1:], motions, strict=True)):
        image = _space_time(column[1], motion, motion.steady + motion.vibrational, 2.0)
        _panel(column[1], f"c{3 * k + 1}", f"base {motion.boundary}: steady and vibrational")
        small = _space_time(column[2], motion, motion.vibrational, 0.2)
        _panel(column[2], f"c{3 * k + 2}", f"base {motion.boundary}: vibrational alone")
        _shapes(column[3], motion, motion.vibrational)
        _panel(column[3], f"c{3 * k + 3}", "vibrational shapes, every ms")
    figure.colorbar(image, ax=axes[1, :], label="y (mm)", aspect=12)
    figure.colorbar(small, ax=axes[2, :], label="y (mm)", aspect=12, extend="both")
    scale = matplotlib.cm.ScalarMappable(Normalize(0, 40), "viridis")
    figure.colorbar(scale, ax=axes[3, :], label="time (ms)", aspect=12)
    return figure


def _space_time(panel, motion, y, limit_mm):
    image = panel.pcolormesh(
        motion.time[::20] * figure_data.MILLI,
        motion.arc_length * figure_data.MILLI,
        y[:, ::20] * figure_data.MILLI,
        cmap="RdBu_r",
        norm=Normalize(-limit_mm, limit_mm),
        shading="nearest",
        rasterized=True,
    )
    panel.axhline(9, color=INK, linewidth=0.6, linestyle=":")
    panel.set(xlabel="time (ms)", ylabel="x (mm)")
    return image


def _shapes(panel, motion, y):
    step = round(1e-3 / figure_data.DT)
    for j in range(0, len(motion.time), step):
        colour = matplotlib.colormaps["viridis"](j * figure_data.DT / 40e-3)
        along, across = motion.arc_length * figure_data.MILLI, y[:, j] * figure_data.MILLI
        panel.plot(along, across, color=colour, linewidth=0.7)
    panel.axvline(9, color=INK, linewidth=0.6, linestyle=":")
    panel.set(xlabel="x (mm)", ylabel="y (mm)")


# Base moments ---------------------------------------------------------------------------------


@_styled
def draw_fig7(table, cases):
    """Contact points, traces, and the ratio against position."""
    figure = _figure(10, 6.4, "Fig. 7  Base moment against contact position, 12 ms contacts")
    grid = figure.add_gridspec(3, 4, height_ratios=(0.55, 1, 1.25))
    outline = figure.add_subplot(grid[0, :])
    _outline(outline, mouse_c2(), [c for c, _, _ in cases], SEQUENCE)
    _panel(outline, "a", "the whisker, 30 times as thick, and where it is touched")
    for i, (contact, _, loads) in enumerate(cases):
        panel = figure.add_subplot(grid[1, i])
        _moment_trace(panel, loads, SEQUENCE[i], 40)
        force = loads.force.max() * figure_data.MICRO
        _panel(panel, f"b{i + 1}", f"{contact * 1e3:.0f} mm, {force:g} µN")
        panel.set_ylabel("moment (nN m)" if i == 0 else "")
        if i == 0:
            panel.legend(loc="lower right")
    ratio = figure.add_subplot(grid[2, :])
    marks = [c * figure_data.MILLI for c, _, _ in cases]
    _ratio_curves(ratio, table, "contact_mm", marks)
    ratio.set(xlabel="contact from the follicle (mm)", ylim=(-1.6, 1.6))
    _panel(ratio, "c")
    return figure


@_styled
def draw_fig8(table, cases):
    """Traces for four durations, and the ratio against duration."""
    figure = _figure(10, 5.2, "Fig. 8  Base moment against contact duration, 2.5 µN at 12 mm")
    grid = figure.add_gridspec(2, 4, height_ratios=(1, 1.25))
    for i, (_, duration, loads) in enumerate(cases):
        panel = figure.add_subplot(grid[0, i])
        _moment_trace(panel, loads, SEQUENCE[i], 40)
        _panel(panel, f"a{i + 1}", f"{duration * 1e3:g} ms")
        panel.set_ylabel("moment (nN m)" if i == 0 else "")
        if i == 0:
            panel.legend(loc="upper right")
    ratio = figure.add_subplot(grid[1, :])
    _ratio_curves(ratio, table, "duration_ms", [t * figure_data.MILLI for _, t, _ in cases])
    ratio.set(xlabel="contact duration (ms)", xscale="log", ylim=(-3, 3))
    _panel(ratio, "b")
    ratio.set_xticks([1, 2, 2.5, 5, 10, 20, 50], ["1", "2", "", "5", "10", "20", "50"])
    ratio.minorticks_off()
    return figure


def _moment_trace(panel, loads, colour, end_ms):
    time = loads.time * figure_data.MILLI
    panel.plot(
        time, loads.vibrational_moment * figure_data.NANO, color=colour, label="vibrational"
    )
    panel.plot(time, loads.steady_moment * figure_data.NANO, ":", color=INK, linewidth=1.4,
               label="steady")  # fmt: skip
    _zero(panel)
    panel.set(xlim=(0, end_ms), xlabel="time (ms)")


def _ratio_curves(panel, table, abscissa, marks):
    """Peak + and − of vibrational over steady moment, both frames; dots at the paper's cases."""
    for frame, style in (("chord", "-"), ("clamped", "--")):
        pick = table["frame"] == frame
        x = table[abscissa][pick]
        for name, colour in (("vibration_max_ratio", ORANGE), ("vibration_min_ratio", BLUE)):
            y = table[name][pick]
            panel.plot(x, y, style, color=colour, linewidth=1.4 if style == "-" else 1)
            if frame == "chord":
                dots = [int(np.argmin(np.abs(x - mark))) for mark in marks]
                panel.plot(x[dots], y[dots], "o", color=colour, markersize=5)
    for level in (-1, 1):
        panel.axhline(level, color=GREY, linewidth=0.6, linestyle=":")
    _zero(panel)
    panel.set_ylabel("peak vibrational / peak steady")
    place = "upper left" if abscissa == "contact_mm" else "upper right"
    panel.legend(handles=_ratio_key(), loc=place, ncols=2)


def _ratio_key():
    """What colours, lines and dots of `_ratio_curves` mean."""
    lines = (
        ("positive peak", {"color": ORANGE}),
        ("negative peak", {"color": BLUE}),
        ("cases drawn above", {"color": INK, "linestyle": "", "marker": "o", "markersize": 5}),
        ("chord frame (the paper's)", {"color": INK}),
        ("follicle clamped in the lab", {"color": INK, "linestyle": "--", "linewidth": 1}),
    )
    return [Line2D([], [], label=label, **style) for label, style in lines]


@_styled
def draw_fig9(table, cases, single, deflections):
    """Stick-slip: place, deflection at 16 mm, moments for five slips."""
    figure = _figure(10, 8, "Fig. 9  Stick-slip of a rat whisker, 5 µN at 32 mm")
    grid = figure.add_gridspec(3, 6, height_ratios=(0.5, 1, 2.2))
    outline = figure.add_subplot(grid[0, :3])
    _outline(outline, rat_c2(), [figure_data.FIGURE_9_CONTACT])
    _panel(outline, "a", "the whisker, 30 times as thick, and where it sticks")
    deflection = figure.add_subplot(grid[:2, 3:])
    for i, (slip, y) in enumerate(deflections):
        time = np.arange(len(y)) * figure_data.DT * figure_data.MILLI
        deflection.plot(
            time, y * figure_data.MILLI, color=SEQUENCE[i], label=f"slip {slip * 1e3:g} ms"
        )
    deflection.set(xlim=(0, 45), xlabel="time (ms)", ylabel="y at 16 mm (mm)")
    _panel(deflection, "b")
    deflection.legend(loc="upper right")
    ratio = figure.add_subplot(grid[1, :3])
    _slip_ratios(ratio, table)
    _panel(ratio, "d", "peak ratios of c")
    inner = grid[2, :].subgridspec(2, 3)
    for i, ((_, slip, loads), (*_, alone)) in enumerate(zip(cases, single, strict=True)):
        panel = figure.add_subplot(inner[i // 3, i % 3])
        time = alone.time * figure_data.MILLI
        panel.plot(time, alone.vibrational_moment * figure_data.NANO, color=GREY, linewidth=0.8,
                   label="without the second stick")  # fmt: skip
        _moment_trace(panel, loads, SEQUENCE[i], 45)
        _panel(panel, f"c{i + 1}", f"slip {slip * 1e3:g} ms")
        panel.set_ylabel("moment (nN m)" if i % 3 == 0 else "")
    key = figure.add_subplot(inner[1, 2])
    key.axis("off")
    handles, labels = panel.get_legend_handles_labels()
    key.legend(handles, labels, loc="center", fontsize=9)
    return figure


def _slip_ratios(panel, table):
    for frame, style in (("chord", "o-"), ("clamped", "s--")):
        pick = table["frame"] == frame
        peak = np.maximum(table["vibration_max_ratio"], -table["vibration_min_ratio"])[pick]
        panel.plot(table["duration_ms"][pick], peak, style,
                   color=INK if frame == "chord" else GREY,
                   markersize=4, label=f"{frame} frame")  # fmt: skip
    panel.axhline(1, color=GREY, linewidth=0.6, linestyle=":")
    panel.set(xscale="log", yscale="log", xlabel="slip duration (ms)", ylabel="vibr. / steady")
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    panel.set_xticks([0.25, 0.5, 1, 2, 4])
    panel.set_yticks([1, 3, 10, 30])
    panel.minorticks_off()
    panel.legend()


@_styled
def draw_fig10(cases):
    """Ramp-and-hold: place, displacement, moments, and the same magnified."""
    figure = _figure(10, 6.2, "Fig. 10  Ramp-and-hold, 12° at 10 mm, rat whisker cut at 13 mm")
    (outline, moved), (moment, close) = figure.subplots(2, 2, height_ratios=(1, 1.5))
    _outline(outline, rat_c2(length=13e-3), [figure_data.FIGURE_10_CONTACT])
    _panel(outline, "a", "the whisker, 30 times as thick, and where it is pushed")
    for i, (contact, ramp, loads) in enumerate(cases):
        time, share = loads.time * figure_data.MILLI, loads.force / loads.force.max()
        reach = contact * np.tan(figure_data.FIGURE_10_ANGLE) * figure_data.MILLI
        label = f"{ramp * 1e3:g} ms ({np.rad2deg(figure_data.FIGURE_10_ANGLE) / ramp:.0f} °/s)"
        moved.plot(time, reach * share, color=SEQUENCE[i], label=label)
        moment.plot(
            time, loads.steady_moment * figure_data.NANO, ":", color=SEQUENCE[i], linewidth=1.4
        )
        for panel in (moment, close):
            panel.plot(time, loads.vibrational_moment * figure_data.NANO, color=SEQUENCE[i])
    moved.set(xlabel="time (ms)", ylabel="displacement at 10 mm (mm)", xlim=(0, 80))
    _panel(moved, "b", "ramps")
    moved.legend(loc="lower right")
    _panel(moment, "c", "steady (dotted) and vibrational (solid), colours as in b")
    _panel(close, "d", "vibrational, magnified, colours as in b")
    for panel in (moment, close):
        panel.set(xlabel="time (ms)", ylabel="base moment (nN m)", xlim=(0, 80))
        _zero(panel)
    return figure


# The map, and the contact-consistent model -------------------------------------------------------

LABELS_AT_MS = 1.5, 50.0  # where the lines of the map are labelled; those below 0.1 later
# label, contact mm and duration ms (low, high), where the label stands and its alignment; the
# ranges are those the paper's text gives
TASKS = {
    "mouse": (
        ("poles at 7–11 mm,\n5–95 % of durations", (7, 11), (5, 113), (7.15, 95), "left"),
        ("Fig. 7", (6, 15), (11.4, 12.6), (14.9, 13.2), "right"),
        ("Fig. 8", (11.85, 12.15), (2.5, 20), (12.3, 3.0), "left"),
    ),
    "rat": (
        ("sandpaper, 5 mm from\nthe tip: 2 ms slips,\nsticks up to 20 ms", (29.6, 30.7), (2, 20),
         (29.2, 18), "right"),
        ("slips of Fig. 9", (31.5, 32.5), (0.5, 4), (31.2, 0.62), "right"),
        ("ramp-and-hold\n(of a cut whisker)", (9.6, 10.4), (2.4, 48), (10.7, 40), "left"),
    ),
}  # fmt: skip


@_styled
def draw_fig11(table):
    """Ratio over contact position and duration, rat and mouse, with where tasks lie."""
    figure = _figure(11, 5, "Fig. 11  Peak vibrational over peak steady base moment")
    panels = figure.subplots(1, 2)
    for letter, panel, species in zip("ab", panels, ("rat", "mouse"), strict=True):
        pick = table["species"] == species
        c, duration = (np.unique(table[n][pick]) for n in ("contact_mm", "duration_ms"))
        ratio = table["vibration_ratio"][pick].reshape(len(c), len(duration)).T
        image = panel.pcolormesh(c, duration, ratio, cmap="magma", norm=LogNorm(1e-3, 30),
                                 shading="nearest", rasterized=True)  # fmt: skip
        panel.set(yscale="log", xlabel="contact from the follicle (mm)", ylim=(0.5, 120),
                  ylabel="contact duration (ms)")  # fmt: skip
        panel.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        _panel(panel, letter, f"{species} C2")
        _levels(panel, c, duration, ratio)
        _tasks(panel, species)
    figure.colorbar(image, ax=figure.axes, label="peak |vibrational| / peak |steady|", aspect=30)
    return figure


def _levels(panel, c, duration, ratio):
    """Lines of equal ratio, labelled where the tasks' names do not stand."""
    levels = [0.01, 0.1, 0.3, 1, 3, 10]
    lines = panel.contour(c, duration, ratio, levels, colors="white", linewidths=0.8)
    lines.set_path_effects(ON_ANY_GROUND)
    places = []
    for level in levels:
        row = int(np.argmin(np.abs(np.log(duration / LABELS_AT_MS[level < 0.1]))))
        if ratio[row].min() < level < ratio[row].max():
            places.append((np.interp(np.log(level), np.log(ratio[row]), c), duration[row]))
    for label in panel.clabel(lines, fmt="%g", fontsize=8, manual=places):
        label.set_path_effects(ON_ANY_GROUND)


def _tasks(panel, species):
    """Where tasks lie on the map."""
    shade = {"facecolor": "#000000d0", "edgecolor": "none", "pad": 1.5}
    for label, (x0, x1), (y0, y1), place, side in TASKS[species]:
        box = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor="#7de3ff", linewidth=1.3)
        box.set_path_effects(ON_ANY_GROUND)
        panel.add_patch(box)
        panel.text(*place, label, fontsize=7.5, color="#d6f6ff", va="center", ha=side, bbox=shade)


@_styled
def draw_supported(comparisons):
    """The paper's model against one in which the pole holds the whisker during the contact."""
    figure = _figure(10, 9, "Beyond the paper: the pole holds the whisker, then lets go")
    axes = figure.subplots(len(comparisons), 2, sharex=True, width_ratios=(1.6, 1))
    for k, ((moment, force), case) in enumerate(zip(axes, comparisons, strict=True)):
        peak = np.abs(case.paper.steady_moment).max()
        time, until = case.paper.time * figure_data.MILLI, case.duration * figure_data.MILLI
        moment.plot(time, case.paper.vibrational_moment / peak, color=BLUE, label="the paper's")
        moment.plot(time, case.held.vibrational_moment / peak, color=ORANGE, label="held, let go")
        force.plot(
            time, case.held.pole_force * figure_data.MICRO, color=ORANGE, label="of the pole"
        )
        force.plot(
            time, case.paper.force * figure_data.MICRO, ":", color=INK, label="quasi-static"
        )
        for panel in (moment, force):
            panel.axvspan(0, until, color=GREY, alpha=0.12, linewidth=0)
            _zero(panel)
        for letter, panel in (("a", moment), ("b", force)):
            _panel(panel, f"{letter}{k + 1}", f"{case.contact * 1e3:g} mm, {until:g} ms")
        moment.set_ylabel("vibrational /\npeak steady moment")
        force.set_ylabel("force (µN)")
    axes[0, 0].legend(loc="upper right")
    axes[0, 1].legend(loc="upper right")
    for panel in axes[-1]:
        panel.set(xlabel="time (ms)", xlim=(0, 30))
    return figure
