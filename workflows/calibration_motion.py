"""How accurate `calibrate dust` and `calibrate views` are, on rendered sessions of known truth."""

import tempfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pages
import pandas as pd

from pipeline.app import cli
from pipeline.calibrate.follicle_motion import contact_row, slope_of
from pipeline.tables.calibration_columns import (
    DUST_COLUMNS,
    DUST_CONTACT_COLUMNS,
    DUST_VIDEO_COLUMNS,
    VIEW_FRAME_COLUMNS,
)
from pipeline.tables.columns import CONTACT_COLUMNS, as_table
from pipeline.tables.files import read_csv, read_frames
from synthetic.presets import make_trial
from synthetic.session import render_session
from synthetic.two_view_session import render_two_views

COURSE_AIM_UM, ELEVATION_AIM, PROJECTION_AIM, FORCE_AIM = 10.0, 0.5, 0.2, 5.0
LEAST_FORCE_UN = 2.0  # of the frames whose force is compared
VIEW_FRAMES = 300  # of each video


@contextmanager
def work_folder(keep, name):
    """A folder to work in: `keep`/name, which stays, or a temporary one.

    A session that is finished in it is not made again.
    """
    if keep is None:
        with tempfile.TemporaryDirectory() as folder:
            yield Path(folder)
    else:
        folder = Path(keep) / name
        folder.mkdir(parents=True, exist_ok=True)
        yield folder


def command(*arguments) -> None:
    """Run a command of whiskerforce as a user would; SystemExit where it fails."""
    try:
        cli.main([str(each) for each in arguments])
    except SystemExit as stopped:
        if stopped.code:
            raise


def dust_text(count: int, seed: int, keep=None):
    """Videos with a particle: the follicle's motion beside the truth, as Markdown, and aims."""
    rows = []
    for k in range(count):
        with work_folder(keep, f"dust_{seed + k}") as folder:
            videos, results, out = (folder / name for name in ("videos", "results", "out"))
            if not out.exists():
                render_session(videos, "dust", seed + k, trials=2)
                command("run", videos, "--out", results, "--jobs", 1)
                command("calibrate", "dust", results, "--out", out)
            rows += [[f"{seed + k}", *row] for row in dust_rows(videos / "truth", out)]
    header = ["session", "video", "range found", "true", "error of its course", "slope (95 %)"]
    held = sum(row[-1] == "yes" for row in rows)
    text = (
        f"{pages.table([*header, 'true slope', 'held'], rows)}\n\nThe course's error is its SD. "
        "Slopes in µm per 1/m of curvature change; true slopes are those of the "
        f"rendered motion over the true contacts. {held} of {len(rows)} intervals hold them."
    )
    off = [float(row[4].split()[0]) for row in rows]
    cells = (f"{part:.1f} µm" for part in (COURSE_AIM_UM, np.median(off), max(off)))
    covered = f"{100 * held / len(rows):.0f} % (slopes)"
    return text, [["dust", "follicle's course, per video", *cells, covered]]


def dust_rows(truth: Path, out: Path):
    """Cells of each video that `calibrate dust` wrote, beside the truth."""
    frames = read_csv(out / "dust.csv", DUST_COLUMNS)
    found = read_csv(out / "dust_videos.csv", DUST_VIDEO_COLUMNS)
    for row in found[found["video"] != "pooled"].itertuples():
        own = frames[frames["video"] == row.video]
        true = _true_course(truth / row.video, own)
        slope = slope_of(_true_contacts(truth / row.video, true))
        true_slope = 1e3 * slope.slope
        yield [
            row.video[-3:],
            f"{row.radial_range_mm:.3f} mm",
            f"{np.ptp(true['radial_mm']):.3f} mm",
            f"{1e3 * np.std(own['radial_mm'].to_numpy() - true['radial_mm'].to_numpy()):.1f} µm",
            f"{row.slope_um_m:.2f} ({row.slope_um_m_low:.2f} to {row.slope_um_m_high:.2f})",
            f"{true_slope:.2f}",
            "yes" if row.slope_um_m_low < true_slope < row.slope_um_m_high else "no",
        ]


def _true_course(truth, own):
    """The rows of dust.csv as they are in truth."""
    table = read_frames(truth / "frames.parquet").set_index("frame").loc[own["frame"]]
    scale = 1e-3 * make_trial("dust", 0, 0, 40).scene.camera.pixels_per_m
    axis = np.deg2rad(table["base_angle_deg"].median())
    x, y = (table[f"follicle_{c}_px"] - table[f"follicle_{c}_px"].median() for c in "xy")
    radial = (x * np.cos(axis) - y * np.sin(axis)) / scale
    return table.assign(radial_mm=radial).reset_index()


