"""`whiskerforce import` and `export` as a user calls them."""

import shutil

import h5py
import numpy as np
import pandas as pd
import pytest
import traced_motion
from tracked_files import settings_of, write_tracked

from pipeline.app.cli import main
from pipeline.convert.keypoints import points_along
from pipeline.session.session_file import write_session
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


@pytest.mark.slow
def test_a_tracked_folder_becomes_results(results):
    contacts = pd.read_csv(results / "contacts.csv")
    assert len(contacts) >= FEWEST_CONTACTS_IN_300_FRAMES
    assert (contacts["peak_force_uN"] > 0).all()
    frames = pd.read_parquet(results / "trial" / "frames.parquet")
    assert len(frames) == 300
    assert frames["tracked"].all()
    for name in ("report.html", "figures/fig3.png", "trial/centrelines.parquet", "run.json"):
        assert (results / name).is_file()


def test_without_settings_it_does_not_advise_to_look_at_videos_that_are_not_there(
    tmp_path, capsys
):
    (tmp_path / "trial.whiskers").write_bytes(b"")
    assert run("import", "janelia", tmp_path, "--out", tmp_path / "out", "--jobs", 1) == 2
    said = capsys.readouterr().err
    assert "no session.toml" in said
    assert "--config" in said
    assert "init" not in said


@pytest.mark.slow
def test_janelia_files_there_and_back(results, tmp_path, capsys):
    assert run("export", "janelia", results, "--out", tmp_path) == 0
    said = capsys.readouterr().out.split()
    assert said == [str(tmp_path / f"trial.{s}") for s in ("whiskers", "measurements", "bar")]


@pytest.mark.slow
def test_the_trackers_own_files_stay_as_they_are(results, tmp_path, capsys):
    (tmp_path / "trial.measurements").write_text("the tracker's")
    assert run("export", "janelia", results, "--out", tmp_path) == 2
    assert "trial.measurements: would be replaced" in capsys.readouterr().err
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["trial.measurements"]
    assert (tmp_path / "trial.measurements").read_text() == "the tracker's"


@pytest.mark.slow
@pytest.mark.parametrize(("program", "file"), [("mat", "trial_WL.mat"), ("whacc", "whacc.h5")])
def test_a_video_with_damaged_tables_is_left_out_of_an_export(
    results, tmp_path, capsys, program, file
):
    folder, out = shutil.copytree(results, tmp_path / "results"), tmp_path / "out"
    shutil.copytree(folder / "trial", folder / "bad")
    (folder / "bad" / "frames.parquet").write_bytes(b"damaged")
    videos = pd.read_csv(folder / "videos.csv")
    pd.concat([videos.assign(video="bad"), videos]).to_csv(folder / "videos.csv", index=False)
    assert run("export", program, folder, "--out", out) == 1
    left_out, written = capsys.readouterr().out.splitlines()  # each said when its turn comes
    assert left_out.startswith(f"left out: bad: {folder / 'bad' / 'frames.parquet'}: damaged")
    assert written == str(out / file)


def test_a_damaged_file_fails_by_itself(tracked, tmp_path, capsys):
    for path in tracked.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / "cut.whiskers").write_bytes((tracked / "trial.whiskers").read_bytes()[:999])
    (tmp_path / "cut.measurements").write_bytes((tracked / "trial.measurements").read_bytes())
    out = tmp_path / "results"
    assert run("import", "janelia", tmp_path / "cut.whiskers", "--out", out) == 1
    printed = capsys.readouterr().out.splitlines()
    (said,) = [line for line in printed if line.startswith("failed: cut")]
    assert f"{out.parent / 'cut.whiskers'}): is cut off or damaged" in said
    assert said.count("cut.whiskers") == 1


@pytest.mark.parametrize(
    ("program", "name"), [("janelia", "a.whiskers"), ("dlc", "a.csv"), ("sleap", "a.h5")]
)
def test_an_empty_file_says_so(session, tmp_path, capsys, program, name):
    (session / name).write_bytes(b"")
    assert run("import", program, session / name, "--out", tmp_path / "out") == 1
    assert f"failed: a ({session / name}): the file is empty; copy" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("import", "janelia", "nowhere", "--out", "o"), "no such file or folder: nowhere"),
        (("import", "janelia", ".", "--out", "o"), "files called NAME.whiskers"),
        (("import", "whacc", "..", "--out", "o"), "a folder, not a file; name WhACC's HDF5 file"),
        (("export", "janelia", ".", "--out", "o"), "results of `whiskerforce run`"),
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


@pytest.mark.parametrize("out", ["note.txt", "note.txt/in/it"])
def test_a_file_in_place_of_the_folder_is_refused_before_any_work(tmp_path, capsys, out):
    (tmp_path / "note.txt").write_text("a person's")
    assert run("calibrate", "geometry", "no.png", "--out", tmp_path / out) == 2
    expected = f"--out {tmp_path / out}: {tmp_path / 'note.txt'} is a file, not a folder; choose"
    assert expected in capsys.readouterr().err


def test_one_name_for_two_whiskers_is_unusable(session, tmp_path, capsys):
    (session / "trial.whiskers").write_bytes(b"")
    out = tmp_path / "out"
    assert run("import", "janelia", session, "--out", out, "--names", "C2, C2") == 2
    assert "--names: C2 is there twice; give each" in capsys.readouterr().err


