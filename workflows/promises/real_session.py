"""A small rendered session, processed by the real analysis, for the promises that need it."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pipeline.run  # noqa: F401, here once, not anew in every process
from pipeline.app import batch
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS
from promises import stand_in

ROOT = Path(__file__).parents[2]
TRIALS, FRAMES = 2, 50
LONGEST_S = 900  # of a run, on a busy machine


def videos(folder) -> Path:
    """A folder of rendered videos with session.toml, made once."""
    from synthetic.session import render_session

    made = folder.parent / "rendered"
    render_session(made, "single", seed=0, trials=TRIALS, frames=FRAMES)
    return made


def processed(folder) -> tuple[Path, Path]:
    """As `curated`, before the person came."""
    start, work = folder.parent / "processed", folder.parent / "work"
    if not start.exists():
        stand_in.copy_of(videos(folder), work / "videos")
        _run_here(work)
        stand_in.copy_of(work, start)
    return start, work


def curated(folder) -> tuple[Path, Path]:
    """(start, work): folders of `videos`, and `results` that a person corrected.

    A setting has been changed since. Results know where their videos lie: `work` is where they
    were made, and `start` is the copy that `work` can be made anew from.
    """
    start, work = folder.parent / "curated", folder.parent / "work"
    if not start.exists():
        stand_in.copy_of(processed(folder)[0], work)
        for each in stand_in.videos_in(work / "results"):
            _correct(each)
        path = work / "videos" / "session.toml"
        text = path.read_text("utf-8")
        path.write_text(text.replace("curvature_at_mm = 5.5", "curvature_at_mm = 5.6"), "utf-8")
        stand_in.copy_of(work, start)
    return start, work


def _correct(folder) -> None:
    """Let a person delete the first contact."""
    contacts = files.read_csv(folder / "contacts.csv", CONTACT_COLUMNS)
    onset, offset = contacts.loc[0, ["onset_frame", "offset_frame"]]
    head = stand_in.CORRECTIONS.splitlines()[0]
    row = f"C2,free,{onset},{offset},{onset},{offset},2026-01-01"
    (folder / stand_in.CORRECTIONS_FILE).write_text(f"{head}\n{row}\n", "utf-8")


def _run_here(work) -> None:
    """Run in this process, so that its copies have compiled code."""
    (work / "results" / "figures").mkdir(parents=True)  # as if they were drawn
    with stand_in.drawn_quickly():
        summary = batch.run([work / "videos"], work / "results")
    for each in summary.of("failed"):
        raise RuntimeError(f"{each.video}: {each.message}")


def begin(work, jobs=1, *options) -> subprocess.Popen:
    """Begin `whiskerforce run` of `work`/videos into `work`/results, in a group of its own."""
    command = [sys.executable, "-m", "pipeline", "run", "videos", "--out", "results"]
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.Popen(
        [*command, "--jobs", str(jobs), *options],
        cwd=work,
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def begin_here(work, **options) -> multiprocessing.Process:
    """Begin the same run in a copy of this process, which has loaded all; no figures are drawn."""
    process = multiprocessing.get_context("fork").Process(
        target=_run, args=(work,), kwargs=options
    )
    process.start()
    return process


def _run(work, **options) -> None:
    stand_in.draw_quickly()
    batch.run([work / "videos"], work / "results", **options)


def finish(process) -> str:
    """Wait for a run that must succeed; what it said."""
    said, _ = process.communicate(timeout=LONGEST_S)
    if process.returncode:
        raise RuntimeError(f"the run ended with {process.returncode}: {said}")
    return said


def end(process, how=signal.SIGKILL) -> None:
    """Send a signal to a run and all of its processes."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, how)


def ended_within(process, seconds) -> bool:
    """Wait so long for a run; whether it has ended by itself."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    return process.poll() is not None


def workers_of(process) -> list[int]:
    """The processes that a run has started."""
    tasks = Path(f"/proc/{process.pid}/task")
    return [int(pid) for each in tasks.glob("*/children") for pid in each.read_text().split()]


def wait_for(condition, seconds=LONGEST_S) -> None:
    """Wait until a condition holds."""
    until = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > until:
            raise TimeoutError
        time.sleep(0.02)


def started_videos(out) -> list[str]:
    """Names of the videos whose analysis the log says has been started, in order."""
    path = out / "run.log"
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    words = (line.split("  ", 1)[-1] for line in lines)
    names = (word.removesuffix(": started") for word in words if word.endswith(": started"))
    return [name for name in names if name not in ("figures", "report")]
