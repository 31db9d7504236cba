"""What `calibrate geometry` writes: tables, whiskers pooled, values for session.toml."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.calibrate.geometry import BROKEN_UM, Geometry, Measured
from pipeline.calibrate.geometry_picture import draw_pooled, draw_whisker
from pipeline.errors import renamed
from pipeline.session.edit import set_whisker_values, whisker_has
from pipeline.tables.calibration_columns import (
    DENSITY_COLUMNS,
    GEOMETRY_COLUMNS,
    POOLED_COLUMNS,
    PROFILE_COLUMNS,
)
from pipeline.tables.files import write_csv
from pipeline.tables.own_files import new_files
from pipeline.tables.whole_files import sha256

PROFILE = "_profile.csv"  # end of a file's name
UNITS = {"length": "mm", "base_radius": "um", "tip_radius": "um", "cone_length": "mm"}
DEVIATION_SHARE = 0.02  # of the base radius, from which a whisker is said to be no cone


@dataclass(frozen=True)
class Pooled:
    """A dimension of several whiskers: mean, SD between whiskers (NaN of one), how many."""

    mean: float
    sd: float
    n: int


def pooled(geometries, masses=()) -> dict[str, Pooled]:
    """Mean and SD of every dimension, keyed as the columns of geometry.csv."""
    table = geometry_table(geometries, masses)
    names = [name for name in table if name != "image" and not name.endswith("_se")]
    return {
        name: Pooled(float(table[name].mean()), float(table[name].std()), len(table))
        for name in names
    }


def geometry_table(geometries, masses=()) -> pd.DataFrame:
    """Rows of geometry.csv; `masses` [µg], one per whisker or none at all."""
    rows = []
    for i, geometry in enumerate(geometries):
        row = {"image": geometry.path.name}
        for name, unit in UNITS.items():
            row |= _pair(f"{name}_{unit}", getattr(geometry, name))
        if masses:
            row |= _pair("density_kg_per_m3", geometry.density(masses[i]))
        rows.append(row)
    return pd.DataFrame(rows)


def _pair(name, measured: Measured):
    return {name: measured.value, f"{name}_se": measured.se}


def write_geometry(out, geometries: list[Geometry], masses=()) -> None:
    """Write geometry.csv, a profile and a picture per whisker, and all whiskers together."""
    columns = GEOMETRY_COLUMNS + (DENSITY_COLUMNS if masses else ())
    with new_files(out, [sha256(geometry.path) for geometry in geometries]) as new:
        stems = _stems(geometry.path for geometry in geometries)
        for stem, geometry in zip(stems, geometries, strict=True):
            write_csv(new / f"{stem}{PROFILE}", profile(geometry), PROFILE_COLUMNS)
            draw_whisker(new / f"{stem}.png", geometry, profile(geometry))
        if len(geometries) > 1:
            write_csv(new / "pooled.csv", _pooled_table(geometries, masses), POOLED_COLUMNS)
            draw_pooled(new / "geometry.png", geometries, [profile(each) for each in geometries])
        write_csv(new / "geometry.csv", geometry_table(geometries, masses), columns)


def check_names(out, pictures) -> None:
    """OSError where the names of what is made of these pictures are too long for the disk."""
    folder = next(each for each in (out, *out.parents) if each.is_dir())
    for stem in _stems(pictures):
        try:
            (folder / f"{stem}{PROFILE}").lstat()
        except FileNotFoundError:
            continue
        except OSError as error:
            raise renamed(error, out / f"{stem}{PROFILE}") from None


def _stems(pictures):
    """A file name per picture, numbered where two are alike."""
    stems = []
    for picture in pictures:
        stem, k = picture.stem, 1
        while stem in (*stems, "geometry"):
            k += 1
            stem = f"{picture.stem}_{k}"
        stems.append(stem)
    return stems


def _pooled_table(geometries, masses) -> pd.DataFrame:
    rows = [(name, v.mean, v.sd, v.n) for name, v in pooled(geometries, masses).items()]
    return pd.DataFrame(rows, columns=[column.name for column in POOLED_COLUMNS])


def profile(geometry: Geometry) -> pd.DataFrame:
    """Diameter and edges along a whisker, base → tip (PROFILE_COLUMNS)."""
    sections, scale = geometry.sections, geometry.pixels_per_mm
    along = np.abs(sections.s - geometry.base_at.s)
    forward = geometry.tip_at.s > geometry.base_at.s
    # seen from base to tip, y down: the left edge lies at smaller u
    left, right = (
        geometry.straight.place(sections.s, sections.centre + sign * sections.half_width)
        for sign in ((-1, 1) if forward else (1, -1))
    )
    table = pd.DataFrame(
        {
            "arc_length_mm": along / scale,
            "diameter_um": 2e3 * sections.half_width / scale,
            "diameter_um_se": 2e3 * sections.half_width_se / scale,
            "cone_um": 2e3 * geometry.cone(along) / scale,
            "left_x_px": left[0],
            "left_y_px": left[1],
            "right_x_px": right[0],
            "right_y_px": right[1],
            "used": geometry.cone.used,
        }
    )
    return table.sort_values("arc_length_mm").reset_index(drop=True)


def remarks(geometry: Geometry) -> list[str]:
    """What a person should know about one whisker beyond its dimensions."""
    out = []
    tip, base = geometry.tip_radius, geometry.base_radius
    if tip.value - 2 * tip.se > BROKEN_UM:
        out.append(f"the tip is cut or broken: it is {tip.value:.1f} µm in radius")
    left_out = 1 - geometry.cone.used.mean()
    if left_out > 0.1:
        out.append(f"{100 * left_out:.0f} % of it is no cone (dust, root, seam): not used")
    scatter = 1e3 * geometry.cone.scatter / geometry.pixels_per_mm
    if scatter > DEVIATION_SHARE * base.value:
        out.append(f"the radius lies {scatter:.2f} µm (SD) about the cone: see the picture")
    return out


def write_into(session, name, dimensions: dict[str, Pooled]) -> str:
    """Write the (mean) dimensions into a whisker of session.toml; returns that, in words.

    A whisker described by its tip radius keeps that key; any other gets a cone length.
    """
    values = {key: round(value.mean, 4) for key, value in dimensions.items()}
    by_tip = whisker_has(session, name, "tip_radius_um")
    values.pop("cone_length_mm" if by_tip else "tip_radius_um")
    return set_whisker_values(session, name, values)
