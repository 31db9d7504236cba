"""One frame with its findings: centrelines, names, pole, force arrows, and a strip of words below.

The strip lies below the picture, so that no word hides a whisker or the face. Words or dashes show
all that colours show, and people who cannot distinguish red from green can tell the colours apart.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import pandas as pd

from pipeline.numerics.polyline import places_along
from pipeline.reports.lettering import line_height, put_text, text_width
from pipeline.session.schema import Settings
from pipeline.tables.known_names import KNOWN

# BGR
FREE, TOUCHING, POLE = (255, 150, 0), (40, 40, 230), (74, 213, 255)
DOUBTFUL = (90, 90, 90)  # a line that could not be identified: dashed, too
INK, PAPER, GROUND = (20, 20, 20), (255, 255, 255), (44, 36, 30)
CHIPS = {FREE: (255, 176, 60), TOUCHING: (90, 96, 255), DOUBTFUL: (160, 160, 160)}  # on GROUND
MM_PER_UN = 0.15  # length of the force arrow
SMALL_PX = 480  # narrower pictures are drawn enlarged, for the text
SHIFT = 4  # binary digits after the point in OpenCV's coordinates
DASH_PX = 7
SCALE_PX = 6  # of a letter's height, at most, for the bars that show the scales
COLUMNS = [
    "frame", "time_s", "whisker", "follicle_x_px", "follicle_y_px", "base_angle_deg",
    "in_contact", "contact_force_uN", "axial_force_uN", "lateral_force_uN",
    "contact_arc_length_mm", "confidence",
]  # fmt: skip


@dataclass(frozen=True)
class View:
    """The part of the picture that is shown [px], and how much enlarged."""

    left: int
    top: int
    width: int
    height: int
    zoom: float
    is_still: bool = False  # shown small, on a page: its letters and lines are larger

    @classmethod
    def whole(cls, image) -> "View":
        """All of a picture; a small one enlarged."""
        height, width = image.shape
        return cls(0, 0, width, height, max(1, -(-SMALL_PX // width)))

    @classmethod
    def around(cls, image, centre, size, width_px) -> "View":
        """Part of a picture: `size` (width, height) [px] about a place, drawn `width_px` wide."""
        limits = image.shape[1], image.shape[0]
        width, height = (min(round(s), limit) for s, limit in zip(size, limits, strict=True))
        corner = (
            min(max(round(c - s / 2), 0), limit - s)
            for c, s, limit in zip(centre, (width, height), limits, strict=True)
        )
        return cls(*corner, width, height, width_px / width, is_still=True)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) as drawn."""
        return round(self.height * self.zoom), round(self.width * self.zoom)

    @property
    def letters(self) -> int:
        """Height of the letters that suit it [px]."""
        return int(np.clip(self.shape[1] / (25 if self.is_still else 45), 13, 28))

    @property
    def stroke(self) -> int:
        """Thickness of thin lines [px]."""
        return max(1, round(self.shape[1] / (300 if self.is_still else 800)))

    def canvas(self, image) -> np.ndarray:
        """Return what is seen of a grey picture, uint8 (height, width, 3), BGR."""
        part = image[self.top : self.top + self.height, self.left : self.left + self.width]
        if self.zoom != 1:
            way = cv2.INTER_CUBIC if self.zoom > 1 else cv2.INTER_AREA
            part = cv2.resize(part, self.shape[::-1], interpolation=way)
        return cv2.cvtColor(part, cv2.COLOR_GRAY2BGR)

    def places(self, points) -> np.ndarray:
        """Places of image points in the view [px]."""
        moved = np.asarray(points, float) - (self.left, self.top)
        return (moved + 0.5) * self.zoom - 0.5

    def pixels(self, points) -> np.ndarray:
        """The same as OpenCV's fixed-point coordinates."""
        return np.round(self.places(points) * 2**SHIFT).astype(np.int32)


def draw(image, lines: dict, rows: pd.DataFrame, pole, settings: Settings, view=None, unnamed=()):
    """One frame with its findings, uint8 (height, width, 3), BGR.

    Parameters
    ----------
    image : uint8 (height, width)
    lines : whisker → points (n, 2) [px]
    rows : this frame's rows of frames.parquet, with COLUMNS
    pole : (x, y, radius) [px] or None
    view : what part is shown; None: the whole picture, with each whisker's state below
    unnamed : names of lines that belong to no known whisker: they get a question mark
    """
    shown = view or View.whole(image)
    canvas = shown.canvas(image)
    table = {row["whisker"]: row for row in rows.to_dict("records")}
    if pole is not None:
        _draw_pole(canvas, pole, shown)
    for name, points in lines.items():
        _draw_line(canvas, points, _colour(table.get(name)), shown)
    for name, points in lines.items():
        if _colour(table.get(name)) == TOUCHING:
            _draw_force(canvas, points, table[name], settings, shown)
    if len(table or lines) > 1:
        _draw_names(canvas, lines, table, shown, unnamed)
    named = [name for name in table or lines if name not in unnamed]
    cells = [] if view else [_state(name, table.get(name), lines) for name in named]
    return np.vstack([canvas, _strip(cells, table, settings, shown)])


