"""Tasks in worker processes, one at a time each; if a process dies, only its task is lost."""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
import traceback
from collections import deque
from dataclasses import dataclass, replace
from multiprocessing import resource_tracker
from multiprocessing.connection import wait
from typing import Any

from pipeline.runtime import interrupts
from pipeline.runtime.garbage import search_seldom

REPORT_EVERY = 0.1  # s between progress messages of one worker and stage
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Event:
    """News of one task: kind "start", "progress", "done" or "died".

    `value` is what was reported, the task's result, or why it died (a sentence).
    """

    kind: str
    task: int
    value: Any = None


def run_tasks(function, tasks, on_event, jobs=1) -> None:
    """Run ``function(task, report)`` for every task and call `on_event` with each `Event`.

    `report(value)` makes a "progress" event; it may be called often: only some values are passed
    on, but of a `progress.Step` the first of every stage. With `jobs` = 1 all happens in this
    process; with more, in that many spawned ones, and `function` and the tasks must then be
    importable and picklable. An exception that leaves `function` becomes a "died" event with its
    traceback. A task whose process dies is begun once more when the others have been: it may have
    lacked the memory that they took.

    Ctrl-C (or an exception in `on_event`) ends the workers; what they have finished stays.
    """
    if jobs < 1:
        raise ValueError(f"jobs must be at least 1, got {jobs!r}")
    tasks = list(tasks)
    if jobs == 1 or len(tasks) < 2:
        for number, task in enumerate(tasks):
            on_event(Event("start", number))
            _call(function, task, lambda message, n=number: _here(on_event, message, n))
        return
    workers = [_Worker(function) for _ in range(min(jobs, len(tasks)))]
    try:
        _feed(workers, tasks, on_event)
    finally:
        for worker in workers:
            worker.stop()


def _here(on_event, message, number):
    """Hand on what a task in this process says."""
    on_event(Event(message[0], number, message[1]))
    interrupts.check()


def _call(function, task, send):
    """Call `function` and send its progress and then its result, or why there is none."""
    last, stage = 0.0, None

    def report(value):
        nonlocal last, stage
        here = getattr(value, "stage", None)
        if time.monotonic() - last >= REPORT_EVERY or here != stage:
            last, stage = time.monotonic(), here
            send(("progress", value))

    try:
        outcome = "done", function(task, report)
    except Exception:
        outcome = "died", traceback.format_exc()
    send(outcome)


def _serve(connection, function):
    """Body of a worker process: take tasks until None comes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what Ctrl-C means
    end_with_parent()
    search_seldom()
    with contextlib.suppress(EOFError, OSError):
        while (task := connection.recv()) is not None:
            _call(function, task[0], connection.send)


def end_with_parent() -> None:
    """Let this process end, in the middle of its task, when the one that started it has ended."""
    threading.Thread(target=_wait_for_end_of_parent, daemon=True).start()


def _wait_for_end_of_parent():
    multiprocessing.parent_process().join()
    os._exit(1)


class _Worker:
    """One process, started with its first task, and the task it is at (None: idle)."""

    def __init__(self, function):
        self.function = function
        self.task = self.process = None

    def _start(self):
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other, self.function), daemon=True)
        with _one_thread(), _interrupts_blocked():
            self.process.start()
        other.close()

    def give(self, number, task):
        if self.process is None:
            self._start()
        self.task = number
        self.connection.send((task,))

    def receive(self):
        """The next event, "ended" where the process has died."""
        try:
            kind, value = self.connection.recv()
        except (EOFError, OSError):
            kind, value = "ended", self._ended()
        event = Event(kind, self.task, value)
        if kind != "progress":
            self.task = None
        return event

    def _ended(self) -> str:
        """How the process ended; the next task starts another."""
        self.process.join()
        code = self.process.exitcode
        self.connection.close()
        self.process = None
        how = f"was ended by {signal.Signals(-code).name}" if code and code < 0 else f"({code})"
        return f"the worker process ended unexpectedly {how}; out of memory, or a fault in a codec"

    def stop(self):
        if self.process is None:
            return
        with contextlib.suppress(OSError):
            self.connection.send(None)
        if self.task is not None:
            self.process.terminate()
        self.process.join(timeout=5)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


@contextlib.contextmanager
def _one_thread():
    """Let processes started inside compute with one thread each: they share the cores already."""
    before = dict(os.environ)
    os.environ.update({name: "1" for name in THREADS if name not in before})
    try:
        yield
    finally:
        for name in THREADS:
            if name not in before:
                os.environ.pop(name, None)


@contextlib.contextmanager
def _interrupts_blocked():
    """Let processes started inside never receive Ctrl-C, from their first moment on."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # where it is started, it lets interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _given(workers, waiting):
    """Give the idle workers what is waiting; yield the number of each task."""
    for worker in workers:
        if worker.task is None and waiting:
            number, task = waiting.popleft()
            worker.give(number, task)
            yield number


def _feed(workers, tasks, on_event):
    """Keep every worker busy until all tasks are done."""
    waiting = deque(enumerate(tasks))
    again = set()  # tasks whose process has died once
    while waiting or any(w.task is not None for w in workers):
        for number in _given(workers, waiting):
            if number not in again:
                on_event(Event("start", number))
        busy = {w.connection: w for w in workers if w.task is not None}
        interrupts.check()
        for connection in wait(list(busy), timeout=0.5):
            event = busy[connection].receive()
            if event.kind == "ended" and event.task not in again:
                again.add(event.task)
                waiting.append((event.task, tasks[event.task]))
            else:
                on_event(replace(event, kind="died") if event.kind == "ended" else event)
