"""A promise, how it is tried, and the outcome."""

import resource
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class Effort:
    """How hard to try: `share` of the cases (1 is all of them), drawn from `seed`."""

    share: float = 1.0
    seed: int = 0

    def cases(self, all_of_them: int, at_least: int = 1) -> int:
        """Return how many cases to try."""
        return max(round(self.share * all_of_them), at_least)


@dataclass
class Tried:
    """The outcome of trying a promise.

    Attributes
    ----------
    cases : how many were tried
    broken : violations of the promise that were found, a sentence each
    said : what was measured
    """

    cases: int = 0
    broken: list[str] = field(default_factory=list)
    said: str = ""

    def check(self, holds, otherwise: str) -> None:
        """Note what is wrong where something does not hold."""
        if not holds:
            self.broken.append(otherwise)


@dataclass(frozen=True)
class Promise:
    """A sentence that the program keeps, and the function that tries to break it.

    `try_it(folder, effort)` works in an empty folder and returns a `Tried`. `in_ci` is the share
    of the cases that the tests try.
    """

    name: str
    group: str
    sentence: str
    try_it: Callable
    in_ci: float = 0.0

    @property
    def place(self) -> str:
        """The file that tries it."""
        function = getattr(self.try_it, "func", self.try_it)
        return f"workflows/{function.__module__.replace('.', '/')}.py"


@dataclass(frozen=True)
class Result:
    """A promise, its outcome, and how long the trial took [s]."""

    promise: Promise
    tried: Tried
    seconds: float
    cpu: float


def attempt(promise: Promise, folder, effort: Effort) -> Result:
    """Try a promise in an empty folder."""
    started, before = time.monotonic(), _cpu()
    try:
        tried = promise.try_it(folder, effort)
    except Exception as error:
        traceback.print_exc()
        tried = Tried(broken=[f"the trial ended with {type(error).__name__}: {error}"])
    return Result(promise, tried, time.monotonic() - started, _cpu() - before)


def for_ci(promise: Promise) -> Effort:
    """The effort that the tests make."""
    return replace(Effort(), share=promise.in_ci)


def _cpu() -> float:
    """CPU time of this process and of its finished children [s]."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)
