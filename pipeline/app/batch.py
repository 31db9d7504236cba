"""Many videos: which need processing, each in a worker process, all results in one folder."""

import contextlib
import hashlib
import os
import platform
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd

from pipeline import __version__
from pipeline.app.outcome import (
    PARQUETS,
    Outcome,
    earlier_results,
    failure,
    finished_outcome,
    kept_outcome,
    save_state,
)
from pipeline.curate.corrected import follow_corrections, write_session_tables
from pipeline.errors import InputError, counted, in_words, why, with_advice
from pipeline.runtime import interrupts
from pipeline.runtime.folder_lock import LOCK_FILE, locked
from pipeline.runtime.progress import Progress, Step, duration
from pipeline.runtime.run_log import LOG_FILE, RunLog
from pipeline.runtime.workers import run_tasks
from pipeline.scene import pole_runs
from pipeline.session.inputs import (
    PREVIEW_NAME,
    SESSION_FILES,
    SETTINGS_NAME,
    STATE_FILE,
    find_inputs,
    is_beside_videos,
    readable,
    results_folders,
    same_input,
    settings_of,
    sha256,
    stamp,
)
from pipeline.session.session_file import Settings, session_text
from pipeline.tables import centrelines, files
from pipeline.tables.columns import VIDEO_COLUMNS
from pipeline.tables.result_exchange import OVERLAYS, READY, draft, settle, settle_all
from pipeline.tables.run_record import read_run, read_state, recorded_path

# What a video goes through, and the time that each takes, beside that of following its whiskers
STAGES = {
    "scene": 0.2, "whiskers": 0.4, "following": 1.0, "forces": 0.2, "contacts": 0.2,
    "tables": 0.05, "overlay": 1.2,
}  # fmt: skip
COUNTED = "following"
OTHER_CONTENT = "corrections.csv was made before the video changed: check its contacts"
AFTER = {"figures": 400, "report": 600}  # with the frames that are processed in such a time


def analyse_video(task, keep, report, corrections):
    """Analyse the video of a `Task`; the other arguments are those of `pipeline.run.analyse`."""
    from pipeline.run import analyse

    return analyse(task.path, task.settings, keep, report, corrections, task.threads)


@dataclass(frozen=True)
class Source:
    """What is processed: `find(paths, out)` gives the `Input`s, `analyse` works as above."""

    find: Callable
    analyse: Callable


VIDEOS = Source(find_inputs, analyse_video)


@dataclass(frozen=True)
class Task:
    """One video to process into `folder`; if its tables are `finished`, only to draw it.

    `earlier` is when its results of before were written [ns], 0 if there are none.
    """

    path: Path
    folder: Path
    settings: Settings
    overlay: bool = False
    threads: int = 1
    finished: "Outcome | None" = None
    earlier: int = 0
    analyse: Callable = analyse_video


@dataclass(frozen=True)
class Summary:
    """What a run did: all outcomes of the results folder, of which `skipped` were there before.

    `lost` are videos that have gone from the folders of this run: their results stay, but are not
    in the session's tables.
    """

    out: Path
    outcomes: tuple[Outcome, ...]
    skipped: int
    seconds: float
    interrupted: bool = False
    lost: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()  # of figures and report

    @property
    def copies(self) -> tuple[tuple[str, ...], ...]:
        """Videos of one and the same content, by their names: their contacts count twice."""
        same = {}
        for each in self.outcomes:
            if each.frames and each.sha256:
                same.setdefault(each.sha256, []).append(each.video)
        return tuple(tuple(names) for names in same.values() if len(names) > 1)

    def of(self, status) -> list[Outcome]:
        """Outcomes of one status."""
        return [each for each in self.outcomes if each.status == status]

    def line(self) -> str:
        """What it did, in one line."""
        frames = counted(sum(each.frames for each in self.outcomes), "frame")
        contacts = counted(sum(each.contacts for each in self.outcomes), "contact")
        return (
            f"{counted(len(self.outcomes), 'video')}: {len(self.of('done'))} done, "
            f"{len(self.of('warning'))} with a warning, {len(self.of('failed'))} failed"
            + (f" ({self.skipped} finished before)" if self.skipped else "")
            + f"; {frames}, {contacts}, in {duration(self.seconds)}"
            + ("; interrupted" if self.interrupted else "")
        )


