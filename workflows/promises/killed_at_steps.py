"""Runs killed before every single change of a file, and in the middle of every write."""

import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd

from pipeline.runtime.folder_lock import LOCK_FILE
from pipeline.session.session_file import read_session, settings_digest
from pipeline.tables.own_files import RECORD
from pipeline.tables.result_exchange import READY
from pipeline.tables.run_record import STATE_FILE, read_state
from promises import stand_in, whole
from promises.children import in_child, last_line
from promises.trial import Effort, Tried

CHANGES = (
    "open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod",
    "shutil.rmtree", "shutil.move", "tempfile.mkstemp", "tempfile.mkdtemp",
)  # fmt: skip
KINDS = ("a first run", "a second run over curated results")


def try_steps(folder, effort: Effort) -> Tried:
    """Kill runs at their steps on the disk, check what is there, and let them go on."""
    tried = Tried()
    points = {}
    for kind in KINDS:
        start = _prepared(folder / "work", kind)
        expected, steps = _undisturbed(start, folder / "work")
        points[kind] = steps
        wanted = effort.cases(steps, 3)
        for k in range(wanted):
            step = 1 + round(k * (steps - 1) / max(wanted - 1, 1))
            tried.cases += 1
            for fault in _killed(start, folder / "work", step, expected):
                tried.check(False, f"{kind}, killed at step {step}: {fault}")
    tried.said = "; ".join(f"{kind} has {steps} steps" for kind, steps in points.items())
    return tried


def _prepared(work, kind) -> Path:
    """A copy of `work` with `videos`, and with `results` that are due again where there were some.

    Results know where their videos lie: they are made where they are used.
    """
    shutil.rmtree(work, ignore_errors=True)
    stand_in.make_videos(work / "videos", count=2)
    if kind == KINDS[1]:
        in_child(stand_in.curated, work / "videos", work / "results")
    return stand_in.copy_of(work, work.with_name(f"start {KINDS.index(kind)}"))


def _undisturbed(start, work):
    """Tables of a run that nothing disturbs, and the number of its steps."""
    stand_in.copy_of(start, work)
    counted = in_child(_run, work, None)
    if counted.fault:
        raise RuntimeError(counted.fault)
    return stand_in.tables(work / "results"), counted.value[0]


def _run(work, step):
    """Run; return the number of steps, and the names of the videos that were analysed."""
    analysed = []

    def analyse(task, *rest):
        analysed.append(task.folder.name)
        return stand_in.analyse(task, *rest)

    count = count_steps(work / "results", kill_at(step) if step else None)
    stand_in.STAND_IN = stand_in.batch.Source(stand_in.find_inputs, analyse)
    stand_in.run(work / "videos", work / "results")
    return count(), analysed


def count_steps(out, at_step: Callable | None = None) -> Callable:
    """Count what this process does with files in `out`; call ``at_step(number, arguments)``."""
    number, inside = 0, str(out)

    def hook(event, arguments):
        nonlocal number
        if event in CHANGES and any(inside in _text(each) for each in arguments[:2]):
            number += 1
            if at_step:
                at_step(number, arguments)

    sys.addaudithook(hook)
    return lambda: number


def _text(argument) -> str:
    return os.fsdecode(argument) if isinstance(argument, (str, bytes, os.PathLike)) else ""


def kill_at(step):
    """End the process at that step; a file that is not yet on the disk is written by half."""

    def at_step(number, arguments):
        if number == step:
            place = Path(_text(arguments[0]))
            if ".part" in place.name and place.is_file():
                os.truncate(place, place.stat().st_size // 2)
            os.kill(os.getpid(), signal.SIGKILL)

    return at_step


def _killed(start, work, step, expected):
    """Yield what is wrong after a run that was killed at a step, and after the next one."""
    stand_in.copy_of(start, work)
    out = work / "results"
    in_child(_run, work, step)
    yield from whole.faults(out) if out.exists() else ()
    if (start / "results").exists():
        yield from lost(start / "results", out)
    done = finished(work / "videos", out)
    again = in_child(_run, work, None)
    if again.fault:
        yield f"the next run: {last_line(again.fault)}"
        return
    yield from computed_again(done, again.value[1])
    yield from other_tables(out, expected)
    kept = LOCK_FILE, RECORD
    hidden = [str(p.relative_to(out)) for p in out.rglob(".*") if p.name not in kept]
    if hidden:
        yield f"left behind: {hidden[0]}"


def lost(before, out):
    """Yield what was in a results folder of curated videos and is not there now."""
    for folder in stand_in.videos_in(before):
        now = out / folder.name
        name = stand_in.CORRECTIONS_FILE
        if (now / name).read_bytes() != (folder / name).read_bytes():
            yield f"{folder.name}: the corrections have changed"
        for path in folder.iterdir():
            if not (now / path.name).exists():
                yield f"{folder.name}: {path.name} is lost"
    listed = set(pd.read_csv(out / "contacts.csv")["video"])
    for folder in stand_in.videos_in(before):
        if folder.name not in listed and all(map(_has_contacts, (folder, out / folder.name))):
            yield f"contacts.csv has lost the contacts of {folder.name}"


def _has_contacts(folder) -> bool:
    return len(pd.read_csv(folder / "contacts.csv")) > 0


def finished(videos, out) -> list[str]:
    """Names of the videos whose results are whole and of the present settings."""
    digest = settings_digest(read_session(videos / "session.toml"))
    folders = {path.parent for path in out.glob(f"*/{STATE_FILE}")}
    folders |= {path.parent.parent for path in out.glob(f"*/{READY}/{STATE_FILE}")}
    states = {f.name: (read_state(f / READY), read_state(f)) for f in folders}
    return [
        name
        for name, pair in states.items()
        if any(state.get("settings_sha256") == digest for state in pair)
    ]


def computed_again(done, analysed):
    """Yield the finished videos that were analysed again."""
    for name in set(done) & set(analysed):
        yield f"{name} was finished, and computed again"


def other_tables(out, expected):
    """Yield the tables that differ from those of an undisturbed run; figures follow from them."""
    found = stand_in.tables(out)
    names = (name for name in {*found, *expected} if not name.startswith("figures/"))
    for name in sorted(names):
        if found.get(name) != expected.get(name):
            yield f"{name} differs from that of an undisturbed run"
