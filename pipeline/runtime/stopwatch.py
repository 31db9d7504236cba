"""A stopwatch: the sum of the periods in which it ran."""

import time


class Stopwatch:
    """Seconds for which it has run, in `seconds`; it stands still at first.

    clock : returns seconds
    """

    def __init__(self, clock=time.perf_counter):
        self._clock = clock
        self._before_s, self._started = 0.0, None

    @property
    def is_running(self) -> bool:
        """Whether it runs."""
        return self._started is not None

    @property
    def seconds(self) -> float:
        """Time for which it has run [s], up to now."""
        running = 0.0 if self._started is None else self._clock() - self._started
        return self._before_s + running

    def run(self, is_running: bool) -> None:
        """Start or stop it; nothing changes where it runs, or stands still, already."""
        self._before_s = self.seconds
        self._started = self._clock() if is_running else None
