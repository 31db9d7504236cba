"""Runs over folders: what is processed, skipped, refused, kept. The analysis is a stand-in."""

import json
import os
import pathlib
import shutil
import struct
import sys
import tempfile
import time
import unicodedata
import zlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import typer
from killed_task import killed
from quick_analysis import quick_analyse

import pipeline.reports.figures
import pipeline.reports.report
import pipeline.run
from pipeline.app import batch, cli, earlier_results, outcome, terminal, video_task
from pipeline.app.session_files import is_drawn
from pipeline.contacts.corrections import read_corrections
from pipeline.curate.corrected import MADE_WITH, corrections_digest, save_contacts
from pipeline.errors import InputError
from pipeline.runtime import Progress, Step
from pipeline.runtime.compiling import compile_times
from pipeline.runtime.folder_lock import LOCK_FILE, locked
from pipeline.session import content, inputs
from pipeline.session.input_settings import session_of
from pipeline.session.session_file import (
    read_session,
    settings_digest,
    settings_from,
    write_session,
)
from pipeline.tables import files, own_files, result_exchange, run_record, whole_files
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS
from pipeline.tables.own_files import RECORD

SETTINGS = settings_from(
    {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}}
)
COMPILE_S = 0.5  # much longer than a stand-in takes


@pytest.fixture
def folder(tmp_path):
    """A folder of two "videos" (their content is not looked at) with a session.toml."""
    folder = tmp_path / "videos"
    folder.mkdir()
    write_session(folder / "session.toml", SETTINGS)
    for name in ("a.avi", "b.avi"):
        (folder / name).write_bytes(name.encode())
    return folder


@pytest.fixture
def out(tmp_path):
    """A results folder, not there yet."""
    return tmp_path / "results"


@pytest.fixture
def calls(monkeypatch):
    """Replace `analyse` by something quick; the list of its calls' file names."""
    calls = []

    def analyse(path, settings, keep=None, progress=None, corrections=None, threads=1):
        calls.append(path.name)
        content = path.read_bytes()
        if content.startswith(b"large"):
            np.empty((10**7, 10**7, 10**4))
        if content.startswith(b"stop"):
            raise KeyboardInterrupt
        if progress:
            progress(Step("following", 10, 10))
        found = quick_analyse(path, settings, corrections=corrections)
        odd = ("beware",) if content.startswith(b"odd") else ()
        return replace(found, messages=(*odd, *found.messages), seconds={"centrelines": 0.5})

    monkeypatch.setattr(pipeline.run, "analyse", analyse)
    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", lambda out: None)
    monkeypatch.setattr(pipeline.reports.report, "write_report", lambda out: [])
    return calls


CORRECTIONS = (
    "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
    "C2,free,2,3,1,5,2026-01-01\n"
)


def correct(folder):
    """Curate a video, all tables made: the stand-in's evidence holds nothing to make them of."""
    (folder / "corrections.csv").write_text(CORRECTIONS)
    digest = corrections_digest(read_corrections(folder))
    run_record.write_state(folder, run_record.read_state(folder) | {MADE_WITH: digest})


