"""The paper's figures of the moment at the follicle (7 to 11), drawn from their numbers."""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter

from whiskermodel.paper import figure_data
from whiskermodel.paper.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    SEQUENCE,
    draw_outline,
    name_panel,
    new_figure,
    styled_drawing,
    zero_line,
)
from whiskermodel.whisker import mouse_c2, rat_c2

ON_ANY_GROUND = [withStroke(linewidth=2.2, foreground="#000000c0")]  # a dark rim for light ink


@styled_drawing
def draw_fig7(table, cases):
    """Contact points, traces, and the ratio against position."""
    figure = new_figure(10, 6.4, "Fig. 7  Base moment against contact position, 12 ms contacts")
    grid = figure.add_gridspec(3, 4, height_ratios=(0.55, 1, 1.25))
    outline = figure.add_subplot(grid[0, :])
    draw_outline(outline, mouse_c2(), [c for c, _, _ in cases], SEQUENCE)
    name_panel(outline, "a", "the whisker, 30 times as thick, and where it is touched")
    for i, (contact, _, loads) in enumerate(cases):
        panel = figure.add_subplot(grid[1, i])
        _moment_trace(panel, loads, SEQUENCE[i], 40)
        force = loads.force.max() * figure_data.MICRO
        name_panel(panel, f"b{i + 1}", f"{contact * 1e3:.0f} mm, {force:g} µN")
        panel.set_ylabel("moment (nN m)" if i == 0 else "")
        if i == 0:
            panel.legend(loc="lower right")
    ratio = figure.add_subplot(grid[2, :])
    marks = [c * figure_data.MILLI for c, _, _ in cases]
    _ratio_curves(ratio, table, "contact_mm", marks)
    ratio.set(xlabel="contact from the follicle (mm)", ylim=(-1.6, 1.6))
    name_panel(ratio, "c")
    return figure


@styled_drawing
def draw_fig8(table, cases):
    """Traces for four durations, and the ratio against duration."""
    figure = new_figure(10, 5.2, "Fig. 8  Base moment against contact duration, 2.5 µN at 12 mm")
    grid = figure.add_gridspec(2, 4, height_ratios=(1, 1.25))
    for i, (_, duration, loads) in enumerate(cases):
        panel = figure.add_subplot(grid[0, i])
        _moment_trace(panel, loads, SEQUENCE[i], 40)
        name_panel(panel, f"a{i + 1}", f"{duration * 1e3:g} ms")
        panel.set_ylabel("moment (nN m)" if i == 0 else "")
        if i == 0:
            panel.legend(loc="upper right")
    ratio = figure.add_subplot(grid[1, :])
    _ratio_curves(ratio, table, "duration_ms", [t * figure_data.MILLI for _, t, _ in cases])
    ratio.set(xlabel="contact duration (ms)", xscale="log", ylim=(-3, 3))
    name_panel(ratio, "b")
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
    zero_line(panel)
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
    zero_line(panel)
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


@styled_drawing
def draw_fig9(table, cases, single, deflections):
    """Stick-slip: place, deflection at 16 mm, moments for five slips."""
    figure = new_figure(10, 8, "Fig. 9  Stick-slip of a rat whisker, 5 µN at 32 mm")
    grid = figure.add_gridspec(3, 6, height_ratios=(0.5, 1, 2.2))
    outline = figure.add_subplot(grid[0, :3])
    draw_outline(outline, rat_c2(), [figure_data.FIGURE_9_CONTACT])
    name_panel(outline, "a", "the whisker, 30 times as thick, and where it sticks")
    deflection = figure.add_subplot(grid[:2, 3:])
    for i, (slip, y) in enumerate(deflections):
        time = np.arange(len(y)) * figure_data.DT * figure_data.MILLI
        deflection.plot(
            time, y * figure_data.MILLI, color=SEQUENCE[i], label=f"slip {slip * 1e3:g} ms"
        )
    deflection.set(xlim=(0, 45), xlabel="time (ms)", ylabel="y at 16 mm (mm)")
    name_panel(deflection, "b")
    deflection.legend(loc="upper right")
    ratio = figure.add_subplot(grid[1, :3])
    _slip_ratios(ratio, table)
    name_panel(ratio, "d", "peak ratios of c")
    inner = grid[2, :].subgridspec(2, 3)
    for i, ((_, slip, loads), (*_, alone)) in enumerate(zip(cases, single, strict=True)):
        panel = figure.add_subplot(inner[i // 3, i % 3])
        time = alone.time * figure_data.MILLI
        panel.plot(time, alone.vibrational_moment * figure_data.NANO, color=GREY, linewidth=0.8,
                   label="without the second stick")  # fmt: skip
        _moment_trace(panel, loads, SEQUENCE[i], 45)
        name_panel(panel, f"c{i + 1}", f"slip {slip * 1e3:g} ms")
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


@styled_drawing
def draw_fig10(cases):
    """Ramp-and-hold: place, displacement, moments, and the same magnified."""
    figure = new_figure(10, 6.2, "Fig. 10  Ramp-and-hold, 12° at 10 mm, rat whisker cut at 13 mm")
    (outline, moved), (moment, close) = figure.subplots(2, 2, height_ratios=(1, 1.5))
    draw_outline(outline, rat_c2(length=13e-3), [figure_data.FIGURE_10_CONTACT])
    name_panel(outline, "a", "the whisker, 30 times as thick, and where it is pushed")
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
    name_panel(moved, "b", "ramps")
    moved.legend(loc="lower right")
    name_panel(moment, "c", "steady (dotted) and vibrational (solid), colours as in b")
    name_panel(close, "d", "vibrational, magnified, colours as in b")
    for panel in (moment, close):
        panel.set(xlabel="time (ms)", ylabel="base moment (nN m)", xlim=(0, 80))
        zero_line(panel)
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


@styled_drawing
def draw_fig11(table):
    """Ratio over contact position and duration, rat and mouse, with where tasks lie."""
    figure = new_figure(11, 5, "Fig. 11  Peak vibrational over peak steady base moment")
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
        name_panel(panel, letter, f"{species} C2")
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


@styled_drawing
def draw_supported(comparisons):
    """The paper's model against one in which the pole holds the whisker during the contact."""
    figure = new_figure(10, 9, "Beyond the paper: the pole holds the whisker, then lets go")
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
            zero_line(panel)
        for letter, panel in (("a", moment), ("b", force)):
            name_panel(panel, f"{letter}{k + 1}", f"{case.contact * 1e3:g} mm, {until:g} ms")
        moment.set_ylabel("vibrational /\npeak steady moment")
        force.set_ylabel("force (µN)")
    axes[0, 0].legend(loc="upper right")
    axes[0, 1].legend(loc="upper right")
    for panel in axes[-1]:
        panel.set(xlabel="time (ms)", xlim=(0, 30))
    return figure
