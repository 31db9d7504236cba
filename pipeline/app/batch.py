"""Many videos: which need processing, each in a worker process, all results in one folder."""

import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline import __version__
from pipeline.app.earlier_results import (
    digests_of,
    failure,
    finished_outcome,
    made_otherwise,
    of_other_videos,
    without_lost,
)
from pipeline.app.outcome import Outcome
from pipeline.app.session_files import (
    check_folder,
    with_pictures,
    write_session_file,
    write_tables,
)
from pipeline.app.video_task import (
    Task,
    analyse_video,
    died,
    has_overlay,
    interrupted_outcome,
    process_video,
    settled_outcome,
    warned,
    written,
)
from pipeline.curate.corrected import follow_corrections
from pipeline.errors import InputError, counted
from pipeline.runtime.folder_lock import locked
from pipeline.runtime.progress import Progress, duration
from pipeline.runtime.run_log import RunLog
from pipeline.runtime.workers import run_tasks
from pipeline.session.input_settings import guesses_left, has_session_of, settings_of
from pipeline.session.inputs import find_inputs, readable
from pipeline.session.results_folders import make_results_folder, results_folders
from pipeline.session.session_file import settings_digest
from pipeline.tables.result_exchange import settle_all
from pipeline.tables.run_record import read_state

# What a video goes through, and the time that each takes, beside that of following its whiskers
STAGES = {
    "scene": 0.2, "whiskers": 0.4, "following": 1.0, "forces": 0.2, "contacts": 0.2,
    "tables": 0.05, "overlay": 1.2,
}  # fmt: skip
COUNTED = "following"
AFTER = {"figures": 1.0, "report": 1.0}  # seconds


@dataclass(frozen=True)
class Source:
    """What is processed: `find(paths, out)` gives the `Input`s, `analyse` as `analyse_video`.

    `check` raises an InputError where the inputs' settings cannot be used.
    """

    find: Callable
    analyse: Callable
    check: Callable = lambda settings: None


VIDEOS = Source(find_inputs, analyse_video)