def _colour(row):
    """Of a whisker in a frame, from its row of frames.parquet (None: there is none)."""
    if row is None:
        return FREE
    if row["in_contact"]:
        return TOUCHING
    return DOUBTFUL if row["confidence"] < KNOWN else FREE


def _draw_pole(canvas, pole, view):
    """Yellow, cased in black: it shows on bright and on dark."""
    x, y, radius = pole
    centre = view.pixels([[x, y]])[0]
    size = round(radius * view.zoom * 2**SHIFT)
    for colour, width in ((INK, 2 * view.stroke + 1), (POLE, view.stroke)):
        cv2.circle(canvas, centre, size, colour, width, cv2.LINE_AA, SHIFT)


def _draw_line(canvas, points, colour, view):
    pieces = [view.pixels(points)]
    if colour == DOUBTFUL:
        dash = max(round(DASH_PX / view.zoom), 2)
        pieces = [view.pixels(points[k : k + dash + 1]) for k in range(0, len(points), 2 * dash)]
    cv2.polylines(canvas, pieces, False, colour, view.stroke, cv2.LINE_AA, SHIFT)


def _draw_force(canvas, points, row, settings, view):
    """Arrow of the force on the whisker, its head at the contact point."""
    scale = settings.recording.pixels_per_mm
    angle = np.radians(row["base_angle_deg"])
    along, across = row["axial_force_uN"], row["lateral_force_uN"]
    # base tangent (cos, −sin) and normal (−sin, −cos) in image axes, y down
    force = np.array(
        [along * np.cos(angle) - across * np.sin(angle),
         -along * np.sin(angle) - across * np.cos(angle)]
    )  # fmt: skip
    head = _point_at(points, row, scale)
    if head is not None and np.isfinite(force).all():
        _draw_arrow(canvas, *view.pixels([head - MM_PER_UN * scale * force, head]), view, TOUCHING)


def _draw_arrow(canvas, tail, head, view, colour):
    """An arrow between two places in OpenCV's fixed-point coordinates."""
    length = np.hypot(*(head - tail))
    if length <= 2**SHIFT:
        return
    width = view.stroke + 1
    cv2.line(canvas, tail, head, colour, width, cv2.LINE_AA, SHIFT)
    barb = (tail - head) / length * min(0.5 * view.letters * 2**SHIFT, 0.7 * length)
    for turn in (0.4, -0.4):
        c, s = np.cos(turn), np.sin(turn)
        end = head + np.array([c * barb[0] - s * barb[1], s * barb[0] + c * barb[1]])
        cv2.line(canvas, head, end.astype(np.int32), colour, width, cv2.LINE_AA, SHIFT)


def _point_at(points, row, scale):
    """The centreline's point at the contact's arc length, None if that is not known."""
    arc = row["contact_arc_length_mm"]
    if not np.isfinite(arc):
        return None
    follicle = np.array([row["follicle_x_px"], row["follicle_y_px"]])
    beyond_first = arc * scale - np.hypot(*(points[0] - follicle))
    return places_along(points, [beyond_first])[0]


# --- names ---------------------------------------------------------------------------------


def _draw_names(canvas, lines, table, view, unnamed):
    """Each whisker's name beyond its tip, inside the picture, none upon another."""
    boxes = name_boxes({name: view.places(points) for name, points in lines.items()}, view)
    for name, (x, y, _, _) in boxes.items():
        shown = "?" if name in unnamed else name
        put_text(canvas, shown, (x, y), _colour(table.get(name)), view.letters, PAPER)


