"""Parameters of `pipeline.scene`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class SceneParams:
    """Background, face and obstacles, and when large things move."""

    thickest_whisker_mm: quantity(0.02, 2, "mm") = parameter(
        0.32, "thickest whisker as the picture shows it, blurred; poles and rods are thicker",
        "chosen",
    )  # fmt: skip
    shortest_whisker_mm: quantity(0.5, 20, "mm") = parameter(
        2.5, "in a single picture, a shorter thin line is fur or dust", "chosen for mice"
    )
    shortest_still_mm: quantity(0.5, 20, "mm") = parameter(
        4.0, "in a movie, a shorter line that never moves is fur", "chosen for mice"
    )
    fur_average_mm: quantity(0.02, 2, "mm") = parameter(
        0.15, "SD of the average over fur: single hairs vanish, the face stays",
        "chosen",
    )  # fmt: skip
    tuft_mm: quantity(0.05, 5, "mm") = parameter(
        0.5, "thinner dark parts at the face are tufts or whiskers", "chosen"
    )
    fur_breadth_mm: quantity(0.05, 5, "mm") = parameter(
        0.4, "moving fur is broader (in pixels at least as at 25 px/mm), two whiskers are not",
        "chosen on real recordings",
    )  # fmt: skip
    fur_darkens: quantity(0.01, 0.9, "of the light") = parameter(
        0.1, "moving fur takes at least so much of it", "chosen"
    )
    fur_moves_share: quantity(0, 1, "of the frames") = parameter(
        0.1, "moving fur is there in at least so many", "chosen"
    )
    face_edge: quantity(0.05, 0.95, "of the light") = parameter(
        0.45, "light that passes at the face's edge", "chosen"
    )
    opaque: quantity(0.1, 0.99, "of the light") = parameter(
        0.7, "a still thing that lets less light pass hides whiskers", "chosen"
    )
    least_obstacle_mm2: quantity(0, 10, "mm²") = parameter(
        0.05, "smaller still things are dust, not obstacles", "chosen"
    )
    thinnest_obstacle_mm: quantity(0.02, 5, "mm") = parameter(
        0.3, "thinner still things are not obstacles", "chosen"
    )
    illumination_mm: quantity(0.1, 10, "mm") = parameter(
        0.8, "length over which the light is averaged (SD)", "chosen"
    )
    cell_mm: quantity(0.05, 5, "mm") = parameter(
        0.2, "cells in which frames are compared: whiskers are thinner than two",
        "chosen",
    )  # fmt: skip
    change: quantity(0.02, 0.9, "of the light") = parameter(
        0.3, "a cell that differs by more holds something else", "chosen"
    )
    settled_s: quantity(0, 1, "s") = parameter(
        0.01, "a thing that moved in has come to rest after so long", "chosen"
    )
