"""The paper's figures of modes, ring-down and displacement (2, 5, 6), drawn from their numbers."""

import matplotlib
import numpy as np
from matplotlib.colors import Normalize

from whiskermodel.paper import figure_data
from whiskermodel.paper.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    name_panel,
    new_figure,
    styled_drawing,
    zero_line,
)

# Modes and ring-down --------------------------------------------------------------------------


@styled_drawing
def draw_fig2(table):
    """The three lowest modes and their first three derivatives."""
    figure = new_figure(10, 9.5, "Fig. 2  The three lowest modes of a cylinder and of a cone")
    columns = ("displacement", "slope", "curvature", "third_derivative")
    rows = (("fixed", 0.0), ("fixed", 1.0), ("pinned", 0.0), ("pinned", 1.0))
    axes = figure.subplots(4, 4, sharex=True)
    for k, (row, (boundary, taper)) in enumerate(zip(axes, rows, strict=True)):
        here = (table["boundary"] == boundary) & (table["taper"] == taper)
        for i, (panel, column) in enumerate(zip(row, columns, strict=True), 1):
            _mode_curves(panel, table, here, column)
            name_panel(panel, f"{'ab'[k // 2]}{i + 4 * (k % 2)}")
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
    zero_line(panel)


@styled_drawing
def draw_fig5(traces, fits):
    """Simulated slips with their fits, and the fitted damping and frequency."""
    figure = new_figure(
        10, 3.6, "Fig. 5  Ring-down after a slip (simulated; published means in grey)"
    )
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.7, 1, 1))
    pick = traces["slip"] == 1
    time, curvature = traces["time_ms"][pick], traces["curvature_change_per_m"][pick]
    first = {name: fits[name][0] for name in ("damping_per_s", "angular_frequency_rad_per_s")}
    left.plot(time, curvature, "o", color=INK, markersize=3.5, label="film, 1000 frames/s")
    left.plot(*_fitted_curve(time, traces["fitted_per_m"][pick], first), color=ORANGE, label="fit")
    zero_line(left)
    left.set(xlabel="after the slip (ms)", ylabel="curvature change at 6 mm (1/m)")
    name_panel(left, "b")
    left.legend()
    for panel, letter, name, label, mean, spread in (
        (middle, "c1", "angular_frequency_rad_per_s", "angular frequency (rad/s)", 938, 27),
        (right, "c2", "damping_per_s", "damping (1/s)", 215, 45),
    ):
        _intervals(panel, fits, name)
        panel.axhspan(mean - spread, mean + spread, color=GREY, alpha=0.25, linewidth=0)
        panel.axhline(mean, color=GREY, linewidth=1)
        panel.set(xlabel="slip", ylabel=label)
        name_panel(panel, letter)
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


@styled_drawing
def draw_fig6(motions):
    """Force; steady displacement; whole and vibrational displacement for both ends."""
    figure = new_figure(10.5, 8.5, "Fig. 6  Displacement of the whisker, 20 µN contact at 9 mm")
    axes = figure.subplots(4, 3, height_ratios=(0.6, 1.2, 1.2, 1.2))
    fixed = motions[0]
    force = axes[0, 0]
    force.plot(fixed.time * figure_data.MILLI, fixed.force * figure_data.MICRO, color=INK)
    force.set(ylabel="force (µN)", xlabel="time (ms)", xlim=(0, 40))
    name_panel(force, "a", "force")
    for panel in (axes[0, 1], axes[0, 2], axes[2, 0]):
        panel.axis("off")
    _space_time(axes[1, 0], fixed, fixed.steady, 2.0)
    name_panel(axes[1, 0], "b1", "steady")
    _shapes(axes[3, 0], fixed, fixed.steady)
    name_panel(axes[3, 0], "b2", "steady shapes, every ms")
    for k, (column, motion) in enumerate(zip(axes.T[1:], motions, strict=True)):
        image = _space_time(column[1], motion, motion.steady + motion.vibrational, 2.0)
        name_panel(column[1], f"c{3 * k + 1}", f"base {motion.boundary}: steady and vibrational")
        small = _space_time(column[2], motion, motion.vibrational, 0.2)
        name_panel(column[2], f"c{3 * k + 2}", f"base {motion.boundary}: vibrational alone")
        _shapes(column[3], motion, motion.vibrational)
        name_panel(column[3], f"c{3 * k + 3}", "vibrational shapes, every ms")
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
