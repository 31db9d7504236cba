"""A small results folder made by hand, for the tests of what is drawn from it."""

import numpy as np
import pandas as pd

from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import centrelines, files, whole_files
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS
from whiskermodel.force_profiles import half_gaussian

FRAMES, LENGTH_PX = 120, 400
SETTINGS = settings_from(
    {
        "recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"},
        "whisker": [
            {"name": "C2", "length_mm": 18, "cone_length_mm": 18.947, "base_radius_um": 37}
        ],
    }
)


def contact(video, number, onset, duration, peak, **other):
    """One row of contacts.csv: a half-Gaussian touch [frames = ms, µN]."""
    return {
        "video": video,
        "whisker": "C2",
        "contact": number,
        "onset_frame": onset,
        "offset_frame": onset + duration,
        "onset_s": 1e-3 * onset,
        "duration_ms": duration,
        "peak_force_uN": peak,
        "contact_arc_length_mm": 8.0,
        "pulse_peak_uN": peak,
        "pulse_duration_ms": duration,
        "pulse_centre_s": 1e-3 * (onset + duration / 2),
        "pulse_r2": 0.99,
        **other,
    }


CONTACTS = (
    contact("one", 1, 30, 10, 4.0, vibration_ratio=0.5),
    contact("one", 2, 60, 20, 10.0, vibration_ratio=0.2),
    contact("two", 1, 30, 40, 30.0, flags="large_deflection; not_half_gaussian"),
)


def frame_table(contacts):
    """frames.parquet of one whisker whose force is as its contacts say."""
    time = 1e-3 * np.arange(FRAMES)
    force = np.zeros(FRAMES)
    for c in contacts:
        duration = 1e-3 * c["duration_ms"]
        if np.isfinite(c["peak_force_uN"]):
            force += half_gaussian(time, duration, c["peak_force_uN"], c["onset_s"])
    return pd.DataFrame(
        {
            "frame": range(FRAMES),
            "time_s": time,
            "whisker": "C2",
            "tracked": True,
            "follicle_x_px": 40.0,
            "follicle_y_px": 250.0,
            "base_angle_deg": 0.0,
            "in_contact": force > 0,
            "contact_arc_length_mm": np.where(force > 0, 8.0, np.nan),
            "contact_force_uN": force,
            "axial_force_uN": -0.1 * force,
            "lateral_force_uN": force,
        }
    )


def swinging_whisker():
    """A whisker that swings up and down."""
    x = np.tile(np.arange(75, 75 + LENGTH_PX, dtype=np.float32), FRAMES)
    swing = np.repeat(np.sin(np.arange(FRAMES) / 10), LENGTH_PX).astype(np.float32)
    return Centrelines(
        names=("C2",),
        frame=np.arange(FRAMES, dtype=np.int32),
        whisker=np.zeros(FRAMES, np.int32),
        offsets=np.arange(FRAMES + 1, dtype=np.int64) * LENGTH_PX,
        x_px=x,
        y_px=250 + swing * (x - 75) / 10,
        se_px=np.zeros_like(x),
        confidence=np.ones(FRAMES, np.float32),
    )


def make_results(folder, contacts=CONTACTS, videos=("one", "two"), failed=("three",)):
    """Write a results folder of hand-made tables; its inputs do not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    states = {}
    for name in videos:
        own = [c for c in contacts if c["video"] == name]
        (folder / name).mkdir(exist_ok=True)
        write_session(folder / name / "session.toml", SETTINGS)
        files.write_frames(folder / name / "frames.parquet", frame_table(own))
        centrelines.write_centrelines(folder / name / "centrelines.parquet", swinging_whisker())
        pole = {"radius_px": 6.25, "runs": [[0, 230.0, 240.0]]}
        whole_files.write_json(folder / name / "run.json", {"pole": pole})
        states[name] = {
            "path": f"/nowhere/{name}.avi",
            "status": "done",
            "frames": FRAMES,
            "stages": {"centrelines": 1.2},
        }
    rows = [
        {"video": n, "path": s["path"], "status": "done", "frames": FRAMES, "frames_per_s": 100}
        for n, s in states.items()
    ]
    rows += [
        {"video": n, "path": n, "status": "failed", "frames": 0, "message": "<b> & broken"}
        for n in failed
    ]
    files.write_csv(folder / "videos.csv", pd.DataFrame(rows), VIDEO_COLUMNS)
    files.write_csv(folder / "contacts.csv", pd.DataFrame(contacts), CONTACT_COLUMNS)
    write_session(folder / "session.toml", SETTINGS)
    whole_files.write_json(folder / "run.json", {"version": "9.9", "inputs": states})
    return folder
