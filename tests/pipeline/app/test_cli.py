"""The command: exit status, messages, quick start, and no traceback unless asked for."""

import os
import subprocess
import sys

import pytest

from pipeline.app import batch, cli
from pipeline.app.batch import Outcome, Summary
from pipeline.runtime import progress
from pipeline.runtime.workers import Event

HEAVY = (
    "av", "bokeh", "cv2", "jinja2", "matplotlib", "numba", "numpy", "pandas", "pyarrow",
    "pydantic", "rich", "scipy", "skimage", "tifffile", "tomlkit",
)  # fmt: skip
COMMANDS = ("run", "init", "demo", "synth", "figures", "paper", "curate", "calibrate")


def exit_code(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main([str(a) for a in arguments])
    return caught.value.code or 0


def summary(tmp_path, *statuses, interrupted=False):
    outcomes = [
        Outcome(f"v{i}", f"/in/v{i}.avi", status, 10, 100.0, f"message {i}", 2)
        for i, status in enumerate(statuses)
    ]
    return Summary(tmp_path, tuple(outcomes), 0, 61.0, interrupted)


@pytest.fixture
def ran(monkeypatch, tmp_path):
    """Let `run` come to a given summary; pictures are left out."""

    def put(*statuses, **options):
        monkeypatch.setattr(batch, "run", lambda *_: summary(tmp_path, *statuses, **options))
        monkeypatch.setattr(cli, "_write_pictures", lambda *_: [])

    return put


@pytest.mark.parametrize(
    ("statuses", "code"),
    [
        (("done",), 0),
        (("done", "warning"), 0),
        (("done", "failed"), 1),
        (("failed",), 1),
    ],
)
def test_exit_status_of_run(ran, capsys, statuses, code):
    ran(*statuses)
    assert exit_code("run", "x", "--out", "y") == code
    videos = "1 video:" if len(statuses) == 1 else f"{len(statuses)} videos:"
    assert videos in capsys.readouterr().out


def test_last_lines_say_what_failed_and_why(ran, capsys):
    ran("failed", "done", "warning", "failed")
    exit_code("run", "x", "--out", "y")
    lines = capsys.readouterr().out.strip().split("\n")
    assert lines[-2:] == [
        "failed: v0 (/in/v0.avi): message 0",
        "failed: v3 (/in/v3.avi): message 3",
    ]
    assert lines[-3] == "warning: v2: message 2"


def test_interruption_says_how_to_go_on(ran, capsys):
    ran("done", interrupted=True)
    assert exit_code("run", "x", "--out", "y") == 130
    assert "goes on from here" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run"], "PATH"),
        (["run", "a.avi"], "--out"),
        (["run", "nowhere.avi", "--out", "out"], "nowhere.avi"),
        (["run", "here", "--out", "out"], "no session.toml"),
        (["run", "here", "--out", "out", "--config", "none.toml"], "none.toml: 1 problem"),
        (["run", "here", "--out", "out", "--jobs", "0"], "--jobs"),
        (["frobnicate"], "frobnicate"),
        (["synth", "out", "--preset", "none"], "single"),
        (["init", "nowhere"], "nowhere"),
        (["figures", "here"], "contacts.csv"),
    ],
)
def test_unusable_arguments(arguments, expected, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "a.avi").touch()
    assert exit_code(*arguments) == 2
    message = capsys.readouterr().err
    assert expected in message
    assert "Traceback" not in message
    assert not (tmp_path / "out").exists()


def test_unusable_settings_name_file_and_key(capsys, tmp_path):
    (tmp_path / "a.avi").touch()
    (tmp_path / "session.toml").write_text(
        '[recording]\nframes_per_second = 1000\npixels_per_mm = 25000\nface = "left"\n'
    )
    assert exit_code("run", tmp_path, "--out", tmp_path / "out") == 2
    message = capsys.readouterr().err
    for part in (str(tmp_path / "session.toml"), "[recording] pixels_per_mm", "25000", "write 25"):
        assert part in message
    assert "Traceback" not in message


