"""`whiskerforce import` and `export` as a user calls them."""

import pandas as pd
import pytest
from tracked_files import write_tracked

from pipeline.app.cli import main
from synthetic.presets import make_trial

FEWEST_CONTACTS_IN_300_FRAMES = 3


def run(*arguments):
    """Exit status of the command."""
    with pytest.raises(SystemExit) as left:
        main([str(a) for a in arguments])
    return left.value.code


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracked")
    write_tracked(folder, make_trial("noisy", 0, 0, 300).motion)
    return folder


@pytest.fixture(scope="module")
def results(tracked, tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    assert run("import", "janelia", tracked, "--out", out, "--jobs", 1) == 0
    return out


def test_a_tracked_folder_becomes_results(results):
    contacts = pd.read_csv(results / "contacts.csv")
    assert len(contacts) >= FEWEST_CONTACTS_IN_300_FRAMES
    assert (contacts["peak_force_uN"] > 0).all()
    frames = pd.read_parquet(results / "trial" / "frames.parquet")
    assert len(frames) == 300
    assert frames["tracked"].all()
    for name in ("report.html", "figures/fig3.png", "trial/centrelines.parquet", "run.json"):
        assert (results / name).is_file()


def test_janelia_files_there_and_back(results, tmp_path, capsys):
    assert run("export", "janelia", results, "--out", tmp_path) == 0
    said = capsys.readouterr().out.split()
    assert said == [str(tmp_path / f"trial.{s}") for s in ("whiskers", "measurements", "bar")]


def test_a_damaged_file_fails_by_itself(tracked, tmp_path, capsys):
    for path in tracked.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "cut.whiskers").write_bytes((tracked / "trial.whiskers").read_bytes()[:999])
    (tmp_path / "cut.measurements").write_bytes((tracked / "trial.measurements").read_bytes())
    out = tmp_path / "results"
    assert run("import", "janelia", tmp_path / "cut.whiskers", "--out", out) == 1
    assert "cut.whiskers: is cut off or damaged" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("import", "janelia", "nowhere", "--out", "o"), "no such file or folder: nowhere"),
        (("import", "janelia", ".", "--out", "o"), "no .whiskers file in it"),
        (("export", "janelia", ".", "--out", "o"), "no videos.csv in it"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments) == 2
    said = capsys.readouterr().err.strip()
    assert message in said
    assert len(said.splitlines()) == 1
