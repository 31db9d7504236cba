"""Tasks in worker processes: their events, their deaths, what they are started with."""

import os

import pytest

from pipeline.workers import run_tasks

THREADS = "OPENBLAS_NUM_THREADS"


def _threads(task, report):
    return os.environ.get(THREADS)


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_processes_compute_with_one_thread_unless_told(monkeypatch, given, expected):
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


def test_jobs_must_be_positive():
    with pytest.raises(ValueError, match="jobs must be at least 1, got 0"):
        run_tasks(_square, [1], print, 0)
