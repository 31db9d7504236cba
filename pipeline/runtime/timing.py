"""Time spent by stage, and frames counted, while they are handed on."""

from collections import defaultdict
from contextlib import contextmanager

from pipeline.runtime.compiling import seconds_without_compiling


class Counted:
    """Frames handed on one by one and counted; `progress(done, expected)` is called."""

    def __init__(self, frames, expected: int | None, progress=None):
        self.frames = frames
        self.expected = expected
        self.progress = progress
        self.count = 0

    def __iter__(self):
        for frame in self.frames:
            yield frame
            self.count += 1
            if self.progress is not None:
                self.progress(self.count, max(self.expected or 0, self.count))


class Clock:
    """Time spent by stage [s], in `seconds`, without that for compiling."""

    def __init__(self, clock=seconds_without_compiling):
        self._clock = clock
        self.seconds = defaultdict(float)

    @contextmanager
    def __call__(self, stage):
        """Count the time of a with block to `stage`."""
        started = self._clock()
        try:
            yield
        finally:
            self.seconds[stage] += self._clock() - started

    def each(self, stage, items):
        """Hand on `items`, counting the time it takes to make them to `stage`."""
        items, none = iter(items), object()
        while True:
            started = self._clock()
            item = next(items, none)
            self.seconds[stage] += self._clock() - started
            if item is none:
                return
            yield item
