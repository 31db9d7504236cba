"""Dimensions of plucked whiskers from micrographs (Hires et al. 2013, Fig. 3c)."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pipeline.calibrate.cone import ConeFit, fit_cone, students_factor
from pipeline.calibrate.cross_sections import Sections, Straightened, cut_sections, without
from pipeline.calibrate.find_whisker import NoWhiskerError, find_whisker, read_micrograph
from pipeline.calibrate.scale_bar import LENGTH_SE_PX, scale_bar_px
from pipeline.calibrate.whisker_ends import End, find_end, leaves_the_picture
from pipeline.numerics.robust import robust_sd

BROKEN_UM = 5.0  # radius of a tip that grew whole is less
MODEL_SE_PX = 0.005  # what half-widths are off by where pictures are rendered exactly
JUMP_SDS = 6.0
SEAM_SDS, SEAM_GREY = 6.0, 0.5  # of the light from tile to tile
SEAM_PX = 0.7  # by which tiles do not fit along the whisker


@dataclass(frozen=True)
class Measured:
    """A value with its standard error; 95 % intervals are ± 1.96 of it."""

    value: float
    se: float

    def __str__(self):
        return f"{self.value:.4g} ± {self.se:.2g}"


@dataclass(frozen=True)
class Geometry:
    """Dimensions of one plucked whisker, and what they were measured from.

    Attributes
    ----------
    path : the picture
    length, cone_length : Measured [mm], to the (cut) tip and to the extrapolated apex
    base_radius, tip_radius : Measured [µm], of the fitted cone
    volume : Measured [mm³], of the whisker as it is
    pixels_per_mm : scale
    image, straight, sections, cone : what was seen, along the centreline
    base_at, tip_at : End [px] along the centreline
    """

    path: Path
    length: Measured
    cone_length: Measured
    base_radius: Measured
    tip_radius: Measured
    volume: Measured
    pixels_per_mm: float
    image: np.ndarray
    straight: Straightened
    sections: Sections
    cone: ConeFit
    base_at: End
    tip_at: End

    def density(self, mass_ug) -> Measured:
        """Mean density [kg/m³] of a whisker of this mass [µg]."""
        value = mass_ug / self.volume.value  # µg/mm³ = kg/m³
        return Measured(value, value * self.volume.se / self.volume.value)


def check_scale(scale: dict) -> None:
    """ValueError where not just one of two values is given, above 0.

    scale : pixels per mm and length of the scale bar [mm], by the names that the caller knows
    """
    given = {name: value for name, value in scale.items() if value is not None}
    if len(given) != 1:
        raise ValueError(
            f"{' and '.join(scale)}: expected one of them, the scale of the pictures or the "
            "length of the scale bar in them"
        )
    for name, value in given.items():
        if not 0 < value < np.inf:
            raise ValueError(f"{name} {value}: expected a number above 0")


def measure_geometry(path, pixels_per_mm=None, scale_bar_mm=None) -> Geometry:
    """Measure the one whisker in a micrograph.

    Parameters
    ----------
    path : picture file
    pixels_per_mm : its scale; None: from the scale bar in it, which is `scale_bar_mm` long

    Raises
    ------
    ValueError
        Where not just one of these is given, above 0.
    NoWhiskerError
        Where there is none, or not the whole of one.
    VideoError
        Where the file is no picture.
    """
    check_scale({"pixels_per_mm": pixels_per_mm, "scale_bar_mm": scale_bar_mm})
    path = Path(path)
    image = read_micrograph(path)
    try:
        scale = _scale(image, pixels_per_mm, scale_bar_mm)
        trace = find_whisker(image)
        straight, sections = cut_sections(trace)
        return _measured(path, scale, trace.image, straight, sections)
    except NoWhiskerError as error:
        raise NoWhiskerError(f"{path}: {error}") from None


def _scale(image, pixels_per_mm, scale_bar_mm) -> Measured:
    """Pixels per mm: as given (assumed exact), or from the scale bar."""
    if pixels_per_mm is not None:
        return Measured(pixels_per_mm, 0.0)
    return Measured(scale_bar_px(image) / scale_bar_mm, LENGTH_SE_PX / scale_bar_mm)


def _measured(path, scale, image, straight, sections) -> Geometry:
    """Ends, cone and dimensions of a whisker that is straightened and cut."""
    rough = _cone_of(sections, sections.s)
    if rough.slope == 0 or abs(rough.slope) * np.ptp(sections.s) < 3 * rough.scatter:
        raise NoWhiskerError(
            "shows a fibre that does not taper: expected a whisker, thick at its base"
        )
    ends = [find_end(straight, sections, rough, last) for last in (False, True)]
    base_at, tip_at = ends if rough.slope > 0 else ends[::-1]
    for end, name in ((base_at, "base"), (tip_at, "tip")):
        if leaves_the_picture(straight, end.s, image.shape):
            raise NoWhiskerError(
                f"cuts the whisker off at its {name}: expected the whole whisker within the "
                "picture; photograph it again, or stitch more tiles"
            )
    along = np.abs(sections.s - base_at.s)
    inside = (sections.s - ends[0].s) * (sections.s - ends[1].s) < 0
    sections = without(sections, inside)
    cone = _cone_of(sections, along[inside])
    return Geometry(
        path=path,
        pixels_per_mm=scale.value,
        image=image,
        straight=straight,
        sections=sections,
        cone=cone,
        base_at=base_at,
        tip_at=tip_at,
        **_dimensions(sections, cone, base_at, tip_at, scale, _seams(image, straight)),
    )


def _cone_of(sections, s):
    """The cone through the sections, which lie at `s` [px]."""
    return fit_cone(s, sections.half_width, sections.half_width_se, sections.half_width_doubt)


def _dimensions(sections, cone, base_at, tip_at, scale, seams):
    """The dimensions of a whisker, Measured each, from its cone and ends [px].

    `seams` is what stitching adds to the variance of the length [px²].
    """
    length = abs(tip_at.s - base_at.s)
    length_se = np.sqrt(base_at.se**2 + tip_at.se**2 + _jumps(sections, cone) + seams)
    wider = students_factor(cone.independent)
    base_se = np.hypot(wider * cone.se_at(0.0), MODEL_SE_PX)
    tip = float(cone(length))
    tip_se = np.hypot(wider * cone.se_at(length), MODEL_SE_PX)
    apex = cone.base / cone.slope
    # of where the half-width is 0
    apex_se = np.hypot(wider * cone.se_at(apex), MODEL_SE_PX) / cone.slope
    um, mm = 1e3 / scale.value, 1 / scale.value
    doubt = scale.se / scale.value
    return {
        "length": _scaled(length, length_se, mm, doubt),
        "base_radius": _scaled(cone.base, base_se, um, doubt),
        "tip_radius": _scaled(max(tip, 0.0), tip_se, um, doubt),
        "cone_length": _scaled(max(apex, length), np.hypot(apex_se, length_se), mm, doubt),
        "volume": _scaled(*_volume(cone, length, length_se), mm**3, 3 * doubt),
    }


def _scaled(value, se, unit, doubt) -> Measured:
    """A value and its standard error [px] in another unit, whose own relative error is given."""
    return Measured(value * unit, float(np.hypot(se, value * doubt)) * unit)


def _jumps(sections, cone):
    """Sum of the squares of sudden steps [px²] of the centreline: tiles that do not fit.

    A step seen across the whisker stands for one that is not seen along it.
    """
    steps = np.diff(sections.centre)[cone.used[1:] & cone.used[:-1]]
    noise = robust_sd(steps, about=0.0)
    return float(np.sum(steps[np.abs(steps) > JUMP_SDS * noise] ** 2))


def _seams(image, straight):
    """What the seams of stitched tiles add to the variance of the length [px²].

    Seams are where the light of the ground steps from one row or column to the next.
    """
    ground = np.ones(image.shape, np.uint8)
    line = np.column_stack([straight.x, straight.y]).round().astype(np.int32)
    cv2.polylines(ground, [line], False, 0, thickness=2 * int(np.abs(straight.u).max()))
    count = 0
    for axis in (0, 1):
        steps = np.diff(image, axis=1 - axis)
        usual = robust_sd(steps, about=0.0) + 1.0
        clear = np.delete(ground, 0, axis=1 - axis) * (np.abs(steps) < SEAM_SDS * usual)
        step = (steps * clear).sum(axis=axis) / np.maximum(clear.sum(axis=axis), 1)
        noise = usual / np.sqrt(np.maximum(clear.sum(axis=axis), 1))
        count += np.count_nonzero(np.abs(step) > np.maximum(SEAM_SDS * noise, SEAM_GREY))
    return count * SEAM_PX**2


def _volume(cone, length, length_se):
    """Volume of the cone up to the tip, and its standard error [px³]."""
    base, tip = cone.base, max(float(cone(length)), 0.0)
    value = np.pi * length * (base**2 + base * tip + tip**2) / 3
    # of base and slope: dV = 2π ∫ r dr ds
    by_base = np.pi * length * (base + tip)
    by_slope = -2 * np.pi * length**2 * (base / 2 - cone.slope * length / 3)
    row = np.array([by_base, by_slope])
    se = np.sqrt(row @ cone.covariance @ row + (np.pi * tip**2 * length_se) ** 2)
    return value, float(se)