def run(
    paths, out, config=None, jobs=1, overwrite=False, overlay=False, progress=None, source=VIDEOS
):
    """Process videos and folders of videos into the results folder `out`; return a `Summary`.

    Videos whose results are there, from the same input, settings and version, are not
    processed again unless `overwrite`. Figures and report are made of all, but not where a person
    interrupts. `progress` makes a
    `pipeline.runtime.Progress` of the same arguments. Another `source` than videos are files of
    other programs.

    Raises
    ------
    InputError
        Where an argument or the settings cannot be used; nothing is processed then.
    """
    started = time.monotonic()
    out = Path(out)
    is_ours = (out / LOCK_FILE).exists() or (out / LOG_FILE).exists()
    inputs = source.find(paths, out)
    _check_inputs(inputs)
    settings = settings_of(inputs, config)
    _make_folder(out)
    if not is_ours:
        _check_stranger(out)
    with locked(out):
        _check_folder(out)
        settle_all(out)
        names = results_folders(inputs, out)
        tasks = _tasks(inputs, settings, names, out, overwrite, overlay)
        tasks = [replace(task, analyse=source.analyse) for task in tasks]
        outcomes = _unusable(inputs, names, out)
        due = [t for t in tasks if not t.finished or (overlay and not has_overlay(t.folder))]
        skipped = [t for t in tasks if t not in due]
        log = RunLog(out)
        log.write(_begun(inputs, due))
        with _shown(due, progress) as shown:
            interrupted = _process(due, outcomes, jobs, shown, log)
            outcomes |= _left(due, outcomes)
            behind = follow_corrections(out)
            outcomes |= {t.folder.name: _as_corrected(t, behind) for t in skipped}
            ordered = [outcomes[name] for name in names.values() if name in outcomes]
            others, lost = _without_lost(_earlier(out, set(names.values())), paths)
            seconds = time.monotonic() - started
            every = (*ordered, *others)
            summary = Summary(out, every, len(skipped), seconds, interrupted, tuple(lost))
            own, problems = "", ()
            if not is_beside_videos(out, inputs):
                own, problems = _write_session(out, list(settings.values()), config)
            summary = replace(summary, problems=problems)
            _write_tables(summary, jobs, own)
            if not interrupted:  # who presses Ctrl-C does not want to wait for them
                summary = _with_pictures(summary, due, shown, log)
        log.write(f"ended: {summary.line()}")
    return summary


def _tasks(inputs, settings, names, out, overwrite, overlay) -> list[Task]:
    """A task for each usable input, with its outcome where it needs no other."""
    tasks = []
    for each in inputs:
        if not each.fault:
            path, folder = each.path.resolve(), out / names[each.path]
            task = Task(path, folder, settings[each.path], overlay, earlier=_written(folder))
            finished = None if overwrite else finished_outcome(path, folder, task.settings)
            tasks.append(replace(task, finished=finished))
    return tasks


def _as_corrected(task, behind) -> Outcome:
    """The outcome of results that were there, which now follow from a person's corrections."""
    count = read_state(task.folder).get("contacts", task.finished.contacts)
    outcome = replace(task.finished, contacts=count)
    reason = behind.get(task.folder.name)
    return _warned(outcome, reason) if reason else outcome


def _unusable(inputs, names, out) -> dict:
    """Outcomes of the inputs that cannot be opened, by the name of their folder."""
    faulty = [(names[each.path], each) for each in inputs if each.fault]
    return {name: failure(out / name, readable(each.path), each.fault) for name, each in faulty}


def _left(tasks, outcomes) -> dict:
    """Outcomes of the tasks that have none yet, where there are results at all."""
    left = [task for task in tasks if task.folder.name not in outcomes]
    return {task.folder.name: outcome for task in left if (outcome := _interrupted(task))}


def _check_inputs(inputs):
    """There is a video, or at least a file, to be processed: not only folders without any."""
    if all(each.fault and each.path.is_dir() for each in inputs):
        raise InputError("\n".join(f"{readable(each.path)}: {each.fault}" for each in inputs))


def _make_folder(out):
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot write there ({why(error)}); choose another folder"
        ) from None


