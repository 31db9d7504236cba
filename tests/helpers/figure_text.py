"""Words in drawn figures: are they all inside, and none upon another?"""

import itertools

from matplotlib.backends.backend_agg import FigureCanvasAgg

ROUNDING_PX = 1.0


def faults(figure) -> list[str]:
    """What is wrong with the words of a matplotlib Figure: cut at its edge, or overlapping."""
    canvas = FigureCanvasAgg(figure)
    renderer, drawn = canvas.get_renderer(), []
    draw_text = renderer.draw_text

    def record(gc, x, y, words, prop, angle, ismath=False, mtext=None):
        drawn.append(mtext)
        draw_text(gc, x, y, words, prop, angle, ismath=ismath, mtext=mtext)

    renderer.draw_text = record
    figure.draw(renderer)
    width, height = canvas.get_width_height()
    boxes = [(text, text.get_window_extent(renderer)) for text in dict.fromkeys(drawn) if text]
    cut = [
        f"{text.get_text()!r} is cut"
        for text, box in boxes
        if min(box.x0, box.y0) < -ROUNDING_PX
        or box.x1 > width + ROUNDING_PX
        or box.y1 > height + ROUNDING_PX
    ]
    upon = [
        f"{a.get_text()!r} is upon {b.get_text()!r}"
        for (a, one), (b, other) in itertools.combinations(boxes, 2)
        if _overlap(one, other)
    ]
    return cut + upon


def _overlap(one, other):
    across = min(one.x1, other.x1) - max(one.x0, other.x0)
    along = min(one.y1, other.y1) - max(one.y0, other.y0)
    return across > ROUNDING_PX and along > ROUNDING_PX
