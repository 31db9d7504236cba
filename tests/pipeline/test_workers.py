"""What worker processes are started with."""

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
