"""Progress of a run: a bar on a terminal, plain lines elsewhere."""

import threading
import time
from collections import Counter
from typing import NamedTuple

from pipeline.errors import counted
from pipeline.runtime.stopwatch import Stopwatch

LEAST_DONE = 0.02  # of all work, before the time left is shown
TYPICAL_FRAMES = 500  # of a video, before any is opened
REDRAWN_PER_S = 4  # bar
COMPILING = "compiling"  # what a task does in the middle of a stage, the first time


class Step(NamedTuple):
    """Progress within a task: the stage that it is in, and how much of that is done."""

    stage: str
    done: int = 0
    expected: int = 0


class Progress:
    """Work done over several tasks at once, with stages, speed and time left.

    `receive` is called with each event of `pipeline.runtime.workers`, whose progress messages are
    `Step`; `doing` with what follows all tasks. What is shown is up to the subclasses.

    Parameters
    ----------
    names : of the tasks
    stages : what a task goes through, in order, with the time that each takes beside the others
    counted : the stage in which a task's frames are counted
    after : what follows all tasks, with the seconds that it takes
    clock : returns seconds
    """

    def __init__(self, names, stages, counted, after=None, clock=time.monotonic):
        self.names = list(names)
        self.clock = clock
        self.started = clock()
        self.finished = 0
        self._stages, self._counted, self._after = dict(stages), counted, dict(after or {})
        self._steps = {}  # of each task under way
        self._compiling = set()  # tasks
        self._idle = Stopwatch(clock)  # runs while all that is under way is compiling
        self._frames = {}  # of each task begun: (done, expected)
        self._ended, self._closing, self._tasks_s = set(), None, None
        self._lock = threading.RLock()  # a timer looks, too
        self._at = 0.0, 0.0  # time spent at the last event, and the share done by then

    def receive(self, event):
        """Update the state by one event, and show it."""
        with self._lock:
            if event.kind == "start":
                self._frames[event.task] = 0, 0
            elif event.kind == "progress":
                self._take(event.task, event.value)
            else:
                self._end(event.task)
            self._idle.run(bool(self._compiling) and self._compiling >= self._steps.keys())
            self._at = self._spent_s, self.share
        self.show(event)

    def doing(self, what: str) -> None:
        """All tasks have ended; `what` (one of `after`) begins."""
        with self._lock:
            if self._closing is None:
                self._tasks_s = self._spent_s
            self._closing = what
            self._at = self._spent_s, self.share
        self.show(None)

    def _take(self, task, step):
        if step.stage == COMPILING:
            self._compiling.add(task)
            return
        self._compiling.discard(task)
        self._steps[task] = step
        if step.stage == self._counted:
            self._frames[task] = step.done, max(step.expected, step.done)

    def _end(self, task):
        self.finished += 1
        self._steps.pop(task, None)
        self._compiling.discard(task)
        self._ended.add(task)
        total = max(self._frames.get(task, (0, 0)))
        self._frames[task] = total, total

    def show(self, event):
        """Show the state after `event`; None: after `doing`."""

    # ---- numbers --------------------------------------------------------------------------

    @property
    def _spent_s(self) -> float:
        """Seconds since the start, without those in which all that was under way was compiling."""
        return self.clock() - self.started - self._idle.seconds

    @property
    def frames_done(self) -> int:
        """Frames processed so far."""
        return sum(done for done, _ in self._frames.values())

    @property
    def share(self) -> float:
        """Part of all work that is done, 0 to 1."""
        spent = self._spent_s if self._closing is None else self._tasks_s
        behind = 0.0  # seconds of what follows the tasks
        if self._closing is not None:
            before = list(self._after)[: list(self._after).index(self._closing)]
            behind = sum(self._after[what] for what in before)
        tasks = self._share_of_tasks
        whole = spent / tasks + sum(self._after.values()) if tasks else 0.0
        return (spent + behind) / whole if whole else tasks

    @property
    def _share_of_tasks(self) -> float:
        known = [total for _, total in self._frames.values() if total]
        usual = sum(known) / len(known) if known else TYPICAL_FRAMES
        whole = done = 0.0
        for task in range(len(self.names)):
            frames = self._frames.get(task, (0, 0))[1] or usual
            whole += frames
            done += frames * self._share_of(task)
        return done / whole if whole else 1.0

    def _share_of(self, task) -> float:
        if task in self._ended:
            return 1.0
        step = self._steps.get(task)
        if step is None or step.stage not in self._stages:
            return 0.0
        names = list(self._stages)
        behind = sum(self._stages[name] for name in names[: names.index(step.stage)])
        part = min(step.done / step.expected, 1.0) if step.expected else 0.0
        return (behind + part * self._stages[step.stage]) / sum(self._stages.values())

    @property
    def frames_per_s(self) -> float:
        """Speed since the start, compiling left out."""
        return self.frames_done / max(self._spent_s, 1e-9)

    @property
    def seconds_left(self) -> float | None:
        """Expected time to the end, None while it cannot be estimated.

        That is while too little is done, and while code is compiled, which may take any time.

        It counts down between events, and stays above 0 while there is work left.
        """
        then, share = self._at
        if share <= LEAST_DONE or self._compiling:
            return None
        left = then * (1 - share) / share - (self._spent_s - then)
        return max(left, 0.0 if share >= 1 else 1.0)

    @property
    def stage(self) -> str:
        """What is being done, "overlay" or "following ×2, overlay"."""
        if self._closing is not None:
            return self._closing
        count = Counter(
            COMPILING if task in self._compiling else step.stage
            for task, step in self._steps.items()
        )
        return ", ".join(name if n == 1 else f"{name} ×{n}" for name, n in count.items())

    def line(self) -> str:
        """The state in one line."""
        with self._lock:
            frames = f"{counted(self.frames_done, 'frame')}, {self.frames_per_s:.0f} frames/s"
            left = self.seconds_left
            parts = (
                f"{self.finished}/{counted(len(self.names), 'video')}",
                frames if self._counted and self.frames_done else "",
                self.stage,
                "" if left is None else f"{duration(left)} left",
            )
            return ", ".join(part for part in parts if part)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        return None


