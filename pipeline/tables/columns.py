"""Every table column, declared once."""

from dataclasses import dataclass

import numpy as np
import pandas as pd


@dataclass(frozen=True)
class Column:
    """One table column: its name, pandas dtype, unit ("" where none) and meaning.

    Files of earlier versions may be without a column that is `later`.
    """

    name: str
    dtype: str
    unit: str
    meaning: str
    later: bool = False


def number(name, unit, meaning) -> Column:
    """A column of numbers, NaN where one is not known."""
    return Column(name, "float64", unit, meaning)


def text(name, meaning, **more) -> Column:
    """A column of words, "" where there are none."""
    return Column(name, "string", "", meaning, **more)


def whole(name, meaning) -> Column:
    """A column of whole numbers."""
    return Column(name, "int64", "", meaning)


def yes_no(name, meaning) -> Column:
    """A column of true and false."""
    return Column(name, "bool", "", meaning)


def measured(name, unit, meaning) -> tuple[Column, Column]:
    """A measured column, and behind it the one with its standard error."""
    return number(name, unit, meaning), number(f"{name}_se", unit, f"standard error of {name}")


FRAME = Column("frame", "int32", "", "frame number, from 0")
WHISKER = text("whisker", "name of the whisker")

CENTRELINE_COLUMNS = (
    FRAME,
    WHISKER,
    Column("x_px", "list<float32>", "px", "x of the centreline's points, follicle side → tip"),
    Column("y_px", "list<float32>", "px", "y of the centreline's points, follicle side → tip"),
)

FRAME_COLUMNS = (
    FRAME,
    number("time_s", "s", "frame / frames_per_second"),
    WHISKER,
    yes_no("tracked", "the whisker was found in this frame"),
    number(
        "confidence", "", "0 to 1; below 0.5 the line may be another whisker's, or badly traced"
    ),
    number("follicle_x_px", "px", "x of the extrapolated follicle"),
    number("follicle_y_px", "px", "y of the extrapolated follicle"),
    number(
        "base_angle_deg",
        "deg",
        "whisker's angle at the follicle, counter-clockwise on the screen from +x; "
        "continuous in time, so it may pass ±180",
    ),
    number(
        "base_angle_se_deg",
        "deg",
        "standard error of base_angle_deg, at the scale and hidden length given",
    ),
    number(
        "visible_angle_deg",
        "deg",
        "mean direction of the first 4.5 mm (80 px at least) beyond the fur, likewise",
    ),
    number("visible_angle_se_deg", "deg", "standard error of visible_angle_deg"),
    *measured("curvature_per_m", "1/m", "measured curvature at curvature_at_mm"),
    *measured("rest_curvature_per_m", "1/m", "measured curvature when untouched"),
    *measured("curvature_change_per_m", "1/m", "measured curvature − rest"),
    number(
        "pole_distance_mm",
        "mm",
        "least distance from whisker surface to pole surface; negative: overlap",
    ),
    yes_no("in_contact", "the frame belongs to a contact"),
    number("contact_probability", "", "probability that the frame is in a contact"),
    number("contact_arc_length_mm", "mm", "follicle to the place of contact, while in contact"),
    *measured("contact_force_uN", "µN", "measured contact force, magnitude"),
    *measured(
        "axial_force_uN",
        "µN",
        "measured force along the base tangent; negative pushes into the face",
    ),
    *measured("lateral_force_uN", "µN", "measured force along the base normal"),
    *measured(
        "base_moment_nN_m",
        "nN m",
        "measured bending moment at the follicle, signed as the curvature change",
    ),
)