def contents(folder):
    """What every file of a folder holds."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def contact_videos(out):
    """The videos that have rows in contacts.csv."""
    return list(files.read_csv(out / "contacts.csv", CONTACT_COLUMNS)["video"])


def change_settings(folder):
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text.replace("5.5", "5.6"))


def statuses(out):
    videos = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)
    return dict(zip(videos["video"], videos["status"], strict=True))


# --- log and pictures ------------------------------------------------------------------------


def test_the_log_says_what_happened(folder, calls, out):
    (folder / "c.avi").write_bytes(b"fault")
    batch.run([folder], out)
    said = [line.split("  ", 1)[1] for line in (out / "run.log").read_text().splitlines()]
    assert said[0].startswith("whiskerforce")
    assert said[2] == "3 inputs, 3 to be processed"
    wanted = ("a: started", "a: done, 10 frames", "c: failed: unexpected", "Traceback",
              "figures: started", "report: started", "ended: 3 videos: 2 done")  # fmt: skip
    places = [next(k for k, line in enumerate(said) if line.startswith(w)) for w in wanted]
    assert places == sorted(places)
    batch.run([folder / "a.avi"], out)
    again = (out / "run.log").read_text().splitlines()
    assert again[len(said) + 2].endswith("1 input, 0 to be processed")


def test_a_figure_that_cannot_be_made_costs_no_table(folder, calls, tmp_path, monkeypatch):
    def fault(out):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", fault)
    out = tmp_path / "results"
    summary = batch.run([folder], out)
    assert summary.problems == ("the figures could not be made (ZeroDivisionError: oops)",)
    assert summary.undrawn
    assert contact_videos(out) == ["a", "b"]
    assert "ZeroDivisionError" in (out / "run.log").read_text()


def test_compiling_is_said_and_is_no_part_of_the_speed(folder, calls, tmp_path, monkeypatch):
    analyse, steps = pipeline.run.analyse, []

    def compiling(path, settings, keep, progress, *other):
        progress(Step("following"))
        compile_times().begin()
        time.sleep(COMPILE_S)
        compile_times().end()
        return analyse(path, settings, keep, progress, *other)

    class Listening(Progress):
        def show(self, event):
            steps.append(self.stage)

    monkeypatch.setattr(pipeline.run, "analyse", compiling)
    (folder / "b.avi").unlink()
    (done,) = batch.run([folder], tmp_path / "out", progress=Listening).outcomes
    assert done.frames / done.frames_per_s < COMPILE_S
    i = steps.index("compiling")
    assert steps[i - 1 : i + 2] == ["following", "compiling", "following"]


def test_stages_come_in_order(folder, calls, tmp_path):
    seen = []

    class Shown(Progress):
        def show(self, event):
            seen.append((self.stage, self.share))

    batch.run([folder], tmp_path / "results", progress=Shown)
    stages = [stage for stage, _ in seen if stage]
    assert list(dict.fromkeys(stages)) == ["following", "tables", "figures", "report"]
    shares = [share for _, share in seen]
    assert shares == sorted(shares)


@pytest.mark.parametrize("quiet", [(), ("--quiet",)])
def test_what_is_to_be_said_of_a_video_is_said_once(folder, calls, tmp_path, capsys, quiet):
    (folder / "a.avi").write_bytes(b"odd")
    command = ["run", str(folder), "--out", str(tmp_path / "results"), "--jobs", "1", *quiet]
    for _ in range(2):  # then of results that are there
        with pytest.raises(SystemExit):
            cli.main(command)
        assert capsys.readouterr().out.count("beware") == 1


def test_values_that_are_still_a_guess_are_said(folder, calls, tmp_path):
    notes = {"recording.pixels_per_mm": "GUESS, measure it", "whisker.length_mm": "GUESS"}
    write_session(folder / "session.toml", SETTINGS, notes)
    for _ in range(2):  # also where there is nothing to be done
        (problem,) = batch.run([folder], tmp_path / "results").problems
        assert problem.startswith(f"{folder / 'session.toml'}: pixels_per_mm: still marked as a")
    write_session(folder / "session.toml", SETTINGS)
    assert batch.run([folder], tmp_path / "results").problems == ()


# --- results ---------------------------------------------------------------------------------


def test_results_folder_is_as_promised(folder, calls, out):
    summary = batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}
    assert (out / "videos.csv").read_text().split("\n")[0] == (
        "video,path,status,frames,frames_per_s,message"
    )
    for name in ("centrelines.parquet", "frames.parquet", "contacts.csv"):
        assert (out / "a" / name).is_file()
    contacts = files.read_csv(out / "contacts.csv", CONTACT_COLUMNS)
    assert list(contacts["video"]) == ["a", "b"]
    assert read_session(out / "session.toml") == SETTINGS
    record = json.loads((out / "run.json").read_text())
    assert record["inputs"]["a"]["sha256"] == content.sha256(folder / "a.avi")
    assert record["inputs"]["a"]["stages"] == {"centrelines": 0.5}
    assert record["version"] == batch.__version__
    assert (summary.skipped, summary.interrupted) == (0, False)
    assert not list(out.rglob("*.part*"))


def test_an_empty_results_folder_among_the_videos_is_no_input(folder, calls, tmp_path):
    (folder / "results").mkdir()
    outcomes = batch.run([folder], folder / "results").outcomes
    assert [(each.video, each.status) for each in outcomes] == [("a", "done"), ("b", "done")]
    for name in ("a.avi", "b.avi"):
        (folder / name).unlink()
    (folder / "later").mkdir()
    with pytest.raises(InputError, match="videos: holds neither videos nor images"):
        batch.run([folder], folder / "later")
    with pytest.raises(InputError, match="holds results, not videos: name the folder of the vid"):
        batch.run([folder / "results"], folder / "later")


@pytest.mark.parametrize("name", ["contacts.csv", "videos.csv"])
def test_a_table_that_a_person_has_changed_is_kept_and_said(folder, calls, out, name):
    batch.run([folder], out)
    table = out / name
    written, edited = table.read_text("utf-8"), table.read_text("utf-8") + "my notes\n"
    table.write_text(edited, "utf-8")
    (said,) = batch.run([folder], out).problems
    assert said.startswith(f"{table} was changed since whiskerforce wrote it: it is kept as")
    assert (out / f"{name}.old").read_text("utf-8") == edited
    assert table.read_text("utf-8") == written
    assert not batch.run([folder], out).problems


@pytest.mark.parametrize("name", ["contacts.csv", "session.toml", "frames.parquet"])
def test_a_videos_table_that_a_person_has_changed_is_kept_and_said(folder, calls, out, name):
    batch.run([folder], out)
    path = out / "a" / name
    written = path.read_bytes()
    path.write_bytes(written + b"# my notes\n")
    summary = batch.run([folder], out, overwrite=True)
    advice = {
        "contacts.csv": "contacts that you change in `whiskerforce curate` stay changed",
        "session.toml": "settings that you change in the session.toml beside the videos hold",
    }.get(name, "take from there what you need")
    said = f"kept as {path}.old; {advice}"
    assert [said in each.message for each in summary.outcomes] == [True, False]
    assert path.with_name(f"{name}.old").read_bytes() == written + b"# my notes\n"
    assert path.read_bytes() == written
    assert not any(each.message for each in batch.run([folder], out).outcomes)


def test_a_report_that_a_person_has_changed_is_kept_and_said(folder, calls, tmp_path, monkeypatch):
    def write_report(out):
        return own_files.replace_own(out / "report.html", lambda new: new.write_text("ours"))

    monkeypatch.setattr(pipeline.reports.report, "write_report", write_report)
    out = tmp_path / "results"
    assert not batch.run([folder], out).problems
    page = out / "report.html"
    page.write_text("my notes")
    (said,) = batch.run([folder], out, overwrite=True).problems
    assert said.startswith(f"{page} was changed since whiskerforce wrote it: it is kept as {page}")
    assert page.with_name("report.html.old").read_text() == "my notes"
    (out / "figures").mkdir(exist_ok=True)
    assert is_drawn(out)  # nothing has failed
    assert not batch.run([folder], out, overwrite=True).problems


def test_an_overlay_that_a_person_has_changed_is_kept_and_said(folder, calls, out, monkeypatch):
    import pipeline.reports.overlay

    def write_overlay(path, folder, settings, progress):
        return own_files.replace_own(folder / "overlay.png", lambda new: new.write_text("drawn"))

    monkeypatch.setattr(pipeline.reports.overlay, "write_overlay", write_overlay)
    batch.run([folder], out, overlay=True)
    drawn = out / "a" / "overlay.png"
    drawn.write_text("a person's arrows")
    os.utime(drawn, ns=(0, 0))  # as if it were older than the tables
    said = batch.run([folder], out, overlay=True).outcomes[0].message
    assert said.startswith(f"{drawn} was changed since whiskerforce wrote it: it is kept as")
    assert drawn.with_name("overlay.png.old").read_text() == "a person's arrows"


def test_of_results_copied_without_hidden_files_only_edited_tables_are_kept(
    folder, calls, tmp_path, monkeypatch
):
    def draw(results):
        with own_files.new_files(results / "figures") as new:
            (new / "fig3.csv").write_text(f"{len(calls)}")
        (results / "figures" / "courses").mkdir(exist_ok=True)
        page = results / "figures" / "courses" / "a.html"
        own_files.replace_own(page, lambda new: new.write_text(f"{len(calls)}"))

    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", draw)
    batch.run([folder], tmp_path / "results")
    out = tmp_path / "copy"
    shutil.copytree(tmp_path / "results", out, ignore=shutil.ignore_patterns(".*"))
    edited = out / "a" / "contacts.csv", out / "contacts.csv"
    for path in edited:
        path.write_text(path.read_text("utf-8") + "my notes\n", "utf-8")
    change_settings(folder)
    (said,) = batch.run([folder], out).problems
    assert said.startswith(f"{edited[1]} was changed since whiskerforce wrote it: it is kept as")
    assert not batch.run([folder], out, overwrite=True).problems
    assert sorted(out.rglob("*.old*")) == [path.with_name("contacts.csv.old") for path in edited]
    assert all(old.read_text("utf-8").endswith("my notes\n") for old in out.rglob("*.old"))
    assert (out / "figures" / "fig3.csv").read_text() == f"{len(calls)}"


@pytest.mark.parametrize("when", ["before", "while"])
def test_an_edited_table_that_is_kept_as_a_killed_run_is_completed_is_said(
    folder, calls, out, monkeypatch, when
):
    batch.run([folder], out)
    table = out / "a" / "contacts.csv"
    table.write_text(table.read_text("utf-8") + "my notes\n", "utf-8")
    with monkeypatch.context() as patch:
        patch.setattr(video_task, "settle", lambda folder: [])  # as if it was killed before
        task = batch.Task(folder / "a.avi", out / "a", SETTINGS, settings_digest(SETTINGS))
        video_task.process_video(task)
    if when == "while":  # the first of two processes of a run was killed
        monkeypatch.setattr(batch, "settle_all", lambda out: [])
    summary = batch.run([folder], out)
    said = [*summary.problems, *(each.message for each in summary.outcomes if each.message)]
    assert len(said) == 1
    assert f"kept as {table}.old" in said[0]


def test_a_row_that_is_deleted_by_hand_is_said_to_be_missing(folder, calls, out):
    batch.run([folder], out)
    table = out / "a" / "contacts.csv"
    table.write_text(table.read_text("utf-8").splitlines()[0] + "\n", "utf-8")
    for _ in range(2):
        (said,) = batch.run([folder], out).problems
        assert said.startswith(f"{table} was changed since whiskerforce wrote it: its rows count")
        assert contact_videos(out) == ["b"]


def test_failures_do_not_stop_the_others(folder, calls, out):
    (folder / "a.avi").write_bytes(b"bad")
    (folder / "c.avi").write_bytes(b"fault")
    (folder / "d.avi").write_bytes(b"odd")
    (folder / "empty").mkdir()
    summary = batch.run([folder], out)
    assert statuses(out) == {
        "a": "failed", "b": "done", "c": "failed", "d": "warning", "empty": "failed",
    }  # fmt: skip
    messages = {each.video: each.message for each in summary.outcomes}
    assert messages["a"] == "frame 3 is broken: record it again"
    assert "ZeroDivisionError: oops" in messages["c"]
    assert "--debug" in messages["c"]
    assert messages["d"] == "beware"
    assert "empty" in messages["empty"]
    assert sorted(p.name for p in out.iterdir() if p.is_dir()) == ["b", "d"]
    assert "\n" not in "".join(messages.values())


def test_paths_in_the_tables_are_whole_also_of_what_fails(folder, calls, tmp_path, monkeypatch):
    (folder / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    summary = batch.run([folder.relative_to(tmp_path)], tmp_path / "results")
    assert all(Path(each.path).is_absolute() for each in summary.outcomes)
    assert not summary.problems


def test_corrections_that_do_not_fit_the_video_are_said_and_kept(folder, calls, out):
    batch.run([folder], out)
    text = CORRECTIONS + "B1,contact,3,4,3,4,\nB1,free,5,6,5,6,\nC2,contact,7,99,7,99,\n"
    (out / "a" / "corrections.csv").write_text(text)
    summary = batch.run([folder], out, overwrite=True)
    assert "corrections, kept by every run: 4 decisions in a" in terminal._results(summary)
    message = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)["message"][0]
    assert "2 of 'B1', which is not a whisker of this video (C2)" in message
    assert "1 reach beyond the video's end (it has 10 frames)" in message
    assert (out / "a" / "corrections.csv").read_text() == text


def test_links_that_lead_back_pipes_and_names_like_formulas(folder, calls, tmp_path, out):
    for name in ("one", "two"):
        (folder / name).symlink_to(folder, target_is_directory=True)
    (folder / "=1+1.avi").write_bytes(b"formula")
    os.mkfifo(folder / "pipe.tif")
    os.mkfifo(folder / "pipe.avi")
    batch.run([folder], out)
    assert statuses(out) == {"_=1+1": "done", "a": "done", "b": "done"}
    (failed,) = batch.run([folder / "pipe.avi"], tmp_path / "other").of("failed")
    assert "is a pipe or a device" in failed.message


def test_an_image_that_claims_a_huge_size_costs_its_folder_only(folder, calls, out):
    (folder / "trial").mkdir()
    chunk = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 0, 0, 0, 0)
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk
    (folder / "trial" / "f1.png").write_bytes(head + struct.pack(">I", zlib.crc32(chunk)))
    (failed,) = batch.run([folder], out).of("failed")
    assert statuses(out) == {"a": "done", "b": "done", "trial": "failed"}
    assert "100000×100000 px: expected at most 34 megapixels" in failed.message


@pytest.mark.parametrize("what", [b"large", b"library"])
def test_too_little_memory_is_no_fault_of_the_program(folder, calls, tmp_path, what):
    (folder / "a.avi").write_bytes(what)
    (failed,) = batch.run([folder], tmp_path / "results").of("failed")
    assert "out of memory" in failed.message
    assert "fewer --jobs" in failed.message
    assert "fault of the program" not in failed.message


def test_broken_corrections_of_a_finished_video_are_said(folder, calls, out):
    batch.run([folder], out)
    (out / "a" / "corrections.csv").write_text(CORRECTIONS.replace("free", "freed"))
    (failed,) = batch.run([folder], out).of("failed")
    assert "verdict is 'freed'" in failed.message
    assert "earlier results kept" in failed.message
    assert contact_videos(out) == ["a", "b"]


def test_what_a_killed_run_left_is_used_or_removed(folder, calls, out):
    (out / "a").mkdir(parents=True)
    (out / ".whiskerforce-x1.part.csv").touch()
    (out / "figures").mkdir()
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}
    assert not list(out.rglob("*.part*"))


def test_figures_are_not_waited_for_after_an_interruption(folder, calls, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", drawn.append)
    (folder / "b.avi").write_bytes(b"stop")
    assert batch.run([folder], tmp_path / "results").interrupted
    assert drawn == []
    (folder / "b.avi").write_bytes(b"b.avi")
    batch.run([folder], tmp_path / "results")
    assert drawn == [tmp_path / "results"]


def test_a_broken_corrections_file_fails_its_video_only(folder, calls, out):
    batch.run([folder], out)
    text = "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
    (out / "a" / "corrections.csv").write_text(text + "C2,free,4,x,4,9,\n")
    summary = batch.run([folder], out, overwrite=True)
    assert statuses(out) == {"a": "failed", "b": "done"}
    message = summary.outcomes[0].message
    assert "corrections.csv: line 2: offset_frame is 'x', expected a whole number" in message
    assert "fault of the program" not in message
    assert (out / "a" / "corrections.csv").exists()


def test_a_video_that_fails_now_keeps_its_results_of_before(folder, calls, out):
    batch.run([folder], out)
    before = contents(out / "a")
    (folder / "a.avi").write_bytes(b"bad")
    for _ in range(2):
        summary = batch.run([folder], out)
        assert statuses(out) == {"a": "failed", "b": "done"}
        assert summary.outcomes[0].message == (
            "frame 3 is broken: record it again; earlier results kept, made of the video before "
            "it changed"
        )
        assert contents(out / "a") == before
        assert contact_videos(out) == ["a", "b"]


def test_a_failed_video_keeps_apart_its_results_of_other_settings(folder, calls, out):
    batch.run([folder], out)
    change_settings(folder)
    text = "whisker,verdict,onset_frame,offset_frame,covers_from,covers_to,saved_at\n"
    (out / "a" / "corrections.csv").write_text(text + "C2,free,4,x,4,9,\n")
    summary = batch.run([folder], out)
    assert statuses(out) == {"a": "failed", "b": "done"}
    assert "earlier results kept, made with other settings" in summary.outcomes[0].message
    assert contact_videos(out) == ["a", "b"]


def test_an_analysis_that_breaks_off_leaves_no_file(folder, calls, tmp_path, monkeypatch):
    def analyse(path, settings, keep, *_):
        raise OSError("disk full")

    monkeypatch.setattr(pipeline.run, "analyse", analyse)
    batch.run([folder / "a.avi"], tmp_path / "results")
    assert not (tmp_path / "results" / "a").exists()
    assert statuses(tmp_path / "results") == {"a": "failed"}


# --- resumption ------------------------------------------------------------------------------


def test_finished_videos_are_skipped(folder, calls, out):
    batch.run([folder], out)
    before = (out / "a" / "contacts.csv").stat().st_mtime_ns
    summary = batch.run([folder], out)
    assert calls == ["a.avi", "b.avi"]
    assert summary.skipped == 2
    assert (out / "a" / "contacts.csv").stat().st_mtime_ns == before
    assert statuses(out) == {"a": "done", "b": "done"}


def test_touching_a_file_is_no_change_but_new_content_is(folder, calls, tmp_path):
    batch.run([folder], tmp_path / "results")
    os.utime(folder / "a.avi", (1, 1))
    batch.run([folder], tmp_path / "results")
    assert calls == ["a.avi", "b.avi"]
    (folder / "a.avi").write_bytes(b"A.avi")
    batch.run([folder], tmp_path / "results")
    assert calls[2:] == ["a.avi"]


def meanwhile(act):
    """A source of videos; `act` is called with each video's path after it has been looked at."""

    def analyse(task, *rest):
        found = batch.VIDEOS.analyse(task, *rest)
        act(task.path)
        return found

    return replace(batch.VIDEOS, analyse=analyse)


