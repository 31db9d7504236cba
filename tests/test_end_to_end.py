"""The whole way, from a video on disk to tables that agree with the truth."""

import contextlib
import io
import shutil

import cv2
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from quick_codec import quick_to_read

from pipeline import analyse, read_session
from pipeline.app import cli, demo
from pipeline.session.session_file import write_session
from pipeline.tables import centrelines, files, whole_files
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS
from synthetic.encode import write_video
from synthetic.scene import Codec

pytestmark = pytest.mark.e2e

EDGE_FRAMES = 1  # of onset and offset
FORCE = 0.05  # relative, of the peak force
FORCE_UN = 0.5  # or this much
POLE_PX = 0.5  # of its centre
FIRST_SHAPES_PX = 0.15  # root mean square over the visible whisker


def exit_code(*arguments) -> int:
    with pytest.raises(SystemExit) as caught:
        cli.main([str(a) for a in arguments])
    return caught.value.code or 0


def truth_of(rendered, name):
    (folder,) = (p for p in (rendered / "truth").iterdir() if p.is_dir())
    return folder / name


@pytest.fixture(scope="module")
def results(rendered, tmp_path_factory):
    """The rendered session, run by the command with overlay."""
    out = tmp_path_factory.mktemp("results")
    assert exit_code("run", rendered, "--out", out, "--overlay") == 0
    return out


def test_contacts_are_the_true_ones(results, rendered):
    found = files.read_csv(results / "contacts.csv", CONTACT_COLUMNS)
    true = files.read_csv(truth_of(rendered, "contacts.csv"), CONTACT_COLUMNS)
    assert len(true) >= 2
    assert len(found) == len(true)
    for edge in ("onset_frame", "offset_frame"):
        np.testing.assert_allclose(found[edge], true[edge], atol=EDGE_FRAMES)
    off = (found["peak_force_uN"] - true["peak_force_uN"]).abs()
    assert (off <= np.maximum(FORCE * true["peak_force_uN"], FORCE_UN)).all()
    np.testing.assert_allclose(
        found["peak_base_moment_nN_m"], true["peak_base_moment_nN_m"], rtol=2 * FORCE
    )
    assert (found["pulse_r2"] > 0.9).all()


def test_centrelines_lie_on_the_true_ones(results, rendered, video):
    found = centrelines.read_centrelines(results / video.stem / "centrelines.parquet")
    true = centrelines.read_centrelines(truth_of(rendered, "centrelines.parquet"))
    assert len(found) == len(true)
    squares = []
    for i in range(0, len(found), 10):
        points, line = found.row(i), true.row(i)
        # distance of each found point to the true line, which is sampled every pixel
        to = points[:, None] - line[None, :-1]
        along = np.diff(line, axis=0)
        t = np.clip((to * along).sum(-1) / (along**2).sum(-1), 0, 1)
        distance = np.linalg.norm(to - t[..., None] * along, axis=-1).min(axis=1)
        squares.append(distance[:-20] ** 2)
    assert np.sqrt(np.mean(np.concatenate(squares))) < FIRST_SHAPES_PX


def test_every_promised_file_is_there(results, video):
    for name in (
        "contacts.csv", "videos.csv", "session.toml", "run.json", "report.html",
        "figures/fig3.png", "figures/fig3.svg", "figures/fig3.csv",
        f"{video.stem}/centrelines.parquet", f"{video.stem}/frames.parquet",
        f"{video.stem}/contacts.csv", f"{video.stem}/overlay.mp4",
    ):  # fmt: skip
        assert (results / name).stat().st_size > 0, name
    assert not list(results.rglob("*.part*"))
    videos = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    assert list(videos["status"]) == ["done"]
    assert videos["path"][0] == str(video)


def test_a_row_per_whisker_and_frame(results, video, rendered):
    frames = pq.read_table(results / video.stem / "frames.parquet").to_pandas()
    true = files.read_frames(truth_of(rendered, "frames.parquet"))
    assert list(frames["frame"]) == list(range(len(true)))
    np.testing.assert_allclose(frames["time_s"], frames["frame"] / 1000)
    assert frames["tracked"].all()
    free = ~frames["in_contact"]
    assert (frames.loc[free, "contact_force_uN"] == 0).all()
    assert (frames["curvature_per_m_se"] > 0).all()


