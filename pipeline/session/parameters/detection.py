"""Parameters of `pipeline.detection`."""

from pydantic.dataclasses import dataclass

from pipeline.session.quantities import TABLE, parameter, quantity


@dataclass(frozen=True, config=TABLE)
class DetectionParams:
    """Thin dark lines in one frame, each to a part of a pixel.

    Millimetres are those of the tracking table; a gap or a distance between lines counts at least
    as many pixels as at 25 px/mm. What depends on blur, pixels or codec is in pixels.
    """

    faintest: quantity(0.0001, 0.5, "of the light") = parameter(
        0.012, "light that a line takes, below which nothing of it is seen",
        "chosen: noise and codecs leave as much",
    )  # fmt: skip
    faintest_share: quantity(0, 1, "ratio") = parameter(
        0.2, "the same as a part of what the usual whisker takes, where that is less: in pictures "
        "of little contrast", "chosen on real recordings",
    )  # fmt: skip
    faintest_sd: quantity(0, 100, "SD") = parameter(
        1.5, "but no less than so many SDs of a pixel's noise", "chosen on real recordings"
    )
    unseen_gap_mm: quantity(0, 10, "mm") = parameter(
        0.48, "a line ends where it is not seen over more than this", "chosen: 12 px at 25 px/mm"
    )
    quiet: quantity(0.0001, 1, "of the light") = parameter(
        0.0165, "SD of a pixel's noise, beyond which absorbance is measured over more of a line",
        "chosen",
    )  # fmt: skip
    least_quality: quantity(0, 1, "of the contrast") = parameter(
        0.3, "contrast found, of that expected, below which a line is no whisker", "chosen"
    )
    fine_sd_px: quantity(0.5, 10, "px") = parameter(
        1.1, "SD of the Gaussian by which ridges are found where whiskers lie close together",
        "chosen: half-width of a sharp whisker",
    )  # fmt: skip
    sharp_sd_px: quantity(0.5, 10, "px") = parameter(1.6, "the same elsewhere", "chosen")
    blurred_sd_px: quantity(0.5, 20, "px") = parameter(
        3.2, "the same for whiskers that motion has blurred", "chosen"
    )
    same_whisker_mm: quantity(0.01, 2, "mm") = parameter(
        0.12, "lines this near over half of their length are one whisker's; among many whiskers "
        "1.2 to 3 px", "chosen: 3 px at 25 px/mm",
    )  # fmt: skip
    crossing_mm: quantity(0.01, 2, "mm") = parameter(
        0.16, "lines that come this near cross or touch, and may have changed far parts",
        "chosen: 4 px at 25 px/mm",
    )  # fmt: skip
    crossing_hidden_mm: quantity(0, 2, "mm") = parameter(
        0.12, "part of a line beside a crossing that is left out: both lie upon each other there",
        "chosen: 3 px at 25 px/mm",
    )  # fmt: skip
    crossing_reach_mm: quantity(0.1, 20, "mm") = parameter(
        1.6, "part of a line on either side of a crossing that decides, if it can; then twice as "
        "much, then all", "chosen: 40 px at 25 px/mm",
    )  # fmt: skip
    crossing_least_mm: quantity(0.05, 20, "mm") = parameter(
        0.48, "a crossing nearer to the end of a line is left as it is",
        "chosen: 12 px at 25 px/mm",
    )  # fmt: skip
    blur_share: quantity(0, 1, "ratio") = parameter(
        0.5, "a line so much fainter than another one beside it is that one's blur", "chosen"
    )
    blur_px: quantity(0, 20, "px") = parameter(3.0, "distance up to which this holds", "chosen")
    ringing_share: quantity(0, 1, "ratio") = parameter(
        0.35, "a line so much fainter than another one beside it is the codec's ringing", "chosen"
    )
    ringing_px: quantity(0, 20, "px") = parameter(
        6.0, "distance up to which this holds", "chosen: codecs' blocks are 8 px wide"
    )
    one_line: quantity(0.5, 1, "ratio") = parameter(
        0.98, "a broad line stands for several that explain no more than this part more",
        "chosen",
    )  # fmt: skip
    broad: quantity(1, 5, "ratio") = parameter(
        1.25, "a line broader than the usual one by this factor lies on two whiskers", "chosen"
    )
    thickest_radius_mm: quantity(0.001, 1, "mm") = parameter(
        0.05, "largest radius of a whisker: some are broader than others", "chosen for mice"
    )
    thickens: quantity(1, 10, "ratio") = parameter(
        1.3,
        "a line from face to body whose far half takes more light by this factor is turned "
        "round, also if it runs straight off the face's side",
        "chosen",
    )
    edge_px: quantity(0, 50, "px") = parameter(
        6.0, "a line that runs this near along the edge of face or obstacles over half of its "
        "length is that edge", "chosen",
    )  # fmt: skip
    trembling_px: quantity(0, 5, "px") = parameter(
        0.15, "obstacles may move this far, unnoticed", "chosen"
    )
    rim_px: quantity(1, 100, "px") = parameter(
        9.0, "bright parts of obstacles narrower than this are rims; whiskers are not seen there",
        "chosen",
    )  # fmt: skip
