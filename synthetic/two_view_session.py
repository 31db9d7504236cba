"""A rendered session in two views on disk: two videos a trial, or one with both in a frame.

DIR/first/…, DIR/second/…  (or DIR/… )   videos, a session.toml per view
DIR/points.csv                           points seen in both views
DIR/truth/<video stem>/views.csv         elevation, paths and force in every contact frame
"""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.session.session_file import settings_from, write_session
from pipeline.tables.own_files import new_files
from pipeline.tables.whole_files import write_text
from synthetic.encode import write_video
from synthetic.scene import Codec
from synthetic.staging import Setting
from synthetic.truth import centreline_table, hidden_length, visibility_table
from synthetic.two_views import renderers, whisker_in_space

POINTS, POINT_SE_PX = 12, 0.3
BOX_M = ((4e-3, 20e-3), (-12e-3, -2e-3), (-4e-3, 4e-3))  # that the points lie in
CURVATURE_AT_MM = 5.5
PRESETS = {
    "two_views": "two views of a C2 whisker in two videos, with elevation and droop",
    "mirror": "the same with both views in one frame",
}


def render_two_views(out_dir, preset="two_views", seed=0, trials=2, frames=400) -> list[Path]:
    """Render the trials of a session; returns the paths of the videos of the first view.

    The cameras stand still for the whole session; elevation and droop differ between trials.
    """
    out_dir, stacked = Path(out_dir), preset == "mirror"
    out_dir.mkdir(parents=True, exist_ok=True)
    second, paths = None, []
    for trial in range(trials):
        rng = np.random.default_rng([seed, trial, 11])
        space = whisker_in_space(Setting(preset, seed, trial, rng, frames), second)
        second = space.second
        views = renderers(space, 1000 * seed + trial)
        stem = f"{preset}_{trial:03d}.avi"
        if trial == 0:
            _write_sessions(out_dir, space, views, stacked)
            with new_files(out_dir) as new:
                write_text(new / "points.csv", _points_text(space, rng, stacked))
        paths.append(_write_videos(out_dir, stem, views, stacked))
        truth = out_dir / "truth" / paths[-1].stem
        truth.mkdir(parents=True, exist_ok=True)
        write_text(truth / "views.csv", true_rows(space).to_csv(index=False, lineterminator="\n"))
    return paths


def _write_videos(out_dir, stem, views, stacked):
    """Both views of a trial, in a video each or one above the other."""
    codec, frames = Codec(), range(len(views[0]))
    if stacked:
        both = (np.vstack([view.frame(i) for view in views]) for i in frames)
        write_video(out_dir / stem, both, codec)
        return out_dir / stem
    for name, view in zip(("first", "second"), views, strict=True):
        (out_dir / name).mkdir(exist_ok=True)
        write_video(out_dir / name / stem, (view.frame(i) for i in frames), codec)
    return out_dir / "first" / stem


def _write_sessions(out_dir, space, views, stacked):
    whisker = space.whisker
    height, width = (getattr(views[0].scene.camera, name) for name in ("height", "width"))
    below = height + views[1].scene.camera.height
    regions = ([0, 0, width, height], [0, height, width, below])
    for name, view, region in zip(("first", "second"), views, regions, strict=True):
        visibility = visibility_table(view.motion, view, centreline_table(view.motion))
        settings = {
            "recording": {
                "frames_per_second": float(view.scene.camera.frames_per_second),
                "pixels_per_mm": round(float(view.scene.camera.pixels_per_mm), 1),
                "face": view.scene.face.side,
            },
            "whisker": [
                {
                    "name": whisker.name,
                    "length_mm": 1e3 * whisker.length,
                    "cone_length_mm": round(1e3 * whisker.cone_length, 6),
                    "base_radius_um": 1e6 * whisker.base_radius,
                    "hidden_length_mm": round(1e3 * hidden_length(visibility, whisker.name), 3),
                }
            ],
            "pole": {"diameter_mm": 2e3 * space.motion.scene.pole.radius},
            "analysis": {"curvature_at_mm": CURVATURE_AT_MM},
        }
        if stacked:
            settings["image"] = {"region_px": region}
        path = out_dir / f"{name}.toml" if stacked else out_dir / name / "session.toml"
        with new_files(path.parent) as new:
            write_session(new / path.name, settings_from(settings, "rendered session"))


def matched_points(space, rng, below=0) -> np.ndarray:
    """Points in space as a person would click them in both pictures, (n, 4) [px].

    `below` is how far the second picture lies below the first, where both are in one.
    """
    x, y, z = (rng.uniform(*side, POINTS) for side in BOX_M)
    first, second = space.motion.scene.to_pixels(x, y), space.second.project(x, y, z)
    columns = np.column_stack([*first, second[0], second[1] + below])
    return columns + rng.normal(scale=POINT_SE_PX, size=columns.shape)


def _points_text(space, rng, stacked) -> str:
    """The text of points.csv."""
    below = space.motion.scene.camera.height if stacked else 0
    points = matched_points(space, rng, below)
    rows = [",".join(f"{value:.2f}" for value in row) for row in points]
    return "\n".join(["first_x_px,first_y_px,second_x_px,second_y_px", *rows, ""])


def true_rows(space) -> pd.DataFrame:
    """Elevation, azimuth, path to the contact and force in every frame with contact."""
    x, y, z, flat, path = space.contact_places()
    dx, dy = x - space.tilt.x, y - space.tilt.y
    table = pd.DataFrame(
        {
            "frame": np.arange(len(space)),
            "elevation_deg": np.rad2deg(np.arctan2(z, np.hypot(dx, dy))),
            "azimuth_deg": np.rad2deg(np.arctan2(dy, dx)),
            "apparent_path_mm": 1e3 * flat,
            "true_path_mm": 1e3 * path,
            "projection_error_percent": 100 * (1 - flat / path),
            "contact_force_uN": 1e6 * space.contact.contact_force,
        }
    )
    return table[space.contact.touching]