def test_a_video_that_changes_while_it_is_read_is_said_and_processed_again(
    folder, calls, tmp_path
):
    def change(path):
        if path.name == "a.avi":
            path.write_bytes(b"A.avi")

    summary = batch.run([folder], tmp_path / "results", source=meanwhile(change))
    (said,) = summary.of("warning")
    assert said.message == "the video was changed or removed while it was read: run it again"
    assert len(batch.run([folder], tmp_path / "results").of("done")) == 2
    assert calls[2:] == ["a.avi"]


def test_a_video_that_is_removed_after_it_was_read_keeps_its_results(folder, calls, out):
    summary = batch.run([folder], out, source=meanwhile(lambda path: path.unlink()))
    assert statuses(out) == {"a": "warning", "b": "warning"}
    assert all(each.frames for each in summary.outcomes)
    assert contact_videos(out) == ["a", "b"]


@pytest.mark.parametrize("has_config", [False, True])
def test_settings_that_are_removed_during_a_run_are_those_it_began_with(
    folder, calls, tmp_path, has_config
):
    mask, session = tmp_path / "mask.png", folder / "session.toml"
    cv2.imwrite(str(mask), np.full((8, 8), 255, np.uint8))
    given = SETTINGS.model_dump(exclude_none=True) | {"image": {"mask": str(mask)}}
    write_session(session, settings_from(given))
    options = {"config": session} if has_config else {}
    before = read_session(session)

    def remove(path):
        for each in (mask, session):
            each.unlink(missing_ok=True)

    batch.run([folder], tmp_path / "results", **options)  # its results are kept where a run fails
    source = meanwhile(remove)
    batch.run([folder], tmp_path / "results", overwrite=True, source=source, **options)
    assert statuses(tmp_path / "results") == {"a": "done", "b": "done"}
    cv2.imwrite(str(mask), np.full((8, 8), 255, np.uint8))
    assert read_session(tmp_path / "results" / "session.toml") == before


