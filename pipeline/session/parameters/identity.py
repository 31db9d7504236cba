"""Parameters of `pipeline.identity`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class IdentityParams:
    """Which line is which whisker, where whiskers stand close together.

    A time is at least as many frames as at 1000 frames/s: fewer frames show too little.
    """

    centre_mm: quantity(0.1, 20, "mm") = parameter(
        3.0, "directions are measured from a centre so far behind the whiskers' bases", "chosen"
    )
    near_mm: quantity(0.1, 50, "mm") = parameter(
        4.0, "distance from this centre at which the bend near the face is measured", "chosen"
    )
    angle_mm: quantity(0.1, 50, "mm") = parameter(
        5.5, "distance at which a whisker's angle is measured: beyond the fur", "chosen"
    )
    far_mm: quantity(0.1, 50, "mm") = parameter(
        8.0, "distance at which its bend is measured", "chosen"
    )
    farthest_mm: quantity(0.1, 80, "mm") = parameter(
        12.0, "distance at which the bend of its far part is measured", "chosen"
    )
    lasting_s: quantity(0.001, 1, "s") = parameter(
        0.015, "a line that moves steadily for so long is one whisker", "chosen"
    )
    long_track_s: quantity(0.001, 10, "s") = parameter(
        0.04, "a line followed for so long that matches no whisker is another whisker", "chosen"
    )
    same_mean_s: quantity(0.01, 10, "s") = parameter(
        0.3, "at first, whiskers are taken to whisk about the same mean angle for so long",
        "chosen: two to three whisks",
    )  # fmt: skip
    along_track_s: quantity(0.001, 1, "s") = parameter(
        0.014,
        "likeness to a whisker, and agreement of namings, are averaged over so long along a track",
        "chosen",
    )
    moving_deg: quantity(0.05, 45, "°") = parameter(
        2.0, "turn from frame to frame from which every frame is new evidence",
        "chosen: resting whiskers show the same errors again",
    )  # fmt: skip
    own_turn_deg: quantity(0.05, 45, "°") = parameter(
        2.0, "a line that turns by more relative to the others may be another whisker", "chosen"
    )
    alone_deg: quantity(0.1, 45, "°") = parameter(
        4.0, "a line with no other one this near keeps its whisker from frame to frame", "chosen"
    )
    seldom: quantity(0, 1, "of the frames") = parameter(
        0.1, "whiskers seen in fewer frames get no name, where none are given", "chosen"
    )
    nameless_confidence: quantity(0, 1, "ratio") = parameter(
        0.4, "confidence in a line without a known whisker, times that in the line", "chosen"
    )
    side_gap: quantity(0.05, 1, "of the width") = parameter(
        1 / 3, "two sides of a face are at least this part of most bases' width apart", "chosen"
    )
    sides_apart_deg: quantity(5, 180, "°") = parameter(
        45.0, "whiskers of two sides grow in directions at least so far apart", "chosen"
    )
