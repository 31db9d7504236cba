"""Time courses: lanes of contacts, distance, curvature change and force, and the whole video."""

import numpy as np
from bokeh.models import ColumnDataSource, FixedTicker, Range1d, Span, VStrip
from bokeh.plotting import figure

from pipeline.curate.colours import CURSOR, GRID, HATCHED, INK, SOFT, STATES, WHISKERS, state_of
from pipeline.reports.time_courses import thinned

MARGIN = 1.0  # of the window, loaded on either side of it
MOST_POINTS = 3000  # of a line; longer ones are thinned to their extremes
DOTS_BELOW = 130  # frames in the window, below which every frame has its dot
HIGHEST_DISTANCE_MM = 2.0
LEFT_BORDER, LETTER = 68, 7  # px: the panels' room for numbers like −1,000, and of a name's letter

COURSES = {  # panel → (quantity of Traces, its axis)
    "distance": ("distance_mm", "distance (mm)"),
    "change": ("curvature_change", "Δκ (1/m)"),
    "force": ("force_uN", "force (µN)"),
}


class Courses:
    """Five Bokeh figures in `plots`; `point` is called with the frame that was clicked."""

    def __init__(self, point):
        self._window = Range1d(0, 1)
        self._whole = Range1d(0, 1)
        self.plots = {name: _course_figure(name, self._window) for name in ("lanes", *COURSES)}
        self.plots["overview"] = _course_figure("overview", self._whole)
        self._strips = ColumnDataSource(_strip_data([]))
        self._ghost = ColumnDataSource({"left": [], "right": []})
        self._box = ColumnDataSource({"left": [], "right": []})
        self._lines, self._dots, self._cursors = {}, {}, []
        for name, plot in self.plots.items():
            if name in COURSES:
                self._draw_course(name, plot)
            else:
                self._draw_lanes(plot)
            cursor = Span(location=0, dimension="height", line_color=CURSOR, line_width=1.5)
            plot.add_layout(cursor)
            self._cursors.append(cursor)
            plot.on_event("tap", lambda event: point(round(event.x)))
        self.plots["force"].xaxis.visible = True
        self.plots["overview"].add_glyph(
            self._box, _strip_glyph(fill_alpha=0.10, fill_color=INK, line_color=INK)
        )
        self._loaded = None

    def _draw_course(self, name, plot):
        plot.yaxis.axis_label = COURSES[name][1]
        plot.add_glyph(
            self._strips, _strip_glyph(fill_color="colour", fill_alpha="wash", line_color=None)
        )
        plot.add_glyph(self._ghost, _strip_glyph(fill_color=STATES["adding"], fill_alpha=0.25))
        plot.add_layout(Span(location=0, dimension="width", line_color=SOFT, line_width=0.7))
        source = ColumnDataSource({"xs": [], "ys": [], "colour": [], "width": [], "alpha": []})
        plot.multi_line(
            "xs", "ys", source=source, color="colour", line_width="width", line_alpha="alpha"
        )
        dots = ColumnDataSource({"x": [], "y": []})
        plot.scatter("x", "y", source=dots, size=3.5, color=INK)
        self._lines[name], self._dots[name] = source, dots

    def _draw_lanes(self, plot):
        plot.quad(
            left="left", right="right", top="top", bottom="bottom", source=self._strips,
            fill_color="colour", fill_alpha="solid", line_color="edge", line_width="edge_width",
            line_dash="dash", hatch_pattern="hatch", hatch_color="#ffffff", hatch_scale=6,
            hatch_weight=1.5,
        )  # fmt: skip
        plot.add_glyph(self._ghost, _strip_glyph(fill_color=STATES["adding"], fill_alpha=0.35))

    def enter(self, video) -> None:
        """Make ready for a video."""
        n = len(video.whiskers)
        self._whole.update(start=-0.5, end=video.n_frames - 0.5)
        frame_ms = 1e3 / video.recording.frames_per_second
        self.plots["force"].xaxis.axis_label = f"frame ({frame_ms:.4g} ms each)"
        room = LETTER * (max(map(len, video.whiskers), default=0) + 1)
        for plot in self.plots.values():  # the same for all, so that frames lie below each other
            plot.min_border_left = max(LEFT_BORDER, room)
        for name in ("lanes", "overview"):
            self.plots[name].y_range.update(start=n - 0.5, end=-0.5)
            self.plots[name].yaxis.ticker = FixedTicker(ticks=list(range(n)))
            self.plots[name].yaxis.major_label_overrides = dict(enumerate(video.whiskers))
        self._loaded = None

    def show_window(self, video, start, width, whisker) -> None:
        """Show the time window; data are sent when it leaves what is there."""
        stop = min(start + width, video.n_frames)
        self._window.update(start=start - 0.5, end=max(stop, start + 1) - 0.5)
        self._box.data = {"left": [start - 0.5], "right": [stop - 0.5]}
        what = (video.tables, width, whisker)
        if self._loaded and self._loaded[0][0] is what[0] and self._loaded[0][1:] == what[1:]:
            first, last = self._loaded[1]
            if first <= start and stop <= last:
                self._scale(video, start, stop, whisker)
                return
        first = max(0, int(start - MARGIN * width))
        last = min(video.n_frames, int(stop + MARGIN * width))
        self._loaded = what, (first, last)
        for name in COURSES:
            self._load(name, video, first, last, whisker, width)
        self._scale(video, start, stop, whisker)

    def _load(self, name, video, first, last, whisker, width):
        quantity = COURSES[name][0]
        rows = []
        for i, (whose, traces) in enumerate(video.traces().items()):
            own, colour = whose == whisker, WHISKERS[i % len(WHISKERS)]
            if name == "force":
                would_be = traces.would_be_force_uN[first:last]
                rows.append((would_be, SOFT, 1.0, 0.75 if own else 0.2))
            values = getattr(traces, quantity)[first:last]
            rows.append((values, colour, 1.8 if own else 1.0, 1.0 if own else 0.35))
            if own:
                self._dots[name].data = _dot_data(values, first, width)
        frames = np.arange(first, last, dtype=float)
        lines = [thinned(frames, values, MOST_POINTS) for values, *_ in rows]
        self._lines[name].data = {
            "xs": [x for x, _ in lines],
            "ys": [y for _, y in lines],
            "colour": [row[1] for row in rows],
            "width": [row[2] for row in rows],
            "alpha": [row[3] for row in rows],
        }

    def _scale(self, video, start, stop, whisker):
        """Fit the axes to the window: distances of the present whisker, loads of all."""
        traces = video.traces()

        def values(name):
            return np.concatenate(
                [np.empty(0), *(getattr(t, name)[start:stop] for t in traces.values())]
            )

        own = traces[whisker].distance_mm[start:stop] if whisker in traces else np.empty(0)
        high = min(_extreme(own, 99, 0.5), HIGHEST_DISTANCE_MM)
        _fit(self.plots["distance"].y_range, -0.12, 1.08 * max(high, 0.5))
        change = values("curvature_change")
        low, high = _extreme(change, 0.5, 0.0), _extreme(change, 99.5, 0.0)
        pad = max(0.12 * (high - low), 1.0)
        _fit(self.plots["change"].y_range, low - pad, high + pad)
        force = values("force_uN")
        _fit(self.plots["force"].y_range, -0.8, max(1.12 * _extreme(force, 100, 0.0), 3.0))

    def show_cursor(self, frame, adding=None) -> None:
        """Put the cursor to a frame; colour what is being added."""
        for cursor in self._cursors:
            cursor.location = frame
        if adding is None:
            self._ghost.data = {"left": [], "right": []}
        else:
            ends = sorted((adding, max(frame, adding + 1) if frame >= adding else frame))
            self._ghost.data = {"left": [ends[0] - 0.5], "right": [ends[1] - 0.5]}

    def show_items(self, items, whiskers, selected) -> None:
        """Colour contacts and possible contacts."""
        self._strips.data = _strip_data(items, whiskers, selected)


