"""What a command shows on the terminal: lines, progress, and what a run says at its end."""

import os
import shlex
import sys

import typer

from pipeline.app.missing_poles import missing_pole_lines
from pipeline.runtime.interrupts import INTERRUPTED

FAILED, UNUSABLE = 1, 2  # exit status


def say(line: str):
    """Print a line at once, also where the output goes to a file.

    Where nobody reads any more, as behind `| head`, the work goes on.
    """
    try:
        typer.echo(line)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def say_nothing(line: str):
    """Print nothing, for `--quiet`."""


def cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def leave(left_out):
    """Leave with the exit status of `run`: 1 where something was left out."""
    raise typer.Exit(FAILED if left_out else 0)


def progress(*what):
    """A bar on a terminal, plain lines elsewhere; `what` as of `pipeline.runtime.Progress`."""
    from pipeline.runtime import progress

    if not sys.stdout.isatty():
        return progress.Lines(*what, write=say)
    from rich.console import Console

    return progress.Bar(*what, console=Console())


def finish_run(summary, debug, say_result):
    """Say what came of a run, failures last, and leave with the exit status.

    say_result : `say`, or `say_nothing` where only warnings and failures are wanted
    """
    for line in _results(summary):
        say_result(line)
    say_problems(summary, say, debug)
    if summary.interrupted:
        say(
            "interrupted; finished videos are kept: the same command continues from here and "
            "makes figures and report"
        )
        raise typer.Exit(INTERRUPTED)
    leave(summary.of("failed") or summary.undrawn)


def say_problems(summary, say, debug=False):
    """Say what went wrong in a run, failures last, with tracebacks if `debug`."""
    for line in _warnings(summary):
        say(line)
    for each in summary.of("failed"):
        if debug and each.details:
            typer.echo(each.details, err=True)
        say(f"failed: {each.video} ({each.path}): {each.message}")


def _results(summary):
    """How many videos were processed, where the results lie, and what to do next."""
    from pipeline.contacts.corrections import decisions_in_words
    from pipeline.tables.result_exchange import overlays_in

    out = summary.out
    yield summary.line()
    if decided := decisions_in_words(out):
        yield f"corrections, kept by every run: {decided}"
    for name, path in (("report", "report.html"), ("contacts", "contacts.csv")):
        if (out / path).is_file():
            yield f"{name}: {(out / path).resolve()}"
    overlays = [path for folder in sorted(out.glob("*/")) for path in overlays_in(folder)]
    if overlays:
        more = f" and {len(overlays) - 1} more" if len(overlays) > 1 else ""
        yield f"overlay: {overlays[0].resolve()}{more}"
    is_shown = (out / "report.html").is_file() and not summary.interrupted
    if is_shown and any(each.contacts for each in summary.outcomes):
        yield f"next: look at the report, then `whiskerforce curate {shlex.quote(str(out))}`"


def _warnings(summary):
    """What a person should know of the session, then of each video that was not shown before."""
    for problem in summary.problems:
        yield f"warning: {problem}"
    for names in summary.copies:
        often = f"its contacts count {len(names)} times"
        yield f"warning: {' and '.join(names)} are the same video: {often}"
    if summary.lost:
        yield (
            f"no longer there: {', '.join(summary.lost)}; left out of videos.csv and "
            "contacts.csv, but their own results are kept"
        )
    for line in missing_pole_lines(summary.outcomes):
        yield f"warning: {line}"
    said = set()
    for each in summary.of("warning"):
        if each.video not in summary.said:
            yield from each.warning_lines(said)
