"""What `calibrate dust` writes: tables of frames, contacts and videos, and a figure per video."""

from pathlib import Path

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
from pipeline.tables.new_files import new_files


def pooled_slope(motions: list[FollicleMotion]) -> Slope | None:
    """The slope over the contacts of all videos together; None where there are too few."""
    return slope_of(pd.concat([motion.contacts for motion in motions]))


def video_table(motions: list[FollicleMotion]) -> pd.DataFrame:
    """Rows of dust_videos.csv: one per video, then all pooled."""
    rows = [
        {
            "video": motion.video,
            "whisker": motion.whisker,
            "particle_mm": motion.particle_mm,
            "seen": motion.particle.seen.mean(),
            "radial_range_mm": motion.radial_range_mm,
            **_slope_cells(slope_of(motion.contacts)),
        }
        for motion in motions
    ]
    rows.append(
        {
            "video": "pooled",
            "whisker": motions[0].whisker,
            "particle_mm": np.mean([motion.particle_mm for motion in motions]),
            "seen": np.mean([motion.particle.seen.mean() for motion in motions]),
            "radial_range_mm": max(motion.radial_range_mm for motion in motions),
            **_slope_cells(pooled_slope(motions)),
        }
    )
    return as_table(pd.DataFrame(rows), DUST_VIDEO_COLUMNS)


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


def write_dust(out, motions: list[FollicleMotion]) -> list[Path]:
    """Write dust.csv, dust_contacts.csv, dust_videos.csv and the figures."""
    frames = pd.concat([motion.frames for motion in motions])
    contacts = pd.concat([motion.contacts for motion in motions])
    pictures = [f"{motion.video}.png" for motion in motions]
    with new_files(out) as new:
        for name, motion in zip(pictures, motions, strict=True):
            draw_dust(new / name, motion)
        write_csv(new / "dust.csv", as_table(frames, DUST_COLUMNS), DUST_COLUMNS)
        write_csv(new / "dust_contacts.csv", contacts, DUST_CONTACT_COLUMNS)
        write_csv(new / "dust_videos.csv", video_table(motions), DUST_VIDEO_COLUMNS)
    names = "dust_videos.csv", "dust.csv", "dust_contacts.csv", *pictures
    return [Path(out) / name for name in names]