def test_names_that_no_whisker_of_the_session_has_are_unusable(session, tmp_path, capsys):
    (session / "trial.whiskers").write_bytes(b"")
    out = tmp_path / "out"
    assert run("import", "janelia", session, "--out", out, "--names", "C2,C9") == 2
    said = capsys.readouterr().err
    assert "--names: session.toml has no [[whisker]] table for C9, but for C2" in said
    assert not out.exists()


# --- every other format through the command ---------------------------------------------


def true_points(motion, rng):
    """Ten noisy points along every true line."""
    lines = traced_motion.trace_lines(motion, rng, 0.001)
    xy = np.stack([points_along(lines.row(i), 10) for i in range(len(lines))])
    return xy + rng.normal(0, 0.3, xy.shape)


@pytest.fixture(scope="module")
def motion():
    return make_trial("noisy", 0, 0, 300).motion


@pytest.fixture
def session(tmp_path, motion):
    """A folder with the motion's session.toml, the pole in it."""
    x, y = motion.scene.to_pixels(motion.pole_x[:1], motion.pole_y[:1])
    settings = settings_of(motion)
    place = {"x_px": float(x[0]), "y_px": float(y[0])}
    pole = settings.pole.model_copy(update=place)
    folder = tmp_path / "session"
    folder.mkdir()
    write_session(folder / "session.toml", settings.model_copy(update={"pole": pole}))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("program", ["dlc", "sleap"])
@pytest.mark.usefixtures("nothing_is_drawn")
def test_key_points_become_results(session, motion, tmp_path, program):
    xy = true_points(motion, np.random.default_rng(0))
    if program == "dlc":
        path = session / "trialDLC_resnet50.csv"
        columns = {
            ("DLC", f"C2_{p}", c): xy[:, p, "xy".index(c)] if c in "xy" else np.ones(len(xy))
            for p in range(10)
            for c in ("x", "y", "likelihood")
        }
        table = pd.DataFrame(columns)
        table.columns = table.columns.set_names(["scorer", "bodyparts", "coords"])
        table.to_csv(path)
    else:
        path = session / "trial.analysis.csv"
        places = {f"C2_{p}.{c}": xy[:, p, i] for p in range(10) for i, c in enumerate("xy")}
        pd.DataFrame({"track": "", "frame_idx": range(len(xy)), **places}).to_csv(
            path, index=False
        )
    out = tmp_path / "out"
    assert run("import", program, session, "--out", out, "--jobs", 1) == 0
    contacts = pd.read_csv(out / "contacts.csv")
    assert len(contacts) >= FEWEST_CONTACTS_IN_300_FRAMES - 1
    frames = pd.read_parquet(out / path.stem / "frames.parquet")
    assert frames["tracked"].all()
    assert len(frames) == 300


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("mat", "trial_WL.mat"),
        ("nwb", "trial.nwb"),
        ("movement", "trial.nc"),
        ("whacc", "whacc.h5"),
    ],
)
def test_every_format_is_written(results, tmp_path, capsys, form, name):
    assert run("export", form, results, "--out", tmp_path / "new" / "folder") == 0
    written = tmp_path / "new" / "folder" / name
    assert capsys.readouterr().out.split() == [str(written)]
    assert written.stat().st_size > 1000


@pytest.mark.slow
def test_nwb_refers_to_the_video_from_where_it_lies(results, tmp_path):
    folder, video = tmp_path / "new" / "folder", tmp_path / "films" / "trial.avi"
    shutil.copytree(results, tmp_path / "results")
    video.parent.mkdir()
    video.write_bytes(b"")
    table = pd.read_csv(tmp_path / "results" / "videos.csv")
    table.assign(path=str(video)).to_csv(tmp_path / "results" / "videos.csv", index=False)
    assert run("export", "nwb", tmp_path / "results", "--out", folder) == 0
    with h5py.File(folder / "trial.nwb") as file:
        (path,) = file["acquisition/video/external_file"].asstr()[:]
    assert (folder / path).resolve() == video


@pytest.mark.slow
def test_contacts_of_whacc_take_the_place_of_those_found(results, tmp_path):
    out = tmp_path / "results"
    shutil.copytree(results, out)
    before = pd.read_csv(out / "contacts.csv")
    with h5py.File(tmp_path / "w.h5", "w") as file:
        labels = np.zeros(300)
        first = before.iloc[0]
        labels[first["onset_frame"] + 1 : first["offset_frame"]] = 1
        file["labels"], file["frame_nums"] = labels, [300]
        file["full_file_names"] = [b"C:\\videos\\trial.mp4"]
    assert run("import", "whacc", tmp_path / "w.h5", "--out", out) == 0
    (after,) = pd.read_csv(out / "contacts.csv").to_dict("records")
    assert after["onset_frame"] == first["onset_frame"] + 1
    assert after["offset_frame"] == first["offset_frame"]
    assert after["curated"]
    assert after["peak_force_uN"] == pytest.approx(first["peak_force_uN"], rel=0.05)
    table = (out / "contacts.csv").read_bytes()
    assert run("import", "whacc", tmp_path / "w.h5", "--out", out) == 0  # what is there stays
    assert (out / "contacts.csv").read_bytes() == table
