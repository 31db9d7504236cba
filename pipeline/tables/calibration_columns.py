"""Every column of the tables that `calibrate` writes, declared once."""

from pipeline.tables.columns import Column


def _each_with(suffixes, columns):
    """Every column followed by one more per suffix: (suffix, what it means)."""
    for column in columns:
        yield column
        for suffix, meaning in suffixes:
            name = f"{column.name}_{suffix}"
            yield Column(name, "float64", column.unit, f"{meaning} of {column.name}")


GEOMETRY_COLUMNS = (
    Column("image", "string", "", "file of the micrograph"),
    *_each_with(
        [("se", "standard error")],
        (
            Column("length_mm", "float64", "mm", "base to (cut) tip, along the whisker"),
            Column("base_radius_um", "float64", "µm", "of the fitted cone at the base"),
            Column("tip_radius_um", "float64", "µm", "of the fitted cone at the tip"),
            Column("cone_length_mm", "float64", "mm", "base to the extrapolated apex"),
        ),
    ),
)
DENSITY_COLUMNS = tuple(
    _each_with(
        [("se", "standard error")],
        (Column("density_kg_per_m3", "float64", "kg/m³", "mass over volume, where one is given"),),
    )
)
PROFILE_COLUMNS = (
    Column("arc_length_mm", "float64", "mm", "from the base, along the whisker"),
    Column("diameter_um", "float64", "µm", "edge to edge"),
    Column("diameter_um_se", "float64", "µm", "standard error of diameter_um"),
    Column("cone_um", "float64", "µm", "diameter of the fitted cone"),
    Column("left_x_px", "float64", "px", "x of the left edge, seen from base to tip"),
    Column("left_y_px", "float64", "px", "y of the left edge"),
    Column("right_x_px", "float64", "px", "x of the right edge"),
    Column("right_y_px", "float64", "px", "y of the right edge"),
    Column("used", "bool", "", "used to fit the cone; false: dust or root"),
)
RINGDOWN_COLUMNS = (
    Column("video", "string", "", "stem of the video; `pooled` in the last row"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("frame", "int64", "", "first frame of the ring-down; number of slips where pooled"),
    *_each_with(
        [("low", "lower end of the 95 % interval"), ("high", "upper end of the 95 % interval")],
        (
            Column("angular_frequency_rad_per_s", "float64", "rad/s", "damped, of the first mode"),
            Column("damping_per_s", "float64", "1/s", "decay rate d"),
            Column("youngs_modulus_GPa", "float64", "GPa", "from frequency and dimensions"),
        ),
    ),
)

DUST_COLUMNS = (
    Column("video", "string", "", "stem of the video"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("frame", "int64", "", "frame number, from 0"),
    Column("time_s", "float64", "s", "time of the frame"),
    Column("particle_x_px", "float64", "px", "x of the centreline where the particle sits"),
    Column("particle_y_px", "float64", "px", "y of it"),
    Column(
        "radial_mm",
        "float64",
        "mm",
        "place of the follicle, from its median; positive: out of the face",
    ),
    Column("radial_mm_se", "float64", "mm", "standard error of radial_mm"),
    Column("in_contact", "bool", "", "the frame belongs to a contact"),
    Column("curvature_change_per_m", "float64", "1/m", "as in frames.parquet"),
)
DUST_CONTACT_COLUMNS = (
    Column("video", "string", "", "stem of the video"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("contact", "int64", "", "its number in contacts.csv"),
    Column("curvature_change_per_m", "float64", "1/m", "largest of the contact, signed"),
    Column(
        "radial_change_mm", "float64", "mm", "change of radial_mm from before the contact to there"
    ),
    Column("radial_range_mm", "float64", "mm", "largest less least radial_mm in the contact"),
)
DUST_VIDEO_COLUMNS = (
    Column("video", "string", "", "stem of the video; `pooled` in the last row"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("particle_mm", "float64", "mm", "follicle to particle, along the whisker"),
    Column("seen", "float64", "", "share of the traced frames in which the particle is seen"),
    Column("radial_range_mm", "float64", "mm", "largest less least radial_mm"),
    Column("contacts", "int64", "", "contacts with a radial and a curvature change"),
    *_each_with(
        [("low", "lower end of the 95 % interval"), ("high", "upper end of the 95 % interval")],
        (
            Column("slope_um_m", "float64", "µm m", "radial change per absolute curvature change"),
            Column("correlation", "float64", "", "of these two changes, over the contacts"),
        ),
    ),
)

_VIEW_COLUMNS = (
    *_each_with(
        [("se", "standard error")],
        (
            Column("elevation_deg", "float64", "deg", "follicle to contact, above the horizontal"),
            Column(
                "projection_error_percent",
                "float64",
                "%",
                "how much shorter the apparent path is than the true one",
            ),
        ),
    ),
    Column("azimuth_deg", "float64", "deg", "follicle to contact, as base_angle_deg"),
    Column("apparent_path_mm", "float64", "mm", "follicle to contact along the first view's line"),
    Column("true_path_mm", "float64", "mm", "follicle to contact in space"),
    Column(
        "elevation_part_percent",
        "float64",
        "%",
        "part of projection_error_percent, by elevation alone",
    ),
    Column("droop_part_percent", "float64", "%", "the rest of it"),
)
VIEW_FRAME_COLUMNS = (
    Column("video", "string", "", "stem of the first view's video"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("frame", "int64", "", "frame number, from 0"),
    Column("time_s", "float64", "s", "time of the frame"),
    Column("in_contact", "bool", "", "in contact; in other frames, paths end nearest to the pole"),
    *_VIEW_COLUMNS,
    *_each_with(
        [("se", "standard error")],
        (
            Column(
                "first_view_force_uN", "float64", "µN", "contact force from the first view alone"
            ),
            Column("own_plane_force_uN", "float64", "µN", "force in the whisker's own plane"),
        ),
    ),
)
VIEW_CONTACT_COLUMNS = (
    Column("video", "string", "", "stem of the first view's video"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("contact", "int64", "", "its number in contacts.csv; values are medians over it"),
    *_VIEW_COLUMNS,
    Column("first_view_peak_uN", "float64", "µN", "largest first_view_force_uN"),
    Column("own_plane_peak_uN", "float64", "µN", "largest own_plane_force_uN"),
    Column(
        "force_effect_percent",
        "float64",
        "%",
        "by how much own_plane_force_uN exceeds first_view_force_uN",
    ),
)
SPACE_LINE_COLUMNS = (
    Column("video", "string", "", "stem of the first view's video"),
    Column("whisker", "string", "", "name of the whisker"),
    Column("frame", "int64", "", "frame number, from 0"),
    Column("x_mm", "list<float32>", "mm", "x of its points, follicle → tip, right in the picture"),
    Column("y_mm", "list<float32>", "mm", "y of its points, up in the first picture"),
    Column("z_mm", "list<float32>", "mm", "height above the follicle"),
)
CALIBRATED_VIEW_COLUMNS = (
    *_each_with(
        [("se", "standard error")],
        (
            Column("second_pixels_per_mm", "float64", "px/mm", "scale of the second view"),
            Column("shared_axis_deg", "float64", "deg", "of the shared axis in the first picture"),
            Column(
                "second_axis_deg", "float64", "deg", "of the shared axis in the second picture"
            ),
        ),
    ),
    Column("points_rms_px", "float64", "px", "how far matched points disagree"),
)