def test_same_size_and_date_but_other_content_is_a_change(folder, calls, tmp_path):
    batch.run([folder], tmp_path / "results")
    stat = (folder / "a.avi").stat()
    (folder / "a.avi").write_bytes(b"A.avi")
    os.utime(folder / "a.avi", ns=(stat.st_atime_ns, stat.st_mtime_ns))
    batch.run([folder], tmp_path / "results")
    assert calls[2:] == ["a.avi"]


def test_changed_settings_version_or_overwrite_process_again(folder, calls, out, monkeypatch):
    batch.run([folder], out)
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text("# a comment changes nothing\n" + text)
    batch.run([folder], out)
    assert len(calls) == 2
    (folder / "session.toml").write_text(text.replace("5.5", "5.6"))
    batch.run([folder], out)
    assert len(calls) == 4
    for module in (earlier_results, outcome):
        monkeypatch.setattr(module, "__version__", "99")
    batch.run([folder], out)
    assert len(calls) == 6
    batch.run([folder], out, overwrite=True)
    assert len(calls) == 8


def test_missing_or_unfinished_results_are_made_again(folder, calls, out):
    batch.run([folder], out)
    (out / "a" / "frames.parquet").unlink()
    begun = {"path": str(folder / "b.avi"), "status": "begun"}
    whole_files.write_json(out / "b" / "run.json", begun)
    batch.run([folder], out)
    assert calls[2:] == ["a.avi", "b.avi"]
    assert sorted(p.name for p in out.iterdir() if p.is_dir()) == ["a", "b"]


def test_failed_videos_are_tried_again_and_those_gone_forgotten(folder, calls, out):
    (folder / "a.avi").write_bytes(b"bad")
    batch.run([folder], out)
    batch.run([folder], out)
    assert calls == ["a.avi", "b.avi", "a.avi"]
    (folder / "a.avi").unlink()
    batch.run([folder], out)
    assert statuses(out) == {"b": "done"}


def test_figures_and_report_are_made_anew_only_where_tables_have_changed(
    folder, calls, tmp_path, monkeypatch
):
    out, drawn = tmp_path / "results", []

    def draw(results):
        drawn.append("figures")
        (results / "figures").mkdir(exist_ok=True)

    def write(results):
        drawn.append("report")
        (results / "report.html").touch()
        return []

    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", draw)
    monkeypatch.setattr(pipeline.reports.report, "write_report", write)

    def drawn_by_a_run(**options):
        drawn.clear()
        batch.run([folder], out, **options)
        return drawn == ["figures", "report"]

    assert drawn_by_a_run()
    assert not drawn_by_a_run()
    assert drawn == []
    table = out / "a" / "contacts.csv"
    table.write_text(table.read_text().replace(",2,", ",3,", 1))  # as a curation would
    assert drawn_by_a_run()
    (out / "report.html").unlink()
    assert drawn_by_a_run()
    assert drawn_by_a_run(overwrite=True)
    (folder / "a.avi").unlink()
    assert drawn_by_a_run()
    assert not drawn_by_a_run()
    out = out.rename(tmp_path / "moved")
    assert drawn_by_a_run()


def test_a_moved_or_renamed_video_keeps_its_results(folder, calls, tmp_path, out):
    batch.run([folder], out)
    correct(out / "a")
    (folder / "a.avi").rename(folder / "better_name.avi")
    elsewhere = folder.rename(tmp_path / "archive")
    batch.run([elsewhere], out)
    assert calls == ["a.avi", "b.avi"]
    assert contact_videos(out) == ["b", "a"]
    assert (out / "a" / "corrections.csv").read_text() == CORRECTIONS
    assert run_record.recorded_path(out / "a") == str(elsewhere / "better_name.avi")
    batch.run([elsewhere], out)
    assert len(calls) == 2


def test_videos_that_change_names_take_their_results_with_them(folder, calls, out):
    batch.run([folder], out)
    correct(out / "a")
    for old, new in [("a", "c"), ("b", "a"), ("c", "b")]:
        (folder / f"{old}.avi").rename(folder / f"{new}.avi")
    batch.run([folder], out)
    assert calls == ["a.avi", "b.avi"]
    assert run_record.recorded_path(out / "a") == str(folder / "b.avi")
    assert run_record.recorded_path(out / "b") == str(folder / "a.avi")
    assert (out / "a" / "corrections.csv").read_text() == CORRECTIONS
    batch.run([folder], out)
    assert len(calls) == 2


def test_a_new_video_gets_no_corrections_of_the_one_that_had_its_name(folder, calls, out):
    batch.run([folder], out)
    correct(out / "a")
    (folder / "a.avi").rename(folder / "old.avi")
    (folder / "a.avi").write_bytes(b"recorded later")
    for _ in range(2):
        batch.run([folder], out)
        assert calls == ["a.avi", "b.avi", "a.avi"]
        assert run_record.recorded_path(out / "a") == str(folder / "old.avi")
        assert run_record.recorded_path(out / "a_2") == str(folder / "a.avi")
        assert not (out / "a_2" / "corrections.csv").exists()
        assert statuses(out) == {"a": "done", "a_2": "done", "b": "done"}