def name_boxes(lines: dict, view: View) -> dict:
    """Where the names of whiskers stand: name → (x, y, width, height) [px of the view].

    `lines`: name → places (n, 2) [px of the view]; a whisker that is not in view has no name.
    """
    height, limit = line_height(view.letters), view.shape
    wanted = []
    for name, places in lines.items():
        inside = np.all((places >= 0) & (places < limit[::-1]), axis=1)
        if inside.any():
            tip = places[np.flatnonzero(inside)[-1]]
            width = text_width(name, view.letters)
            wanted.append((name, *_beyond(tip, places, width, height, limit), width))
    boxes = {}
    for name, x, y, width in sorted(wanted, key=lambda each: each[2]):
        for bx, by, bwidth, bheight in boxes.values():
            if bx < x + width and x < bx + bwidth:
                y = max(y, by + bheight)
        boxes[name] = x, y, width, height
    over = max((y + height for _, y, _, _ in boxes.values()), default=0) - limit[0]
    return {name: (x, y - max(over, 0), w, h) for name, (x, y, w, h) in boxes.items()}


def _beyond(tip, places, width, height, limit):
    """Top left corner of a name beyond a tip, moved into the picture."""
    way = tip - places[max(np.argmin(np.hypot(*(places - tip).T)) - 10, 0)]
    way = way / max(np.hypot(*way), 1e-9)
    middle = tip + way * (4 + np.array([width, height]) / 2)
    corner = middle - np.array([width, height]) / 2
    return np.clip(corner, 1, np.array(limit[::-1]) - (width + 1, height)).astype(int)


# --- the strip below -----------------------------------------------------------------------


def _state(name, row, lines):
    """(colour or None, words) that say how a whisker is in a frame."""
    colour = _colour(row)
    if name not in lines:
        return None, f"{name} not found"
    if colour == TOUCHING:
        force = row["contact_force_uN"]
        return colour, f"{name} {force:.1f} µN" if np.isfinite(force) else f"{name} touches"
    return colour, f"{name} in doubt" if colour == DOUBTFUL else f"{name} free"


def _strip(cells, table, settings, view):
    """Frame and time, the scales, and in further lines the whiskers' `cells`."""
    size, full = view.letters, view.shape[1]
    line, edge = line_height(size), size // 2
    names = table or [words.split()[0] for _, words in cells]
    cell = max((text_width(f"{name} not found", size) for name in names), default=0) + 3 * edge
    columns = max((full - edge) // max(cell + edge, 1), 1)
    height = line * (1 + -(-len(cells) // columns)) + edge
    strip = np.full((height + height % 2, full, 3), GROUND, np.uint8)
    first = next(iter(table.values()), None)
    bare = first is None or view.is_still  # a still has a caption
    head = "" if bare else f"frame {first['frame']}   {1e3 * first['time_s']:.1f} ms"
    put_text(strip, head, (edge, edge // 2), PAPER, size)
    _draw_scales(strip, text_width(head, size) + 2 * size, settings, view)
    for k, (colour, words) in enumerate(cells):
        x, y = edge + k % columns * (cell + edge), edge // 2 + line * (1 + k // columns)
        if colour is not None:
            corner = x, y + size // 4
            end = x + size * 2 // 3, y + size // 4 + size * 2 // 3
            cv2.rectangle(strip, corner, end, CHIPS[colour], 1 if colour == DOUBTFUL else -1)
        put_text(strip, words, (x + 2 * edge, y), PAPER, size)
    return strip


def _draw_scales(strip, left, settings, view):
    """A force arrow and a bar of known size, right in the first line, where there is room."""
    size = view.letters
    px_per_mm = settings.recording.pixels_per_mm * view.zoom
    scales = [(px_per_mm, "mm", None)]
    if any(whisker.si() is not None for whisker in settings.whisker):
        scales.append((px_per_mm * MM_PER_UN, "µN", CHIPS[TOUCHING]))
    right, middle = strip.shape[1] - size // 2, size // 4 + line_height(size) // 2
    for per_unit, unit, colour in scales:
        value = _round_below(SCALE_PX * size / per_unit)
        words, length = f"{value:g} {unit}", value * per_unit
        start = right - text_width(words, size) - length - size // 2
        if start < left:
            return
        ends = np.array([[start, middle], [start + length, middle]])
        tail, head = np.round(ends * 2**SHIFT).astype(np.int32)
        if colour is None:
            cv2.line(strip, tail, head, PAPER, view.stroke + 1, cv2.LINE_AA, SHIFT)
        else:
            _draw_arrow(strip, tail, head, view, colour)
        put_text(strip, words, (start + length + size // 2, size // 4), PAPER, size)
        right = start - size


def _round_below(value: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is not larger.

    >>> _round_below(0.7), _round_below(3), _round_below(50)
    (0.5, 2.0, 50.0)
    """
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step for step in (1, 2, 5) if step <= value / power * (1 + 1e-9)) * power)
