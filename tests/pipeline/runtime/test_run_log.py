"""run.log: lines with times, run after run."""

import re

from pipeline.app.outcome import Outcome
from pipeline.runtime import RunLog
from pipeline.runtime.workers import Event

TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z"


def test_lines_have_times_and_are_added(tmp_path):
    RunLog(tmp_path).write("one\ntwo")
    RunLog(tmp_path).write("three")
    text = (tmp_path / "run.log").read_text("utf-8")
    assert re.fullmatch(rf"{TIME}  one\n{TIME}  two\n{TIME}  three\n", text)


def test_events_are_recorded_with_their_outcome(tmp_path):
    log = RunLog(tmp_path)
    log.record(Event("start", 0), ["a"])
    log.record(Event("progress", 0, None), ["a"])
    failed = Outcome("a", "a.avi", "failed", message="no good", details="Traceback …\n  here")
    log.record(Event("done", 0, failed), ["a"])
    lines = (tmp_path / "run.log").read_text("utf-8").splitlines()
    assert [line.split("  ", 1)[1] for line in lines] == [
        "a: started", "a: failed: no good", "Traceback …", "  here",
    ]  # fmt: skip


def test_a_log_that_cannot_be_written_stops_nothing(tmp_path):
    (tmp_path / "run.log").mkdir()
    RunLog(tmp_path).write("one")
