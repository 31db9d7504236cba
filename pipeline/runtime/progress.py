"""Progress of a run: a bar on a terminal, plain lines elsewhere."""

import time

LEAST_DONE = 0.02  # of all frames, before the time left is shown: compiling takes a while


class Progress:
    """Frames done over several videos at once, with speed and time left.

    `receive` is called with each event of `pipeline.runtime.workers`; what is shown is up to the
    subclasses. `clock` returns seconds.
    """

    def __init__(self, names, clock=time.monotonic):
        self.names = list(names)
        self.clock = clock
        self.started = clock()
        self.frames = {}  # of each video begun: (done, total)
        self.finished = 0

    def receive(self, event):
        """Update the state by one event, and show it."""
        if event.kind == "start":
            self.frames[event.task] = (0, 0)
        elif event.kind == "progress":
            self.frames[event.task] = event.value
        else:
            self.finished += 1
            total = max(self.frames.get(event.task, (0, 0)))
            self.frames[event.task] = (total, total)
        self.show(event)

    def show(self, event):
        """Show the state after `event`."""

    @property
    def frames_done(self) -> int:
        """Frames processed so far."""
        return sum(done for done, _ in self.frames.values())

    @property
    def frames_expected(self) -> float:
        """Frames of all videos, those not yet opened taken to be like the others."""
        totals = [total for _, total in self.frames.values() if total]
        if not totals:
            return 0.0
        return sum(totals) + (len(self.names) - len(self.frames)) * sum(totals) / len(totals)

    @property
    def frames_per_s(self) -> float:
        """Speed since the start."""
        return self.frames_done / max(self.clock() - self.started, 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """Expected time to the end, None while too little is done to estimate it."""
        if self.frames_done <= LEAST_DONE * self.frames_expected:
            return None
        return max(self.frames_expected - self.frames_done, 0) / self.frames_per_s

    def line(self) -> str:
        """The state in one line."""
        left = "" if self.seconds_left is None else f", {duration(self.seconds_left)} left"
        return (
            f"{self.finished}/{len(self.names)} videos, {self.frames_done} frames, "
            f"{self.frames_per_s:.0f} frames/s{left}"
        )

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        return None


class Lines(Progress):
    """A line per finished video, and one for the whole run every `every` seconds."""

    def __init__(self, names, write, every=10.0, clock=time.monotonic):
        super().__init__(names, clock)
        self.write = write
        self.every = every
        self.last = self.started

    def show(self, event):
        """Write what is new."""
        if event.kind == "done":
            self.write(f"{self.names[event.task]}: {event.value.line()}")
        if self.clock() - self.last >= self.every:
            self.last = self.clock()
            self.write(self.line())


class Bar(Progress):
    """A rich progress bar."""

    def __init__(self, names, console, clock=time.monotonic):
        super().__init__(names, clock)
        from rich import progress

        self.bar = progress.Progress(
            progress.TextColumn("{task.description}"),
            progress.BarColumn(),
            progress.TextColumn("{task.fields[state]}"),
            console=console,
            transient=True,
        )
        self.task = self.bar.add_task("processing", total=None, state="")

    def show(self, event):
        """Redraw."""
        self.bar.update(
            self.task,
            total=self.frames_expected or None,
            completed=self.frames_done,
            state=self.line(),
        )
        if event.kind == "done":
            self.bar.console.print(
                f"{self.names[event.task]}: {event.value.line()}", markup=False, highlight=False
            )

    def __enter__(self):
        self.bar.start()
        return self

    def __exit__(self, *exception):
        self.bar.stop()


def duration(seconds: float) -> str:
    """Seconds in words: "45 s", "3 min 5 s", "2 h 10 min".

    >>> duration(185)
    '3 min 5 s'
    """
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60} min"
