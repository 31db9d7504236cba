"""The two views as the paper's Fig. 4: the lines, elevation, path, projection error, force."""

import numpy as np
import pandas as pd

from pipeline.calibrate.pictures import save
from pipeline.reports.plot_style import ACCENT, BLACK, PALE

LINES = 60  # that are drawn of each video


def draw_views(path, measured) -> None:
    """Draw Fig. 4 b–e of these videos, and what the projection does to the force."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.6), layout="constrained")
    axes = figure.subplots(2, 3)
    frames = pd.concat([each.frames for each in measured])
    touching = frames[frames["in_contact"]].dropna(subset=["true_path_mm"])
    _lines(axes[0, 0], axes[0, 1], measured)
    _elevation(axes[0, 2], touching)
    _path(axes[1, 0], touching)
    _error(axes[1, 1], touching)
    _force(axes[1, 2], pd.concat([each.contacts for each in measured]))
    save(path, figure, axes.flat)


def _lines(above, beside, measured):
    """Lines of one video from above, and by their height; black: contact."""
    shown = measured[0]
    touching = shown.frames.set_index("frame")["in_contact"]
    frames = list(shown.lines)[:: max(len(shown.lines) // LINES, 1)]
    for frame in sorted(frames, key=lambda f: bool(touching.get(f, False))):
        line, colour = shown.lines[frame], BLACK if touching.get(frame, False) else PALE
        above.plot(*line.first.T, color=colour, lw=0.5)
        out = np.hypot(*(line.first - line.first[0]).T)
        beside.plot(out, line.height, color=colour, lw=0.5)
    above.set_aspect("equal", adjustable="datalim")
    above.invert_yaxis()
    above.set(xlabel="x (px), first view; black: contact", ylabel="y (px)")
    beside.set(
        xlabel="from the follicle, first view (px)", ylabel="height above the follicle (mm)"
    )


def _elevation(axes, touching):
    axes.plot(touching["azimuth_deg"], touching["elevation_deg"], ".", color=BLACK, ms=3)
    axes.axhline(0, color=PALE, lw=0.6)
    axes.set(xlabel="azimuth at contact (°)", ylabel="elevation at contact (°)")


def _path(axes, touching):
    share = touching["apparent_path_mm"] / touching["true_path_mm"]
    axes.plot(touching["azimuth_deg"], share, ".", color=BLACK, ms=3)
    axes.axhline(1, color=PALE, lw=0.6)
    axes.set(xlabel="azimuth at contact (°)", ylabel="apparent over true path")


def _error(axes, touching):
    error = touching["projection_error_percent"]
    axes.hist(error, bins=30, color=BLACK)
    axes.yaxis.get_major_locator().set_params(integer=True)
    if len(error):
        axes.axvline(error.quantile(0.99), color=ACCENT, lw=1)
        axes.set_title(f"99 % below {error.quantile(0.99):.1f} %", fontsize=9, color=ACCENT)
    axes.set(xlabel="projection error of the path (%)", ylabel="contact frames")


def _force(axes, contacts):
    axes.plot(contacts["elevation_deg"], contacts["force_effect_percent"], "o", color=BLACK, ms=4)
    axes.axhline(0, color=PALE, lw=0.6)
    axes.set(xlabel="elevation at contact (°)", ylabel="effect on the force (%)")