def _check_stranger(out):
    """A folder in which no run has been holds no files of a person that would be replaced."""
    written = set(SESSION_FILES) - {SETTINGS_NAME, PREVIEW_NAME}
    there = sorted(name for name in written if (out / name).is_file())
    there += [f"figures/{path.name}" for path in sorted(out.glob("figures/fig3*"))]
    if there:
        raise InputError(
            f"--out {out}: holds {there[0]}, which no run of whiskerforce has written there and "
            "this one would replace; move it away, or choose another folder"
        )


def _check_folder(out):
    """Check that the session's tables can be written."""
    for name in SESSION_FILES:
        if (out / name).is_dir():
            raise InputError(f"--out {out}: {name} in it is a folder; move it away")
    tried = out / f"{files.PART}try{files.PART_END}"
    try:
        with files.whole_file(tried) as temporary:
            temporary.write_text("")
        tried.unlink()
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot write there ({why(error)}); choose another folder"
        ) from None


def _shown(tasks, progress):
    """A `Progress` of the tasks, whose stages are those that they go through."""
    stages = {name: each for name, each in STAGES.items() if name != "overlay"}
    if any(task.overlay for task in tasks):
        stages = STAGES
    names = [task.folder.name for task in tasks]
    return (progress or Progress)(names, stages, COUNTED, AFTER)


def _begun(inputs, due) -> str:
    """The first lines of a run in its log."""
    command = " ".join(["whiskerforce", *(readable(argument) for argument in sys.argv[1:])])
    return (
        f"{command}\nwhiskerforce {__version__}, Python {platform.python_version()}, "
        f"{platform.platform()}\n{len(inputs)} inputs, {len(due)} to be processed"
    )


def _process(tasks, outcomes, jobs, shown, log) -> bool:
    """Run the tasks and put their outcomes in; True if the user interrupted."""
    if jobs == 1 or len(tasks) == 1:
        tasks = [replace(task, threads=0) for task in tasks]
    names = [task.folder.name for task in tasks]

    def take(event):
        if event.kind == "died":
            event = replace(event, kind="done", value=_died(tasks[event.task], event.value))
        if event.kind == "done":
            event = replace(event, value=_settled(tasks[event.task], event.value))
            outcomes[names[event.task]] = event.value
        log.record(event, names)
        shown.receive(event)

    try:
        run_tasks(process_video, tasks, take, jobs)
    except KeyboardInterrupt:
        log.write("interrupted")
        return True
    return False


def _with_pictures(summary, due, shown, log) -> Summary:
    """The summary, when figures and report show what the tables hold: if they do not already."""
    if not due and is_drawn(summary.out):
        return summary
    problems = tuple(_write_pictures(summary, shown, log))
    if not problems:
        _mark_drawn(summary.out)
    return replace(summary, problems=(*summary.problems, *problems))


def is_drawn(out) -> bool:
    """Figures and report are there, and show what the tables hold."""
    there = all((out / name).exists() for name in ("figures", "report.html"))
    return there and read_run(out).get("pictures_of") == _digest(out)


def _mark_drawn(out):
    record = files.read_json(out / STATE_FILE, {})
    files.write_json(out / STATE_FILE, record | {"pictures_of": _digest(out)})


def _digest(out) -> str:
    """Hash of the tables that figures and report are made of, and of where they lie."""
    whole = hashlib.sha256(str(out.resolve()).encode())
    for path in (out / name for name in ("contacts.csv", "videos.csv", SETTINGS_NAME)):
        whole.update(path.read_bytes() if path.is_file() else b"")
    return whole.hexdigest()


def _write_pictures(summary, shown, log):
    """Figures and report from the tables; a fault there leaves the tables as they are."""
    from pipeline.reports import figures, report

    if not any(each.frames for each in summary.outcomes):
        return
    for what, write in (("figures", figures.write_fig3), ("report", report.write_report)):
        interrupts.check()
        shown.doing(what)
        log.write(f"{what}: started")
        try:
            write(summary.out)
        except Exception as error:
            log.write(traceback.format_exc())
            if isinstance(error, OSError):
                yield f"the {what} could not be made: {with_advice(error)}"
            else:
                yield f"the {what} could not be made ({type(error).__name__}: {in_words(error)})"


# --- one video ---------------------------------------------------------------------------