class Lines(Progress):
    """A line per finished task, and one on the whole every `every` seconds."""

    def __init__(self, *what, write, every=10.0, clock=time.monotonic):
        super().__init__(*what, clock=clock)
        self.write = write
        self.every = every
        self.said = set()
        self.last = self.started
        self._over = threading.Event()
        self._timer = threading.Thread(target=self._run, daemon=True)

    def show(self, event):
        """Write what is new."""
        if event is not None and event.kind == "done":
            for line in outcome_lines(self.names[event.task], event.value, self.said):
                self.write(line)
        self.tick()

    def tick(self) -> None:
        """Write how far all is, if it is time."""
        with self._lock:
            if self.clock() - self.last >= self.every:
                self.last = self.clock()
                self.write(self.line())

    def _run(self):
        while not self._over.wait(self.every / 10):
            self.tick()

    def __enter__(self):
        self._timer.start()
        return self

    def __exit__(self, *exception):
        self._over.set()
        self._timer.join()


class Bar(Progress):
    """A rich progress bar, drawn anew by a timer."""

    def __init__(self, *what, console, clock=time.monotonic):
        super().__init__(*what, clock=clock)
        self.said = set()
        from rich import progress
        from rich.text import Text

        class State(progress.ProgressColumn):
            """The state in words, made when it is drawn."""

            def render(column, task):
                return Text(self.line())

        self.bar = progress.Progress(
            progress.SpinnerColumn(),
            progress.BarColumn(bar_width=20),
            State(),
            console=console,
            transient=True,
            refresh_per_second=REDRAWN_PER_S,
        )
        self.task = self.bar.add_task("", total=1.0)

    def show(self, event):
        """Move the bar; say what has ended."""
        self.bar.update(self.task, completed=self.share)
        if event is not None and event.kind == "done":
            for line in outcome_lines(self.names[event.task], event.value, self.said):
                self.bar.console.print(line, markup=False, highlight=False)

    def __enter__(self):
        self.bar.start()
        return self

    def __exit__(self, *exception):
        self.bar.stop()


def outcome_lines(name, value, said: set) -> list[str]:
    """What became of a task, in lines without what was `said` before; that is added to it."""
    first, *more = value.lines(said) if hasattr(value, "lines") else [str(value)]
    return [f"{name}: {first}", *more]


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
