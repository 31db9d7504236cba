"""One video in its results folder: analysed, its tables saved, or why not."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.app.earlier_results import earlier_in_words, failure, kept_outcome
from pipeline.app.outcome import Outcome, save_state
from pipeline.curate.corrected import DECIDED_ON, DOUBTS, decided_on
from pipeline.errors import InputError, in_words, lacks_memory, why, with_advice
from pipeline.runtime.compiling import compiling_reported, seconds_without_compiling
from pipeline.runtime.progress import Step
from pipeline.scene import pole_runs
from pipeline.session.content import same_input, sha256, stamp
from pipeline.session.schema import Settings
from pipeline.tables import centrelines
from pipeline.tables.result_exchange import READY, draft, overlays_in, settle
from pipeline.tables.run_record import STATE_FILE, read_run, read_state
from pipeline.tables.video_messages import as_cell

CHANGED = "the video was changed or removed while it was read: run it again"


def analyse_video(task, keep, report, corrections):
    """Analyse the video of a `Task`; the other arguments are those of `pipeline.run.analyse`."""
    from pipeline.run import analyse

    return analyse(task.path, task.settings, keep, report, corrections, task.threads)


@dataclass(frozen=True)
class Task:
    """One video to process into `folder`; if its tables are `finished`, only to draw it.

    `digest` is that of the settings when the run began, `earlier` the time [ns] at which earlier
    results were written, 0 if there are none.
    """

    path: Path
    folder: Path
    settings: Settings
    digest: str
    overlay: bool = False
    threads: int = 1
    finished: "Outcome | None" = None
    earlier: int = 0
    analyse: Callable = analyse_video


def process_video(task: Task, report=None) -> Outcome:
    """Analyse one video and save its results; a failure is an outcome, not an exception.

    `report` is called with a `Step`, often. The new results are complete then, but not yet in
    their place: see `result_exchange`.
    """
    from pipeline.errors import CorrectionsError, VideoError

    try:
        if task.finished:
            return _with_overlay(task, task.finished, task.folder, report)
        kept = settle(task.folder)
        outcome = warned(_analyse_and_save(task, report), *kept)
        if not task.overlay:
            return outcome
        return _with_overlay(task, outcome, task.folder / READY, report)
    except VideoError as error:
        return _failed(task, error.problem)
    except (OSError, CorrectionsError, InputError) as error:
        return _failed(task, with_advice(error))


def _analyse_and_save(task, report) -> Outcome:
    """Analyse and write all tables; the state file records how they were made."""
    from pipeline.contacts.corrections import read_corrections

    before, content = stamp(task.path), sha256(task.path)
    started = seconds_without_compiling()
    corrections = read_corrections(task.folder)
    known = {"sha256": content, "whiskers": [each.name for each in task.settings.whisker]}
    decided = known | _decided_on(task.folder) if len(corrections) else known
    with draft(task.folder) as new:
        with (
            centrelines.centreline_file(new / "centrelines.parquet") as keep,
            compiling_reported(report) as report_step,
        ):
            analysis = task.analyse(task, keep, report_step, corrections)
        if report:
            report(Step("tables"))
        analysis.write_tables(new, task.folder.name)
        outcome = _outcome_of(task, analysis, content, seconds_without_compiling() - started)
        if not same_input({"input": before, "sha256": content}, task.path):
            before = {}  # of no video: the next run processes it anew
            outcome = warned(outcome, CHANGED)
        for key, doubt in DOUBTS.items():
            outcome = warned(outcome, doubt if decided[key] != known[key] else "")
        known = known | {"settings_sha256": task.digest, "input": before, DECIDED_ON: decided}
        save_state(new, outcome, corrections, known)
    return outcome


def _decided_on(folder) -> dict:
    """What the corrections in a video's folder were made for, as far as records know."""
    state = read_state(folder) or read_run(folder.parent)["inputs"].get(folder.name, {})
    decided = state.get(DECIDED_ON)
    return decided if isinstance(decided, dict) else decided_on(state)


