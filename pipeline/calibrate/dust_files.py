"""What `calibrate dust` writes: tables of frames, contacts and videos, and a figure per video."""

import numpy as np
import pandas as pd

from pipeline.calibrate.dust_picture import draw_dust
from pipeline.calibrate.follicle_motion import FollicleMotion, Slope, slope_of
from pipeline.tables.calibration_columns import (
    DUST_COLUMNS,
    DUST_CONTACT_COLUMNS,
    DUST_VIDEO_COLUMNS,
)
from pipeline.tables.columns import as_table
from pipeline.tables.files import write_csv
from pipeline.tables.own_files import new_files


def pooled_slope(motions: list[FollicleMotion]) -> Slope | None:
    """The slope over the contacts of all videos together; None where there are too few."""
    return slope_of(pd.concat([motion.contacts for motion in motions]))


def video_table(motions: list[FollicleMotion]) -> pd.DataFrame:
    """Rows of dust_videos.csv: one per video, then all pooled."""
    rows = [*(_row(each.video, [each]) for each in motions), _row("pooled", motions)]
    return as_table(pd.DataFrame(rows), DUST_VIDEO_COLUMNS)


def _row(video, motions) -> dict:
    """A row of DUST_VIDEO_COLUMNS, of one video or of several together."""
    return {
        "video": video,
        "whisker": motions[0].whisker,
        "particle_mm": np.mean([each.particle_mm for each in motions]),
        "seen": np.mean([each.particle.seen.mean() for each in motions]),
        "radial_range_mm": max(each.radial_range_mm for each in motions),
        **_slope_cells(pooled_slope(motions)),
    }


def _slope_cells(slope: Slope | None) -> dict:
    if slope is None:
        return {"contacts": 0}
    return {
        "contacts": slope.n,
        "slope_um_m": 1e3 * slope.slope,
        "slope_um_m_low": 1e3 * slope.low,
        "slope_um_m_high": 1e3 * slope.high,
        "correlation": slope.r,
        "correlation_low": slope.r_low,
        "correlation_high": slope.r_high,
    }


def write_dust(out, motions: list[FollicleMotion], made_of=()) -> None:
    """Write dust.csv, dust_contacts.csv, dust_videos.csv and the figures.

    made_of : of `new_files`
    """
    frames = pd.concat([motion.frames for motion in motions])
    contacts = pd.concat([motion.contacts for motion in motions])
    with new_files(out, made_of) as new:
        for motion in motions:
            draw_dust(new / f"{motion.video}.png", motion)
        write_csv(new / "dust.csv", as_table(frames, DUST_COLUMNS), DUST_COLUMNS)
        write_csv(new / "dust_contacts.csv", contacts, DUST_CONTACT_COLUMNS)
        write_csv(new / "dust_videos.csv", video_table(motions), DUST_VIDEO_COLUMNS)
