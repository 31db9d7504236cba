"""Parameters of `pipeline.tracking`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class TrackerParams:
    """Which whiskers a video shows, and how their lines are followed from frame to frame.

    Where whisker lengths are not given, millimetres are those of a picture 35 mm wide and high.
    A time is at least as many frames as at 1000 frames/s, a distance between neighbouring whiskers
    at least as many pixels as at 25 px/mm, a gap or a distance along a line as at 12.5 px/mm:
    fewer show too little.
    """

    shortest_line_mm: quantity(0.5, 20, "mm") = parameter(
        3.5, "a shorter line is no whisker, where whisker lengths are not given", "chosen for mice"
    )
    base_gap_mm: quantity(0.1, 10, "mm") = parameter(
        2.0, "a whisker's line begins no farther than this from the face", "chosen"
    )
    bridge_mm: quantity(0, 10, "mm") = parameter(
        1.2, "a line is followed across a gap this long, as in front of a pole", "chosen"
    )
    knot_spacing_mm: quantity(0.1, 5, "mm") = parameter(
        0.64, "distance between the knots of a line's spline", "chosen"
    )
    narrow_strip_mm: quantity(0.05, 5, "mm") = parameter(
        0.4, "half-width of the strip searched about the predicted line, 4 to 10 px", "chosen"
    )
    wide_strip_mm: quantity(0.05, 10, "mm") = parameter(
        1.2, "the same where nothing is found in the narrow strip, 10 to 30 px", "chosen"
    )
    neighbour_mm: quantity(0.05, 5, "mm") = parameter(
        0.72, "a whisker this near is seen in the search strip, and allowed for",
        "chosen: 18 px at 25 px/mm",
    )  # fmt: skip
    shared_pixels_mm: quantity(0.02, 5, "mm") = parameter(
        0.2, "lines this near share pixels, and are fitted together",
        "chosen: 5 px at 25 px/mm",
    )  # fmt: skip
    same_line_mm: quantity(0.01, 1, "mm") = parameter(
        0.08, "lines this near over most of their length lie on the same whisker",
        "chosen: 2 px at 25 px/mm",
    )  # fmt: skip
    largest_turn_deg: quantity(10, 360, "°") = parameter(
        150.0, "a line that bends by more from base to tip is no whisker", "chosen"
    )
    hook_mm: quantity(0.1, 10, "mm") = parameter(
        2.5, "first part of a line in which a sharp bend means the edge of the fur", "chosen"
    )
    hook_deg: quantity(5, 180, "°") = parameter(35.0, "bend that is too sharp there", "chosen")
    good_quality: quantity(0, 1, "of the contrast") = parameter(
        0.6, "contrast found, of that expected, below which a wider strip is searched", "chosen"
    )
    lost_quality: quantity(0, 1, "of the contrast") = parameter(
        0.35, "the same below which a whisker is lost", "chosen"
    )
    search_every_s: quantity(0.0005, 10, "s") = parameter(
        0.02, "lines at rest, one of up to four whiskers missing: time between two searches for "
        "new lines", "chosen",
    )  # fmt: skip
    search_beside_all_s: quantity(0.0005, 10, "s") = parameter(
        0.2, "the same while none is missing: one of the lines may be a hair", "chosen",
    )  # fmt: skip
    established_s: quantity(0.0005, 1, "s") = parameter(
        0.01, "a line followed for so long is no blur beside another one", "chosen"
    )
    young_s: quantity(0.0005, 1, "s") = parameter(
        0.005, "of two tracks on one line, one of this age has half the claim to it that it will "
        "have when old", "chosen",
    )  # fmt: skip
    rest_s: quantity(0.0005, 1, "s") = parameter(
        0.003, "lines are at rest when none has begun or ended for so long; beside five and more "
        "whiskers, this is also the time between two searches", "chosen on real recordings",
    )  # fmt: skip
    astray_deg: quantity(0.1, 45, "°") = parameter(
        4.0, "SD of a line's direction about the predicted one, among many whiskers", "chosen"
    )
    pivot_mm: quantity(0, 10, "mm") = parameter(
        1.4, "whiskers turn about a point so far behind the fur's edge, where the hidden length "
        "is not given", "chosen for mice",
    )  # fmt: skip
    crowd_pivot_mm: quantity(0, 10, "mm") = parameter(
        1.25, "the same for the prediction of a row's common turn", "chosen for mice"
    )
    first_frames_s: quantity(0, 1, "s") = parameter(
        0.008, "first part of a video with many whiskers, in which the row's motion is learnt "
        "there and back before they are followed", "chosen on real recordings",
    )  # fmt: skip
    look_back_s: quantity(0, 1, "s") = parameter(
        0.04, "time through which new lines of a row of whiskers are followed back, before they "
        "were found", "chosen on real recordings",
    )  # fmt: skip
    base_order_mm: quantity(0, 10, "mm") = parameter(
        1.5, "so far outside the fur, whiskers lie in the order of their follicles", "chosen"
    )
    base_chord_mm: quantity(0.2, 20, "mm") = parameter(
        4.0, "first part of a line that gives its direction", "chosen"
    )
    place_sd_mm: quantity(0.01, 5, "mm") = parameter(
        0.35, "SD of the place where a whisker's line begins", "chosen"
    )
    angle_sd_deg: quantity(0.1, 45, "°") = parameter(
        5.0, "SD of a whisker's angle beside the turn of the whole row", "chosen"
    )
    fur_share: quantity(0, 1, "ratio") = parameter(
        0.18, "length × absorbance, of the strongest line, below which a line is fur", "chosen"
    )
    faint_share: quantity(0, 1, "ratio") = parameter(
        0.5, "the same among many whiskers, of the faintest whisker", "chosen"
    )
    seen_share: quantity(0, 1, "of the frames") = parameter(
        0.4, "a line seen in fewer sample frames is no whisker", "chosen"
    )
    field_mm: quantity(5, 200, "mm") = parameter(
        35.0, "width and height of the picture where whisker lengths are not given",
        "chosen: common recordings",
    )  # fmt: skip
    resting_mm: quantity(0, 20, "mm") = parameter(
        3.0, "a whisker on the same pixels beyond this distance from the face is at rest", "chosen"
    )
    resting_fur_mm: quantity(0, 20, "mm") = parameter(
        1.0, "nearer to the face there is fur, which is background", "chosen"
    )