def _outcome_of(task, analysis, content, seconds) -> Outcome:
    return Outcome(
        video=task.folder.name,
        path=str(task.path),
        status="warning" if analysis.messages else "done",
        frames=analysis.n_frames,
        frames_per_s=analysis.n_frames / seconds,
        message=as_cell(analysis.messages),
        contacts=len(analysis.contacts),
        stages={stage: round(s, 3) for stage, s in analysis.seconds.items()},
        sha256=content,
        pole=pole_runs.pole_runs(analysis.pole),
    )


def has_overlay(folder) -> bool:
    """Whether a video's results folder has an overlay that shows its present tables."""
    drawn = [path.stat().st_mtime_ns for path in overlays_in(folder)]
    return bool(drawn) and min(drawn) >= (folder / "frames.parquet").stat().st_mtime_ns


def _with_overlay(task, outcome, folder, report=None) -> Outcome:
    """Draw the overlay of the results in `folder`; a fault there leaves the tables as they are.

    An overlay that a person has changed is kept, and said.
    """
    from pipeline.reports.overlay import write_overlay

    say = report or (lambda step: None)
    try:
        drawn = task.path, folder, task.settings, lambda *done: say(Step("overlay", *done))
        return warned(outcome, *write_overlay(*drawn))
    except Exception as error:
        reason = f"{type(error).__name__}: {in_words(error)}"
        return warned(outcome, f"the overlay could not be drawn ({reason}); all tables are there")


def warned(outcome, *messages) -> Outcome:
    """The outcome with more messages; as it is where these are empty."""
    if not any(messages):
        return outcome
    return replace(outcome, status="warning", message=as_cell((outcome.message, *messages)))


# --- what stands where there are no new results --------------------------------------------


def written(folder) -> int:
    """When the results in a folder were written [ns]; 0 if there are none."""
    state = folder / STATE_FILE
    return state.stat().st_mtime_ns if state.is_file() else 0


def settled_outcome(task, outcome) -> Outcome:
    """The outcome when the new results are in place, with what is said of files that are kept."""
    try:
        kept = settle(task.folder)
    except OSError as error:
        return _failed(
            task,
            f"new results are complete but cannot replace the old ones ({why(error)}): run again",
        )
    return warned(outcome, *kept)


def died(task, reason) -> Outcome:
    """The outcome where the program failed, or the process in which it ran."""
    last = reason.strip().splitlines()[-1]
    if lacks_memory(last):
        last = (
            f"out of memory ({last}); use fewer --jobs, close other programs, or shorten the video"
        )
    elif "Traceback" in reason:
        last = f"unexpected error in the program: {last}; --debug shows where"
    return replace(_new_or(task, last) or _failed(task, last), details=reason)


def interrupted_outcome(task) -> Outcome | None:
    """The outcome of a video that was interrupted; None if it has no results."""
    if task.finished:
        return task.finished
    new = _new_or(task)
    if new:
        return new
    kept = kept_outcome(task.folder)
    message = f"interrupted before new results were made; {_earlier_results(task)}"
    return kept and replace(kept, status="warning", message=message)


def _new_or(task, message="") -> Outcome | None:
    """The outcome of results that were whole before the process ended, else None."""
    kept = []
    with contextlib.suppress(OSError):
        kept = settle(task.folder)
    made = written(task.folder) != task.earlier  # the clock may have been set back
    outcome = task.finished or (kept_outcome(task.folder) if made else None)
    return outcome and warned(outcome, message, *kept)


def _failed(task, message) -> Outcome:
    """The outcome of a failure; its path is named beside the message, not once more in it."""
    said = message.removeprefix(f"{task.path}: ")
    return failure(task.folder, str(task.path), said, _earlier_results(task))


def _earlier_results(task) -> str:
    return earlier_in_words(task.folder, task.path, task.digest)
