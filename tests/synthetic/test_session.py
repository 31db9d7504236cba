"""Rendered sessions on disk: files, truth tables, settings, resumption; every preset."""

import cv2
import numpy as np
import pandas as pd
import pytest

from pipeline.records import CONTACT_COLUMNS, FRAME_COLUMNS
from pipeline.settings import read_session
from pipeline.tables import read_centrelines, read_frames
from synthetic.presets import PRESETS, find_preset, make_trial, mouse_whisker, trial_place
from synthetic.render import Renderer
from synthetic.session import render_session
from synthetic.truth import centreline_table, contact_table, frame_table, pole_distance

FRAMES = 130


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    seen = []
    paths = render_session(
        folder, "single", seed=3, trials=1, frames=FRAMES, progress=lambda *a: seen.append(a)
    )
    assert seen == [(1, 1, paths[0])]
    return folder, paths[0]


def test_files_of_a_session(session):
    folder, video = session
    assert sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()) == [
        "session.toml",
        "single_000.avi",
        "truth/contacts.csv",
        "truth/single_000/centrelines.parquet",
        "truth/single_000/contacts.csv",
        "truth/single_000/frames.parquet",
        "truth/single_000/scene.json",
        "truth/single_000/visibility.parquet",
    ]
    capture = cv2.VideoCapture(str(video))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == FRAMES


def test_settings_tell_the_scene(session):
    settings = read_session(session[0] / "session.toml")
    scene = make_trial("single", 3, 0, FRAMES).scene
    assert settings.recording.pixels_per_mm == scene.camera.pixels_per_mm
    assert settings.recording.face == scene.face.side
    whisker = settings.whisker[0].si()
    assert whisker.length == pytest.approx(scene.hairs[0].whisker.length)
    assert whisker.base_radius == pytest.approx(scene.hairs[0].whisker.base_radius)
    assert settings.whisker[0].hidden_length == pytest.approx(1.4e-3, abs=0.4e-3)


def test_truth_tables_have_the_results_columns(session):
    truth = session[0] / "truth" / "single_000"
    frames, lines = (
        read_frames(truth / "frames.parquet"),
        read_centrelines(truth / "centrelines.parquet"),
    )
    assert list(frames) == [c.name for c in FRAME_COLUMNS]
    assert len(frames) == len(lines) == FRAMES
    contacts = pd.read_csv(truth / "contacts.csv")
    assert list(contacts) == [c.name for c in CONTACT_COLUMNS]
    spacing = np.hypot(*np.diff(lines.row(5), axis=0).T)
    assert spacing == pytest.approx(1.0, abs=0.01)  # px
    assert lines.row(5)[0] == pytest.approx(
        frames.loc[5, ["follicle_x_px", "follicle_y_px"]].to_numpy(float), abs=1e-3
    )


def test_visibility_tells_what_can_be_seen(session):
    table = pd.read_parquet(session[0] / "truth" / "single_000" / "visibility.parquet")
    lines = read_centrelines(session[0] / "truth" / "single_000" / "centrelines.parquet")
    assert table.first_visible_mm.std() < 0.15  # mm: nearly constant over the motion
    contrast = table.contrast[10]
    assert len(contrast) == len(lines.row(10))
    assert contrast[5] < 5  # in the face
    assert 80 < contrast[int(5.5 * 25)] < 120
    assert contrast[-1] < 15


def test_rerun_makes_nothing_again_and_another_seed_does(session, tmp_path):
    folder, video = session
    before = video.stat().st_mtime_ns
    assert render_session(folder, "single", seed=3, trials=1, frames=FRAMES) == [video]
    assert video.stat().st_mtime_ns == before
    render_session(tmp_path, "single", seed=3, trials=1, frames=20)
    first = (tmp_path / "single_000.avi").read_bytes()
    render_session(tmp_path, "single", seed=4, trials=1, frames=20)
    assert (tmp_path / "single_000.avi").read_bytes() != first