def test_overlay_is_a_video_of_all_frames(results, video):
    capture = cv2.VideoCapture(str(results / video.stem / "overlay.mp4"))
    count, colourful = 0, 0
    while True:
        good, picture = capture.read()
        if not good:
            break
        count += 1
        colourful += (picture.max(axis=2) - picture.min(axis=2)).max() > 60
    assert count == len(files.read_frames(results / video.stem / "frames.parquet"))
    assert colourful == count


def test_analyse_in_python_gives_the_same_tables(results, rendered, video):
    analysis = analyse(video, read_session(rendered / "session.toml"))
    written = files.read_csv(results / "contacts.csv", CONTACT_COLUMNS)
    np.testing.assert_allclose(
        analysis.contacts["peak_force_uN"], written["peak_force_uN"], rtol=1e-5
    )
    assert analysis.messages == ()
    assert set(analysis.seconds) >= {"scene", "decoding", "centrelines", "contacts"}


@pytest.mark.usefixtures("nothing_is_drawn")
def test_without_dimensions_there_is_everything_but_forces(rendered, video, tmp_path):
    settings = read_session(rendered / "session.toml")
    write_session(tmp_path / "bare.toml", settings.model_copy(update={"whisker": ()}))
    out = tmp_path / "out"
    assert exit_code("run", video, "--out", out, "--config", tmp_path / "bare.toml") == 0
    frames = files.read_frames(out / video.stem / "frames.parquet")
    assert frames["tracked"].mean() > 0.95
    assert frames["curvature_per_m"].notna().mean() > 0.9
    assert frames["contact_force_uN"].isna().all()
    videos = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)
    assert "no forces" in videos["message"][0]
    contacts = files.read_csv(out / "contacts.csv", CONTACT_COLUMNS)
    assert contacts["peak_force_uN"].isna().all()


def first_frames(video, n):
    capture = cv2.VideoCapture(str(video))
    return [capture.read()[1][..., 0] for _ in range(n)]


@pytest.fixture(scope="module")
def mixed(rendered, tmp_path_factory):
    """Good videos among bad ones, run with two processes: (their folder, results, words)."""
    folder, out = tmp_path_factory.mktemp("mixed"), tmp_path_factory.mktemp("mixed results")
    video = next(rendered.glob("*.avi"))
    shutil.copy(rendered / "session.toml", folder)
    frames = first_frames(video, 80)
    (folder / "broken.avi").write_bytes(video.read_bytes()[:3000])
    (folder / "text.avi").write_text("This is not a video, whatever its name says.\n" * 50)
    (folder / "empty").mkdir()
    jpegs = [cv2.imencode(".jpg", f)[1].tobytes() for f in frames[:6]]
    jpegs += [cv2.imencode(".jpg", f[:400])[1].tobytes() for f in frames[:6]]
    (folder / "sizes.mjpeg").write_bytes(b"".join(jpegs))
    grey = np.random.default_rng(0).normal(200, 2, (20, 480, 640))
    with quick_to_read():
        write_video(folder / "bare.avi", grey.astype(np.uint8), Codec("ffv1"))
        write_video(folder / "one.avi", frames[:1], Codec("ffv1"))
        write_video(folder / "good.avi", frames, Codec("ffv1"))
    shutil.copy(folder / "good.avi", folder / "again.avi")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert exit_code("run", folder, "--out", out, "--jobs", 2) == 1
    return folder, out, said.getvalue()


def test_bad_inputs_get_their_message_and_the_others_are_processed(mixed):
    _, out, said = mixed
    videos = files.read_csv(out / "videos.csv", VIDEO_COLUMNS)
    videos = videos.set_index("video")
    assert dict(videos["status"]) == {
        "again": "done", "bare": "warning", "broken": "failed", "empty": "failed",
        "good": "done", "one": "warning", "sizes": "warning", "text": "failed",
    }  # fmt: skip
    for name, words in {
        "bare": "no whisker", "empty": "empty folder", "one": "one frame",
        "sizes": "640×400 px, the frames before it are 640×480", "text": "video", "broken": "",
    }.items():  # fmt: skip
        assert words in videos.loc[name, "message"]
        assert len(videos.loc[name, "message"]) > 15
        assert "Traceback" not in videos.loc[name, "message"]
        assert "fault of the program" not in videos.loc[name, "message"]
    assert videos.loc["sizes", "frames"] == 6  # those before the size changes
    for name in ("bare", "one", "good", "sizes"):
        assert (out / name / "frames.parquet").is_file()
    last = said.strip().split("\n")[-3:]
    assert [line.split()[:2] for line in last] == [
        ["failed:", name] for name in ("broken", "empty", "text")
    ]


