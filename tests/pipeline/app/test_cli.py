"""The command: exit status, messages, quick start, and no traceback unless asked for."""

import io
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from pyarrow import parquet
from results_folder import make_results
from typer.main import get_command

from pipeline.app import batch, cli, demo
from pipeline.app.batch import Summary
from pipeline.app.outcome import Outcome
from pipeline.runtime import numba_cache
from pipeline.runtime.folder_lock import LOCK_FILE

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
    """Let `run` come to a given summary."""

    def put(*statuses, **options):
        monkeypatch.setattr(batch, "run", lambda *_: summary(tmp_path, *statuses, **options))
        monkeypatch.setattr(numba_cache, "is_compiled", lambda *_: True)

    return put


@pytest.mark.parametrize(
    ("statuses", "code"),
    [(("done",), 0), (("done", "warning"), 0), (("done", "failed"), 1), (("failed",), 1)],
)
def test_exit_status_of_run(ran, capsys, statuses, code):
    ran(*statuses)
    assert exit_code("run", "x", "--out", "y") == code
    videos = "1 video:" if len(statuses) == 1 else f"{len(statuses)} videos:"
    assert videos in capsys.readouterr().out


def test_not_all_is_done_where_the_report_could_not_be_made(ran, monkeypatch):
    ran("done")
    undrawn = replace(batch.run(), undrawn=True)
    monkeypatch.setattr(batch, "run", lambda *_: undrawn)
    assert exit_code("run", "x", "--out", "y") == 1


def test_last_lines_say_what_failed_and_why(ran, capsys):
    ran("failed", "done", "warning", "failed")
    exit_code("run", "x", "--out", "y")
    lines = capsys.readouterr().out.strip().split("\n")
    assert lines[-2:] == [
        "failed: v0 (/in/v0.avi): message 0",
        "failed: v3 (/in/v3.avi): message 3",
    ]
    assert lines[-3] == "warning: v2: message 2"


def test_what_holds_for_all_videos_is_said_of_the_first_one():
    shown, said = [], set()
    for name, message in (("a", "one | two"), ("b", "two | three; so"), ("c", "one"), ("d", "")):
        shown += Outcome(name, "", "warning", 10, 100.0, message, 2).lines(said)
    state = "warning, 10 frames, 100 frames/s, 2 contacts"
    assert shown == [
        *(state, "  - one", "  - two"),
        *(state, "  - three; so", "  - and 1 message as above"),
        *(state, "  - 1 message as above"),
        state,
    ]


def test_of_videos_that_were_finished_before_it_is_said_at_the_end(ran, capsys, monkeypatch):
    outcomes = [Outcome(f"v{i}", "", "warning", 1, 1.0, "one | two") for i in range(2)]
    ended = Summary(Path("out"), tuple(outcomes), 2, 1.0)
    ran("done")
    monkeypatch.setattr(batch, "run", lambda *_: ended)
    exit_code("run", "x", "--out", "y", "--quiet")
    assert capsys.readouterr().out.splitlines() == [
        *("warning: v0:", "  - one", "  - two"),
        "warning: v1: 2 messages as above",
    ]


def without_pole(seen):
    """The message on a missing pole, with what was seen in its place."""
    return f"no pole of 0.5 mm (12 px) found, so no contacts; what was seen is {seen}; check it"


def of_trials(monkeypatch, **seen):
    """`run` of trials: in each, what was seen in place of a pole, None where one is there."""
    pole = {"radius_px": 6.0, "runs": []}
    outcomes = [
        Outcome(name, "", "warning", 10, 100.0, without_pole(what))
        if what
        else Outcome(name, "", "warning", 10, 100.0, "odd", 2, pole=pole)
        for name, what in seen.items()
    ]
    ended = Summary(Path("out"), tuple(outcomes), 0, 1.0)
    monkeypatch.setattr(batch, "run", lambda *_: ended)
    return outcomes


