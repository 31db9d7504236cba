"""Tasks in worker processes: their events, their deaths, what they are started with."""

import os
import signal
import subprocess
import sys
import time

import endless_tasks
import pytest

from pipeline.runtime import interrupts
from pipeline.runtime.workers import run_tasks

THREADS = "OPENBLAS_NUM_THREADS"


def _threads(task, report):
    return os.environ.get(THREADS)


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_processes_compute_with_one_thread_unless_set(monkeypatch, given, expected):
    monkeypatch.delenv(THREADS, raising=False)
    if given:
        monkeypatch.setenv(THREADS, given)
    events = []
    run_tasks(_threads, [1, 2], events.append, 2)
    assert [e.value for e in events if e.kind == "done"] == [expected] * 2
    assert os.environ.get(THREADS) == given


def _square(task, report):
    report(task)
    if task == 2:
        raise ValueError("two")
    if task == 3:
        os._exit(7)
    return task**2


@pytest.mark.parametrize(("jobs", "tasks"), [(1, [0, 1, 2]), (2, [0, 1, 2, 3, 4])])
def test_tasks_in_processes(jobs, tasks):
    events = []
    run_tasks(_square, tasks, events.append, jobs)
    done = sorted(e.value for e in events if e.kind == "done")
    assert done == [t**2 for t in tasks if t not in (2, 3)]
    died = {tasks[e.task]: e.value for e in events if e.kind == "died"}
    assert "ValueError: two" in died[2]
    if 3 in tasks:
        assert "ended unexpectedly (7)" in died[3]
    for number in range(len(tasks)):
        kinds = [e.kind for e in events if e.task == number]
        assert kinds[0] == "start"
        assert kinds[-1] in ("done", "died")


def _dies_at_first(task, report):
    first = not task.exists()
    task.touch()
    if first:
        os._exit(7)
    return task.name


def test_a_task_whose_process_dies_is_begun_once_more(tmp_path):
    events = []
    run_tasks(_dies_at_first, [tmp_path / "a", tmp_path / "b"], events.append, 2)
    assert sorted(e.value for e in events if e.kind == "done") == ["a", "b"]
    assert sorted(e.kind for e in events) == ["done", "done", "start", "start"]


def test_jobs_must_be_positive():
    with pytest.raises(ValueError, match="jobs must be at least 1, got 0"):
        run_tasks(_square, [1], print, 0)


def _runs(pid) -> bool:
    """A process is there and no zombie."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True)
    return bool(state.stdout.strip()) and not state.stdout.startswith("Z")


def _becomes(condition, seconds=60) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@pytest.mark.skipif(sys.platform == "win32", reason="has no SIGKILL and no ps")
@pytest.mark.parametrize("of", ["tasks", "pool"])
def test_workers_end_with_a_program_that_is_killed(tmp_path, of):
    program = subprocess.Popen(
        [sys.executable, endless_tasks.__file__, str(tmp_path), of],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.DEVNULL,
    )
    try:
        assert _becomes(lambda: len(list(tmp_path.iterdir())) == 2)
        workers = [int(path.name) for path in tmp_path.iterdir()]
        assert all(map(_runs, workers))
    finally:
        program.kill()
        program.wait()
    try:
        assert _becomes(lambda: not any(map(_runs, workers)), 20)
    finally:
        for pid in filter(_runs, workers):
            os.kill(pid, signal.SIGKILL)


class _PressesWhenDeleted:
    """Ctrl-C at a moment at which Python ignores exceptions."""

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)


def _presses(task, report):
    _PressesWhenDeleted()
    report(task)
    return task


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_python_ignores_still_ends_the_run():
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    events = []
    interrupts.listen()
    try:
        with pytest.raises(KeyboardInterrupt):
            run_tasks(_presses, [1, 2], events.append)
    finally:
        interrupts.listen()
        for number, handler in before.items():
            signal.signal(number, handler)
    assert [event.task for event in events if event.kind == "start"] == [0]


def test_an_interrupt_of_before_does_not_end_the_next_run():
    events = []
    run_tasks(_square, [1], events.append)
    assert events[-1].value == 1


DEAF = """
import signal
from pipeline.runtime.workers import run_tasks

def is_deaf(task, report):
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())

if __name__ == "__main__":
    run_tasks(is_deaf, [1, 2], lambda event: print(event.value) if event.kind == "done" else 0, 2)
    print(is_deaf(None, None))
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="Windows")
def test_workers_hear_no_interrupt_even_while_they_start(tmp_path):
    """In a program of its own, whose first workers they are."""
    (tmp_path / "deaf.py").write_text(DEAF)
    said = subprocess.run(
        [sys.executable, tmp_path / "deaf.py"], capture_output=True, text=True, timeout=60,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}, check=True,
    ).stdout  # fmt: skip
    assert said.split() == ["True", "True", "False"]
