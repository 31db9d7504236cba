"""A rendered motion as the files that the Janelia Whisker Tracker would write of it."""

import numpy as np
import traced_motion

from pipeline.convert import janelia, janelia_files
from pipeline.convert.janelia_files import Segment
from pipeline.session.session_file import settings_from, write_session

NOISE_PX = 0.1
RAGGED_PX = 6  # the first points of a trace come and go from frame to frame


def write_tracked(folder, motion, seed=0, stem="trial") -> None:
    """Write NAME.whiskers, .measurements and .bar, and session.toml.

    Traces are noisy and do not begin at the same place; some run from tip to follicle; beside each
    is a short hair that is no whisker.
    """
    rng = np.random.default_rng(seed)
    lines = traced_motion.trace_lines(motion, rng, 0.001)
    segments = [segment for row in range(len(lines)) for segment in _pair(lines, row, rng)]
    table = janelia.measured(segments, "left")
    table.label[table.segment >= 10] = -1  # no whisker
    turned = [s._replace(x=s.x[::-1], y=s.y[::-1]) if rng.random() < 0.3 else s for s in segments]
    janelia_files.write_whiskers(folder / f"{stem}.whiskers", turned)
    janelia_files.write_measurements(folder / f"{stem}.measurements", table)
    x, y = motion.scene.to_pixels(motion.pole_x, motion.pole_y)
    janelia_files.write_bar(folder / f"{stem}.bar", np.column_stack([np.arange(len(x)), x, y]))
    write_session(folder / "session.toml", settings_of(motion))


def _pair(lines, row, rng):
    """A whisker's trace in one frame, and a hair beside it."""
    points = lines.row(row)[rng.integers(RAGGED_PX) :]
    points = points + rng.normal(0, NOISE_PX, points.shape).astype(np.float32)
    number, frame = int(lines.whisker[row]), int(lines.frame[row])
    hair = points[:40] + np.array([0, 15], np.float32)
    for k, each in ((number, points), (10 + number, hair)):
        ones = np.ones(len(each), np.float32)
        yield Segment(k, frame, *each.T, ones, ones)


def settings_of(motion):
    """The settings that go with a motion."""
    camera = motion.scene.camera
    recording = {
        "frames_per_second": float(camera.frames_per_second),
        "pixels_per_mm": float(camera.pixels_per_mm),
        "face": "left",
    }
    whiskers = [_dimensions(hair.whisker) for hair in motion.scene.hairs]
    pole = {"diameter_mm": 2e3 * motion.scene.pole.radius}
    return settings_from({"recording": recording, "whisker": whiskers, "pole": pole})


def _dimensions(whisker):
    return {
        "name": whisker.name,
        "length_mm": 1e3 * whisker.length,
        "cone_length_mm": 1e3 * whisker.cone_length,
        "base_radius_um": 1e6 * whisker.base_radius,
        "youngs_modulus_GPa": 1e-9 * whisker.youngs_modulus,
        "hidden_length_mm": 1e3 * traced_motion.HIDDEN,
    }
