"""Full disks, missing rights, folders that vanish, two runs at once, and no file handles left."""

import contextlib
import ctypes
import functools
import os
import resource
import shutil
import signal
import subprocess
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from promises import killed_at_steps, stand_in, whole
from promises.children import in_child, last_line
from promises.trial import Effort, Tried

CAPABILITIES_VERSION = 0x20080522  # of Linux
LIMITS = 30  # sizes of files, and numbers of free handles, that are tried
LARGEST = 24_000  # bytes of a file: more than any that is written here
HANDLES, MOST_HANDLES = 12, 256
MOST_LEFT = 120_000  # bytes on the small disk
RACES, REMOVALS = 10, 45
LONGEST_S = 300  # of a run, on a busy machine
ONE_FAULT = "1 problem\n"  # each fault in the settings has a line
REPORTED = (InputError, OSError)  # what the command turns into one line


def try_full_disk(folder, effort: Effort) -> Tried:
    """Let the disk take only so many bytes: of each file, and (where it can be made) of all."""
    tried, disk = Tried(), folder / "disk"
    with _small_disk(disk) as small:
        hindrance = Hindrance(disk / "work", tried)
        for size in np.linspace(0, LARGEST, effort.cases(LIMITS, 3)).astype(int):
            limit = functools.partial(_limit, resource.RLIMIT_FSIZE, int(size))
            hindrance.attempt(f"files of at most {size} bytes", limit)
        left = np.linspace(0, MOST_LEFT, effort.cases(LIMITS, 3)).astype(int) if small else ()
        for free in left:
            fill = functools.partial(_fill, disk, free)
            hindrance.attempt(f"{free} bytes left", fill, (disk / "filling").unlink)
    kinds = "limits of files' sizes" + (" and a small disk" if small else "")
    tried.said = f"{kinds}; {hindrance.reported} runs met the limit and said so"
    return tried


def _start(work) -> Path:
    """Make `videos` in `work`, and curated `results` that are due again; a copy of `work`."""
    stand_in.make_videos(work / "videos", count=2)
    in_child(stand_in.curated, work / "videos", work / "results", seconds=LONGEST_S)
    return stand_in.copy_of(work, work.parent.with_name("start"))


class Hindrance:
    """A run under a hindrance, and the next run, which has to mend all.

    `reported` counts the runs that said that something was in their way.
    """

    def __init__(self, work, tried):
        self.work, self.start, self.tried, self.reported = work, _start(work), tried, 0
        _must_succeed(work)
        self.expected = stand_in.tables(work / "results")
        stand_in.copy_of(self.start, work)

    def attempt(self, what, setup, clear=lambda: None) -> None:
        """Run from the start after `setup`; `clear` takes the hindrance away."""
        ending = in_child(_hindered, self.work, setup, seconds=LONGEST_S)
        clear()
        self.tried.cases += 1
        fault, reported = (ending.fault, False) if ending.fault else ending.value
        self.reported += reported
        for each in (fault, *self._damage(self.work)):
            self.tried.check(not each, f"{what}: {last_line(each)}")
        stand_in.copy_of(self.start, self.work)

    def _damage(self, work):
        out = work / "results"
        yield from whole.faults(out)
        yield from killed_at_steps.lost(self.start / "results", out)
        _must_succeed(work)
        yield from killed_at_steps.other_tables(out, self.expected)


def _must_succeed(work) -> None:
    ending = in_child(_hindered, work, lambda: None, seconds=LONGEST_S)
    if ending.fault or ending.value != ("", False):
        raise RuntimeError(f"nothing is in its way, but {ending}")


def _hindered(work, setup):
    """Run under a hindrance; (what is wrong with what is said, whether it is reported)."""
    setup()
    try:
        summary = stand_in.run(work / "videos", work / "results")
    except REPORTED as error:
        return f"many lines: {error}" if "\n" in str(error).replace(ONE_FAULT, "") else "", True
    failed = [each.message for each in summary.outcomes if each.status != "done"]
    said = [*failed, *summary.problems]
    wrong = [text for text in said if "\n" in text or "fault of the program" in text]
    return "; ".join(wrong), bool(said)


def _limit(what, value):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(what, (value, resource.getrlimit(what)[1]))


@contextlib.contextmanager
def _small_disk(place):
    """Mount a disk of half a megabyte for a while; yield False where this may not be done."""
    place.mkdir()
    mounted = _succeeds("mount", "-t", "tmpfs", "-o", "size=512k", "none", place)
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", place], check=True)


def _succeeds(*command) -> bool:
    try:
        return subprocess.run(command, capture_output=True).returncode == 0
    except OSError:
        return False


