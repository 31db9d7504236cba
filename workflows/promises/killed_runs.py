"""Whole runs, with the real analysis, killed or interrupted at random moments."""

import os
import resource
import signal
import time
from pathlib import Path

import numpy as np

from promises import killed_at_steps, real_session, stand_in, whole
from promises.children import in_child
from promises.trial import Effort, Tried

KILLS, INTERRUPTS, DEATHS = 50, 5, 3
PROGRAMS_EVERY = 6  # of the killed runs, one is of the whole program, with worker processes
BEGIN_S = 120  # for a run to begin, on a busy machine
INTERRUPTED = 130


def try_kills(folder, effort: Effort) -> Tried:
    """Kill re-runs of curated results until one completes, and compare the tables."""
    tried, rng = Tried(), np.random.default_rng(effort.seed)
    start, work = real_session.curated(folder)
    expected, duration = _undisturbed(start, work)
    stand_in.copy_of(start, work)
    number = compared = 0
    while tried.cases < effort.cases(KILLS, 2):
        number += 1
        kill = _program_killed if number % PROGRAMS_EVERY == 0 else _copy_killed
        killed, faults = _checked(kill, start, work, rng.uniform(0, duration))
        tried.cases += killed
        tried.broken += faults
        if not killed:
            tried.broken += killed_at_steps.other_tables(work / "results", expected)
            stand_in.copy_of(start, work)
            compared += 1
    while _checked(_copy_killed, start, work, real_session.LONGEST_S)[0]:
        pass
    tried.broken += killed_at_steps.other_tables(work / "results", expected)
    tried.said = (
        f"{real_session.TRIALS} videos of {real_session.FRAMES} frames; the runs came to their "
        f"end {compared + 1} times"
    )
    return tried


def _undisturbed(start, work):
    """Tables of a re-run that nothing disturbs, and how long it takes [s]."""
    stand_in.copy_of(start, work)
    began = time.monotonic()
    process = real_session.begin_here(work)
    process.join()
    if process.exitcode:
        raise RuntimeError(f"the run ended with {process.exitcode}")
    return stand_in.tables(work / "results"), time.monotonic() - began


def _has_begun(work, start) -> bool:
    """The log has grown."""
    return _log_size(work) > _log_size(start)


def _log_size(work) -> int:
    path = work / "results" / "run.log"
    return path.stat().st_size if path.exists() else 0


def _checked(kill, start, work, moment):
    """Go on with a run and kill it so many seconds after it began; (was it killed, faults)."""
    out = work / "results"
    done = killed_at_steps.finished(work / "videos", out)
    earlier = len(real_session.started_videos(out))
    killed = kill(work, moment)
    analysed = real_session.started_videos(out)[earlier:]
    faults = [*whole.faults(out), *killed_at_steps.lost(start / "results", out)]
    return killed, [*faults, *killed_at_steps.computed_again(done, analysed)]


def _copy_killed(work, moment) -> bool:
    """Kill a run in a copy of this process."""
    process = real_session.begin_here(work)
    process.join(moment)
    killed = process.is_alive()
    process.kill()
    process.join()
    return killed


def _program_killed(work, moment) -> bool:
    """Kill the first process of the command with two jobs: the others must notice."""
    size = _log_size(work)
    process = real_session.begin(work, 2)
    real_session.wait_for(lambda: _log_size(work) > size or process.poll() is not None)
    killed = not real_session.ended_within(process, moment)
    workers = real_session.workers_of(process)
    process.kill()
    process.communicate()
    real_session.wait_for(lambda: not any(map(_lives, workers)), BEGIN_S)
    return killed


def _lives(pid) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def try_interrupts(folder, effort: Effort) -> Tried:
    """Press Ctrl-C at random moments; how long it takes is printed for runs of one process."""
    tried, rng = Tried(), np.random.default_rng(effort.seed)
    (start, work), longest = real_session.curated(folder), 0.0
    for number in range(effort.cases(INTERRUPTS)):
        stand_in.copy_of(start, work)
        process = real_session.begin(work, 1 + number % 2)
        real_session.wait_for(lambda: _has_begun(work, start), BEGIN_S)
        time.sleep(rng.uniform(0, 3))
        before = _children_cpu() + _cpu_of(process)
        real_session.end(process, signal.SIGINT)
        said, _ = process.communicate(timeout=real_session.LONGEST_S)
        if number % 2 == 0:
            longest = max(longest, _children_cpu() - before)
        tried.cases += 1
        tried.check(process.returncode in (0, INTERRUPTED), f"ended with {process.returncode}")
        tried.check("Traceback" not in said, f"said {said[-200:]}")
        tried.broken += whole.faults(work / "results")
        tried.broken += killed_at_steps.lost(start / "results", work / "results")
    tried.said = f"with one job, {longest:.1f} s of processor time at most until the end"
    return tried


def _children_cpu() -> float:
    """CPU time of the finished children of this process [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _cpu_of(process) -> float:
    """CPU time of a process that is alive [s]."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def try_dying_workers(folder, effort: Effort) -> Tried:
    """Kill worker processes of real runs; and those of one video again and again."""
    tried, rng = Tried(), np.random.default_rng(effort.seed)
    start, work = real_session.curated(folder)
    for _ in range(effort.cases(DEATHS)):
        stand_in.copy_of(start, work)
        size = _log_size(work)
        process = real_session.begin(work, 2)
        _wait_for_workers(work, size, process)
        time.sleep(rng.uniform(0, 1))
        workers = real_session.workers_of(process)
        if workers:
            os.kill(workers[-1], signal.SIGKILL)
            tried.cases += 1
        said, _ = process.communicate(timeout=real_session.LONGEST_S)
        tried.check(process.returncode == 0, f"one death: {said[-300:]}")
    tried.cases += 1
    stand_in.make_videos(folder / "videos")
    ending = in_child(_deadly, folder / "videos", folder / "results", seconds=BEGIN_S)
    tried.check(not ending.fault, ending.fault)
    if not ending.fault:
        tried.check(
            ending.value == ["done", "failed", "done"],
            f"two deaths: the videos are {ending.value}",
        )
    return tried


def _wait_for_workers(work, size, process):
    """Wait until the log says that videos were begun."""
    real_session.wait_for(lambda: _log_size(work) > size + 400 or process.poll() is not None)


def _deadly(videos, out):
    """Statuses of videos of which one ends every process that analyses it."""
    stand_in.STAND_IN = stand_in.batch.Source(stand_in.find_inputs, dies_of_the_second)
    return [each.status for each in stand_in.run(videos, out, jobs=2).outcomes]


def dies_of_the_second(task, *rest):
    """Analyse a video, or end this process."""
    if task.folder.name == "video1":
        os._exit(9)
    return stand_in.analyse(task, *rest)