def test_video_holds_the_rendered_frames(session):
    trial = make_trial("single", 3, 0, FRAMES)
    renderer = Renderer(trial.scene, trial.motion, seed=3000)
    _, picture = cv2.VideoCapture(str(session[1])).read()
    assert np.array_equal(picture[..., 0], renderer.frame(0))


def test_contacts_are_the_stretches_with_force():
    trial = make_trial("single", 0, 1, 200)
    frames, contacts = frame_table(trial.motion), contact_table(trial.motion, "v")
    force = frames.contact_force_uN.to_numpy()
    covered = np.zeros(len(frames), bool)
    assert len(contacts) >= 3
    for row in contacts.itertuples():
        part = slice(row.onset_frame, row.offset_frame)
        covered[part] = True
        assert row.peak_force_uN == pytest.approx(force[part].max())
        assert row.impulse_uN_ms == pytest.approx(force[part].sum())  # frames of 1 ms
        assert row.duration_ms == row.offset_frame - row.onset_frame
    assert np.array_equal(covered, force > 0)
    assert np.array_equal(covered, frames.in_contact)
    assert np.all(frames.pole_distance_mm[covered] == 0)
    assert np.all(frames.pole_distance_mm[~covered] > 0)


def test_half_gaussian_touches_are_fitted_as_such():
    trial = make_trial("noisy", 0, 0, 200)
    contacts = contact_table(trial.motion, "v")
    good = contacts[contacts.pulse_r2 > 0.9999]
    assert len(good) >= 2
    assert good.pulse_duration_ms.to_numpy() == pytest.approx(
        good.duration_ms.to_numpy(), rel=0.02
    )


def test_slip_ends_a_contact_and_is_told():
    motion = make_trial("slip_off", 0, 0, 400).motion
    contacts = contact_table(motion, "v")
    assert contacts.slip.any()
    for offset in contacts.offset_frame[contacts.slip]:
        assert offset in motion.hairs[0].slips


def test_a_whisker_that_passes_the_pole_overlaps_it_without_touching():
    motion = make_trial("passing", 0, 0, 300).motion
    assert contact_table(motion, "v").empty
    assert pole_distance(motion, 0).min() < 0


@pytest.mark.parametrize("preset", sorted(PRESETS))
def test_every_preset_makes_a_trial_that_can_be_drawn(preset):
    trial = make_trial(preset, 1, 1, FRAMES)
    assert (trial.group, trial.stem) == trial_place(preset, 1, 1)
    picture = Renderer(trial.scene, trial.motion).frame(len(trial.motion) // 2)
    assert picture.shape == (trial.scene.camera.height, trial.scene.camera.width)
    lines = centreline_table(trial.motion)
    assert len(lines) == len(trial.motion) * len(trial.scene.hairs)
    touched = sum(h.contact.touching.any() for h in trial.motion.hairs)
    without = {"crossing", "orientation", "near_miss", "free", "border", "passing"}
    assert (touched == 0) == (preset in without)
    if preset != "slip_off":
        assert all(h.slips == () for h in trial.motion.hairs)


def test_near_misses_are_near():
    motion = make_trial("near_miss", 0, 0, 400).motion
    distance = pole_distance(motion, 0)
    nearest = distance[1:-1][(distance[1:-1] < distance[:-2]) & (distance[1:-1] < distance[2:])]
    assert 0.01e-3 < nearest.min() < 0.2e-3


def test_mice_differ_as_published():
    mice = [mouse_whisker(mouse, 0) for mouse in range(5)]
    lengths, radii = np.array([(m.length, m.base_radius) for m in mice]).T
    assert [lengths.mean(), lengths.std(ddof=1)] == pytest.approx([18.26e-3, 0.44e-3], rel=1e-6)
    assert [radii.mean(), radii.std(ddof=1)] == pytest.approx([37.3e-6, 1.0e-6], rel=1e-6)
    assert mice[0].radius(mice[0].length) == pytest.approx(2.8e-6)


def test_bad_arguments_are_named(tmp_path):
    with pytest.raises(ValueError, match="preset must be one of single"):
        find_preset("nothing")
    with pytest.raises(ValueError, match="trials must be at least 1, got 0"):
        render_session(tmp_path, trials=0)
