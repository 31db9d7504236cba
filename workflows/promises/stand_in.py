"""Runs with a quick stand-in for the analysis: they test the handling of files only."""

import contextlib
import hashlib
import os
import shutil
from pathlib import Path

import filelock  # noqa: F401, here once, not anew in every process
import numpy as np
import pandas as pd
import pyarrow.parquet  # noqa: F401

import pipeline.contacts.corrections
import pipeline.reports.figures
import pipeline.reports.report
import pipeline.tables.evidence
from pipeline.analysis import Analysis
from pipeline.app import batch
from pipeline.detection import PoleTrack
from pipeline.session.inputs import find_inputs
from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import whole_files
from pipeline.tables.centrelines import Centrelines

SETTINGS = settings_from(
    {
        "recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"},
        "whisker": [
            {"name": "C2", "length_mm": 18, "cone_length_mm": 18.947, "base_radius_um": 37}
        ],
    }
)
FRAMES, NODES = 40, 20
CORRECTIONS = (
    "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
    "C2,free,2,3,1,5,2026-01-01\n"
)
CORRECTIONS_FILE = "corrections.csv"


def analyse(task, keep, report, corrections) -> Analysis:
    """Tables that depend on the video's content, on settings and corrections alone."""
    content = task.path.read_bytes() + task.settings.model_dump_json().encode()
    rng = np.random.default_rng(list(hashlib.sha256(content).digest()))
    force = rng.uniform(1, 9)
    keep(_lines(rng))
    frames = pd.DataFrame(
        {"frame": range(FRAMES), "whisker": "C2", "tracked": True, "contact_force_uN": force}
    )
    contacts = [
        {"whisker": "C2", "contact": k + 1, "onset_frame": 9 * k, "peak_force_uN": force}
        for k in range(3 + len(corrections))
    ]
    return Analysis(
        frames=frames,
        contacts=pd.DataFrame(contacts),
        evidence=frames[["frame", "whisker"]],
        pole=PoleTrack(np.full(1, 3.0), np.full(1, 4.0), 6.0),
        n_frames=FRAMES,
        messages=(),
        settings=task.settings,
    )


def _lines(rng) -> Centrelines:
    points = rng.normal(100, 10, (2, FRAMES * NODES)).astype(np.float32)
    return Centrelines(
        names=("C2",),
        frame=np.arange(FRAMES, dtype=np.int32),
        whisker=np.zeros(FRAMES, np.int32),
        offsets=np.arange(FRAMES + 1, dtype=np.int64) * NODES,
        x_px=points[0],
        y_px=points[1],
        se_px=np.zeros(FRAMES * NODES, np.float32),
        confidence=np.ones(FRAMES, np.float32),
    )


STAND_IN = batch.Source(find_inputs, analyse)


def run(videos, out, jobs=1, **options) -> batch.Summary:
    """As `batch.run`, with the quick analysis and a short report."""
    draw_quickly()
    return batch.run([videos], out, jobs=jobs, source=STAND_IN, **options)


def draw_quickly() -> None:
    """Draw no figures in this process from now on, and write a short report."""
    pipeline.reports.figures.write_fig3 = lambda results: None
    pipeline.reports.report.write_report = _write_report


@contextlib.contextmanager
def drawn_quickly():
    """Draw no figures in this process meanwhile, and write a short report."""
    figures, report = pipeline.reports.figures, pipeline.reports.report
    usual = figures.write_fig3, report.write_report
    draw_quickly()
    try:
        yield
    finally:
        figures.write_fig3, report.write_report = usual


def _write_report(results):
    whole_files.write_text(Path(results) / "report.html", "<p>all is well</p>\n" * 200)
    return []


def make_videos(folder, count=3) -> Path:
    """A folder of "videos", whose content is not looked at, with a session.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    write_session(folder / "session.toml", SETTINGS)
    for k in range(count):
        (folder / f"video{k}.avi").write_bytes(b"content %d" % k)
    return folder


def change_settings(videos) -> None:
    """Change a setting: all videos have to be processed again."""
    path = videos / "session.toml"
    path.write_text(path.read_text("utf-8").replace("5.5", "5.6"), "utf-8")


def curated(videos, out) -> Path:
    """Results in `out`, corrected by a person; the settings have been changed since."""
    run(videos, out)
    for folder in videos_in(out):
        (folder / CORRECTIONS_FILE).write_text(CORRECTIONS, "utf-8")
    run(videos, out, overwrite=True)
    change_settings(videos)
    return out


def videos_in(out) -> list[Path]:
    """The results folders of the videos."""
    return sorted(path.parent for path in out.glob("*/run.json"))


def copy_of(folder, to) -> Path:
    """A copy of a folder in place of what is there."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(folder, to)
    return to


def tables(out) -> dict:
    """Content of all tables of a results folder; videos.csv without times and folders."""
    if not videos_in(out):
        raise RuntimeError(f"{out} holds no results")
    found = {}
    for path in sorted(out.rglob("*")):
        name = str(path.relative_to(out))
        if path.suffix in (".parquet", ".csv", ".toml") and "/." not in f"/{name}":
            found[name] = path.read_bytes()
    videos = pd.read_csv(out / "videos.csv").drop(columns="frames_per_s")
    videos["path"] = videos["path"].map(os.path.basename)
    return found | {"videos.csv": videos.to_csv().encode()}