def test_videos_without_a_pole_are_told_together(ran, capsys, monkeypatch):
    ran("done")
    of_trials(monkeypatch, a="a paw", b=None, c="a tuft", d=None)
    exit_code("run", "x", "--out", "y", "--quiet")
    assert capsys.readouterr().out.splitlines() == [
        "warning: 2 of 4 videos show no pole, so no contacts there: a, c; if there is one, see in "
        "videos.csv what was seen in place of it",
        "warning: b: odd",
        "warning: d: 1 message as above",
    ]


def test_where_no_video_shows_a_pole_it_is_said_once_what_to_do(ran, capsys, monkeypatch):
    ran("done")
    of_trials(monkeypatch, a="a paw", b="a tuft", c="a bar")
    exit_code("run", "x", "--out", "y", "--quiet")
    assert capsys.readouterr().out.splitlines() == [
        f"warning: a: {without_pole('a paw')} (nor in 2 other videos)"
    ]


def test_as_a_video_ends_a_missing_pole_is_only_named(monkeypatch):
    said = set()
    first, second = (each.lines(said) for each in of_trials(monkeypatch, a="a paw", b="a tuft"))
    assert first[1:] == ["  - no pole of 0.5 mm (12 px) found, so no contacts"]
    assert second[1:] == ["  - 1 message as above"]


def test_quiet_says_only_what_went_wrong(ran, capsys):
    ran("failed", "done", "warning")
    exit_code("run", "x", "--out", "y", "--quiet")
    assert capsys.readouterr().out.splitlines() == [
        "warning: v2: message 2",
        "failed: v0 (/in/v0.avi): message 0",
    ]


def test_no_report_is_promised_where_there_is_none(ran, capsys, tmp_path):
    ran("done")  # report.html could not be written
    exit_code("run", "x", "--out", "y")
    assert "report" not in capsys.readouterr().out
    (tmp_path / "report.html").touch()  # of an earlier run
    ran("done", interrupted=True)
    exit_code("run", "x", "--out", "y")
    assert "next: look" not in capsys.readouterr().out


def test_last_lines_lead_to_report_and_overlay(ran, capsys, tmp_path):
    ran("done")
    (tmp_path / "v0").mkdir()
    for name in ("report.html", "contacts.csv", "v0/overlay.mp4"):
        (tmp_path / name).touch()
    exit_code("run", "x", "--out", "y")
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == [
        f"report: {tmp_path / 'report.html'}",
        f"contacts: {tmp_path / 'contacts.csv'}",
        f"overlay: {tmp_path / 'v0' / 'overlay.mp4'}",
        f"next: look at the report, then `whiskerforce curate {tmp_path}`",
    ]


def test_who_runs_it_first_is_told_that_it_compiles(ran, monkeypatch, capsys):
    ran("done")
    monkeypatch.setattr(numba_cache, "is_compiled", lambda *_: False)
    exit_code("run", "x", "--out", "y")
    assert capsys.readouterr().out.startswith("this first run compiles")
    exit_code("run", "x", "--out", "y", "--quiet")
    assert "compile" not in capsys.readouterr().out
    exit_code("init", "gone")
    assert capsys.readouterr().out.startswith("this first time, parts of the program are compiled")


def test_a_port_that_cannot_be_is_refused(capsys, tmp_path):
    assert exit_code("curate", tmp_path, "--port", "65536") == 2
    assert "Invalid value for '--port'" in capsys.readouterr().err


