"""Parameters of `pipeline.forces`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class RodParams:
    """The rod fitted to a whisker: its shape at rest, where its trace begins, its force."""

    hidden_length_sd_mm: quantity(0.001, 2, "mm") = parameter(
        0.12, "standard error of the hidden length in session.toml", "chosen: a fur's edge by eye"
    )
    hidden_length_varies_mm: quantity(0.001, 2, "mm") = parameter(
        0.06, "SD by which it changes with time, at most", "chosen"
    )
    hidden_length_knot_s: quantity(0.005, 10, "s") = parameter(
        0.06, "time over which it may change", "chosen: about half a whisk"
    )
    tip_window_mm: quantity(0.02, 5, "mm") = parameter(
        0.3, "traces that end farther from the usual place have lost the tip", "chosen"
    )
    tip_sd_mm: quantity(0.001, 5, "mm") = parameter(
        0.03, "standard error of the tip's place beside what the ends scatter",
        "measured: `calibrate geometry`, rendered videos",
    )  # fmt: skip
    loaded_distance_mm: quantity(0.01, 2, "mm") = parameter(
        0.1, "whisker to pole: frames that may touch, which show the bending", "chosen"
    )
    bending_most_mm: quantity(0.01, 5, "mm") = parameter(
        1.0, "where the bending would add more than this it is not used", "chosen"
    )
    free_distance_mm: quantity(0.01, 5, "mm") = parameter(
        0.2, "whisker to pole: farther than any tracing error, the frame is free", "chosen"
    )
    clear_distance_mm: quantity(0.01, 5, "mm") = parameter(
        0.06, "where hardly any frame is so far off, those are free that are this much farther "
        "off than the nearest ones", "chosen",
    )  # fmt: skip
    least_clear_mm: quantity(0.001, 5, "mm") = parameter(
        0.015, "and where hardly any is that either, as the whisker hardly leaves the pole, this "
        "much", "chosen",
    )  # fmt: skip
    shortest_lever_mm: quantity(0.01, 5, "mm") = parameter(
        0.3, "force from the curvature alone (`point_force_N`): none where the pole touches "
        "nearer to where that is measured", "chosen",
    )  # fmt: skip
    calibration_mm: quantity(0.1, 20, "mm") = parameter(
        3.0, "free frames with the pole this near show the force's noise", "chosen"
    )
