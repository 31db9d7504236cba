"""How the plots of all rooms look, and how the report's become part of its page."""

import base64
import io

GREY, INK = "#6b6b6b", "#1a1a1a"
PALE, BLACK, ACCENT = "#a8a8a8", "#111111", "#c8472b"  # of the paper's figures, and calibrate's
SIZE_IN = 4.8
NO_DATE = {"Date": None}  # in an SVG: the same results make the same file
SVG_IDS = {"svg.hashsalt": "whiskerforce"}  # likewise
STYLE = {"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
MARGINS_IN = {"left": 0.66, "right": 0.12, "bottom": 0.5, "top": 0.1}


def axes(height: float, right=MARGINS_IN["right"], top=MARGINS_IN["top"]):
    """(figure, axis) of a plot `height` inches high; `right`, `top` are margins [inches]."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(SIZE_IN, height), dpi=150)  # of what is drawn as an image
        figure.subplots_adjust(
            left=MARGINS_IN["left"] / SIZE_IN,
            right=1 - right / SIZE_IN,
            bottom=MARGINS_IN["bottom"] / height,
            top=1 - top / height,
        )
        return figure, figure.subplots()


def svg(figure) -> str:
    """A figure as a data URI."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.BytesIO()
    with mpl.rc_context(SVG_IDS):  # `savefig` draws everything twice
        FigureCanvasSVG(figure).print_svg(buffer, metadata=NO_DATE)
    return data_uri(buffer.getvalue(), "image/svg+xml")


def data_uri(content: bytes, kind: str) -> str:
    """Bytes as a data URI of a media type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
