"""Draw the rooms of `pipeline` and what they import from each other, from the code itself.

    python workflows/draw_house.py                     # docs/images/house.png
    python workflows/draw_house.py --out house.svg

Rooms are floors, in the order in which imports may run. An arc leads from a room down to one that
it imports from; the more names it imports, the thicker it is.
"""

import argparse
import ast
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[1]
ORDER = (
    "app", "calibrate", "convert", "curate", "reports", "contacts", "forces", "kinematics",
    "identity", "tracking", "scene", "detection", "session", "video", "tables", "runtime",
    "numerics",
)  # fmt: skip
RESULTS = {  # what leaves the house, and from which room
    "reports": "report.html, figures, overlay.mp4",
    "contacts": "contacts.csv",
    "forces": "evidence.parquet",
    "kinematics": "frames.parquet",
    "identity": "centrelines.parquet",
}
OUTSIDE = "#b45309"
ROOM_COLOURS = {"way": "#2f6f9f", "desk": "#8a6d3b", "ground": "#6b7280"}
LEFT, WIDTH, HEIGHT = 0.0, 7.2, 0.74  # of a room's box, in floors


def imports() -> Counter:
    """How many names each room imports from each other room: {(from, to): names}."""
    count = Counter()
    for file in (ROOT / "pipeline").rglob("*.py"):
        room = room_of(".".join(file.relative_to(ROOT).with_suffix("").parts))
        for node in imports_from(file):
            other = room_of(node.module)
            if room and other and room != other:
                count[room, other] += len(node.names)
    return count


def imports_from(file) -> list[ast.ImportFrom]:
    """All `from module import …` of a Python file, those within functions too."""
    nodes = ast.walk(ast.parse(file.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.ImportFrom) and node.module]


def room_of(module) -> str | None:
    """Room of a module of `pipeline`, None beside the rooms."""
    parts = module.split(".")
    return parts[1] if parts[0] == "pipeline" and len(parts) > 1 and parts[1] in ORDER else None


def purpose_of(room) -> str:
    """What a room is for: the first line of its `__init__`."""
    text = (ROOT / "pipeline" / room / "__init__.py").read_text(encoding="utf-8")
    return ast.get_docstring(ast.parse(text)).splitlines()[0].rstrip(".")


def kind_of(room) -> str:
    """The way of a video, what people use, or the ground on which all stands."""
    if ORDER.index(room) < ORDER.index("contacts"):
        return "desk"
    return "way" if ORDER.index(room) <= ORDER.index("detection") else "ground"


def draw(axes) -> None:
    """Draw boxes, arcs and results."""
    floor = {room: len(ORDER) - i for i, room in enumerate(ORDER)}
    for room in ORDER:
        draw_room(axes, floor[room], room, purpose_of(room))
    for room, what in RESULTS.items():
        draw_result(axes, floor[room], what, "<-")
    draw_result(axes, floor["video"], "videos", "->")
    for (upper, lower), names in imports().items():
        draw_arc(axes, floor[upper], floor[lower], names, ROOM_COLOURS[kind_of(upper)])


def draw_room(axes, y, name, purpose) -> None:
    """A box with name and purpose."""
    box = FancyBboxPatch(
        (LEFT, y - HEIGHT / 2), WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
        facecolor=ROOM_COLOURS[kind_of(name)], alpha=0.92, linewidth=0,
    )  # fmt: skip
    axes.add_patch(box)
    axes.text(LEFT + 0.14, y + 0.14, name, fontsize=11, weight="bold", color="white", va="center")
    axes.text(LEFT + 0.14, y - 0.19, purpose, fontsize=7.2, color="white", va="center")


def draw_result(axes, y, what, arrow) -> None:
    """A file that enters or leaves the house, on the left."""
    axes.annotate(
        what, (LEFT, y), (LEFT - 0.4, y), fontsize=8.5, ha="right", va="center", color=OUTSIDE,
        arrowprops={"arrowstyle": arrow, "color": OUTSIDE},
    )  # fmt: skip


def draw_arc(axes, upper, lower, names, colour) -> None:
    """A half-ellipse on the right from one floor down to another."""
    angle = np.linspace(np.pi / 2, -np.pi / 2, 60)
    reach, middle, half = 0.26 * (upper - lower) + 0.15, (upper + lower) / 2, (upper - lower) / 2
    x, y = LEFT + WIDTH + reach * np.cos(angle), middle + half * np.sin(angle)
    width = 0.5 + 0.32 * np.sqrt(names)
    axes.plot(x, y, color=colour, linewidth=width, alpha=0.45, solid_capstyle="round")
    axes.plot(x[-1] + 0.04, y[-1], marker="<", markersize=3.5, color=colour, alpha=0.8)


def main() -> None:
    """Draw the picture into a file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images" / "house.png")
    figure, axes = plt.subplots(figsize=(9.8, 9.6))
    draw(axes)
    axes.set(xlim=(LEFT - 3.3, LEFT + WIDTH + 4.4), ylim=(0.4, len(ORDER) + 0.6))
    axes.axis("off")
    figure.savefig(parser.parse_args().out, dpi=110, bbox_inches="tight", facecolor="white")


if __name__ == "__main__":
    main()
