"""The video's frame with what was found in it, whole and close up at the pole."""

import numpy as np
from bokeh.models import ColumnDataSource, LinearColorMapper, Range1d
from bokeh.plotting import figure

from pipeline.curate.colours import CONTACT, LINES, POLE
from pipeline.reports.drawing import View, name_boxes

CLOSE_UP_MM = 1.25  # half the width of the close-up
LARGEST_PX = 1100  # wider frames are sent shrunk; the close-up stays as it is
SHOWN_PX = 580  # usual width of the picture on the page: names keep apart at it
PATIENCE_S = 0.03  # longer a frame is not waited for: it comes when it is there


class Picture:
    """Two Bokeh figures: `whole` and `close`."""

    def __init__(self):
        self.whole, self.close = _picture_figure("picture"), _picture_figure("closeup")
        self._grey = LinearColorMapper(palette="Greys256", low=0, high=255)
        self._image, self._crop = (ColumnDataSource(_image_data(_nothing())) for _ in range(2))
        self._lines = ColumnDataSource({"xs": [], "ys": [], "colour": [], "width": []})
        self._pole = ColumnDataSource({"x": [], "y": [], "radius": []})
        self._points = ColumnDataSource({"x": [], "y": [], "colour": []})
        self._names = ColumnDataSource({"x": [], "y": [], "name": [], "colour": []})
        for plot, image in ((self.whole, self._image), (self.close, self._crop)):
            self._draw(plot, image)
        self.whole.text(
            "x", "y", "name", source=self._names, text_baseline="middle",
            text_color="colour", text_font_size="12px", text_font_style="bold",
            text_outline_color="#11161c",
        )  # fmt: skip

    def _draw(self, plot, image):
        plot.image("image", "x", "y", "dw", "dh", source=image, color_mapper=self._grey)
        close = plot is self.close
        plot.multi_line(
            "xs", "ys", source=self._lines, color="colour", line_width="width",
            line_alpha=0.7 if close else 0.85,
        )  # fmt: skip
        plot.circle(
            "x", "y", radius="radius", source=self._pole, fill_color=None, line_color=POLE,
            line_dash=[4, 3] if close else "solid", line_width=1.5,
        )  # fmt: skip
        plot.scatter(
            "x", "y", source=self._points, size=9 if close else 6, fill_color=None,
            line_color="colour", line_width=2,
        )  # fmt: skip

    def enter(self, image) -> None:
        """Fit ranges and contrast to a video by one of its frames, or None."""
        height, width = (480, 640) if image is None else image.shape
        self.aspect = width / height
        self._view = View(0, 0, width, height, SHOWN_PX / width)
        self.whole.x_range.update(start=-0.5, end=width - 0.5)
        self.whole.y_range.update(start=height - 0.5, end=-0.5)
        if image is not None:
            low, high = np.percentile(image[::4, ::4], [0.3, 99.7])
            self._grey.update(low=float(low), high=float(max(high, low + 10)))

    def show_image(self, image, video, frame) -> None:
        """Show a frame's image, uint8 (height, width), or none."""
        if image is None:
            image = _nothing()
        self._image.data = _image_data(_shrunk(image), image.shape)
        x, y, half = self._close_up_place(image, video, frame)
        left, top = max(int(x - half) - 1, 0), max(int(y - half) - 1, 0)
        crop = image[top : int(y + half) + 2, left : int(x + half) + 2]
        self._crop.data = _image_data(crop if crop.size else _nothing(), left=left, top=top)
        self.close.x_range.update(start=x - half, end=x + half)
        self.close.y_range.update(start=y + half, end=y - half)

    def _close_up_place(self, image, video, frame):
        pole = video.pole(frame)
        half = CLOSE_UP_MM * video.recording.pixels_per_mm
        if pole is None:
            return image.shape[1] / 2, image.shape[0] / 2, half
        return pole[0], pole[1], half + pole[2]

    def show_findings(self, video, frame, whisker, drawn=True) -> None:
        """Draw the traced whiskers, the pole, and the places next to it."""
        lines = video.centrelines(frame) if drawn else {}
        pole = video.pole(frame) if drawn else None
        colours = [LINES[video.whiskers.index(name) % len(LINES)] for name in lines]
        self._lines.data = {
            "xs": [points[:, 0] for points in lines.values()],
            "ys": [points[:, 1] for points in lines.values()],
            "colour": colours,
            "width": [1.8 if name == whisker else 1.2 for name in lines],
        }
        named = name_places(lines, self._view) if len(video.whiskers) > 1 else {}
        self._names.data = {
            "x": [x for x, _ in named.values()],
            "y": [y for _, y in named.values()],
            "name": list(named),
            "colour": [LINES[video.whiskers.index(name) % len(LINES)] for name in named],
        }
        x, y, radius = ([value] for value in pole) if pole else ([], [], [])
        self._pole.data = {"x": x, "y": y, "radius": radius}
        touching = [name for name in lines if pole and video.review.at(name, frame)]
        places = [_nearest(lines[name], pole) for name in touching]
        self._points.data = {
            "x": [p[0] for p in places],
            "y": [p[1] for p in places],
            "colour": [CONTACT] * len(places),
        }


def name_places(lines, view: View) -> dict:
    """Name → left end and middle of its line of text (x, y) [px of the image], none upon another.

    `lines`: name → points (n, 2) [px].
    """
    boxes = name_boxes({name: view.places(points) for name, points in lines.items()}, view)
    return {
        name: ((x + 0.5) / view.zoom - 0.5, (y + height / 2 + 0.5) / view.zoom - 0.5)
        for name, (x, y, _, height) in boxes.items()
    }


def _picture_figure(name):
    plot = figure(
        name=name, sizing_mode="stretch_both", toolbar_location=None, tools="",
        x_range=Range1d(0, 1), y_range=Range1d(1, 0), min_border=0, outline_line_color=None,
        background_fill_color="#11161c", border_fill_color="#11161c",
    )  # fmt: skip
    plot.axis.visible = False
    plot.grid.visible = False
    return plot


def _nothing():
    return np.zeros((2, 2), np.uint8)


def _image_data(image, shape=None, left=0, top=0):
    """Column data of an image whose first pixel's centre is at (left, top)."""
    height, width = shape or image.shape
    return {
        "image": [np.ascontiguousarray(image)],
        "x": [left - 0.5],
        "y": [top - 0.5],
        "dw": [width],
        "dh": [height],
    }


def _shrunk(image):
    """A wide image made smaller by a whole number."""
    factor = -(-image.shape[1] // LARGEST_PX)
    if factor == 1:
        return image
    import cv2

    size = image.shape[1] // factor, image.shape[0] // factor
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def _nearest(points, pole):
    """The centreline's point nearest to the pole's centre."""
    return points[np.argmin(np.hypot(points[:, 0] - pole[0], points[:, 1] - pole[1]))]
