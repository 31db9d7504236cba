"""Curations killed before every single change of a file, and in the middle of every write."""

from datetime import datetime

from pipeline.app.session_files import is_drawn
from pipeline.contacts.corrections import CORRECTIONS_FILE, read_corrections, verdicts
from pipeline.curate import corrected, review
from pipeline.curate.desk import Desk
from pipeline.curate.results import Results
from pipeline.tables.result_exchange import settled
from pipeline.tables.run_record import STATE_FILE
from promises import real_session, stand_in, whole
from promises.children import in_child
from promises.killed_at_steps import count_steps, kill_at, other_tables
from promises.trial import Effort, Tried

COMMANDS = "delete", "undo", "delete", "confirm", "next_video", "delete"


class _Noon(datetime):
    """A clock that stands still: tables are compared."""

    @classmethod
    def now(cls, tz=None):
        return cls(2026, 1, 1, 12, tzinfo=tz)


def try_curations(folder, effort: Effort) -> Tried:
    """Kill a person's work at its steps on the disk, and compare the tables of the next run."""
    tried, expected = Tried(), {}
    start, work = real_session.processed(folder)
    stand_in.copy_of(start, work)
    steps = _curate(work, None)  # here, so that the copies of this process have compiled code
    wanted = effort.cases(steps, 3)
    for k in range(wanted):
        step = 1 + round(k * (steps - 1) / max(wanted - 1, 1))
        tried.cases += 1
        for fault in _killed(start, work, step, expected):
            tried.check(False, f"killed at step {step}: {fault}")
    tried.said = f"{len(COMMANDS)} commands on 2 videos have {steps} steps"
    return tried


def _curate(work, step) -> int:
    """Do what COMMANDS say, noting after each what was decided; return the number of steps."""
    out, review.datetime = work / "results", _Noon
    count = count_steps(out, kill_at(step) if step else None)
    with settled(out):
        results = Results(out, corrected.follow_corrections(out)[0])
        desk = Desk(results)
        for command in COMMANDS:
            desk.do(command)
            (work / "answered").write_text(repr(_decided(out)), "utf-8")
        results.close()
    return count()


def _decided(out) -> list:
    """The decisions in the files."""
    return [
        (path.parent.name, *verdict)
        for path in _corrections(out)
        for verdict in verdicts(read_corrections(path.parent))
    ]


def _corrections(out) -> list:
    return sorted(out.glob(f"*/{CORRECTIONS_FILE}"))


def _killed(start, work, step, expected):
    """Yield what is wrong after a curation that was killed, and after the next run."""
    stand_in.copy_of(start, work)
    out, answered = work / "results", work / "answered"
    in_child(_curate, work, step, seconds=real_session.LONGEST_S)
    yield from whole.faults(out)
    decided = _decided(out)
    if answered.exists() and not _is_at_most_one_more(decided, answered.read_text("utf-8")):
        yield f"{decided} are saved, and {answered.read_text('utf-8')} were answered"
    begun = len(real_session.started_videos(out))
    if step % 2:  # as `figures` and `export` do
        ending = in_child(corrected.bring_up_to_date, out, seconds=real_session.LONGEST_S)
        if ending.fault:
            yield ending.fault
    real_session.begin_here(work).join()
    if len(real_session.started_videos(out)) > begun:
        yield "the next run began with the videos again"
    saved = tuple((p.parent.name, p.read_bytes()) for p in _corrections(out))
    if saved not in expected:
        expected[saved] = _tables_with(start, work, out)
    yield from other_tables(out, expected[saved])
    if not is_drawn(out):
        yield "the report is not of these tables"


def _is_at_most_one_more(decided, answered) -> bool:
    """The files hold what was answered last, or one command more."""
    return repr(decided) == answered or abs(len(decided) - answered.count("(")) == 1


def _tables_with(start, work, out) -> dict:
    """Tables that a run from the videos makes with the same corrections.

    Where there are none, `start` has those of such a run.
    """
    kept = stand_in.copy_of(out, work.with_name("kept"))
    stand_in.copy_of(start, work)
    for path in _corrections(kept):
        (out / path.parent.name / path.name).write_bytes(path.read_bytes())
        (out / path.parent.name / STATE_FILE).unlink()  # it is due
    real_session.begin_here(work).join()
    tables = stand_in.tables(out)
    stand_in.copy_of(kept, out)
    return tables
