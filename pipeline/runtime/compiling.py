"""Time that Numba spends compiling: once, after installation or an update, and then no more.

It is kept apart, so that the first video's speed is that of the analysis.
"""

import time
from contextlib import contextmanager
from functools import cache

from pipeline.runtime.progress import COMPILING, Step
from pipeline.runtime.stopwatch import Stopwatch


class CompileTimes:
    """Time spent compiling in this process; `tell` is called with whether it begins or ends.

    A function is compiled within another that calls it: only the outermost counts.
    """

    def __init__(self):
        self.watch = Stopwatch()
        self.tell = None
        self._depth = 0

    def begin(self) -> None:
        """A function begins to be compiled."""
        self._depth += 1
        self._update()

    def end(self) -> None:
        """The function that began last is compiled."""
        self._depth -= 1
        self._update()

    def _update(self):
        is_compiling = self._depth > 0
        if is_compiling != self.watch.is_running:
            self.watch.run(is_compiling)
            if self.tell is not None:
                self.tell(is_compiling)


@cache
def compile_times() -> CompileTimes:
    """The times of this process; what is compiled from the first call on is in them."""
    from numba.core import event  # takes half a second: only where something is compiled

    times = CompileTimes()

    class Listener(event.Listener):
        """Told by Numba of what it compiles, not of what it reads from the disk."""

        def on_start(self, event):
            times.begin()

        def on_end(self, event):
            times.end()

    event.register("numba:compile", Listener())
    return times


def seconds_without_compiling() -> float:
    """As `time.perf_counter`, but it stands still while Numba compiles."""
    return time.perf_counter() - compile_times().watch.seconds


@contextmanager
def compiling_reported(report):
    """Give a `report` to call with each `Step`; while Numba compiles, that is reported, too.

    After it, the step before is reported once more. `report` may be None: nobody listens.
    """
    report, last = report or (lambda step: None), Step("")

    def report_step(step):
        nonlocal last
        last = step
        report(step)

    times = compile_times()
    times.tell = lambda is_compiling: report(Step(COMPILING) if is_compiling else last)
    try:
        yield report_step
    finally:
        times.tell = None
