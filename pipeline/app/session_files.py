"""Files of a whole session in its results folder: settings, tables, record and pictures."""

import hashlib
import platform
import sys
import traceback
from dataclasses import asdict, replace
from datetime import UTC, datetime

import pandas as pd

from pipeline import __version__
from pipeline.curate.corrected import write_session_tables
from pipeline.errors import InputError, in_words, why, with_advice
from pipeline.runtime import interrupts
from pipeline.session.input_settings import SETTINGS_NAME
from pipeline.session.inputs import readable
from pipeline.session.results_folders import SESSION_FILES
from pipeline.session.session_file import session_text
from pipeline.tables import files, whole_files
from pipeline.tables.columns import VIDEO_COLUMNS
from pipeline.tables.own_files import copies
from pipeline.tables.run_record import STATE_FILE, read_run
from pipeline.tables.whole_files import sha256

LISTED = (".", "figures", "figures/courses")  # folders of what is written for the whole session


def check_folder(out):
    """Check that the session's tables can be written."""
    for name in SESSION_FILES:
        if (out / name).is_dir():
            raise InputError(f"--out {out}: {name} in it is a folder; move it away")
    try:
        whole_files.try_writing(out)
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot write there ({why(error)}); choose another folder"
        ) from None


def write_session_file(out, settings, digests) -> tuple[str, tuple[str, ...]]:
    """Write the settings in force; one that a person has written is kept under another name.

    settings : of the videos of this run, by their paths
    digests : of the settings of all videos that have results in `out`
    Returns the hash of what was written, "" if nothing was, and what a person should know.
    """
    target = out / SETTINGS_NAME
    distinct = list(dict.fromkeys(settings.values()))
    if not distinct:
        return "", ()
    text = session_text(distinct[0])
    if len(digests) > 1:
        note = "# Videos differ in their settings: these are the first one's; each video's\n"
        text = f"{note}# results folder holds its own.\n{text}"
    before = target.read_bytes() if target.exists() else b""
    ours = before in (b"", text.encode()) or sha256(target) == read_run(out).get("session_sha256")
    old = whole_files.replace_text(target, text, keep=not ours)
    reason = "this run used the settings beside the videos (or --config)"
    problem = f"{target} was not written by a run: {reason}; it is kept as {old}"
    return sha256(target), (problem,) if old else ()


def write_tables(summary, jobs, session) -> list[str]:
    """Write the tables and run.json of the whole results folder; what a person should know."""
    rows = [asdict(each) for each in summary.outcomes]
    videos = pd.DataFrame(rows, columns=[c.name for c in VIDEO_COLUMNS])
    said = files.replace_csv(summary.out / "videos.csv", videos, VIDEO_COLUMNS)
    names = [each.video for each in summary.outcomes if each.frames]
    said += write_session_tables(summary.out, names)
    whole_files.write_json(summary.out / STATE_FILE, _run_record(summary, jobs, session))
    return said


def _run_record(summary, jobs, session) -> dict:
    """How the results were made: run.json."""
    kept = ("path", "sha256", "status", "frames", "stages")
    return {
        "program": "whiskerforce",
        "version": __version__,
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": [readable(argument) for argument in sys.argv[1:]],
        "python": platform.python_version(),
        "platform": platform.platform(),
        "jobs": jobs,
        "seconds": round(summary.seconds, 3),
        "interrupted": summary.interrupted,
        "pictures_of": read_run(summary.out).get("pictures_of", ""),
        "session_sha256": session,
        **copies(summary.out, LISTED),
        "inputs": {
            each.video: {key: getattr(each, key) for key in kept} for each in summary.outcomes
        },
    }


# --- figures and report --------------------------------------------------------------------


def with_pictures(summary, due, shown, log):
    """Make figures and report that show what the tables hold.

    The `Summary` with what failed, and with pages that a person had changed, which are kept.
    """
    if not due and is_drawn(summary.out):
        return summary
    failed, kept = [], []
    if any(each.frames for each in summary.outcomes):

        def begin(what):
            interrupts.check()
            shown.doing(what)
            log.write(f"{what}: started")

        failed, kept = write_pictures(summary.out, begin=begin, note=log.write)
    if not failed:
        _mark_drawn(summary.out)
    problems = (*summary.problems, *failed, *kept)
    return replace(summary, problems=problems, undrawn=bool(failed))


def is_drawn(out) -> bool:
    """Figures and report are there, and show what the tables hold."""
    there = all((out / name).exists() for name in ("figures", "report.html"))
    return there and read_run(out).get("pictures_of") == _digest(out)


def _mark_drawn(out):
    record = whole_files.read_json(out / STATE_FILE, {})
    drawn = {"pictures_of": _digest(out)} | copies(out, LISTED)
    whole_files.write_json(out / STATE_FILE, record | drawn)


def _digest(out) -> str:
    """Hash of the tables that figures and report are made of, and of where they lie."""
    whole = hashlib.sha256(str(out.resolve()).encode())
    for path in (out / name for name in ("contacts.csv", "videos.csv", SETTINGS_NAME)):
        whole.update(path.read_bytes() if path.is_file() else b"")
    return whole.hexdigest()


def write_pictures(out, begin=lambda what: None, note=lambda text: None, **known):
    """Figures and report from the tables; a fault there leaves the tables as they are.

    begin, note : called with the name of each before it is made, and with tracebacks
    known : `damaged` of `write_fig3` and `write_report`
    Returns sentences on what failed, and on pages that are kept.
    """
    from pipeline.reports import figures, report

    failed, kept = [], []
    makers = {
        "figures": lambda: figures.write_fig3(out, **known),
        "report": lambda: kept.extend(report.write_report(out, **known)),
    }
    for what, write in makers.items():
        begin(what)
        try:
            write()
        except Exception as error:
            note(traceback.format_exc())
            if isinstance(error, (OSError, InputError)):
                failed.append(f"the {what} could not be made: {with_advice(error)}")
            else:
                fault = f"{type(error).__name__}: {in_words(error)}"
                failed.append(f"the {what} could not be made ({fault})")
    return failed, kept