@dataclass(frozen=True)
class Summary:
    """What a run did: all outcomes of the results folder, of which `skipped` were there before.

    `lost` are videos that have gone from the folders of this run: their results stay, but are not
    in the session's tables. `problems` are sentences on the session's own files: settings, tables,
    figures, report; `undrawn` where figures or report could not be made. `said` are videos whose
    messages were shown as they ended.
    """

    out: Path
    outcomes: tuple[Outcome, ...]
    skipped: int
    seconds: float
    interrupted: bool = False
    lost: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    undrawn: bool = False
    said: frozenset[str] = frozenset()

    @property
    def copies(self) -> tuple[tuple[str, ...], ...]:
        """Names of videos that have the same content, whose contacts count several times."""
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

    Videos that have results of the same input, settings and version are not processed again unless
    `overwrite`. Figures and report show all videos; they are not made where a person interrupts.
    `progress` makes a `pipeline.runtime.Progress` of the same arguments. `source` says what is
    processed: videos, or files of another program.

    Raises
    ------
    InputError
        Where an argument or the settings cannot be used; nothing is processed then.
    """
    started = time.monotonic()
    out = Path(out)
    inputs, settings, guesses = _checked(source, paths, out, config)
    with locked(out):
        check_folder(out)
        is_persons = has_session_of(inputs, out, config)
        kept = settle_all(out)
        names = results_folders(inputs, out)
        tasks = _tasks(inputs, settings, names, out, overwrite, overlay)
        due, skipped = _due_and_skipped(tasks)
        due = [replace(task, analyse=source.analyse) for task in due]
        log = RunLog(out)
        log.write(_begun(inputs, due))
        with _shown(due, progress) as shown:
            new, interrupted = _process(due, jobs, shown, log)
            outcomes = _unusable(inputs, names, out) | new | _left(due, new)
            corrected, renewed = _as_corrected(skipped, out)
            outcomes |= corrected
            ordered = [outcomes[name] for name in names.values() if name in outcomes]
            others, lost = without_lost(of_other_videos(out, set(names.values())), paths)
            seconds = time.monotonic() - started
            digests = {task.digest for task in tasks}
            old = made_otherwise(others, out, digests)
            digests |= digests_of(others, out)
            own, replaced = ("", ()) if is_persons else write_session_file(out, settings, digests)
            summary = Summary(
                out, (*ordered, *others), len(skipped), seconds, interrupted, lost,
                problems=(*replaced, *guesses, *kept, *renewed, *old),
                said=frozenset(new if progress else ()),
            )  # fmt: skip
            edited = write_tables(summary, jobs, own)
            summary = replace(summary, problems=(*summary.problems, *edited))
            if not interrupted:  # who presses Ctrl-C does not want to wait for them
                summary = with_pictures(summary, due, shown, log)
        log.write(f"ended: {summary.line()}")
    return summary


def _checked(source, paths, out, config):
    """Inputs, their settings by path, guesses in these; InputError where `run` cannot begin."""
    inputs = source.find(paths, out)
    _check_inputs(inputs)
    settings, guesses = settings_of(inputs, config), guesses_left(inputs, config)
    source.check(settings.values())
    make_results_folder(out)
    return inputs, settings, guesses


def _tasks(inputs, settings, names, out, overwrite, overlay) -> list[Task]:
    """A task for each usable input, with its outcome where its results still hold."""
    tasks = []
    for each in inputs:
        if not each.fault:
            path, folder = each.path.resolve(), out / names[each.path]
            own = settings[each.path], settings_digest(settings[each.path])
            task = Task(path, folder, *own, overlay, earlier=written(folder))
            finished = None if overwrite else finished_outcome(path, folder, task.digest)
            tasks.append(replace(task, finished=finished))
    return tasks


def _due_and_skipped(tasks) -> tuple[list[Task], list[Task]]:
    """The tasks that have something to do, to analyse a video or to draw it, and the others."""
    due, skipped = [], []
    for task in tasks:
        is_done = task.finished and (not task.overlay or has_overlay(task.folder))
        (skipped if is_done else due).append(task)
    return due, skipped


def _as_corrected(skipped, out) -> tuple[dict, list[str]]:
    """Outcomes of results that were there, as they follow from a person's corrections now.

    By the name of their folder; and a sentence on each edited file that is kept.
    """
    behind, renewed = follow_corrections(out)
    outcomes = {}
    for task in skipped:
        name = task.folder.name
        count = read_state(task.folder).get("contacts", task.finished.contacts)
        outcomes[name] = warned(replace(task.finished, contacts=count), behind.get(name, ""))
    return outcomes, renewed


def _unusable(inputs, names, out) -> dict:
    """Outcomes of the inputs that cannot be opened, by the name of their folder."""
    faulty = [(names[each.path], each) for each in inputs if each.fault]
    return {
        name: failure(out / name, readable(each.path.resolve()), each.fault)
        for name, each in faulty
    }


def _left(tasks, outcomes) -> dict:
    """Outcomes of the tasks that have none yet, if they have results at all."""
    left = [task for task in tasks if task.folder.name not in outcomes]
    return {task.folder.name: outcome for task in left if (outcome := interrupted_outcome(task))}


def _check_inputs(inputs):
    """There is a video, or at least a file, to be processed: not only folders without any."""
    if all(each.fault and each.path.is_dir() for each in inputs):
        raise InputError("\n".join(f"{readable(each.path)}: {each.fault}" for each in inputs))


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
        f"{platform.platform()}\n{counted(len(inputs), 'input')}, {len(due)} to be processed"
    )


def _process(tasks, jobs, shown, log) -> tuple[dict, bool]:
    """Run the tasks: outcomes by the name of their folder, and whether the user interrupted."""
    if jobs == 1 or len(tasks) == 1:
        tasks = [replace(task, threads=0) for task in tasks]
    names, outcomes = [task.folder.name for task in tasks], {}

    def take(event):
        if event.kind == "died":
            event = replace(event, kind="done", value=died(tasks[event.task], event.value))
        if event.kind == "done":
            event = replace(event, value=settled_outcome(tasks[event.task], event.value))
            outcomes[names[event.task]] = event.value
        log.record(event, names)
        shown.receive(event)

    try:
        run_tasks(process_video, tasks, take, jobs)
    except KeyboardInterrupt:
        log.write("interrupted")
        return outcomes, True
    return outcomes, False
