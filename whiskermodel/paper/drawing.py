"""What the drawings of the paper's model figures share: style, panels, the whisker's outline."""

from functools import wraps

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from whiskermodel.paper import figure_data

INK, GREY, BLUE, ORANGE, GREEN = "#222222", "#8a8a8a", "#0072b2", "#d55e00", "#009e73"
SEQUENCE = ("#3b1f6b", "#2f6aa8", "#1f9e89", "#7cb342", "#e0a100")
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
    """Write `figure` to `path` as "png" or "svg", the same bytes for the same figure.

    The canvases draw themselves: `savefig` draws everything once more beforehand.
    """
    shown_at, figure.dpi = figure.dpi, 150
    with matplotlib.rc_context(STYLE):
        if kind == "svg":
            FigureCanvasSVG(figure).print_svg(path, metadata={"Date": None})
        else:
            FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
    figure.dpi = shown_at
    figure.set_layout_engine("none")  # arranged once is enough


def new_figure(width, height, title):
    """Return a figure of that size [inches], with its title at the left."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.suptitle(title, fontsize=11, fontweight="bold", x=0.01, ha="left")
    return figure


def styled_drawing(draw):
    """Run a drawing function under the house style."""

    @wraps(draw)
    def styled(*content):
        with matplotlib.rc_context(STYLE):
            return draw(*content)

    return styled


def name_panel(axes, letter, words=""):
    """Put the panel's letter, the paper's where it has one, before its title."""
    axes.set_title(words)
    axes.annotate(letter, (0, 1), (-4, 6), xycoords="axes fraction", textcoords="offset points",
                  fontweight="bold", fontsize=10, ha="right", va="baseline")  # fmt: skip


def zero_line(axes):
    """Draw the line of zero, thin, below all else."""
    axes.axhline(0, color=GREY, linewidth=0.6, zorder=0)


def draw_outline(axes, whisker, contacts=(), colours=(INK,)):
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
