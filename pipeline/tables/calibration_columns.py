"""Every column of the tables that `calibrate` writes, declared once."""

from pipeline.tables.columns import WHISKER, Column, measured, number, text, whole, yes_no


def with_interval(name, unit, meaning):
    """A measured column, and behind it those with the ends of its 95 % interval."""
    yield number(name, unit, meaning)
    for end, word in (("low", "lower"), ("high", "upper")):
        yield number(f"{name}_{end}", unit, f"{word} end of the 95 % interval of {name}")


GEOMETRY_COLUMNS = (
    text("image", "file of the micrograph"),
    *measured("length_mm", "mm", "base to (cut) tip, along the whisker"),
    *measured("base_radius_um", "µm", "of the fitted cone at the base"),
    *measured("tip_radius_um", "µm", "of the fitted cone at the tip"),
    *measured("cone_length_mm", "mm", "base to the extrapolated apex"),
)
DENSITY_COLUMNS = measured("density_kg_per_m3", "kg/m³", "mass over volume, where one is given")
POOLED_COLUMNS = (
    text("quantity", "column of geometry.csv"),
    number("mean", "as there", "of all whiskers"),
    number("sd", "as there", "standard deviation between whiskers"),
    whole("whiskers", "how many"),
)
PROFILE_COLUMNS = (
    number("arc_length_mm", "mm", "from the base, along the whisker"),
    *measured("diameter_um", "µm", "edge to edge"),
    number("cone_um", "µm", "diameter of the fitted cone"),
    number("left_x_px", "px", "x of the left edge, seen from base to tip"),
    number("left_y_px", "px", "y of the left edge"),
    number("right_x_px", "px", "x of the right edge"),
    number("right_y_px", "px", "y of the right edge"),
    yes_no("used", "used to fit the cone; false: dust or root"),
)
FOLLICLE_COLUMNS = (
    number("follicle_stiffness", "E I0/L", "of the follicle; inf: fixed, 0: pinned"),
    *with_interval("youngs_modulus_GPa", "GPa", "of all slips together, in such a follicle"),
)
RINGDOWN_COLUMNS = (
    text("video", "stem of the video; `pooled` in the last row"),
    WHISKER,
    whole("frame", "first frame of the ring-down; number of slips where pooled"),
    *with_interval("angular_frequency_rad_per_s", "rad/s", "damped, of the first mode"),
    *with_interval("damping_per_s", "1/s", "decay rate d"),
    *with_interval("youngs_modulus_GPa", "GPa", "from frequency and dimensions"),
)

DUST_COLUMNS = (
    text("video", "stem of the video"),
    WHISKER,
    whole("frame", "frame number, from 0"),
    number("time_s", "s", "time of the frame"),
    number("particle_x_px", "px", "x of the centreline where the particle sits"),
    number("particle_y_px", "px", "y of it"),
    *measured(
        "radial_mm", "mm", "place of the follicle, from its median; positive: out of the face"
    ),
    yes_no("in_contact", "the frame belongs to a contact"),
    number("curvature_change_per_m", "1/m", "as in frames.parquet"),
)
DUST_CONTACT_COLUMNS = (
    text("video", "stem of the video"),
    WHISKER,
    whole("contact", "its number in contacts.csv"),
    number("curvature_change_per_m", "1/m", "largest of the contact, signed"),
    number("radial_change_mm", "mm", "change of radial_mm from before the contact to there"),
    number("radial_range_mm", "mm", "largest less least radial_mm in the contact"),
)
DUST_VIDEO_COLUMNS = (
    text("video", "stem of the video; `pooled` in the last row"),
    WHISKER,
    number("particle_mm", "mm", "follicle to particle, along the whisker"),
    number("seen", "", "share of the traced frames in which the particle is seen"),
    number("radial_range_mm", "mm", "largest less least radial_mm"),
    whole("contacts", "contacts with a radial and a curvature change"),
    *with_interval("slope_um_m", "µm m", "radial change per absolute curvature change"),
    *with_interval("correlation", "", "of these two changes, over the contacts"),
)

_VIEW_COLUMNS = (
    *measured("elevation_deg", "deg", "follicle to contact, above the horizontal"),
    *measured(
        "projection_error_percent", "%", "how much shorter the apparent path is than the true one"
    ),
    number("azimuth_deg", "deg", "follicle to contact, as base_angle_deg"),
    number("apparent_path_mm", "mm", "follicle to contact along the first view's line"),
    number("true_path_mm", "mm", "follicle to contact in space"),
    number("elevation_part_percent", "%", "part of projection_error_percent, by elevation alone"),
    number("droop_part_percent", "%", "the rest of it"),
)
VIEW_FRAME_COLUMNS = (
    text("video", "stem of the first view's video"),
    WHISKER,
    whole("frame", "frame number, from 0"),
    number("time_s", "s", "time of the frame"),
    yes_no("in_contact", "in contact; in other frames, paths end nearest to the pole"),
    *_VIEW_COLUMNS,
    *measured("first_view_force_uN", "µN", "contact force from the first view alone"),
    *measured("own_plane_force_uN", "µN", "force in the whisker's own plane"),
)
VIEW_CONTACT_COLUMNS = (
    text("video", "stem of the first view's video"),
    WHISKER,
    whole("contact", "its number in contacts.csv; values are medians over it"),
    *_VIEW_COLUMNS,
    number("first_view_peak_uN", "µN", "largest first_view_force_uN"),
    number("own_plane_peak_uN", "µN", "largest own_plane_force_uN"),
    number(
        "force_effect_percent", "%", "by how much own_plane_force_uN exceeds first_view_force_uN"
    ),
)
POINT_COLUMNS = (
    number("first_x_px", "px", "x of a point in the first view"),
    number("first_y_px", "px", "y of it there"),
    number("second_x_px", "px", "x of the same point in the second view"),
    number("second_y_px", "px", "y of it there"),
)
SPACE_LINE_COLUMNS = (
    text("video", "stem of the first view's video"),
    WHISKER,
    whole("frame", "frame number, from 0"),
    Column("x_mm", "list<float32>", "mm", "x of its points, follicle → tip, right in the picture"),
    Column("y_mm", "list<float32>", "mm", "y of its points, up in the first picture"),
    Column("z_mm", "list<float32>", "mm", "height above the follicle"),
)
CALIBRATED_VIEW_COLUMNS = (
    *measured("second_pixels_per_mm", "px/mm", "scale of the second view"),
    *measured("shared_axis_deg", "deg", "of the shared axis in the first picture"),
    *measured("second_axis_deg", "deg", "of the shared axis in the second picture"),
    number("points_rms_px", "px", "how far matched points disagree"),
)
