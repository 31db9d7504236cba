"""Functions tried in processes of their own: they may crash, hang, or take all memory."""

import contextlib
import os
import pickle
import resource
import select
import signal
import struct
import sys
import time
import traceback
from dataclasses import dataclass
from typing import Any

LENGTH = struct.Struct("<Q")
CRASHED, TOO_LONG = "crashed", "took too long"


@dataclass(frozen=True)
class Ending:
    """How a function ended in its process.

    Attributes
    ----------
    value : what it returned
    fault : '' where it returned, else the traceback, `CRASHED` with the signal, or `TOO_LONG`
    peak : greatest resident memory of the process [bytes]
    inherited : what it was forked with of that [bytes]
    """

    value: Any = None
    fault: str = ""
    peak: int = 0
    inherited: int = 0

    @property
    def added(self) -> int:
        """Memory that the function itself took, at most [bytes]."""
        return self.peak - self.inherited


def in_child(function, *arguments, seconds=60) -> Ending:
    """Call a function in a forked process; end it after so many seconds."""
    (ending,) = each_in_child(lambda _: function(*arguments), [None], seconds)
    return ending


def each_in_child(function, cases, seconds=20, setup=None):
    """Yield an `Ending` of ``function(case)`` for every case.

    One process takes case after case; after a crash or a hang another goes on with the next.
    """
    cases, done = list(cases), 0
    while done < len(cases):
        for ending in _some(function, cases[done:], seconds, setup):
            done += 1
            yield ending


def _some(function, cases, seconds, setup):
    """Yield endings until all cases are done or the process has ended."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.close(reader)
        _serve(writer, function, cases, setup)
    os.close(writer)
    given = ended = 0
    try:
        while given < len(cases):
            answer = _received(reader, seconds)
            if isinstance(answer, str):
                os.kill(child, signal.SIGKILL)
                ended = _how(child, answer)
                yield ended
                return
            given += 1
            yield answer
    finally:
        os.close(reader)
        if not ended:
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL) if given < len(cases) else None
            os.waitpid(child, 0)


def _how(child, answer) -> Ending:
    """How a process ended that gave no answer."""
    _, status, usage = os.wait4(child, 0)
    if answer == CRASHED:
        code = os.waitstatus_to_exitcode(status)
        answer = f"{CRASHED} ({signal.Signals(-code).name if code < 0 else code})"
    return Ending(fault=answer, peak=usage.ru_maxrss * 1024)


def _received(reader, seconds):
    """The next `Ending` from a process, or why there is none."""
    until, data, length = time.monotonic() + seconds, b"", LENGTH.size
    while len(data) < length:
        left = until - time.monotonic()
        if left <= 0 or not select.select([reader], [], [], left)[0]:
            return TOO_LONG
        more = os.read(reader, length - len(data))
        if not more:
            return CRASHED
        data += more
        if len(data) == length == LENGTH.size:
            length += LENGTH.unpack(data)[0]
    return pickle.loads(data[LENGTH.size :])


def _serve(writer, function, cases, setup):
    """Body of the process: no way leads out of it but its end."""
    try:
        os.setsid()
        _silence()
        inherited = _most_memory()
        if setup is not None:
            setup()
        for case in cases:
            data = pickle.dumps(_called(function, case, inherited))
            os.write(writer, LENGTH.pack(len(data)))
            while data:
                data = data[os.write(writer, data) :]
    finally:
        os._exit(0)


def _called(function, case, inherited) -> Ending:
    try:
        value, fault = function(case), ""
    except BaseException:
        value, fault = None, traceback.format_exc()
    return Ending(value, fault, _most_memory(), inherited)


def _most_memory() -> int:
    """Greatest resident memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _silence():
    """Let nothing that is said reach the terminal."""
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
    for stream in (1, 2):
        os.dup2(sys.stdout.fileno(), stream)


def last_line(fault: str) -> str:
    """What a fault says in the end."""
    return fault.strip().splitlines()[-1] if fault.strip() else ""
