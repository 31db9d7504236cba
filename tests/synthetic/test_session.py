"""Rendered sessions on disk: files, truth tables, settings, resumption; every preset."""

import errno

import cv2
import numpy as np
import pandas as pd
import pytest

import synthetic.session
from pipeline.runtime.workers import Event
from pipeline.session.session_file import read_session
from pipeline.tables.centrelines import read_centrelines
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS
from pipeline.tables.files import read_frames
from pipeline.tables.whole_files import read_json
from synthetic.paper_session import mouse_whisker
from synthetic.presets import PRESETS, find_preset, make_trial, trial_place
from synthetic.render import Renderer
from synthetic.session import STAGES, RenderError, render_session
from synthetic.truth import centreline_table, contact_table, frame_table, pole_distance
from whiskermodel.pulse_response import half_gaussian_extremes
from whiskermodel.response import Response
from whiskermodel.rod import contact_shape

pytestmark = pytest.mark.slow

FRAMES = 130


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session")
    seen = []
    paths = render_session(
        folder, "single", seed=3, trials=1, frames=FRAMES, progress=lambda *a: seen.append(a)
    )
    events = [event for (event,) in seen]
    assert events[-1] == Event("done", 0, paths[0])
    stages = [event.value.stage for event in events if event.kind == "progress"]
    assert list(dict.fromkeys(stages)) == ["motion", "drawing"]
    return folder, paths[0]


def test_files_of_a_session(session):
    folder, video = session
    files = [path for path in folder.rglob("[!.]*") if path.is_file()]
    assert sorted(path.relative_to(folder).as_posix() for path in files) == [
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


def test_settings_are_those_of_the_scene(session):
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


def test_visibility_is_what_can_be_seen(session):
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


def test_vibration_of_half_gaussians_is_that_of_the_closed_form():
    trial = make_trial("noisy", 0, 0, 200)
    contacts = contact_table(trial.motion, "v")
    good = contacts[contacts.pulse_r2 > 0.9999]
    steady, most, least = 1e9 * half_gaussian_extremes(
        Response(trial.scene.hairs[0].whisker),
        1e-3 * good.contact_arc_length_mm.to_numpy(),
        1e-6 * good.pulse_peak_uN.to_numpy(),
        1e-3 * good.pulse_duration_ms.to_numpy(),
        ringing=25e-3,
    )
    for i, row in enumerate(good.itertuples()):
        up = row.peak_base_moment_nN_m > 0
        expected = (-steady[i], -least[i], -most[i]) if up else (steady[i], most[i], least[i])
        found = row.steady_peak_nN_m, row.vibration_max_nN_m, row.vibration_min_nN_m
        assert found == pytest.approx(expected, rel=0.01)
        assert row.vibration_ratio == pytest.approx(
            max(abs(most[i]), abs(least[i])) / abs(steady[i]), rel=0.01
        )
    assert contacts.vibration_ratio.notna().all()


def test_pole_distance_is_the_least_of_all_points():
    motion = make_trial("near_miss", 0, 0, 60).motion
    hair = motion.scene.hairs[0]
    s = np.linspace(0, hair.whisker.length, 20001)
    x, y, _ = contact_shape(hair.whisker, motion.hairs[0].contact, s)
    gap = np.hypot(x - motion.pole_x[:, None], y - motion.pole_y[:, None])
    expected = (gap - hair.whisker.radius(s)).min(1) - motion.scene.pole.radius
    assert pole_distance(motion, 0) == pytest.approx(expected, abs=0.1e-6)  # m


def test_a_trial_that_fails_does_not_stop_the_others(tmp_path, monkeypatch):
    made = synthetic.session.make_trial

    def make(preset, seed, trial, frames):
        if trial == 1:
            raise ValueError("the whisker slips off")
        return made(preset, seed, trial, frames)

    monkeypatch.setattr(synthetic.session, "make_trial", make)
    with pytest.raises(RenderError, match=r"1 of 3 .* trial 1: ValueError: the whisker slips off"):
        render_session(tmp_path, "single", trials=3, frames=20)
    assert sorted(p.name for p in tmp_path.glob("*.avi")) == ["single_000.avi", "single_002.avi"]
    monkeypatch.undo()
    kept = (tmp_path / "single_002.avi").stat().st_mtime_ns
    assert len(render_session(tmp_path, "single", trials=3, frames=20)) == 3
    assert (tmp_path / "single_002.avi").stat().st_mtime_ns == kept
    times = read_json(tmp_path / "truth" / "single_001" / "scene.json")["seconds"]
    assert set(times) == set(STAGES)
    assert all(seconds >= 0 for seconds in times.values())


def test_a_full_disk_is_named_with_what_to_do(tmp_path, monkeypatch):
    def fill(path, *content):
        raise OSError(errno.ENOSPC, "", str(path))

    monkeypatch.setattr(synthetic.session, "write_truth", fill)
    with pytest.raises(RenderError, match=r"trial 0: .*single_000: No space left .*; make room"):
        render_session(tmp_path, "single", trials=1, frames=20)


def test_settings_that_a_person_edited_stay(tmp_path):
    render_session(tmp_path, "single", trials=1, frames=20)
    settings = tmp_path / "session.toml"
    edited = f"# mine\n{settings.read_text()}"
    settings.write_text(edited)
    render_session(tmp_path, "single", trials=2, frames=20)
    assert settings.read_text() == edited
    with pytest.raises(RenderError, match=r"session.toml: would be replaced"):
        render_session(tmp_path, "single", trials=1, frames=21)
    assert settings.read_text() == edited


def test_videos_do_not_depend_on_jobs_or_order(tmp_path):
    places = [tmp_path / name for name in ("one", "two")]
    for place, jobs in zip(places, (1, 2), strict=True):
        render_session(place, "moving_pole", seed=5, trials=2, frames=20, jobs=jobs)
    for name in ("moving_pole_000.avi", "truth/moving_pole_001/centrelines.parquet"):
        one, two = ((place / name).read_bytes() for place in places)
        assert one == two


def test_slip_ends_a_contact_and_is_flagged():
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
    without = {
        "crossing", "dense_row", "orientation", "near_miss", "free", "border", "passing",
        "mouse_face_on_top", "rat_both_sides",
    }  # fmt: skip
    assert (touched == 0) == (preset in without)
    if preset not in ("slip_off", "ringdown"):
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
