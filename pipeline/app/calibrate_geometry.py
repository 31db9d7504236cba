"""`whiskerforce calibrate geometry`: micrographs in, dimensions out."""

import itertools
import math
from pathlib import Path

from pipeline.app.case_by_case import each
from pipeline.calibrate.find_whisker import NoWhiskerError
from pipeline.calibrate.geometry import check_scale, measure_geometry
from pipeline.calibrate.geometry_files import (
    check_names,
    pooled,
    remarks,
    write_geometry,
    write_into,
)
from pipeline.errors import counted, need_content, need_distinct
from pipeline.session.plausibility import doubtful_values
from pipeline.session.quantities import fields_of, limits_of
from pipeline.session.schema import WhiskerSettings
from pipeline.session.session_file import read_session

UNLIKE = 0.05  # SD of whiskers' base radius over its mean: forces differ by four times as much
LENGTH, BASE_RADIUS = (
    limits_of(fields_of(WhiskerSettings)[key]) for key in ("length_mm", "base_radius_um")
)
SHOWN = (("length_mm", "length", "mm"), ("base_radius_um", "base radius", "µm"),
         ("tip_radius_um", "tip radius", "µm"), ("cone_length_mm", "cone length", "mm"),
         ("density_kg_per_m3", "density", "kg/m³"))  # fmt: skip


def run_geometry(images, scale, out, masses, target, say) -> list[str]:
    """Measure all whiskers that can be, write the results, then the session.

    Returns why pictures were left out, each in a sentence.

    Parameters
    ----------
    scale : pixels per mm or None, length of the pictures' scale bar [mm] or None
    target : (session.toml, name of the whisker in it), or None
    say : prints a line
    """
    _check(images, scale, masses)
    check_names(out, images)
    measured, faults = each(
        itertools.zip_longest(images, masses),
        lambda pair: (_measured(pair[0], scale), pair[1]),
        lambda pair: _sentence(pair[0]),
        say,
        none=f"{counted(len(images), 'picture')}, and none can be measured",
    )
    geometries = [geometry for geometry, _ in measured]
    masses = [mass for _, mass in measured if mass is not None]
    write_geometry(out, geometries, masses)
    together = pooled(geometries, masses)
    _say_pooled(together, say)
    say(f"tables and pictures: {out}")
    if target:
        say(write_into(*target, together))
        _say_unlike(together["base_radius_um"], say)
        for doubt in doubtful_values(read_session(target[0])):
            say(f"  {doubt}")
    return faults


def _measured(image, scale):
    geometry = measure_geometry(image, *scale)
    _check_size(geometry)
    return geometry


def _sentence(geometry):
    dimensions = (
        f"{geometry.path}: length {geometry.length} mm, base radius {geometry.base_radius} µm, "
        f"tip radius {geometry.tip_radius} µm, cone length {geometry.cone_length} mm"
    )
    return "\n  ".join([dimensions, *remarks(geometry)])


def _check(images, scale, masses):
    for image in images:
        need_content(image, "micrographs, named one by one,")
    need_distinct(
        map(Path.resolve, images), "{}: is named twice, and its whisker would count as two"
    )
    check_scale(dict(zip(("--pixels-per-mm", "--scale-bar-mm"), scale, strict=True)))
    if masses and len(masses) != len(images):
        raise ValueError(
            f"--mass-ug: expected one per image ({len(images)}), got {len(masses)}; repeat the "
            "option in the order of the images"
        )
    for mass in masses:
        if not (math.isfinite(mass) and mass > 0):
            raise ValueError(f"--mass-ug {mass}: expected a number above 0")


def _check_size(geometry):
    """NoWhiskerError where no whisker is of the size that the scale makes it."""
    length, radius = geometry.length.value, geometry.base_radius.value
    if LENGTH.low <= length <= LENGTH.high and BASE_RADIUS.low <= radius <= BASE_RADIUS.high:
        return
    scale = geometry.pixels_per_mm
    hint = "measure the scale again"
    for factor, unit in ((1e3, "pixels per µm"), (1e-3, "pixels per m")):
        if LENGTH.low <= length / factor <= LENGTH.high:
            hint = f"is it in {unit}? then give --pixels-per-mm {scale * factor:g}"
    raise NoWhiskerError(
        f"{geometry.path}: at {scale:g} pixels per mm the whisker would be {length:.4g} mm long "
        f"and {radius:.4g} µm in radius at its base; expected {LENGTH} and {BASE_RADIUS}: "
        f"{hint}"
    )


def _say_pooled(values, say):
    count = values["length_mm"].n
    if count > 1:
        parts = [
            f"{word} {values[key].mean:.4g} ± {values[key].sd:.2g} {unit}"
            for key, word, unit in SHOWN
            if key in values
        ]
        say(f"{count} whiskers, mean ± SD: {', '.join(parts)}")


def _say_unlike(radius, say):
    """Doubt a mean of whiskers that are not alike."""
    share = radius.sd / radius.mean
    if share > UNLIKE:
        say(
            f"  a mean of unlike whiskers: their base radius varies by {100 * share:.0f} % (SD), "
            "and forces go with its fourth power; write each whisker's own picture into the file, "
            "under its own name"
        )