def test_a_path_in_other_capitals_is_the_same_video_where_the_disk_says_so(folder, calls, out):
    batch.run([folder / "a.avi"], out)
    correct(out / "a")
    os.link(folder / "a.avi", folder / "A.avi")  # as on a disk that takes both for one
    batch.run([folder / "A.avi"], out)
    assert calls == ["a.avi"]
    assert statuses(out) == {"a": "done"}
    assert run_record.recorded_path(out / "a") == str(folder / "A.avi")
    batch.run([folder], out)  # here they are two
    assert statuses(out) == {"a": "done", "a_2": "done", "b": "done"}
    assert (out / "a" / "corrections.csv").read_text() == CORRECTIONS


def test_names_that_a_disk_may_take_for_one_have_distinct_folders(folder, calls, tmp_path):
    for name in ("\u00e9.avi", "e\u0301.avi"):
        (folder / name).write_bytes(name.encode())
    batch.run([folder], tmp_path / "results")
    assert len(statuses(tmp_path / "results")) == 4
    assert (
        len({unicodedata.normalize("NFC", name) for name in statuses(tmp_path / "results")}) == 4
    )


def test_a_very_long_name_leaves_room_for_those_of_files_made_of_the_video(folder, calls, out):
    for k, name in enumerate([251 * "y", 248 * "y" + "zzz", 83 * "鼠"]):
        (folder / f"{name}.avi").write_bytes(bytes([k]))
    for _ in range(2):
        batch.run([folder], out)
        assert len(calls) == 5
    names = statuses(out)
    for name in names:
        (out / f"{name}.measurements").touch()  # none of them has a longer ending
    assert set(names) == {"a", "b", 230 * "y", f"{230 * 'y'}_2", 76 * "鼠"}


def test_where_a_record_is_lost_no_other_video_gets_the_corrections(folder, calls, tmp_path):
    out, other = tmp_path / "results", tmp_path / "other"
    batch.run([folder], out)
    correct(out / "a")
    (out / "a" / "run.json").unlink()
    shutil.copytree(folder, other)
    folder = folder.rename(tmp_path / "archive")
    (other / "a.avi").write_bytes(b"another session")
    (other / "b.avi").unlink()
    batch.run([other], out)
    assert run_record.recorded_path(out / "a_2") == str(other / "a.avi")
    assert not (out / "a_2" / "corrections.csv").exists()
    batch.run([folder], out)
    assert run_record.recorded_path(out / "a") == str(folder / "a.avi")
    assert statuses(out) == {"a": "done", "a_2": "done", "b": "done"}


def test_corrections_of_a_video_whose_content_has_changed_are_said(folder, calls, out):
    batch.run([folder], out)
    correct(out / "a")
    before = (folder / "a.avi").read_bytes()
    for name in "ab":
        (folder / f"{name}.avi").write_bytes(f"{name}, exported again".encode())
    batch.run([folder], out)
    assert statuses(out) == {"a": "warning", "b": "done"}
    message = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)["message"][0]
    assert message == "corrections.csv was made before the video changed: check its contacts"
    assert (out / "a" / "corrections.csv").read_text() == CORRECTIONS
    change_settings(folder)
    batch.run([folder], out)
    assert statuses(out)["a"] == "warning"  # nobody has looked at its contacts since
    (folder / "a.avi").write_bytes(before)
    batch.run([folder], out)
    assert statuses(out)["a"] == "done"


def name_whiskers(folder, *names):
    """Put whiskers into session.toml."""
    whiskers = [{"name": name} for name in names]
    write_session(
        folder / "session.toml",
        settings_from({"recording": SETTINGS.recording.model_dump(), "whisker": whiskers}),
    )


def test_corrections_made_before_whiskers_changed_their_names_are_said(folder, calls, out):
    name_whiskers(folder, "C1", "C2")
    batch.run([folder], out)
    correct(out / "a")
    name_whiskers(folder, "C2", "C3")  # another whisker is called C2 now
    for _ in range(2):
        batch.run([folder], out)
        assert statuses(out) == {"a": "warning", "b": "done"}
        change_settings(folder)
    message = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)["message"][0]
    assert "made before whiskers were named, added or moved in session.toml: check" in message
    frames = files.read_frames(out / "a" / "frames.parquet")
    contacts = files.read_csv(out / "a" / "contacts.csv", CONTACT_COLUMNS)
    tables = SimpleNamespace(frames=frames, contacts=contacts)
    save_contacts(out / "a", tables, read_corrections(out / "a"))  # a person has looked at them
    change_settings(folder)
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}


def test_corrections_made_since_the_video_changed_are_of_the_new_one(folder, calls, out):
    batch.run([folder], out)
    correct(out / "a")
    (folder / "a.avi").write_bytes(b"a, recorded again")
    batch.run([folder], out)
    frames = files.read_frames(out / "a" / "frames.parquet")
    contacts = files.read_csv(out / "a" / "contacts.csv", CONTACT_COLUMNS)
    tables = SimpleNamespace(frames=frames, contacts=contacts)
    save_contacts(out / "a", tables, read_corrections(out / "a"))
    for _ in range(2):
        batch.run([folder], out)
        assert statuses(out)["a"] == "done"
        change_settings(folder)


def test_tables_made_from_corrections_leave_alone_what_is_being_saved(
    folder, calls, tmp_path, out
):
    """The page saves the next correction while a thread makes the tables of the last one."""
    batch.run([folder], out)
    correct(out / "a")
    frames = files.read_frames(out / "a" / "frames.parquet")
    contacts = files.read_csv(out / "a" / "contacts.csv", CONTACT_COLUMNS)
    with whole_files.whole_file(out / "a" / "corrections.csv") as being_saved:
        save_contacts(
            out / "a",
            SimpleNamespace(frames=frames, contacts=contacts),
            read_corrections(tmp_path),
        )
        assert being_saved.exists()
        being_saved.write_text(CORRECTIONS)
    assert result_exchange.is_settled(out / "a")


def test_a_link_that_leads_nowhere_is_a_video_that_fails(folder, calls, tmp_path):
    (folder / "c.avi").symlink_to(tmp_path / "unplugged" / "c.avi")
    (failed,) = batch.run([folder], tmp_path / "results").of("failed")
    assert failed.video == "c"
    assert failed.message == "is a link to a file that is not there; is a disk missing?"


def test_a_copy_is_a_video_of_its_own_and_is_said(folder, calls, out, capsys):
    batch.run([folder], out)
    for name in ("c", "d"):
        shutil.copy2(folder / "a.avi", folder / f"{name}.avi")
    summary = batch.run([folder], out)
    assert contact_videos(out) == ["a", "b", "c", "d"]
    assert summary.copies == (("a", "c", "d"),)
    with pytest.raises(typer.Exit):
        terminal.finish_run(summary, False, terminal.say_nothing)
    said = "a and c and d are the same video: its contacts count 3 times"
    assert said in capsys.readouterr().out


def test_a_video_that_was_removed_leaves_the_tables_but_not_the_folder(folder, calls, out):
    batch.run([folder], out)
    (folder / "a.avi").unlink()
    summary = batch.run([folder], out)
    assert summary.lost == ("a",)
    assert contact_videos(out) == ["b"]
    assert (out / "a" / "frames.parquet").is_file()


def test_results_stay_in_the_tables_where_a_whole_folder_of_videos_is_gone(
    folder, calls, tmp_path, out
):
    batch.run([folder], out)
    other = shutil.copytree(folder, tmp_path / "day2")
    for name in "ab":
        (other / f"{name}.avi").write_bytes(f"{name} of day 2".encode())
    shutil.rmtree(folder)
    batch.run([other], out)
    assert contact_videos(out) == ["a_2", "b_2", "a", "b"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["frames.parquet", "contacts.csv", "run.json", "session.toml"])