@pytest.mark.usefixtures("nothing_is_drawn")
def test_two_processes_come_to_the_same(mixed, tmp_path):
    folder, out, _ = mixed
    assert exit_code("run", folder / "good.avi", "--out", tmp_path, "--jobs", 1) == 0
    one = files.read_csv(tmp_path / "good" / "contacts.csv", CONTACT_COLUMNS)
    assert len(one) >= 2
    for name in ("good", "again"):
        here = files.read_csv(out / name / "contacts.csv", CONTACT_COLUMNS)
        assert set(here["video"]) == {name}
        pd.testing.assert_frame_equal(
            here.drop(columns="video"), one.drop(columns="video"), check_exact=True
        )


@pytest.mark.usefixtures("nothing_is_drawn")
def test_init_then_run(rendered, video, tmp_path, capsys):
    folder = tmp_path / "mine"
    folder.mkdir()
    shutil.copy(video, folder)
    assert exit_code("init", folder) == 0
    settings = read_session(folder / "session.toml")
    assert settings.recording.face == "left"
    assert settings.recording.pixels_per_mm == pytest.approx(25, rel=0.05)
    assert len(settings.whisker) == 1
    pole = whole_files.read_json(truth_of(rendered, "scene.json"))["pole"]
    true = 25_000 * pole["x"], -25_000 * pole["y"]
    np.testing.assert_allclose(settings.pole.position_px, true, atol=POLE_PX)
    text = (folder / "session.toml").read_text("utf-8")
    assert text.count("GUESS") >= 3
    picture = cv2.imread(str(folder / "session_preview.png"))
    assert np.ptp(picture.astype(int), axis=2).max() > 100  # something is drawn in colour
    assert exit_code("run", folder, "--out", tmp_path / "out") == 0
    frames = files.read_frames(tmp_path / "out" / video.stem / "frames.parquet")
    assert frames["tracked"].mean() > 0.95
    corrected = text.replace('name = "w1"', 'name = "C2"')
    (folder / "session.toml").write_text(corrected, "utf-8")
    (folder / "session_preview.png").unlink()
    capsys.readouterr()
    assert exit_code("init", folder) == 0  # shows what the corrected settings find
    said = capsys.readouterr().out
    assert "--overwrite" in said
    assert "1 whisker (C2)" in said
    assert (folder / "session.toml").read_text("utf-8") == corrected
    preview = folder / "session_preview.png"
    assert cv2.imread(str(preview)) is not None
    preview.write_bytes(preview.read_bytes() + b"a person's arrow")
    assert exit_code("init", folder, "--overwrite") == 0
    assert (folder / "session.toml").read_text("utf-8") == text
    assert (folder / "session.toml.old").read_text("utf-8") == corrected
    said = capsys.readouterr().out
    assert "session.toml.old" in said
    assert f"it is kept as {preview}.old" in said
    kept = preview.with_name(f"{preview.name}.old")
    assert kept.read_bytes().endswith(b"a person's arrow")


def test_demo_prints_contacts_beside_the_truth(rendered, tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "render", lambda folder, *_: shutil.copytree(rendered, folder))
    said = []
    failed = demo.run_demo(tmp_path / "demo", 1, None, said.append)
    assert not failed
    text = "\n".join(said)
    true = files.read_csv(truth_of(rendered, "contacts.csv"), CONTACT_COLUMNS)
    assert f"{len(true)} of {len(true)} contacts found" in text
    assert "0 invented" in text
    for force in true["peak_force_uN"]:
        assert f"{force:.2f}" in text
    assert str(tmp_path / "demo" / "results" / "report.html") in text


def test_demo_says_why_all_videos_failed(rendered, tmp_path, monkeypatch):
    def no_memory(*given, **how):
        raise MemoryError

    monkeypatch.setattr(demo, "render", lambda folder, *_: shutil.copytree(rendered, folder))
    monkeypatch.setattr("pipeline.run.analyse", no_memory)
    said = []
    assert demo.run_demo(tmp_path / "demo", 1, None, said.append)
    assert any("failed: " in line and "out of memory" in line for line in said)
    assert not any("report.html" in line or "fig3.png" in line for line in said)