def process_video(task: Task, report=None) -> Outcome:
    """Analyse one video and save its results; a failure is an outcome, not an exception.

    `report` is called with a `Step`, often. The new results are ready then, not
    in their place: see `result_exchange`.
    """
    from pipeline.errors import CorrectionsError, VideoError

    try:
        if task.finished:
            return _with_overlay(task, task.finished, task.folder, report)
        settle(task.folder)
        outcome = _analyse_and_save(task, report)
        if not task.overlay:
            return outcome
        return _with_overlay(task, outcome, task.folder / READY, report)
    except VideoError as error:
        return _failed(task, error.problem)
    except OSError as error:
        return _failed(task, with_advice(error))
    except (CorrectionsError, InputError) as error:
        return _failed(task, str(error))


def _analyse_and_save(task, report) -> Outcome:
    """Analyse and write all tables; the state file records how they were made."""
    from pipeline.contacts.corrections import left_out, read_corrections

    started = time.perf_counter()
    before = stamp(task.path)
    corrections, earlier = read_corrections(task.folder), read_state(task.folder)
    with draft(task.folder) as new:
        with centrelines.centreline_file(new / "centrelines.parquet") as keep:
            analysis = task.analyse(task, keep, report, corrections)
        if report:
            report(Step("tables"))
        analysis.save(new, task.folder.name)
        outcome = _outcome_of(task, analysis, time.perf_counter() - started)
        whiskers = tuple(dict.fromkeys(analysis.frames["whisker"]))
        for problem in left_out(corrections, whiskers, analysis.n_frames):
            outcome = _warned(outcome, problem)
        if len(corrections) and earlier and not same_input(earlier, task.path):
            outcome = _warned(outcome, OTHER_CONTENT)
        save_state(new, outcome, task.settings, before, corrections)
    return outcome


def _outcome_of(task, analysis, seconds) -> Outcome:
    return Outcome(
        video=task.folder.name,
        path=str(task.path),
        status="warning" if analysis.messages else "done",
        frames=analysis.n_frames,
        frames_per_s=analysis.n_frames / seconds,
        message="; ".join(analysis.messages),
        contacts=len(analysis.contacts),
        stages={stage: round(s, 3) for stage, s in analysis.seconds.items()},
        sha256=sha256(task.path),
        pole=pole_runs.pole_runs(analysis.pole),
    )


def has_overlay(folder) -> bool:
    """The results folder of a video holds an overlay of its tables, not of those of before."""
    drawn = [path.stat().st_mtime_ns for path in folder.glob(OVERLAYS)]
    return bool(drawn) and min(drawn) >= (folder / "frames.parquet").stat().st_mtime_ns


def _with_overlay(task, outcome, folder, report=None) -> Outcome:
    """Draw the overlay of the results in `folder`; a fault there leaves the tables as they are."""
    from pipeline.reports.overlay import write_overlay

    say = report or (lambda step: None)
    try:
        write_overlay(task.path, folder, task.settings, lambda *done: say(Step("overlay", *done)))
    except Exception as error:
        reason = f"{type(error).__name__}: {in_words(error)}"
        return _warned(outcome, f"the overlay could not be drawn ({reason}); all tables are there")
    return outcome


def _warned(outcome, message) -> Outcome:
    """The outcome with one more message."""
    message = "; ".join(filter(None, (outcome.message, message)))
    return replace(outcome, status="warning", message=message)


# --- what stands where there are no new results --------------------------------------------


def _written(folder) -> int:
    """When the results in a folder were written [ns]; 0 if there are none."""
    state = folder / STATE_FILE
    return state.stat().st_mtime_ns if state.is_file() else 0


def _settled(task, outcome) -> Outcome:
    """The outcome when the new results are in place."""
    try:
        settle(task.folder)
    except OSError as error:
        return _failed(
            task,
            f"new results are complete but cannot replace the old ones ({why(error)}): run again",
        )
    return outcome


def _died(task, reason) -> Outcome:
    """A fault of the program, or of the process it ran in."""
    last = reason.strip().splitlines()[-1]
    if "MemoryError" in last or "Insufficient memory" in last:
        last = (
            f"out of memory ({last}); use fewer --jobs, close other programs, or shorten the video"
        )
    elif "Traceback" in reason:
        last = f"unexpected error in the program: {last}; --debug shows where"
    return replace(_new_or(task, last) or _failed(task, last), details=reason)