@pytest.mark.parametrize("damage", ["cut", "emptied", "flipped", "replaced"])
def test_damaged_results_are_made_again_and_corrections_stay(folder, calls, out, name, damage):
    change_settings(folder)
    batch.run([folder], out)
    correct(out / "a")
    (out / "run.json").unlink()
    good = (out / "a" / name).read_bytes()
    middle = len(good) // 2
    bad = {
        "cut": good[:middle],
        "emptied": b"",
        "flipped": good[:4] + bytes(255 - b for b in good[4:middle]) + good[middle:],
        "replaced": b"\x00\xff of another program",
    }
    (out / "a" / name).write_bytes(bad[damage])
    summary = batch.run([folder], out)
    assert calls == ["a.avi", "b.avi", "a.avi"]
    if name == "run.json":
        assert [each.status for each in summary.outcomes] == ["done", "done"]
    else:  # it may be a person's work
        assert (out / "a" / f"{name}.old").read_bytes() == bad[damage]
    assert (out / "a" / name).read_bytes() not in bad.values()
    assert (out / "a" / "corrections.csv").read_text() == CORRECTIONS
    assert sorted(p.name for p in out.iterdir() if p.is_dir()) == ["a", "b"]


def test_damaged_results_of_a_video_that_is_not_there_are_said(folder, calls, out):
    batch.run([folder / "a.avi"], out)
    (out / "a" / "contacts.csv").write_text("not,a\ntable,of,contacts\n")
    summary = batch.run([folder / "b.avi"], out)
    assert statuses(out) == {"b": "done", "a": "failed"}
    assert "damaged" in summary.of("failed")[0].message


def test_tables_that_a_person_saved_among_the_results_are_no_video_of_the_run(folder, calls, out):
    batch.run([folder], out)
    run_record.write_saved(shutil.copytree(out / "a", out / "mine"), 9, None)
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}


def test_results_of_other_inputs_stay(folder, calls, tmp_path):
    batch.run([folder / "a.avi"], tmp_path / "results")
    batch.run([folder / "b.avi"], tmp_path / "results")
    assert statuses(tmp_path / "results") == {"a": "done", "b": "done"}
    assert calls == ["a.avi", "b.avi"]


def test_settings_of_one_session_are_not_taken_for_those_of_all(folder, calls, tmp_path):
    out, other, note = (
        tmp_path / "results",
        tmp_path / "other",
        "# Videos differ in their settings",
    )
    batch.run([folder / "a.avi"], out)
    batch.run([folder / "b.avi"], out)
    assert note not in (out / "session.toml").read_text()
    shutil.copytree(folder, other)
    (other / "a.avi").write_bytes(b"another session")
    change_settings(other)
    summary = batch.run([other / "a.avi"], out)
    assert (out / "session.toml").read_text().startswith(note)
    assert not summary.problems
    assert read_session(out / "session.toml").analysis.curvature_at_mm == 5.6


def test_results_of_settings_that_have_changed_since_are_said(folder, calls, out):
    batch.run([folder / "a.avi"], out)
    change_settings(folder)
    (said,) = batch.run([folder / "b.avi"], out).problems
    assert said.startswith("a was made with other settings than session.toml has now")
    assert not batch.run([folder], out).problems


@pytest.mark.parametrize("there", ["the settings beside the video", "no settings", "no video"])
def test_results_of_other_settings_are_right_where_these_are_their_own(
    folder, calls, out, tmp_path, there
):
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    change_settings(other)
    batch.run([other / "a.avi"], out)
    if there != "the settings beside the video":
        (other / {"no settings": "session.toml", "no video": "a.avi"}[there]).unlink()
    assert not batch.run([folder / "b.avi"], out).problems


def test_results_made_with_this_runs_settings_are_right(folder, calls, out, tmp_path):
    config = shutil.copy(folder / "session.toml", tmp_path / "mine.toml")
    change_settings(folder)
    for name in ("a.avi", "b.avi"):
        assert not batch.run([folder / name], out, config=config).problems


def test_interruption_keeps_what_is_finished(folder, calls, out):
    (folder / "b.avi").write_bytes(b"stop")
    summary = batch.run([folder], out)
    assert summary.interrupted
    assert statuses(out) == {"a": "done"}
    assert not (out / "b").exists()
    (folder / "b.avi").write_bytes(b"b.avi")
    batch.run([folder], out)
    assert calls == ["a.avi", "b.avi", "b.avi"]
    assert statuses(out) == {"a": "done", "b": "done"}


def test_interruption_of_a_second_run_loses_nothing(folder, calls, out):
    """Curate, change a setting, run, Ctrl-C, run again."""
    (folder / "c.avi").write_bytes(b"c.avi")
    batch.run([folder], out)
    for name in "abc":
        correct(out / name)
    change_settings(folder)
    before = {name: contents(out / name) for name in "abc"}
    (folder / "b.avi").write_bytes(b"stop")
    summary = batch.run([folder], out)
    assert summary.interrupted
    assert statuses(out) == {"a": "done", "b": "warning", "c": "warning"}
    assert contact_videos(out) == ["a", "b", "c"]
    for each in summary.outcomes[1:]:
        assert each.message == (
            "interrupted before new results were made; earlier results kept, made with other "
            "settings"
        )
        assert contents(out / each.video) == before[each.video]
    assert read_session(out / "a" / "session.toml").analysis.curvature_at_mm == 5.6
    (folder / "b.avi").write_bytes(b"b.avi")
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done", "c": "done"}
    assert sorted(p.name for p in out.iterdir() if p.is_dir()) == ["a", "b", "c"]
    for name in "abc":
        assert (out / name / "corrections.csv").read_text() == CORRECTIONS


def test_results_count_as_made_also_where_the_clock_was_set_back(folder, calls, tmp_path):
    batch.run([folder], tmp_path / "results")
    own = tmp_path / "results" / "a"
    later = video_task.written(own) + 10**9
    task = video_task.Task(folder / "a.avi", own, SETTINGS, "", earlier=later)
    assert video_task.interrupted_outcome(task).status == "done"


def test_a_second_run_in_the_same_folder_is_refused(folder, calls, out):
    batch.run([folder], out)
    before = contents(out)
    with locked(out), pytest.raises(InputError, match=r"results: another whiskerforce .*process"):
        batch.run([folder], out, overwrite=True)
    assert calls == ["a.avi", "b.avi"]
    assert contents(out) == {**before, LOCK_FILE: contents(out)[LOCK_FILE]}


@pytest.mark.slow
def test_a_killed_process_costs_only_its_video(folder, calls, out, monkeypatch):
    batch.run([folder / "a.avi"], out)
    (folder / "c.avi").write_bytes(b"c.avi")
    with monkeypatch.context() as patch:
        patch.setattr(batch, "process_video", killed)
        summary = batch.run([folder], out, jobs=2)
    assert statuses(out) == {"a": "done", "b": "failed", "c": "failed"}
    assert all("ended unexpectedly (9)" in each.message for each in summary.of("failed"))
    assert sorted(p.name for p in out.iterdir() if p.is_dir()) == ["a"]
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done", "c": "done"}
    assert calls == ["a.avi", "b.avi", "c.avi"]