CONTACT_COLUMNS = (
    text("video", "stem of the video (its results folder)"),
    WHISKER,
    whole("contact", "number of the contact in this video and whisker, from 1"),
    whole("onset_frame", "first frame of contact"),
    whole("offset_frame", "first frame after the contact (half-open)"),
    number("onset_s", "s", "time of the onset frame"),
    number("duration_ms", "ms", "from onset to offset"),
    number(
        "peak_force_uN",
        "µN",
        "largest contact force, corrected for noise, which makes the largest value too large; "
        "frames.parquet has the forces as measured",
    ),
    number("mean_force_uN", "µN", "mean contact force, corrected likewise"),
    number("impulse_uN_ms", "µN ms", "integral of the contact force, corrected likewise"),
    number("peak_base_moment_nN_m", "nN m", "base moment of largest magnitude, likewise"),
    number("peak_axial_force_uN", "µN", "axial force of largest magnitude, likewise"),
    number("contact_arc_length_mm", "mm", "follicle to contact at peak force"),
    number("pulse_peak_uN", "µN", "half-Gaussian fit: peak force"),
    number("pulse_duration_ms", "ms", "half-Gaussian fit: duration 2 t_d"),
    number("pulse_centre_s", "s", "half-Gaussian fit: time of the peak"),
    number("pulse_r2", "", "half-Gaussian fit: coefficient of determination"),
    number("steady_peak_nN_m", "nN m", "dynamic model: steady base moment's peak"),
    number("vibration_max_nN_m", "nN m", "dynamic model: largest vibrational moment"),
    number("vibration_min_nN_m", "nN m", "dynamic model: least vibrational moment"),
    number("vibration_ratio", "", "largest |vibrational| over peak |steady| base moment"),
    yes_no("slip", "ended by slipping past the pole"),
    yes_no("curated", "added or moved by a person"),
    text("flags", "what to be careful about, separated by ';'"),
    number("peak_force_se_uN", "µN", "standard error of the peak force"),
    number("tracking_se_uN", "µN", "part of peak_force_se_uN: tracking noise"),
    number("hidden_length_se_uN", "µN", "part of peak_force_se_uN: error of the hidden length"),
    number("radius_uN_per_percent", "µN", "change of the peak force for 1 % more base radius"),
    number("modulus_uN_per_percent", "µN", "the same for 1 % more Young's modulus"),
    number("scale_uN_per_percent", "µN", "the same for 1 % more pixels per mm"),
)

CONTACT_FLAGS = {
    "starts_before": "touches in the video's first frame: its onset is not seen",
    "ends_after": "touches in the video's last frame: its end is not seen",
    "slip": "ended by slipping past the pole",
    "no_rest_curvature": "too few free frames to know the whisker's shape at rest: no force",
    "large_deflection": "the force is tilted by more than 34° against the follicle's normal",
    "contact_near_curvature_window": "less than 1 mm beyond curvature_at_mm, so little bent there",
    "bends_unlike_rod": "bends as no rod of its dimensions: these are wrong, or the whisker is",
    "base_contradicted": "bends as if the hidden length were wrong by more than contradicted_mm "
    "(docs/parameters.md): correct it or the dimensions, unless the whisker is out of the "
    "picture's plane",
    "gaps_in_trace": "not traced in some of its frames",
    "faint_force": "the force is no larger than its error; the distance shows the contact",
    "doubtful": "the probability of contact is below 0.99 in all frames",
    "not_half_gaussian": "the half-Gaussian fits poorly: the measured force is used for vibration",
}

VIDEO_COLUMNS = (
    text("video", "name of the video's results folder"),
    text("path", "the input"),
    text("status", "done, warning (results, but read the message) or failed"),
    whole("frames", "frames of which there are results; 0: none"),
    number("frames_per_s", "1/s", "speed of processing"),
    text(
        "message",
        "what failed, what to be careful about, which results are old; messages are separated "
        "by a vertical bar",
    ),
)

CORRECTION_COLUMNS = (
    WHISKER,
    text(
        "verdict",
        "contact (added or moved), confirmed (as the program had it) or free (no contact)",
    ),
    whole("onset_frame", "first frame of contact (or of the stretch without)"),
    whole("offset_frame", "first frame after it (half-open)"),
    whole("covers_from", "first frame for which the verdict holds"),
    whole("covers_to", "first frame after these (half-open)"),
    text("saved_at", "date and time of the correction, UTC"),
    text("saved_by", "who made it: a person's name, or a program's", later=True),
)

DECISION_COLUMNS = (
    text("video", "name of the video's results folder"),
    WHISKER,
    text("decision", "added or moved, confirmed, or no contact"),
    whole("onset_frame", "first frame of contact (or of the stretch without)"),
    whole("offset_frame", "first frame after it (half-open)"),
    number("onset_s", "s", "onset_frame / frames_per_second"),
    number("duration_ms", "ms", "from onset to offset"),
    text("decided_by", "name of the person, or of the program"),
    text("decided_at", "date and time, UTC"),
)