def _true_contacts(truth, course):
    """What the follicle truly does in the true contacts."""
    rows = read_csv(truth / "contacts.csv", CONTACT_COLUMNS)
    changes = [contact_row(course, each) for each in rows.itertuples()]
    return as_table(pd.DataFrame(changes), DUST_CONTACT_COLUMNS)


def views_text(count: int, seed: int, keep=None):
    """Two views: elevation, projection error and force beside the truth, as Markdown, and aims."""
    rows, frames = [], []
    for k in range(count):
        with work_folder(keep, f"views_{seed + k}") as folder:
            preset = ("mirror", "two_views")[(seed + k) % 2]
            out = measured_views(folder, preset, seed + k)
            for video, table in _beside_truth(folder / "videos" / "truth", out):
                rows.append([f"{seed + k}, {video[:-4]}", video[-3:], *_view_cells(table)])
                frames.append(table)
    header = ["session", "video", "elevation", "its error", "projection error", "found"]
    header += ["first view's force", "own plane's"]
    every = pd.concat(frames)
    held = {name: 100 * np.mean(_off(every, name).abs() < 1.96) for name in _WITH_ERRORS}
    text = (
        f"{pages.table(header, rows)}\n\nContact frames; forces are off by these shares of the "
        f"true ones where they are {LEAST_FORCE_UN:g} µN or more. Of the frames' 95 % intervals, "
        f"{held['elevation_deg']:.0f} % hold the true elevation and "
        f"{held['projection_error_percent']:.0f} % the true projection error."
    )
    return text, _view_aims(every, frames, held)


_WITH_ERRORS = "elevation_deg", "projection_error_percent"


def measured_views(folder: Path, preset: str, seed: int) -> Path:
    """Render a session in two views and process it by the commands; returns the results."""
    videos, out = folder / "videos", folder / "out"
    if out.exists():
        return out
    render_two_views(videos, preset, seed, frames=VIEW_FRAMES)
    for name in ("first", "second"):
        config = videos / (f"{name}.toml" if preset == "mirror" else f"{name}/session.toml")
        source = videos if preset == "mirror" else videos / name
        results = folder / f"{name}_results"
        command("run", source, "--config", config, "--out", results, "--jobs", 1)
    both = folder / "first_results", folder / "second_results"
    command("calibrate", "views", *both, "--points", videos / "points.csv", "--out", out)
    return out


def _beside_truth(truth, out):
    """Each video's contact frames with what is true of them."""
    found = read_csv(out / "views.csv", VIEW_FRAME_COLUMNS)
    for video, own in found[found["in_contact"]].groupby("video"):
        true = pd.read_csv(truth / video / "views.csv").add_suffix("_true")
        yield video, own.merge(true, left_on="frame", right_on="frame_true")


def _off(table, name):
    """Errors in standard errors."""
    return (table[name] - table[f"{name}_true"]) / table[f"{name}_se"]


def _force_off(table):
    """Share [%] by which the first view's and the own plane's forces are off."""
    strong = table[table["contact_force_uN_true"] > LEAST_FORCE_UN]
    true = strong["contact_force_uN_true"].sum()
    names = "first_view_force_uN", "own_plane_force_uN"
    return [100 * (strong[name].sum() / true - 1) if true else np.nan for name in names]


def _view_cells(table):
    off = (table["elevation_deg"] - table["elevation_deg_true"]).abs()
    flat, own = _force_off(table)
    return [
        f"{table['elevation_deg_true'].median():.1f}°",
        f"{off.median():.2f}°",
        f"{table['projection_error_percent_true'].median():.2f} %",
        f"{table['projection_error_percent'].median():.2f} %",
        pages.cell("{:+.1f} %", flat),
        pages.cell("{:+.1f} %", own),
    ]


def _view_aims(every, frames, held):
    own = np.abs([_force_off(table)[1] for table in frames])
    aims = []
    for name, what, unit, aim in (
        ("elevation_deg", "elevation", "°", ELEVATION_AIM),
        ("projection_error_percent", "projection error", " percent points", PROJECTION_AIM),
    ):
        off = (every[name] - every[f"{name}_true"]).abs()
        cells = (f"{part:.2f}{unit}" for part in (aim, off.median(), off.quantile(0.95)))
        aims.append(["views", what, *cells, f"{held[name]:.0f} %"])
    cells = (f"{part:.1f} %" for part in (FORCE_AIM, np.nanmedian(own), np.nanmax(own)))
    return [*aims, ["views", "force in its own plane, per video", *cells, "–"]]