def test_overlay_alone_does_not_analyse_again(folder, calls, out, monkeypatch):
    import pipeline.reports.overlay

    drawn = []

    def write_overlay(path, folder, settings, progress):
        drawn.append(path.name)
        (folder / "overlay.mp4").touch()
        return []

    monkeypatch.setattr(pipeline.reports.overlay, "write_overlay", write_overlay)
    batch.run([folder], out)
    for _ in range(2):
        batch.run([folder], out, overlay=True)
    assert calls == ["a.avi", "b.avi"]
    assert drawn == ["a.avi", "b.avi"]


@pytest.mark.parametrize("first", [False, True])
def test_a_fault_of_the_overlay_costs_no_table(folder, calls, out, monkeypatch, first):
    import pipeline.reports.overlay

    def write_overlay(path, folder, settings, progress):
        if path.name == "a.avi":
            raise OSError("disk full")
        (folder / "overlay.mp4").touch()
        return []

    monkeypatch.setattr(pipeline.reports.overlay, "write_overlay", write_overlay)
    if not first:
        batch.run([folder], out)
    summary = batch.run([folder], out, overlay=True)
    assert statuses(out) == {"a": "warning", "b": "done"}
    assert summary.outcomes[0].message == (
        "the overlay could not be drawn (OSError: disk full); all tables are there"
    )
    assert contact_videos(out) == ["a", "b"]
    assert not list((out / "a").glob("overlay*"))
    assert (out / "b" / "overlay.mp4").exists()
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}
    assert calls == ["a.avi", "b.avi"]


def test_an_overlay_of_before_goes_with_its_tables(folder, calls, out):
    batch.run([folder], out)
    (out / "a" / "overlay.mp4").touch()
    batch.run([folder], out, overwrite=True)
    assert not (out / "a" / "overlay.mp4").exists()


@pytest.mark.parametrize("broken", ["mkdtemp", "rename", "replace"])
def test_a_folder_that_cannot_be_written_costs_its_video_only(
    folder, calls, out, monkeypatch, broken
):
    batch.run([folder], out)
    change_settings(folder)
    before = contents(out / "a")
    del before[RECORD]
    owners = {"mkdtemp": tempfile, "rename": pathlib.Path, "replace": result_exchange.os}
    original = getattr(owners[broken], broken)

    def refuse(*args, **kwargs):
        if str(out / "a") in f"{args} {kwargs}" and ".part" not in f"{args}":
            raise PermissionError(13, "Permission denied")
        return original(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(owners[broken], broken, refuse)
        summary = batch.run([folder], out)
        assert statuses(out) == {"a": "failed", "b": "done"}
        assert "Permission denied" in summary.outcomes[0].message
        kept = contents(out / "a")
        assert {k: v for k, v in kept.items() if "/" not in k and k != RECORD} == before
        assert contact_videos(out) == (["b"] if broken == "replace" else ["a", "b"])
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}
    assert calls.count("a.avi") == (3 if broken == "rename" else 2)


# --- inputs and their settings ---------------------------------------------------------------


def test_equal_stems_get_distinct_folders_and_keep_them(folder, calls, tmp_path, out):
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    (folder / "A.mp4").write_bytes(b"A.mp4")
    (folder / "figures.avi").write_bytes(b"figures")
    batch.run([folder, other], out)
    record = json.loads((out / "run.json").read_text())["inputs"]
    assert len({name.casefold() for name in record}) == 6
    assert record["figures_2"]["path"] == str(folder / "figures.avi")
    batch.run([other, folder], out)
    again = json.loads((out / "run.json").read_text())["inputs"]
    assert {n: v["path"] for n, v in again.items()} == {n: v["path"] for n, v in record.items()}
    assert len(calls) == 6


NAMES = {
    "...avi": "video", "....avi": "video_2", "..avi": "video_3", ".. .avi": "video_4",
    "videos.csv.avi": "videos.csv_2", "run.json.avi": "run.json_2", "Figures.avi": "Figures_2",
    "session.toml.avi": "session.toml_2", "report.html.avi": "report.html_2",
    "contacts.csv.avi": "contacts.csv_2", "a\nb.avi": "a_b", "a\\b.avi": "a_b_2",
}  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="has no such names")
def test_no_name_leads_out_of_the_results_or_onto_their_files(folder, calls, tmp_path):
    around = tmp_path / "around"
    shutil.copytree(folder, around)
    paths = [around / name for name in NAMES]
    for path in paths:
        path.write_bytes(path.name.encode())
    before = contents(around)
    for _ in range(2):
        summary = batch.run(paths, around / "results")
        names = {each.path: each.video for each in summary.outcomes}
        assert names == {str(around / name): folder for name, folder in NAMES.items()}
        assert set(statuses(around / "results").values()) == {"done"}
        kept = {k: v for k, v in contents(around).items() if not k.startswith("results/")}
        assert kept == before
    assert len(calls) == len(NAMES)


@pytest.mark.parametrize("name", ["..", ".", "../..", "videos.csv", "x/y", ""])
def test_a_folder_recorded_in_an_unsafe_place_is_not_used(folder, calls, tmp_path, name):
    out = tmp_path / "around" / "results"
    out.mkdir(parents=True)
    record = {"inputs": {name: {"path": str(folder / "a.avi")}}}
    whole_files.write_json(out / "run.json", record)
    (out / "run.log").touch()
    batch.run([folder], out)
    assert statuses(out) == {"a": "done", "b": "done"}
    assert [p.name for p in out.parent.iterdir()] == ["results"]


def test_a_folder_in_the_place_of_a_table_is_refused(folder, calls, tmp_path):
    (tmp_path / "results" / "videos.csv").mkdir(parents=True)
    with pytest.raises(InputError, match=r"results: videos.csv in it is a folder; move it away"):
        batch.run([folder], tmp_path / "results")
    assert calls == []


def test_a_name_that_a_file_has_is_not_used(folder, calls, tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "a").write_text("notes")
    batch.run([folder], tmp_path / "results")
    assert statuses(tmp_path / "results") == {"a_2": "done", "b": "done"}


def test_an_input_named_twice_is_processed_once(folder, calls, tmp_path):
    batch.run([folder, folder / "a.avi", folder / ".." / "videos"], tmp_path / "results")
    assert calls == ["a.avi", "b.avi"]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="has no such names")
def test_a_name_that_is_no_text_is_refused_and_costs_no_other(folder, calls, tmp_path):
    path = os.fsencode(folder) + b"/w\xff.avi"
    with open(path, "wb") as file:
        file.write(b"w.avi")
    batch.run([folder], tmp_path / "results")
    assert statuses(tmp_path / "results") == {"a": "done", "b": "done", "w?": "failed"}
    assert calls == ["a.avi", "b.avi"]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are Unicode there")
def test_a_results_folder_whose_name_is_not_text_is_refused(folder, calls, tmp_path):
    with pytest.raises(InputError, match=r"^--out .*w\?: its path is not text"):
        batch.run([folder], tmp_path / os.fsdecode(b"w\xff"))
    assert not calls


def test_results_among_the_videos_are_no_input(folder, calls):
    batch.run([folder], folder)
    text = (folder / "session.toml").read_text()
    (folder / "figures").mkdir()
    (folder / "figures" / "fig3.png").touch()
    (folder / "a" / "overlay.mp4").touch()
    batch.run([folder], folder)
    batch.run([folder], folder, config=folder / "session.toml")
    assert calls == ["a.avi", "b.avi"]
    assert statuses(folder) == {"a": "done", "b": "done"}
    assert (folder / "session.toml").read_text() == text