EVIDENCE_COLUMNS = (
    FRAME,
    WHISKER,
    number("distance_m", "m", "traced whisker surface to pole surface"),
    number("nearest_m", "m", "arc length of the point nearest to the pole"),
    whole("side", "1: pole on the side of the whisker's normal, -1: other, 0: none"),
    yes_no("pole_known", "the pole is in view and at rest"),
    yes_no("extended", "the nearest point lies beyond the traced part"),
    yes_no("across", "the whisker lies across the pole: in another plane, or over dust"),
    yes_no("interpolated", "the codec made the frame out of frames before and after"),
    yes_no("rest_known", "the rest shape is known from enough free frames"),
    number("origin_m", "m", "correction of the hidden length, added to all arc lengths"),
    number("origin_se_m", "m", "standard error of origin_m"),
    number("gap_m", "m", "distance from the fitted rod's surface to the pole's"),
    number("gap_force_cov", "m N", "covariance of gap_m and shape_force_N"),
    number("contact_m", "m", "arc length where the fitted rod is nearest to the pole"),
    number("base_angle_rad", "rad", "of the fitted rod at the follicle"),
    number("moment_per_force_m", "m", "base moment per contact force"),
    number("axial_per_force", "", "axial force per contact force"),
    number("lateral_per_force", "", "lateral force per contact force"),
    number("chi2", "", "reduced chi-squared of the fitted rod"),
    number("shape_force_N", "N", "force if the pole were touched, by the fitted rod"),
    number("gap_se_m", "m", "standard error of gap_m"),
    number("origin_force_se_N", "N", "part of shape_force_se_N that is due to origin_se_m"),
    number("shape_force_se_N", "N", "standard error of shape_force_N"),
    number("moment_se_N_m", "N m", "standard error of the base moment"),
    number("axial_se_N", "N", "standard error of the axial force"),
    number("lateral_se_N", "N", "standard error of the lateral force"),
    number("point_force_N", "N", "force if the pole were touched, by the curvature"),
    number("origin_per_tip", "", "change of origin_m per change of the tip's place"),
    number("bending_origin_m", "m", "origin_m as estimated from the bending alone"),
    number("bending_origin_se_m", "m", "its standard error"),
    number("point_origin_force_se_N", "N", "part of point_force_se_N, by origin_se_m"),
    number("point_force_se_N", "N", "standard error of point_force_N"),
    number("probability", "", "probability that the frame is in a contact"),
    number("log_odds", "", "log-likelihood ratio of contact to no contact, from this frame alone"),
)


def split_flags(flags: str) -> list[str]:
    """CONTACT_FLAGS of a contact, from its column `flags`."""
    return [flag.strip() for flag in flags.split(";") if flag.strip()]


def units_of(columns) -> dict[str, str]:
    """Unit of each declared column, "" where there is none."""
    return {c.name: c.unit for c in columns}


def with_units(table: pd.DataFrame, columns) -> pd.DataFrame:
    """Return the table with the units of its columns in `attrs["units"]`."""
    units = units_of(columns)
    named = table.copy(deep=False)
    named.attrs = {"units": {name: units[name] for name in table.columns if name in units}}
    return named


def empty_table(columns) -> pd.DataFrame:
    """Return a table of no rows with the declared columns and dtypes."""
    dtypes = {c.name: "object" if c.dtype.startswith("list") else c.dtype for c in columns}
    return pd.DataFrame({name: pd.Series(dtype=dtype) for name, dtype in dtypes.items()})


def as_table(table: pd.DataFrame, columns) -> pd.DataFrame:
    """Return `table` with exactly the declared columns, in order and of their dtypes.

    A declared column that is missing is filled with missing values (False for bool, "" for
    string); an undeclared one raises a ValueError that names it. Values are not copied where they
    need not change: long videos' tables are large.
    """
    extra = set(table.columns) - {c.name for c in columns}
    if extra:
        raise ValueError(f"undeclared columns: {sorted(extra)}")
    fill = {"bool": False, "string": "", "float64": np.nan}
    out = {}
    for c in columns:
        known = c.name in table
        values = table[c.name] if known else pd.Series(fill.get(c.dtype, 0), table.index)
        if not c.dtype.startswith("list") and values.dtype != c.dtype:
            values = values.astype(c.dtype)
        out[c.name] = values.array  # as a column, it would be aligned by its index
    return pd.DataFrame(out, table.index, copy=False)
