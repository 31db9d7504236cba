"""How far a run has got: stages that count as work, time left that runs down, lines and a bar."""

import io
import threading
import time

import pytest
from rich.console import Console

from pipeline.app.outcome import Outcome
from pipeline.runtime import progress
from pipeline.runtime.progress import Step
from pipeline.runtime.workers import Event

STAGES = {"scene": 1.0, "following": 2.0, "overlay": 1.0}
DONE = Outcome("a", "a.avi", "done", 100, 10.0, "", 3)


class Now:
    """A clock that is set."""

    def __init__(self):
        self.s = 0.0

    def __call__(self):
        return self.s


def begun(names, after=None, kind=progress.Progress, **other):
    now = Now()
    return kind(names, STAGES, "following", after, clock=now, **other), now


def test_all_stages_count_as_work():
    shown, _ = begun(["a"])
    shares = []
    for step in (
        Step("scene"), Step("following", 0, 100), Step("following", 50, 100),
        Step("overlay", 0, 100), Step("overlay", 50, 100),
    ):  # fmt: skip
        shown.receive(Event("progress", 0, step))
        shares.append(shown.share)
    assert shares == [0, 0.25, 0.5, 0.75, 0.875]
    shown.receive(Event("done", 0, DONE))
    assert shown.share == 1
    assert shown.seconds_left == 0


def test_figures_and_report_count_too():
    shown, now = begun(["a"], {"figures": 1.0, "report": 3.0})
    shown.receive(Event("progress", 0, Step("following", 100, 100)))
    now.s = 16
    shown.receive(Event("done", 0, DONE))
    assert shown.share == pytest.approx(0.8)
    shown.doing("figures")
    assert (shown.stage, shown.share) == ("figures", pytest.approx(0.8))
    assert shown.seconds_left == pytest.approx(4)
    now.s = 17
    shown.doing("report")
    assert (shown.stage, shown.share) == ("report", pytest.approx(0.85))
    assert shown.seconds_left == pytest.approx(3)


def test_figures_and_report_take_no_longer_where_videos_are_slow():
    shown, now = begun(["a"], {"figures": 1.0, "report": 1.0})
    shown.receive(Event("progress", 0, Step("following", 100, 100)))
    now.s = 60  # 100 frames, as of a face with many whiskers
    shown.receive(Event("done", 0, DONE))
    assert shown.seconds_left == pytest.approx(2)


def test_videos_not_yet_opened_are_taken_to_be_like_the_others():
    shown, now = begun(["a", "b"])
    shown.receive(Event("start", 0))
    shown.receive(Event("progress", 0, Step("following", 100, 100)))
    now.s = 30
    shown.receive(Event("done", 0, DONE))
    assert shown.share == pytest.approx(0.5)
    assert shown.seconds_left == pytest.approx(30)


def test_time_left_runs_down_and_is_never_0_while_there_is_work():
    shown, now = begun(["a"])
    now.s = 10
    shown.receive(Event("progress", 0, Step("overlay", 0, 100)))  # three quarters
    left = []
    for now.s in (10, 11, 13, 20, 60):
        left.append(shown.seconds_left)
    assert left == pytest.approx([10 / 3, 7 / 3, 1, 1, 1])


def test_compiling_is_named_and_takes_no_part_in_speed_and_time_left():
    shown, now = begun(["a"])
    shown.receive(Event("start", 0))
    now.s = 10
    shown.receive(Event("progress", 0, Step("following", 100, 200)))  # half
    assert shown.line() == "0/1 video, 100 frames, 10 frames/s, following, 10 s left"
    shown.receive(Event("progress", 0, Step(progress.COMPILING)))
    now.s = 60
    assert shown.line() == "0/1 video, 100 frames, 10 frames/s, compiling"  # how long: not known
    shown.receive(Event("progress", 0, Step("following", 100, 200)))
    now.s = 62
    assert shown.line() == "0/1 video, 100 frames, 8 frames/s, following, 8 s left"


def test_the_clock_runs_on_while_one_of_two_videos_waits_for_compiling():
    shown, now = begun(["a", "b"])
    for task in (0, 1):
        shown.receive(Event("start", task))
        shown.receive(Event("progress", task, Step("following", 0, 100)))
    shown.receive(Event("progress", 0, Step(progress.COMPILING)))
    now.s = 10
    shown.receive(Event("progress", 1, Step("following", 50, 100)))
    assert shown.line().startswith("0/2 videos, 50 frames, 5 frames/s, compiling, following")
    shown.receive(Event("progress", 1, Step(progress.COMPILING)))
    now.s = 60
    assert shown.frames_per_s == 5


def test_the_line_names_stages_and_how_many_are_in_them():
    shown, now = begun(["a", "b", "c"])
    for task, step in enumerate((Step("following", 40, 100), Step("following", 10, 100))):
        shown.receive(Event("start", task))
        shown.receive(Event("progress", task, step))
    shown.receive(Event("start", 2))
    shown.receive(Event("progress", 2, Step("overlay", 1, 100)))
    now.s = 5
    said = shown.line()
    assert said.startswith("0/3 videos, 50 frames, 10 frames/s, following ×2, overlay, ")
    assert said.endswith(" s left")


def test_plain_lines():
    said = []
    lines, now = begun(["a", "b"], kind=progress.Lines, write=said.append, every=10)
    lines.receive(Event("start", 0))
    now.s = 5
    lines.receive(Event("progress", 0, Step("following", 50, 100)))
    assert said == []
    now.s = 10
    lines.receive(Event("progress", 0, Step("overlay", 0, 100)))
    assert len(said) == 1
    assert "0/2 videos, 50 frames, 5 frames/s, overlay" in said[0]
    lines.receive(Event("done", 0, DONE))
    assert said[1:] == ["a: done, 100 frames, 10 frames/s, 3 contacts"]
    lines.receive(Event("done", 1, Outcome("b", "b.avi", "failed", message="no good")))
    assert said[2:] == ["b: failed: no good"]


def test_plain_lines_come_by_a_timer_while_nothing_happens():
    there, said = threading.Event(), []

    def write(line):
        said.append(line)
        there.set()

    with progress.Lines(["a"], STAGES, "following", write=write, every=0.05) as lines:
        lines.receive(Event("progress", 0, Step("scene")))
        assert there.wait(10)
    assert "scene" in said[0]


def test_the_bar_is_drawn_anew_by_a_timer():
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=120)
    now = Now()
    with progress.Bar(["a"], STAGES, "following", clock=now, console=console) as bar:
        bar.receive(Event("start", 0))
        now.s = 10
        bar.receive(Event("progress", 0, Step("overlay", 0, 100)))
        now.s = 12
        deadline = time.monotonic() + 10
        while "1 s left" not in screen.getvalue() and time.monotonic() < deadline:
            time.sleep(0.05)
        bar.receive(Event("done", 0, DONE))
    assert "overlay" in screen.getvalue()
    assert "1 s left" in screen.getvalue()  # 10/3 s at the event
    assert "a: done, 100 frames" in screen.getvalue()


def test_durations_as_people_say_them():
    assert [progress.duration(s) for s in (3.4, 65, 3600 + 61)] == [
        "3 s",
        "1 min 5 s",
        "1 h 1 min",
    ]
