"""What `calibrate dust` saw: the particle, its path along the whisker, the follicle's motion."""

import numpy as np

from pipeline.calibrate.follicle_motion import FollicleMotion, slope_of
from pipeline.calibrate.pictures import save
from pipeline.numerics.runs import runs_of_true
from pipeline.reports.plot_style import ACCENT, BLACK, PALE


def draw_dust(path, motion: FollicleMotion) -> None:
    """Draw the particle, its path, follicle and curvature in time, and one against the other."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.4), layout="constrained")
    (a, b), (c, d) = figure.subplots(2, 2, width_ratios=(1.6, 1))
    _follicle(a, motion)
    _particle(b, motion)
    _path(c, motion)
    _against(d, motion)
    save(path, figure, (a, b, c, d))


def _follicle(axes, motion):
    frames = motion.frames
    for first, end in runs_of_true(frames["in_contact"].to_numpy(bool)):
        axes.axvspan(frames["time_s"].iloc[first], frames["time_s"].iloc[end - 1], color="#eee")
    axes.plot(frames["time_s"], frames["radial_mm"], color=ACCENT, lw=1)
    axes.set_xlabel("time (s); grey: contacts")
    axes.set_ylabel("follicle out of the face (mm)", color=ACCENT)
    other = axes.twinx()
    other.plot(frames["time_s"], frames["curvature_change_per_m"], color=BLACK, lw=0.7)
    other.set_ylabel("curvature change (1/m)")
    other.spines["top"].set_visible(False)


def _particle(axes, motion):
    row = int(np.argmax(motion.particle.seen))
    place = motion.frames.loc[row, ["particle_x_px", "particle_y_px"]].to_numpy(float)
    line = motion.seen.lines[row]
    if motion.seen.picture is not None:
        axes.imshow(motion.seen.picture, cmap="gray", interpolation="nearest")
    axes.plot(*line.T, color="#4c9bd6", lw=0.6)
    half = 12 * max(len(motion.particle.profile) / 8, 6)
    axes.annotate(
        "",
        place,
        (place[0], place[1] + half / 2),
        arrowprops={"arrowstyle": "->", "color": ACCENT, "shrinkB": 6},
    )
    axes.set(
        xlim=(place[0] - half, place[0] + half),
        ylim=(place[1] + 0.7 * half, place[1] - 0.7 * half),
    )
    axes.set(xticks=[], yticks=[])
    axes.set_xlabel(f"the particle in frame {motion.particle.frame[row]}")


def _path(axes, motion):
    thickness, particle = motion.seen.thickness, motion.particle
    low, high = np.nanquantile(particle.place_px, [0, 1])
    first, last = max(int(low) - 40, 0), min(int(high) + 40, thickness.shape[1])
    shown = thickness[:, first:last].T
    extent = (particle.frame[0], particle.frame[-1], first, last)
    axes.imshow(
        shown, cmap="gray_r", aspect="auto", origin="lower", extent=extent,
        vmax=np.nanquantile(shown, 0.995), interpolation="nearest",
    )  # fmt: skip
    axes.plot(particle.frame, particle.place_px, color=ACCENT, lw=0.6)
    axes.set(xlabel="frame", ylabel="along the whisker (px); dark: thick")


def _against(axes, motion):
    contacts, slope = motion.contacts, slope_of(motion.contacts)
    size = contacts["curvature_change_per_m"].abs()
    axes.axhline(0, color=PALE, lw=0.6)
    axes.plot(size, contacts["radial_change_mm"], "o", color=BLACK, ms=4)
    if slope is not None:
        ends = np.array([size.min(), size.max()])
        mean = contacts["radial_change_mm"].mean() - slope.slope * size.mean()
        axes.plot(ends, mean + slope.slope * ends, color=ACCENT, lw=1)
        axes.set_title(
            f"r = {slope.r:.2f} ({slope.r_low:.2f} to {slope.r_high:.2f})",
            fontsize=9,
            color=ACCENT,
        )
    axes.set(
        xlabel="largest |curvature change| of the contact (1/m)",
        ylabel="follicle out of the face by (mm)",
    )