def _fill(disk, free):
    """Leave so many bytes of a disk."""
    left = shutil.disk_usage(disk).free - int(free)
    (disk / "filling").write_bytes(bytes(max(left, 0)))


def try_read_only(folder, effort: Effort) -> Tried:
    """Run without the right to write: the results, one video's, all of them, single files."""
    tried = Tried()
    hindrance = Hindrance(folder / "work" / "work", tried)
    for place in ("results", "results/video0", "results/video1", "results/video*", "results/*"):
        paths = list(hindrance.work.glob(place))
        for path in paths:
            path.chmod(0o555)
        give_back = functools.partial(_give_back, paths)
        hindrance.attempt(f"no right to write {place}", _lose_rights, give_back)
    tried.check(hindrance.reported == tried.cases, f"only {hindrance.reported} runs said so")
    return tried


def _lose_rights() -> None:
    """Give up an administrator's right to write everywhere."""
    if os.geteuid() == 0:
        header = (ctypes.c_uint32 * 2)(CAPABILITIES_VERSION, 0)
        if ctypes.CDLL(None).capset(header, (ctypes.c_uint32 * 6)()):
            raise RuntimeError("an administrator's rights cannot be given up here")


def _give_back(paths) -> None:
    for path in paths:
        path.chmod(0o755)


def try_removed(folder, effort: Effort) -> Tried:
    """Remove the results folder, a video's, or a video itself in the middle of a run."""
    tried, reported, work = Tried(), 0, folder / "work" / "work"
    start = _start(work)
    for k in range(effort.cases(REMOVALS, 3)):
        what, step = ("results", "results/video0", "videos/video1.avi")[k % 3], 5 + 3 * k
        stand_in.copy_of(start, work)
        setup = functools.partial(_remove_at, work, what, step)
        ending = in_child(_hindered, work, setup, seconds=LONGEST_S)
        tried.cases += 1
        fault, said = (ending.fault, False) if ending.fault else ending.value
        reported += said
        tried.check(not fault, f"{what} removed at step {step}: {last_line(fault)}")
    tried.said = f"{reported} runs said that something was gone"
    return tried


def _remove_at(work, what, step) -> None:
    """Remove something when the run is at that step."""

    def remove(number, _):
        if number == step:
            path = work / what
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()

    killed_at_steps.count_steps(work / "results", remove)


def try_two_runs(folder, effort: Effort) -> Tried:
    """Begin two runs into one folder at the same moment: one does all, the other says so."""
    tried, work, expected = Tried(), folder / "work" / "work", None
    start = _start(work)
    for _ in range(effort.cases(RACES, 2)):
        stand_in.copy_of(start, work)
        answers = in_child(_race, work, seconds=LONGEST_S)
        tried.cases += 1
        tried.check(not answers.fault, last_line(answers.fault))
        tried.check(answers.fault or answers.value in (1, 2), f"{answers.value} runs succeeded")
        found = stand_in.tables(work / "results")
        expected = expected or found
        tried.check(found == expected, "the tables differ")
        tried.broken += whole.faults(work / "results")
    return tried


def _race(work) -> int:
    """Two runs at once; how many of them succeeded. The others must have said why not."""
    children = []
    for _ in range(2):
        child = os.fork()
        if not child:
            os._exit(_one_of_two(work))
        children.append(child)
    codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
    if set(codes) - {0, 2}:
        raise RuntimeError(f"ended with {codes}")
    return codes.count(0)


def _one_of_two(work) -> int:
    try:
        stand_in.run(work / "videos", work / "results")
    except InputError as error:
        return 2 if "another whiskerforce" in str(error) else 3
    except BaseException:
        return 4
    return 0


def try_no_handles(folder, effort: Effort) -> Tried:
    """Let a run open only so many files."""
    tried = Tried()
    hindrance = Hindrance(folder / "work" / "work", tried)
    for free in np.unique(np.linspace(0, HANDLES, effort.cases(HANDLES, 3)).astype(int)):
        leave = functools.partial(_leave_handles, int(free))
        hindrance.attempt(f"{free} free handles", leave)
    tried.said = f"{hindrance.reported} runs lacked one and said so"
    return tried


def _leave_handles(count):
    """Open so many files that this process may open only `count` more."""
    _limit(resource.RLIMIT_NOFILE, MOST_HANDLES)
    opened = []
    with contextlib.suppress(OSError):
        while True:
            opened.append(os.open(os.devnull, os.O_RDONLY))
    for handle in opened[:count]:
        os.close(handle)
