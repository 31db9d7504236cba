"""Parameters of `pipeline.kinematics`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class KinematicsParams:
    """Follicle, angle and curvature of a centreline, and its distance from the pole."""

    hidden_most_mm: quantity(0.5, 20, "mm") = parameter(
        3.0, "thickest fur: the follicle is not deeper than this", "chosen for mice"
    )
    base_skip_mm: quantity(0, 2, "mm") = parameter(
        0.25, "first visible part, which fur draws aside: left out of the base's fit",
        "chosen",
    )  # fmt: skip
    base_window_mm: quantity(1, 20, "mm") = parameter(
        4.5, "part of the whisker from which the hidden piece is extrapolated", "chosen"
    )
    base_window_least_px: quantity(20, 500, "px") = parameter(
        80.0, "or this much at least, if that is more", "measured on real recordings"
    )
    base_skip_least_px: quantity(0, 100, "px") = parameter(
        8.0, "first visible part that base angles do not use", "chosen"
    )
    fur_reach_mm: quantity(0.2, 5, "mm") = parameter(
        1.2, "moving fur draws the trace aside up to here", "chosen"
    )
    fur_window_mm: quantity(1, 20, "mm") = parameter(
        4.0, "part beyond the fur that is continued towards the face, to compare with", "chosen"
    )
    fur_block_mm: quantity(0.05, 1, "mm") = parameter(
        0.2, "length over which fur's error is the same", "chosen"
    )
    curvature_half_window_mm: quantity(0.5, 10, "mm") = parameter(
        3.0, "half-width of the window of the local curvature fit", "chosen"
    )
    curvature_pole_gap_mm: quantity(0, 1, "mm") = parameter(
        0.15, "a pole this near may bend the whisker: the window ends there", "chosen"
    )
    hidden_error_mm: quantity(0, 1, "mm") = parameter(
        0.05, "standard error of the place along the whisker where curvature is measured",
        "chosen",
    )  # fmt: skip
    station_skip_mm: quantity(0, 2, "mm") = parameter(
        0.4, "first visible part that forces do not use", "chosen"
    )
    extension_mm: quantity(0, 10, "mm") = parameter(
        1.5, "a trace that ends before the tip is continued straight this far", "chosen"
    )
