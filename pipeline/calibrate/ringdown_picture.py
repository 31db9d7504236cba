"""The ring-down as the paper's Fig. 5: the whisker, its curvature, all slips."""

import numpy as np

from pipeline.calibrate.pictures import save
from pipeline.reports.plot_style import ACCENT, BLACK, PALE

BEFORE, AFTER = 4, 12  # frames that panel a shows


def draw_ringdown(path, fits, together) -> None:
    """Draw Fig. 5a–c of these slips; a and b show the one whose frequency is best known."""
    from matplotlib.figure import Figure

    shown = min(fits, key=lambda each: each.undamped.high - each.undamped.low)
    figure = Figure(figsize=(11, 3.6), layout="constrained")
    a, b, c = figure.subplots(1, 3)
    _whisker(a, shown.slip)
    _curvature(b, shown)
    _all_slips(c, fits, together)
    save(path, figure, (a, b, c))


def _whisker(axes, slip):
    first, last = slip.first - BEFORE, min(slip.first + AFTER, slip.end)
    lines = slip.video.lines(
        [("whisker", "==", slip.whisker), ("frame", ">=", first), ("frame", "<", last)]
    )
    for row, frame in enumerate(lines.frame):
        colour = PALE if frame < slip.first else BLACK
        axes.plot(*lines.row(row).T, color=colour, lw=0.8)
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set(xlabel="x (px)", ylabel="y (px); grey: before the slip")


def _curvature(axes, shown):
    ms = 1e3 * (shown.time - shown.time[0])
    fine = np.linspace(shown.time[0], shown.time[-1], 600)
    axes.plot(1e3 * (fine - shown.time[0]), shown.fit(fine), color=ACCENT, lw=1)
    axes.plot(ms, shown.curvature, "o", color=BLACK, ms=3)
    axes.axhline(0, color=PALE, lw=0.6)
    axes.set(xlabel="time after the slip (ms)", ylabel="curvature change (1/m)")


def _all_slips(axes, fits, together):
    for each in fits:
        _cross(axes, each.angular_frequency, each.damping, BLACK, 0.8)
    if len(fits) > 1:
        _cross(axes, together.angular_frequency, together.damping, ACCENT, 2.0)
    e = together.youngs_modulus
    axes.set(xlabel="angular frequency (rad/s); red: all slips", ylabel="damping (1/s)")
    axes.text(
        0.03,
        0.97,
        f"E = {1e-9 * e.value:.3g} GPa\n({1e-9 * e.low:.3g} to {1e-9 * e.high:.3g})",
        transform=axes.transAxes,
        va="top",
        color=ACCENT,
    )


def _cross(axes, x, y, colour, width):
    axes.plot([x.low, x.high], [y.value, y.value], color=colour, lw=width)
    axes.plot([x.value, x.value], [y.low, y.high], color=colour, lw=width)
    axes.plot(x.value, y.value, "o", color=colour, ms=3 + width)
