"""In which contacts the whisker rings: all of them on a map as in the paper's Fig. 11."""

from collections import Counter

import numpy as np
import pandas as pd

from pipeline.reports import plot_style

RINGS = 1.0  # vibrational over steady moment
NOTICEABLE = 0.1
LEAST, MOST = 0.01, 3.0  # that differ in colour
MAP_STEP = 2e-5  # s: a tenth of the highest mode's period, enough for a map's colours
TICKS_MS = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
RATIOS = (0.01, 0.03, 0.1, 0.3, 1, 3)  # of the colour bar
NAMED = 5  # contacts that ring most
EDGE = "#ffffff"


def vibration(contacts: pd.DataFrame, whiskers: dict) -> dict | None:
    """Ringing contacts: the map, counts, and the strongest ones; None where not known.

    `whiskers`: (video, whisker) → Whisker, or None where its dimensions are not known.
    """
    known = contacts[np.isfinite(contacts["vibration_ratio"])]
    if known.empty:
        return None
    most = known.sort_values("vibration_ratio", ascending=False).head(NAMED)
    ratio = known["vibration_ratio"]
    return {
        "plot": plot_style.svg(draw_map(known, _usual_whisker(whiskers, known))),
        "known": len(known),
        "ring": int((ratio > RINGS).sum()),
        "noticeable": int(((ratio > NOTICEABLE) & (ratio <= RINGS)).sum()),
        "most": [{"index": index, **row} for index, row in most.iterrows()],
    }


def _usual_whisker(whiskers, contacts):
    """The whisker of most of these contacts, None where no dimensions are known."""
    keys = zip(contacts["video"], contacts["whisker"], strict=True)
    count = Counter(whiskers.get(key) for key in keys)
    count.pop(None, None)
    return count.most_common(1)[0][0] if count else None


def ratio_grid(whisker, durations_ms, contacts_mm, dt=1e-5) -> np.ndarray:
    """Largest |vibrational| over peak |steady| base moment of half-Gaussians, as in Fig. 11.

    The time course of every mode does not depend on where the pulse acts (Eq. 49): places differ
    only by the weights of the modes (Eq. 55).

    Parameters
    ----------
    durations_ms, contacts_mm : of the pulses, and where they act
    dt : step [s] of the force, linear in between

    Returns
    -------
    (contacts, durations)
    """
    from whiskermodel.force_profiles import half_gaussian
    from whiskermodel.modal_filter import modal_filters
    from whiskermodel.response import Response

    response, places = Response(whisker), 1e-3 * np.asarray(contacts_mm, float)
    weights = response.base_moment_weights(places).T
    filters = modal_filters(response.angular_frequency, whisker.damping_rate, dt)
    ratios = np.empty((len(places), len(durations_ms)))
    for column, duration in enumerate(1e-3 * np.asarray(durations_ms, float)):
        force = half_gaussian(np.arange(0, duration + response.longest_period, dt), duration, 1.0)
        change = np.stack([force - mode(force) for mode in filters])
        ratios[:, column] = np.abs(weights @ change).max(axis=1) / places
    return ratios


def draw_map(contacts, whisker):
    """Contacts by place and duration on the model's map of vibrational over steady moment."""
    from matplotlib.colors import LogNorm

    figure, axis = plot_style.axes(3.4, right=0.95)
    norm = LogNorm(LEAST, MOST)
    duration, place = contacts["duration_ms"], contacts["contact_arc_length_mm"]
    if whisker is not None:
        longest = max(120.0, 1.1 * duration.max())
        durations = np.geomspace(min(1.0, 0.9 * duration.min()), longest, 32)
        places = np.linspace(0.1, 0.97, 28) * 1e3 * whisker.length
        grid = ratio_grid(whisker, durations, places, MAP_STEP).T
        axis.contourf(places, durations, grid, np.geomspace(LEAST, MOST, 22), norm=norm,
                      cmap="cividis", extend="both")  # fmt: skip
        axis.contour(places, durations, grid, [NOTICEABLE, RINGS], linewidths=[0.8, 1.8],
                     colors=[EDGE, EDGE], linestyles=["--", "-"])  # fmt: skip
    axis.scatter(
        place, duration, c=contacts["vibration_ratio"], norm=norm, cmap="cividis",
        s=float(np.clip(400 / np.sqrt(len(contacts)), 5, 36)), edgecolors=EDGE,
        linewidths=0.7 if len(contacts) < 1000 else 0.2, rasterized=len(contacts) > 2000,
    )  # fmt: skip
    axis.set(yscale="log", ylabel="contact duration (ms)", xlabel="contact from the follicle (mm)")
    axis.yaxis.set_major_formatter("{x:g}")  # powers of ten take a parser of formulae: 0.3 s
    low, high = axis.get_ylim()
    axis.set_yticks([y for y in TICKS_MS if low <= y <= high])
    axis.minorticks_off()  # every tick is two lines and two texts
    _colour_bar(figure, axis, norm)
    return figure


def _colour_bar(figure, axis, norm):
    """What the colours mean; the lines of the map are drawn in it, too."""
    box = axis.get_position()
    bar = figure.add_axes((box.x1 + 0.025, box.y0, 0.03, box.height))
    ratios = np.geomspace(LEAST, MOST, 100)
    bar.pcolormesh([0, 1], ratios, np.c_[ratios, ratios], norm=norm, cmap="cividis",
                   shading="gouraud", rasterized=True)  # fmt: skip
    bar.axhline(RINGS, color=EDGE, lw=1.8)
    bar.axhline(NOTICEABLE, color=EDGE, lw=0.8, ls="--")
    bar.set(yscale="log", ylabel="largest vibrational / steady moment", xticks=[])
    bar.yaxis.set_major_formatter("{x:g}")
    bar.set_yticks(RATIOS)
    bar.minorticks_off()
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.spines[["top", "right", "left", "bottom"]].set_visible(False)