def _interrupted(task) -> Outcome | None:
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
    with contextlib.suppress(OSError):
        settle(task.folder)
    made = _written(task.folder) > task.earlier
    outcome = task.finished or (kept_outcome(task.folder) if made else None)
    return _warned(outcome, message) if outcome and message else outcome


def _failed(task, message, details="") -> Outcome:
    outcome = failure(task.folder, str(task.path), message, _earlier_results(task))
    return replace(outcome, details=details)


def _earlier_results(task) -> str:
    return earlier_results(task.folder, task.path, task.settings)


def _earlier(out, names) -> list[Outcome]:
    """Outcomes of results in `out` of videos that are not among this run's inputs."""
    folders = [path.parent for path in sorted(out.glob(f"*/{STATE_FILE}"))]
    others = [folder for folder in folders if folder.name not in names and _is_video(folder)]
    return [kept_outcome(folder) or _damaged(folder) for folder in others]


def _is_video(folder) -> bool:
    """A video's results, not another program's, nor a whole results folder within this one."""
    return (
        any((folder / name).exists() for name in PARQUETS) and not (folder / "videos.csv").exists()
    )


def _damaged(folder) -> Outcome:
    return Outcome(
        folder.name,
        recorded_path(folder),
        "failed",
        message=f"its results are damaged: run the video again ({folder} holds what is left)",
    )


def _without_lost(outcomes, paths):
    """Outcomes to keep in the tables, and the names of videos that a searched folder has lost.

    The results of those stay where they are, for they may be all that is left of the video.
    """
    searched = [path.resolve() for path in map(Path, paths) if path.is_dir()]
    lost = [
        each.video
        for each in outcomes
        if not os.path.exists(each.path)
        and any(folder in Path(each.path).parents for folder in searched)
    ]
    return [each for each in outcomes if each.video not in lost], lost


# --- the whole folder --------------------------------------------------------------------


def _write_session(out, settings, config) -> tuple[str, tuple[str, ...]]:
    """Write the settings in force, unless the user's own file already lies there.

    One that a person has written or changed is kept under another name. Returns the hash of what
    was written, "" if nothing was, and what a person should know.
    """
    target = out / SETTINGS_NAME
    distinct = list(dict.fromkeys(settings))
    if not distinct or (config is not None and target.exists() and target.samefile(config)):
        return "", ()
    text = session_text(distinct[0])
    if len(distinct) > 1:
        note = "# Videos differ in their settings: these are the first one's; each video's\n"
        text = f"{note}# results folder holds its own.\n{text}"
    before = target.read_bytes() if target.exists() else b""
    ours = before in (b"", text.encode()) or sha256(target) == read_run(out).get("session_sha256")
    old = None if ours else files.set_aside(target)
    files.write_text(target, text)
    reason = "this run used the settings beside the videos (or --config)"
    problem = f"{target} was not written by a run: {reason}; it is kept as {old}"
    return sha256(target), (problem,) if old else ()


def _write_tables(summary, jobs, session):
    """Write the tables and run.json of the whole results folder."""
    rows = [asdict(each) for each in summary.outcomes]
    videos = pd.DataFrame(rows, columns=[c.name for c in VIDEO_COLUMNS])
    files.write_csv(summary.out / "videos.csv", videos, VIDEO_COLUMNS)
    write_session_tables(summary.out, [each.video for each in summary.outcomes if each.frames])
    files.write_json(summary.out / STATE_FILE, _run_record(summary, jobs, session))


def _run_record(summary, jobs, session) -> dict:
    """How the results were made: run.json."""
    kept = ("path", "sha256", "status", "frames", "stages")
    return {
        "program": "whiskerforce",
        "version": __version__,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": [readable(argument) for argument in sys.argv[1:]],
        "python": platform.python_version(),
        "platform": platform.platform(),
        "jobs": jobs,
        "seconds": round(summary.seconds, 3),
        "interrupted": summary.interrupted,
        "pictures_of": read_run(summary.out).get("pictures_of", ""),
        "session_sha256": session,
        "inputs": {
            each.video: {key: getattr(each, key) for key in kept} for each in summary.outcomes
        },
    }