@pytest.mark.parametrize("has_config", [False, True])
def test_settings_beside_the_videos_stay_as_a_person_wrote_them(
    folder, calls, tmp_path, has_config
):
    text = "# measured with callipers\n" + (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text)
    config = tmp_path / "other.toml"
    write_session(config, SETTINGS)
    batch.run([folder], folder, config=config if has_config else None)
    assert (folder / "session.toml").read_text() == text
    assert (folder / "a" / "session.toml").is_file()


@pytest.mark.parametrize("name", [".trash", "truth", "figures", "out"])
def test_some_folders_are_not_searched(folder, calls, name):
    (folder / name / "more").mkdir(parents=True)
    shutil.copy(folder / "a.avi", folder / name / "more" / "hidden.avi")
    (folder / "day 2").mkdir()
    shutil.copy(folder / "a.avi", folder / "day 2" / "found.avi")
    batch.run([folder], folder / "out")
    assert sorted(calls) == ["a.avi", "b.avi", "found.avi"]


@pytest.fixture
def closed(folder, monkeypatch):
    """A folder among the videos that may not be read, as lost+found on a disk of one's own."""
    closed = folder / "closed"
    closed.mkdir()

    def is_inside(path):
        return not isinstance(path, int) and closed in Path(os.fsdecode(path)).parents

    def refuse(name, is_refused):
        real = getattr(os, name)

        def refusing(path=".", *args, **how):
            if is_refused(path):
                raise PermissionError(13, "Permission denied", str(path))
            return real(path, *args, **how)

        monkeypatch.setattr(os, name, refusing)

    refuse("stat", is_inside)
    for name in ("listdir", "scandir"):
        refuse(name, lambda path: path == closed or is_inside(path))
    access = os.access
    monkeypatch.setattr(os, "access", lambda path, *how: path != closed and access(path, *how))
    return closed


@pytest.mark.parametrize("times", [1, 2])
def test_a_folder_that_may_not_be_read_stops_no_other_video(
    folder, calls, tmp_path, closed, times
):
    for _ in range(times):
        summary = batch.run([folder], tmp_path / "results")
    assert statuses(tmp_path / "results") == {"a": "done", "b": "done", "closed": "failed"}
    (failed,) = summary.of("failed")
    assert "may not be read: change its permissions" in failed.message


def test_results_may_lie_in_the_folder_of_other_results(folder, calls):
    batch.run([folder], folder / "results")
    (folder / "other").mkdir()
    (folder / "other" / "run.json").write_text("[]")  # of another program
    batch.run([folder], folder)
    assert statuses(folder) == {"a": "done", "b": "done"}


def test_subfolders_with_settings_of_their_own(folder, calls, out):
    mouse = folder / "mouse2"
    mouse.mkdir()
    (mouse / "c.avi").write_bytes(b"c.avi")
    other = settings_from({"recording": {**SETTINGS.recording.model_dump(), "face": "right"}})
    write_session(mouse / "session.toml", other)
    batch.run([folder], out)
    assert read_session(out / "a" / "session.toml") == SETTINGS
    assert read_session(out / "c" / "session.toml") == other
    assert "differ" in (out / "session.toml").read_text()


def test_settings_of_the_folder_above_count(folder, calls, tmp_path):
    (folder / "day1").mkdir()
    (folder / "day1" / "c.avi").write_bytes(b"c.avi")
    batch.run([folder], tmp_path / "results")
    assert statuses(tmp_path / "results") == {"a": "done", "b": "done", "c": "done"}


def test_settings_beside_a_link_count_and_else_those_where_it_leads(folder, calls, tmp_path):
    links = tmp_path / "links"
    links.mkdir()
    (links / "a.avi").symlink_to(folder / "a.avi")
    (there,) = inputs.find_inputs([links])
    assert session_of(there) == folder / "session.toml"
    other = settings_from({"recording": {**SETTINGS.recording.model_dump(), "face": "top"}})
    write_session(links / "session.toml", other)
    batch.run([links], tmp_path / "results")
    assert read_session(tmp_path / "results" / "session.toml") == other


def test_files_of_a_person_in_the_results_folder_are_not_replaced(folder, calls, tmp_path):
    for name in ("contacts.csv", "report.html", "figures/fig3.png"):
        out = tmp_path / Path(name).name
        (out / name).parent.mkdir(parents=True)
        (out / name).write_text("a person's")
        with pytest.raises(InputError, match=f"{name}, which no run .* move it away"):
            batch.run([folder], out)
        assert contents(out) == {name: b"a person's"}
    assert not calls


def test_settings_that_a_person_changed_among_the_results_are_kept(folder, calls, out):
    batch.run([folder], out)
    written = (out / "session.toml").read_text()
    assert not batch.run([folder], out).problems
    (out / "session.toml").write_text(written + "# mine")
    (said,) = batch.run([folder], out).problems
    assert said.endswith(f"it is kept as {out / 'session.toml.old'}")
    assert (out / "session.toml.old").read_text() == written + "# mine"
    assert (out / "session.toml").read_text() == written
    change_settings(folder)
    assert not batch.run([folder], out).problems
    (out / "session.toml").write_text("also mine")
    batch.run([folder], out)
    assert (out / "session.toml.old2").read_text() == "also mine"


def test_config_wins_over_the_file_beside_the_videos(folder, calls, tmp_path):
    config = tmp_path / "other.toml"
    other = settings_from({"recording": {**SETTINGS.recording.model_dump(), "face": "top"}})
    write_session(config, other)
    batch.run([folder], tmp_path / "results", config=config)
    assert read_session(tmp_path / "results" / "session.toml") == other


@pytest.mark.parametrize("name", ["session.toml.txt", "Session.TOML"])
def test_settings_with_nearly_the_right_name_are_pointed_out(folder, calls, tmp_path, name):
    (folder / "session.toml").rename(folder / name)
    if (folder / "session.toml").is_file():
        pytest.skip("capitals and small letters are the same on this disk")
    with pytest.raises(InputError, match=f"no session.toml in .*, but {name}: rename it to sess"):
        batch.run([folder], tmp_path / "results")


def test_settings_above_the_folder_that_is_run_are_pointed_out(folder, calls, out):
    day = folder / "day 1"
    day.mkdir()
    shutil.copy(folder / "a.avi", day)
    with pytest.raises(
        InputError, match=r"no session.toml in .*day 1, beside the video"
    ) as caught:
        batch.run([day], out)
    assert f"that in {folder} holds for them where that folder is run" in str(caught.value)
    assert f"--config {folder / 'session.toml'}" in str(caught.value)


def test_unusable_arguments_stop_before_anything_is_processed(folder, calls, tmp_path, out):
    with pytest.raises(InputError, match=r"no such file or folder: .*nowhere"):
        batch.run([folder, tmp_path / "nowhere"], out)
    (folder / "session.toml").unlink()
    with pytest.raises(InputError, match=r"no session.toml in .*videos.*--config.*init") as caught:
        batch.run([folder], out)
    assert str(caught.value).count("no session.toml") == 1
    (folder / "session.toml").write_text("[recording]\nface = 3\n")
    with pytest.raises(InputError, match="frames_per_second"):
        batch.run([folder], out)
    (tmp_path / "file").touch()
    write_session(folder / "session.toml", SETTINGS)
    with pytest.raises(InputError, match=r"--out .*file"):
        batch.run([folder], tmp_path / "file")
    assert calls == []
    assert not out.exists()
