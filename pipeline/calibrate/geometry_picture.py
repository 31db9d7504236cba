"""Pictures of measured whiskers: what was seen, and diameter against arc length (Fig. 3c)."""

import numpy as np

from pipeline.calibrate.pictures import save
from pipeline.reports.plot_style import ACCENT, BLACK, PALE

COOL = "#2b6cc8"
WIDEST_PX = 1800  # of the micrograph as it is shown
CLOSE_PX = 60  # half the side of the close views of base and tip


def draw_whisker(path, geometry, profile) -> None:
    """Draw one whisker: picture, close views of its ends, diameter, deviation from a cone."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 9), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=[1.5, 1, 0.8])
    _whole(figure.add_subplot(grid[0, :2]), geometry)
    ends = grid[0, 2].subgridspec(2, 1)
    for k, (end, name) in enumerate(((geometry.base_at, "base"), (geometry.tip_at, "tip"))):
        _close(figure.add_subplot(ends[k]), geometry, profile, end, name)
    above = figure.add_subplot(grid[1, :])
    _diameter(above, geometry, profile)
    _deviation(figure.add_subplot(grid[2, :], sharex=above), profile)
    save(path, figure)


def draw_pooled(path, geometries, profiles) -> None:
    """Draw diameter against arc length of several whiskers and their cones, as Fig. 3c."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 4), layout="constrained")
    axes = figure.add_subplot()
    for geometry, profile in zip(geometries, profiles, strict=True):
        own = profile[profile["used"]]
        axes.plot(own["arc_length_mm"], own["diameter_um"], ".", ms=1.5, color=PALE)
        axes.plot(
            [0, geometry.length.value],
            [2 * geometry.base_radius.value, 2 * geometry.tip_radius.value],
            color=BLACK,
            lw=0.9,
        )
    _label(axes, "distance from the base (mm)", "diameter (µm)")
    axes.set_ylim(bottom=0)
    save(path, figure)


def _whole(axes, geometry):
    step = max(1, int(np.ceil(max(geometry.image.shape) / WIDEST_PX)))
    height, width = geometry.image.shape
    picture, order = geometry.image[::step, ::step], slice(None)
    if height > width:  # shown on its side
        picture, order, width, height = picture.T, slice(None, None, -1), height, width
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)
    axes.imshow(picture, cmap="gray", extent=extent)
    s = geometry.straight.s
    low, high = sorted((geometry.base_at.s, geometry.tip_at.s))
    shown = (s >= low) & (s <= high)
    line = geometry.straight.x[shown], geometry.straight.y[shown]
    axes.plot(*line[order], color=ACCENT, lw=0.8)
    for end, colour in ((geometry.base_at, ACCENT), (geometry.tip_at, COOL)):
        axes.plot(*geometry.straight.place(end.s, 0.0)[order], "o", mfc="none", color=colour)
    axes.set_title(
        f"{geometry.path.name}: length {geometry.length} mm, base radius {geometry.base_radius} "
        f"µm,\ntip radius {geometry.tip_radius} µm, cone length {geometry.cone_length} mm",
        fontsize=9,
    )
    axes.set_axis_off()


def _close(axes, geometry, profile, end, name):
    x, y = geometry.straight.place(end.s, 0.0)
    axes.imshow(geometry.image, cmap="gray", interpolation="nearest")
    for side in ("left", "right"):
        axes.plot(profile[f"{side}_x_px"], profile[f"{side}_y_px"], color=ACCENT, lw=0.8)
    across = geometry.straight.place(end.s, np.array([-12.0, 12.0]))
    axes.plot(*across, color=COOL, lw=0.8)
    axes.set(xlim=(x - CLOSE_PX, x + CLOSE_PX), ylim=(y + CLOSE_PX, y - CLOSE_PX))
    axes.set_title(f"{name}, edges and end", fontsize=8)
    axes.set(xticks=[], yticks=[])


def _diameter(axes, geometry, profile):
    used = profile["used"]
    axes.plot(profile["arc_length_mm"][used], profile["diameter_um"][used], ".", color=PALE, ms=3)
    axes.plot(
        profile["arc_length_mm"][~used], profile["diameter_um"][~used], "x", color=ACCENT, ms=4
    )
    length, base, tip = geometry.length.value, geometry.base_radius, geometry.tip_radius
    axes.plot([0, length], [2 * base.value, 2 * tip.value], color=BLACK, lw=1)
    axes.set_ylim(0, 2.6 * base.value)
    _label(axes, "red crosses: not used for the cone", "diameter (µm)")


def _deviation(axes, profile):
    used = profile[profile["used"]]
    off = used["diameter_um"] - used["cone_um"]
    axes.fill_between(
        used["arc_length_mm"],
        -1.96 * used["diameter_um_se"],
        1.96 * used["diameter_um_se"],
        color="#e4e4e4",
        lw=0,
    )
    axes.plot(used["arc_length_mm"], off, ".", color=BLACK, ms=3)
    axes.axhline(0, color=ACCENT, lw=0.8)
    _label(axes, "distance from the base (mm); grey: 95 % interval of each", "off the cone (µm)")


def _label(axes, x, y):
    axes.set(xlabel=x, ylabel=y)
    axes.spines[["top", "right"]].set_visible(False)