def test_faults_of_the_program_show_a_traceback_only_on_demand(monkeypatch, capsys):
    def fault(*_):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(batch, "run", fault)
    assert exit_code("run", "x", "--out", "y") == 1
    captured = capsys.readouterr()
    assert "ZeroDivisionError: oops" in captured.err
    assert "--debug" in captured.err
    assert "Traceback" not in captured.err
    assert exit_code("run", "x", "--out", "y", "--debug") == 1
    assert "Traceback" in capsys.readouterr().err


def test_debug_leaves_the_exit_status_as_it_is(capsys, tmp_path):
    assert exit_code("--debug", "run", tmp_path / "nowhere", "--out", tmp_path / "out") == 2
    assert "Traceback" in capsys.readouterr().err


def test_a_console_without_the_letters_of_a_name_gets_the_rest(tmp_path):
    command = [sys.executable, "-m", "pipeline.app.cli", "figures", str(tmp_path / "漢字")]
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252:strict", "PYTHONUTF8": "0"}
    out = subprocess.run(command, env=environment, capture_output=True)
    assert out.returncode == 2
    assert b"??: no contacts.csv in it" in out.stderr


def test_help_and_version(capsys):
    from pipeline import __version__

    assert exit_code("--help") == 0
    text = capsys.readouterr().out
    assert all(f"  {command} " in text for command in COMMANDS)
    assert exit_code("--version") == 0
    assert capsys.readouterr().out.strip() == f"whiskerforce {__version__}"
    for command in COMMANDS:
        assert exit_code(command, "--help") == 0


def test_start_loads_nothing_heavy():
    code = (
        f"import sys, pipeline, pipeline.app.cli\nprint([m for m in {HEAVY} if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_synth_renders_a_preset(monkeypatch, tmp_path, capsys):
    import synthetic.session

    asked = []
    monkeypatch.setattr(
        synthetic.session, "render_session", lambda *a, **k: asked.append((a, k)) or []
    )
    arguments = ["synth", tmp_path, "--preset", "noisy", "--seed", 3, "--trials", 2, "--jobs", 1]
    assert exit_code(*arguments) == 0
    (positional, named) = asked[0]
    assert positional == (tmp_path, "noisy", 3, 2)
    assert named["jobs"] == 1


# --- progress --------------------------------------------------------------------------------


def test_plain_lines_of_progress():
    now = [0.0]
    said = []
    lines = progress.Lines(["a", "b"], said.append, every=10, clock=lambda: now[0])
    lines.receive(Event("start", 0))
    now[0] = 5
    lines.receive(Event("progress", 0, (50, 100)))
    assert said == []
    assert lines.frames_per_s == 10
    assert lines.seconds_left == pytest.approx(15)  # b is taken to be as long as a
    now[0] = 10
    lines.receive(Event("progress", 0, (100, 100)))
    assert said == ["0/2 videos, 100 frames, 10 frames/s, 10 s left"]
    lines.receive(Event("done", 0, Outcome("a", "a.avi", "done", 100, 10.0, "", 3)))
    assert said[1:] == ["a: done, 100 frames, 10 frames/s, 3 contacts"]
    lines.receive(Event("start", 1))
    lines.receive(Event("done", 1, Outcome("b", "b.avi", "failed", message="no good")))
    assert said[2:] == ["b: failed: no good"]
    assert lines.finished == 2


def test_progress_bar_draws_on_a_terminal():
    import io

    from rich.console import Console

    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=100)
    with progress.Bar(["a"], console) as bar:
        bar.receive(Event("start", 0))
        bar.receive(Event("progress", 0, (50, 100)))
        bar.receive(Event("done", 0, Outcome("a", "a.avi", "done", 100, 10.0, "", 3)))
    assert "a: done, 100 frames" in screen.getvalue()
    assert "frames/s" in screen.getvalue()


def test_durations_as_people_say_them():
    assert [progress.duration(s) for s in (3.4, 65, 3600 + 61)] == [
        "3 s",
        "1 min 5 s",
        "1 h 1 min",
    ]
