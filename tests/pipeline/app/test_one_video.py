"""Videos as jobs of a cluster: what `run` gathers is what `run` alone would have made."""

import importlib
import importlib.util
import re
import subprocess
import sys

import pytest
from cluster import ENVIRONMENT, ROOT, compare, snakemake
from quick_analysis import quick_analyse

import pipeline.reports.figures
import pipeline.reports.report
import pipeline.run
from pipeline.app import batch, one_video
from pipeline.errors import InputError
from pipeline.runtime.folder_lock import locked
from pipeline.session.inputs import find_inputs
from pipeline.session.session_file import settings_from, write_session

SETTINGS = {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}}
VIDEOS = {"x/a.avi": b"a", "x/b.avi": b"bad", "y/a.avi": b"another", "y/c.avi": b"fault"}


@pytest.fixture
def videos(tmp_path, monkeypatch):
    """A folder of "videos", two of one name, one that is damaged, and one that hits a bug."""
    monkeypatch.setattr(pipeline.run, "analyse", quick_analyse)
    monkeypatch.setattr(pipeline.reports.figures, "write_fig3", lambda out: None)
    monkeypatch.setattr(pipeline.reports.report, "write_report", lambda out: [])
    folder = tmp_path / "videos"
    for name, content in VIDEOS.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    write_session(folder / "session.toml", settings_from(SETTINGS))
    return folder


def do_jobs(videos, out, order=1) -> dict:
    """Exit status of each video's job, by the name of its results."""
    session = videos / "session.toml"
    names = one_video.planned_names(find_inputs([videos], out), out)
    found = {}
    for path, name in list(names.items())[::order]:
        arguments = [str(path), "--out", str(out), "--name", name, "--config", str(session)]
        found[name] = one_video.main(arguments)
    return found


@pytest.mark.parametrize("order", [1, -1])
def test_jobs_in_any_order_and_a_run_that_gathers_make_the_results_of_a_run(
    videos, tmp_path, order
):
    plain, gathered = tmp_path / "plain", tmp_path / "gathered"
    batch.run([videos], plain)
    gathered.mkdir()
    status = do_jobs(videos, gathered, order)
    assert status == {"a": 0, "b": 1, "a_2": 0, "c": 1}
    summary = batch.run([videos], gathered)
    assert summary.skipped == 2
    rows, differ = compare(plain, gathered)
    assert differ == []
    assert dict((kind, total) for kind, total, _ in rows)["<video>/frames.parquet"] == 2


def test_a_finished_video_is_not_processed_again(videos, tmp_path, monkeypatch):
    do_jobs(videos, tmp_path / "out")
    monkeypatch.setattr(pipeline.run, "analyse", None)
    session = ["--config", str(videos / "session.toml")]
    out = ["--out", str(tmp_path / "out"), "--name", "a"]
    assert one_video.main([str(videos / "x/a.avi"), *out, *session]) == 0


def test_names_stay_when_a_job_has_begun_another_folder(videos, tmp_path):
    out, inputs = tmp_path / "out", find_inputs([videos])
    before = one_video.planned_names(inputs, out)
    (out / "a_2").mkdir()  # as a job does that is at work
    assert one_video.planned_names(inputs, out) == before


def test_jobs_that_begin_together_have_distinct_folders(videos, tmp_path, monkeypatch):
    out, jobs = tmp_path / "out", []
    names_of = one_video.results_folders

    def names(*args, **options):
        with pytest.raises(InputError), locked(out / one_video.JOBS):
            pass  # so no other job reads the plan before it is written
        return names_of(*args, **options)

    monkeypatch.setattr(one_video, "results_folders", names)
    out.mkdir()
    for path in ("x/a.avi", "y/a.avi"):  # neither has begun to write
        jobs += one_video.planned_names(find_inputs([videos / path]), out).values()
    assert jobs == ["a", "a_2"]


def test_two_jobs_of_one_video_do_not_meet(videos, tmp_path):
    job = one_video.job_folder(tmp_path, "a")
    job.mkdir(parents=True)
    with locked(job), pytest.raises(InputError, match="another whiskerforce"):
        one_video.process(videos / "x/a.avi", tmp_path, "a", videos / "session.toml")


def test_unusable_arguments_and_lack_of_memory_have_their_own_status(videos, tmp_path, capsys):
    out = ["--out", str(tmp_path)]
    assert one_video.main([str(videos / "none.avi"), *out]) == 2
    assert "no such file" in capsys.readouterr().err
    assert one_video.main([str(videos), *out]) == 2
    assert "holds 4 videos" in capsys.readouterr().err
    (videos / "x/d.avi").write_bytes(b"large")
    session = ["--config", str(videos / "session.toml")]
    assert one_video.main([str(videos / "x/d.avi"), *out, *session]) == 3


def test_all_that_the_snakefile_imports_is_there():
    """Where Snakemake is not installed, too."""
    text = (ROOT / "workflows" / "Snakefile").read_text("utf-8")
    imports = re.findall(r"^from (pipeline\S*) import (.+)$", text, re.MULTILINE)
    assert len(imports) == text.count("\nfrom pipeline")
    for module, names in imports:
        for name in names.split(", "):
            assert hasattr(importlib.import_module(module), name), (module, name)


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("snakemake") is None, reason="the extra `cluster` is not installed"
)
def test_snakemake_plans_a_job_per_video(videos, tmp_path):
    """`workflows/cluster.py` runs them, too."""
    command = snakemake(videos, tmp_path / "out", "slurm", "--dry-run", "--printshellcmds")
    planned = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=ENVIRONMENT, timeout=240
    )
    said = planned.stdout + planned.stderr
    assert planned.returncode == 0, said
    assert said.count("rule video:") == len(VIDEOS)
    assert said.count("rule gather:") == 1
    assert "mem_mb=2000" in said
    assert sys.executable in said
