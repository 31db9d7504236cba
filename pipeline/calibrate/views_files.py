"""What `calibrate views` writes: tables of frames, contacts, lines in space, and a figure."""

import numpy as np
import pandas as pd

from pipeline.calibrate.two_views import TwoViews
from pipeline.calibrate.views import ViewsMeasurement
from pipeline.calibrate.views_picture import draw_views
from pipeline.tables.calibration_columns import (
    CALIBRATED_VIEW_COLUMNS,
    SPACE_LINE_COLUMNS,
    VIEW_CONTACT_COLUMNS,
    VIEW_FRAME_COLUMNS,
)
from pipeline.tables.columns import as_table
from pipeline.tables.files import write_csv, write_rows
from pipeline.tables.own_files import new_files


def write_views(out, views: TwoViews, measured: list[ViewsMeasurement], made_of=()) -> None:
    """Write calibration.csv, views.csv, view_contacts.csv, lines_3d.parquet and fig4.png.

    made_of : of `new_files`
    """
    tables = {
        "calibration.csv": (_calibration(views), CALIBRATED_VIEW_COLUMNS),
        "views.csv": (pd.concat([each.frames for each in measured]), VIEW_FRAME_COLUMNS),
        "view_contacts.csv": (pd.concat([e.contacts for e in measured]), VIEW_CONTACT_COLUMNS),
    }
    lines = pd.DataFrame([row for each in measured for row in _line_rows(each, views)])
    with new_files(out, made_of) as new:
        draw_views(new / "fig4.png", measured)
        for name, (table, columns) in tables.items():
            write_csv(new / name, as_table(table, columns), columns)
        write_rows(new / "lines_3d.parquet", lines, SPACE_LINE_COLUMNS)


def _calibration(views) -> pd.DataFrame:
    axes = {"shared_axis_deg": views.shared, "second_axis_deg": views.second_shared}
    row = {
        "second_pixels_per_mm": views.second_scale,
        "second_pixels_per_mm_se": views.second_se,
        "points_rms_px": views.rms_px,
    }
    for name, axis in axes.items():
        row |= {name: np.rad2deg(np.arctan2(axis[1], axis[0]))}
        row |= {f"{name}_se": np.rad2deg(views.angle_se)}
    return pd.DataFrame([row])


def _line_rows(measured, views):
    """Rows of lines_3d.parquet of one video."""
    for frame, line in measured.lines.items():
        x, y = (line.first * (1, -1) / views.first_scale).T
        yield {
            "video": measured.video, "whisker": measured.whisker, "frame": frame,
            "x_mm": x, "y_mm": y, "z_mm": line.height,
        }  # fmt: skip