def test_a_decimal_comma_is_refused_in_words(capsys, tmp_path):
    assert exit_code("calibrate", "dust", tmp_path, "--out", tmp_path, "--at-mm", "0,5") == 2
    assert "'--at-mm': '0,5': expected a number with a decimal point" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["figures", "gone"], "gone: no such folder"),
        (["curate", "gone"], "gone: no such folder"),
        (["init", "gone"], "gone: no such folder"),
        (["init", "film.avi"], "film.avi: a file, not a folder; give a folder of videos"),
        (["figures", "film.avi"], "film.avi: a file, not a folder; give the --out folder"),
        (["calibrate", "ringdown", "gone", "--out", "out"], "gone: no such folder"),
        (["export", "mat", "gone", "--out", "out"], "gone: no such folder"),
    ],
)
def test_a_folder_that_is_not_there_is_named(command, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "film.avi").touch()
    assert exit_code(*command) == 2
    assert capsys.readouterr().err.startswith(f"error: {message}")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("hidden", [(), (".DS_Store",)])
@pytest.mark.parametrize(
    "command",
    [
        "run empty --out out",
        "init empty",
        "figures empty",
        "curate empty",
        "calibrate geometry empty --out out --pixels-per-mm 100",
        "calibrate ringdown empty --out out",
        "calibrate dust empty --out out",
        "import janelia empty --out out",
        "import dlc empty --out out",
        "import sleap empty --out out",
        "import whacc empty --out out",
        "export janelia empty --out out",
        "export mat empty --out out",
        "export nwb empty --out out",
        "export movement empty --out out",
        "export whacc empty --out out",
    ],
)
def test_an_empty_folder_gets_the_same_message_everywhere(
    command, hidden, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    for name in hidden:
        (tmp_path / "empty" / name).touch()
    assert exit_code(*command.split()) == 2
    assert re.match(
        r"error: empty: is an empty folder: expected .+ in it\n$", capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "command",
    [
        ["paper", "--out", "file"],
        ["synth", "file", "--preset", "single"],
        ["demo", "--out", "file"],
        ["run", "a.avi", "--out", "file"],
        ["export", "mat", "results", "--out", "file"],
    ],
)
def test_a_file_in_place_of_a_folder_gets_a_message_in_words(
    command, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name in ("file", "a.avi"):
        (tmp_path / name).touch()
    make_results(tmp_path / "results")
    recording = 'frames_per_second = 1000\npixels_per_mm = 25\nface = "left"\n'
    (tmp_path / "session.toml").write_text(f"[recording]\n{recording}")
    assert exit_code(*command) == 2
    message = capsys.readouterr().err
    assert "file is a file, not a folder" in message or "file/videos is a file" in message
    assert "Errno" not in message


def test_curate_gets_the_name_of_the_curator_and_says_which_tables_lack_corrections(
    monkeypatch, tmp_path, capsys
):
    from pipeline import curate
    from pipeline.reports import figures, report

    make_results(tmp_path)
    called, faults, kept = [], {}, []

    def open_page(*arguments, **options):
        called.append(options)
        return SimpleNamespace(results=SimpleNamespace(faults=faults, kept=kept))

    monkeypatch.setattr(curate, "curate", open_page)
    for module, name in ((figures, "write_fig3"), (report, "write_report")):
        monkeypatch.setattr(module, name, lambda results, damaged: ["report.html was changed"])
    assert exit_code("curate", tmp_path, "--name", "Ada", "--no-browser") == 0
    assert str(tmp_path / "report.html") in capsys.readouterr().out
    assert (called[0]["name"], called[0]["open_browser"]) == ("Ada", False)
    faults["trial"] = "No space left on device"
    kept.append("contacts.csv was changed")
    assert exit_code("curate", tmp_path, "--no-browser") == 1
    said = capsys.readouterr().out
    assert "contacts.csv was changed" in said
    assert "report.html was changed" in said
    assert f"{tmp_path / 'trial'}: its corrections are saved, but its tables do not" in said
    assert "follow from the corrections:" not in said


def test_a_report_that_cannot_be_written_is_no_wrong_argument_of_curate(
    tmp_path, monkeypatch, capsys
):
    from pipeline import curate
    from pipeline.reports import report

    def refuse(results, damaged):
        raise PermissionError(13, "Permission denied", "report.html")

    results = make_results(tmp_path)
    opened = SimpleNamespace(results=SimpleNamespace(faults={"trial": "no place"}, kept=[]))
    monkeypatch.setattr(curate, "curate", lambda *_, **__: opened)
    monkeypatch.setattr(report, "write_report", refuse)
    assert exit_code("curate", results, "--no-browser") == 1
    said = capsys.readouterr().out
    assert "the report could not be made: report.html: Permission denied; change its" in said
    assert f"{results / 'trial'}: its corrections are saved" in said
    assert (results / "figures" / "fig3.png").is_file()


DAMAGED = [
    ("session.toml", "[recording"), ("frames.parquet", "half"), ("centrelines.parquet", ""),
    ("frames.parquet", None), ("session.toml", None),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content"), DAMAGED)
def test_a_video_with_damaged_results_is_left_out_of_figures_and_report(
    tmp_path, monkeypatch, capsys, name, content
):
    from pipeline import curate

    results = make_results(tmp_path / "results")
    (results / "one" / name).unlink()
    if content is not None:
        (results / "one" / name).write_text(content)
    assert exit_code("figures", results) == 1
    said = capsys.readouterr().out
    (left_out,) = [line for line in said.splitlines() if line.startswith("left out: ")]
    assert left_out.startswith(f"left out: one: {results / 'one' / name}: ")
    assert len(re.findall(r"\b(again|anew|correct)\b", left_out)) == 1, left_out  # the advice
    rows = (results / "figures" / "fig3f.csv").read_text().splitlines()
    assert len(rows) == 2  # header, contact of two
    opened = SimpleNamespace(results=SimpleNamespace(faults={}, kept=[]))
    monkeypatch.setattr(curate, "curate", lambda *_, **__: opened)
    assert exit_code("curate", results, "--no-browser") == 1
    assert f"left out: one: {results / 'one' / name}: " in capsys.readouterr().out
    page = (results / "report.html").read_text("utf-8")
    assert "its results are damaged" in page


def test_a_video_whose_table_lacks_a_column_is_left_out_and_named(tmp_path, capsys):
    """As where an earlier version has written it."""
    results = make_results(tmp_path / "results")
    table = results / "one" / "frames.parquet"
    parquet.write_table(parquet.read_table(table).drop_columns("axial_force_uN"), table)
    said = f"{table}: expected column axial_force_uN"
    assert exit_code("figures", results) == 1
    printed = capsys.readouterr().out
    assert f"left out: one: {said}" in printed
    assert "left out: two" not in printed
    out = "--out", tmp_path / "mat"
    assert exit_code("export", "mat", results, *out) == 2  # two has no contacts
    assert f"left out: one: {said}" in capsys.readouterr().out


def test_presets_are_listed(capsys):
    assert exit_code("synth", "--preset", "list") == 0
    assert "  single: " in capsys.readouterr().out


def commands(command, name="whiskerforce"):
    """Every command and group, by name."""
    yield name, command
    for own, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, f"{name} {own}")


def helps():
    """Every command and group with its help, every option and argument with its own."""
    for name, command in commands(get_command(cli.app)):
        yield name, command.help
        for each in command.params:
            if getattr(each, "help", None) is not None or each.name != "help":
                yield f"{name} {each.name}", getattr(each, "help", None)


def test_help_names_values_as_the_docs_do_not_by_their_types():
    for name, command in commands(get_command(cli.app)):
        for each in command.params:
            if not getattr(each, "is_flag", False):
                assert (each.metavar or "").isupper(), (name, each.name)


@pytest.mark.parametrize(("command", "name"), [("run", "PATH"), ("init", "FOLDER")])
def test_help_shows_arguments_without_types_of_python(capsys, command, name):
    assert exit_code(command, "--help") == 0
    text = capsys.readouterr().out
    assert "<" not in text
    assert f"  {name}  " in text


def test_a_library_that_finds_no_memory_is_no_fault_of_the_program(capsys, monkeypatch, tmp_path):
    def no_memory(*given):
        raise ImportError("libx.so: failed to map segment from shared object")

    monkeypatch.setattr("pipeline.app.init.init_folder", no_memory)
    assert exit_code("init", tmp_path) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: out of memory (ImportError: libx.so")
    assert "error in the program" not in said


def test_help_says_where_to_begin(capsys):
    assert exit_code("--help") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "`whiskerforce demo`" in text
    assert "`whiskerforce init FOLDER`, then `whiskerforce run FOLDER --out RESULTS`" in text


def test_help_is_in_whole_sentences():
    for name, text in helps():
        assert text, name
        first = text.split("  [default")[0].split("\n")[0]
        assert len(first.split()) >= 3, (name, first)
        assert first[0].isupper(), (name, first)
        assert first.endswith((".", ")")), (name, first)
        assert not re.match(r"(Of|At|Whose|E\.g\.)\b", first), (name, first)


def test_interruption_says_how_to_go_on(ran, capsys):
    ran("done", interrupted=True)
    assert exit_code("run", "x", "--out", "y") == 130
    assert "continues from here" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run"], "PATH"),
        (["run", "a.avi"], "--out"),
        (["run", "nowhere.avi", "--out", "out"], "nowhere.avi"),
        (["run", "here", "--out", "out"], "no session.toml"),
        (["run", "here", "--out", "out", "--config", "none.toml"], "none.toml: 1 problem"),
        (["run", "here", "--out", "out", "--jobs", "0"], "--jobs"),
        (
            ["run", "here", "--out", "out", "--jobs", "x"],
            "'--jobs': 'x': expected a whole number of at least 1",
        ),
        (
            ["synth", "out", "--preset", "single", "--frames", "49"],
            "'--frames': '49': expected a whole number of at least 50",
        ),
        (["curate", "here", "--port", "70000"], "expected a whole number from 0 to 65535"),
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


def test_a_tilde_that_the_shell_has_left_is_the_users_folder(ran, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))  # on Windows
    ran("done")
    given = []
    monkeypatch.setattr(
        batch, "run", lambda *args: given.extend(args) or summary(tmp_path, "done")
    )
    assert exit_code("run", "~/videos", "a~", "--out=~/results", "--config", "~") == 0
    assert given[:3] == [
        [tmp_path / "videos", Path("a~")], tmp_path / "results", tmp_path,
    ]  # fmt: skip


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


def test_a_console_without_the_letters_of_a_name_gets_the_rest(tmp_path, monkeypatch):
    console = io.TextIOWrapper(io.BytesIO(), encoding="cp1252", errors="strict")
    monkeypatch.setattr(sys, "stderr", console)
    assert exit_code("figures", tmp_path / "漢字") == 2
    console.flush()
    assert b"??: no such folder" in console.buffer.getvalue()


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
    assert named["frames"] == 1000


def test_a_rendering_that_was_killed_before_its_first_truth_table_goes_on(monkeypatch, tmp_path):
    import synthetic.session

    def killed(folder, *arguments, **options):
        (folder / "session.toml").write_text("")
        raise KeyboardInterrupt

    arguments = ["synth", tmp_path / "videos", "--preset", "noisy", "--jobs", 1]
    monkeypatch.setattr(synthetic.session, "render_session", killed)
    assert exit_code(*arguments) == 130
    monkeypatch.setattr(synthetic.session, "render_session", lambda *a, **k: [])
    assert exit_code(*arguments) == 0


@pytest.mark.parametrize("preset", ["single", "two_views"])
def test_synth_and_demo_leave_the_folders_of_a_person_alone(preset, tmp_path, capsys):
    settings = tmp_path / "videos" / "session.toml"
    settings.parent.mkdir()
    settings.write_text("a person's")
    for command in (["synth", settings.parent, "--preset", preset], ["demo", "--out", tmp_path]):
        assert exit_code(*command) == 2
        assert "not rendered (session.toml)" in capsys.readouterr().err
    assert settings.read_text() == "a person's"


def test_synth_renders_two_views_of_as_many_frames_as_are_wanted(tmp_path, monkeypatch):
    import synthetic.two_view_session

    made = []
    monkeypatch.setattr(
        synthetic.two_view_session, "render_two_views", lambda *options: made.append(options)
    )
    arguments = ["--preset", "mirror", "--frames", 70, "--trials", 3, "--seed", 5]
    assert exit_code("synth", tmp_path / "videos", *arguments) == 0
    assert made == [(tmp_path / "videos", "mirror", 5, 3, 70)]


def test_synth_mixes_no_presets_in_a_folder(tmp_path, capsys):
    made = tmp_path / "truth" / "row_000" / "scene.json"
    made.parent.mkdir(parents=True)
    made.write_text('{"made_from": {"preset": "row"}}')
    assert exit_code("synth", tmp_path, "--preset", "single") == 2
    assert "holds videos of the preset row" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="there, no process interrupts itself so")
@pytest.mark.parametrize("signal", ["SIGINT", "SIGTERM"])
def test_who_ends_a_command_finds_no_half_files_and_no_traceback(signal, tmp_path):
    code = (
        "import os, signal, whiskermodel.paper.files as files\n"
        "from pipeline.app import cli\n"
        "def write(new, **_):\n"
        "    (new / 'fig2.csv').touch()\n"
        f"    os.kill(os.getpid(), signal.{signal})\n"
        "files.write_paper = write\n"
        f"cli.main(['paper', '--out', {str(tmp_path)!r}])"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 130
    assert "Traceback" not in ended.stderr
    assert [path.name for path in tmp_path.iterdir()] == [LOCK_FILE]


def test_a_demo_that_is_interrupted_is_not_done(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(demo, "render", lambda *_: None)
    ended = summary(tmp_path, "done", interrupted=True)
    monkeypatch.setattr(batch, "run", lambda *_, **how: ended)
    assert exit_code("demo", "--out", tmp_path / "demo", "--jobs", "1") == 130
    assert "done" not in capsys.readouterr().out


@pytest.mark.skipif(sys.platform == "win32", reason="there, no process interrupts itself so")
@pytest.mark.parametrize("signal", ["SIGINT", "SIGTERM"])
def test_ctrl_c_while_the_program_starts_ends_it_silently(signal):
    code = (
        "import os, signal, sys, pipeline.__main__\n"
        "class Slow:\n"
        "    def find_spec(self, *name):\n"
        f"        os.kill(os.getpid(), signal.{signal})\n"
        "sys.meta_path.insert(0, Slow())\n"
        "pipeline.__main__.main()"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


@pytest.mark.skipif(sys.platform == "win32", reason="there, a broken pipe is another error")
@pytest.mark.parametrize("is_closed", [False, True])
def test_the_work_goes_on_where_nobody_reads_what_is_said(is_closed):
    code = "import sys; from pipeline.app.terminal import say; say('a'); say('b'); sys.exit(3)"
    if is_closed:
        code = (
            f"import sys; sys.stdout = None; from pipeline.app import cli; cli._prepare(); {code}"
        )
    reading, writing = os.pipe()
    os.close(reading)
    ended = subprocess.run([sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (3, b"")


@pytest.mark.parametrize("command", [(), ("run",), ("calibrate", "geometry"), ("export", "nwb")])
def test_h_is_help(command, capsys):
    assert exit_code(*command, "-h") == 0
    short = capsys.readouterr().out
    assert exit_code(*command, "--help") == 0
    assert capsys.readouterr().out == short


def test_the_shell_completes_commands():
    asked = {"_WHISKERFORCE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "whiskerforce ca"}
    code = "import sys; sys.argv = ['whiskerforce']; from pipeline.app.cli import main; main()"
    child = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True
    )
    assert "calibrate" in child.stdout
    assert "export" not in child.stdout