def _strip_glyph(**style):
    return VStrip(x0="left", x1="right", **{"line_color": None, **style})


def _course_figure(name, x_range):
    plot = figure(
        name=name, sizing_mode="stretch_both", toolbar_location=None, tools="", x_range=x_range,
        y_range=Range1d(0, 1), min_border_top=3, min_border_bottom=3, min_border_right=8,
        min_border_left=LEFT_BORDER, outline_line_color=GRID,
    )  # fmt: skip
    plot.xaxis.visible = False
    plot.xgrid.grid_line_color = plot.ygrid.grid_line_color = GRID
    plot.axis.major_label_text_color = SOFT
    plot.axis.major_label_text_font_size = "10px"
    plot.axis.axis_line_color = plot.axis.major_tick_line_color = None
    plot.axis.minor_tick_line_color = None
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = "11px"
    plot.axis.axis_label_text_color = INK
    plot.axis.axis_label_standoff = 2
    plot.yaxis.ticker.desired_num_ticks = 4
    plot.xaxis.formatter.use_scientific = False
    return plot


def _strip_data(items, whiskers=(), selected=None):
    """Columns for the intervals of contacts: place, colours, the selected one stronger."""
    names = [state_of(item) for item in items]
    chosen = [item.span == selected for item in items]
    lane = [whiskers.index(item.span.whisker) for item in items]
    filled = [item.is_contact for item in items]
    return {
        "left": [item.span.onset - 0.5 for item in items],
        "right": [item.span.offset - 0.5 for item in items],
        "top": [k - (0.42 if c else 0.32) for k, c in zip(lane, chosen, strict=True)],
        "bottom": [k + (0.42 if c else 0.32) for k, c in zip(lane, chosen, strict=True)],
        "colour": [STATES[name] for name in names],
        "edge": [INK if c else STATES[name] for c, name in zip(chosen, names, strict=True)],
        "edge_width": [1.6 if c else 1.0 for c in chosen],
        "hatch": ["right_diagonal_line" if name == HATCHED else "blank" for name in names],
        "dash": [[] if f else [3, 2] for f in filled],
        "solid": [0.9 if f else 0.0 for f in filled],
        "wash": [_wash(f, c) for f, c in zip(filled, chosen, strict=True)],
    }


def _wash(filled, chosen):
    """Opacity of an interval behind the curves."""
    return (0.32 if chosen else 0.16) if filled else (0.16 if chosen else 0.05)


def _dot_data(values, first, width):
    if width >= DOTS_BELOW:
        return {"x": [], "y": []}
    return {"x": np.arange(first, first + len(values)), "y": values}


def _extreme(values, percent, otherwise):
    known = values[np.isfinite(values)]
    return float(np.percentile(known, percent)) if known.size else otherwise


def _fit(axis, low, high):
    """Set a range unless it fits already: axes that never rest are hard to read."""
    if high > axis.end or low < axis.start or (high - low) < 0.5 * (axis.end - axis.start):
        axis.update(start=low, end=high)
