"""Which round dark things give no scale, and what a first session.toml says."""

import errno
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from pipeline.app import init
from pipeline.app.init import (
    POLE_DIAMETER_MM,
    Look,
    _is_passed_over,
    _scene_and_scale,
    _unlike,
    by_view,
    called_apart,
    findings,
    init_folder,
    look_at,
)
from pipeline.detection.static_scene import PoleTrack, StaticScene
from pipeline.errors import InputError
from pipeline.scene.preparation import prepare_video
from pipeline.session.session_file import session_text, settings_from
from pipeline.tables import whole_files
from pipeline.video.open import open_video

SHAPE = (240, 320)
RADIUS = 7.0  # px
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
DISC = np.hypot(COLUMNS - 200, ROWS - 90) < RADIUS


def scene(dark, face_to=150):
    """A face at the left, a round thing at (200, 90), and other dark things."""
    face = COLUMNS < face_to
    background = np.where(dark | DISC | face, 10.0, 180.0).astype(np.float32)
    pole = PoleTrack(np.array([200.0]), np.array([90.0]), RADIUS)
    return StaticScene(background, 0.02, 1.0, face, dark | DISC, pole, "left")


def test_a_speck_that_a_whisker_passes_over_gives_none():
    plain = scene(np.zeros(SHAPE, bool))
    frames = []
    for shift in (0, 30):  # px, from across the speck's middle to beside it
        line = (np.abs(ROWS - 90 - shift) < 1.5) & (COLUMNS < 260)
        frames.append(np.tile(np.where(line, 0.5, 1.0) * plain.background, (4, 1, 1)))
    across, beside = (np.rint(each).astype(np.uint8) for each in frames)
    assert _is_passed_over(plain, across)
    assert not _is_passed_over(plain, beside)


def test_the_scale_is_from_the_disc_most_similar_to_a_pole():
    """Not from the first: where hairs cross, there is something small and round, but paler."""
    where, radius = (230, 150), 9.0  # px
    picture = np.where(COLUMNS < 60, 10.0, 180.0)
    picture[np.hypot(COLUMNS - where[0], ROWS - where[1]) < radius] = 10.0
    picture[np.hypot(COLUMNS - 150, ROWS - 60) < 3] *= 0.3
    noisy = cv2.GaussianBlur(picture, (0, 0), 0.8) + np.random.default_rng(0).normal(
        0, 1.5, (24, *SHAPE)
    )
    with open_video(np.rint(noisy).astype(np.uint8)) as video:
        scene, scale = _scene_and_scale(prepare_video(video))
    assert (scene.pole.x_px[0], scene.pole.y_px[0]) == pytest.approx(where, abs=0.2)
    assert scale * POLE_DIAMETER_MM == pytest.approx(2 * radius, abs=0.5)


@pytest.mark.parametrize(("light", "found"), [(0.02, True), (0.2, False)])
def test_a_pole_that_whiskers_pass_over_is_no_speck_if_it_is_opaque(monkeypatch, light, found):
    monkeypatch.setattr(init, "_is_passed_over", lambda *_: True)
    picture = np.where(COLUMNS < 60, 10.0, 180.0)
    picture[np.hypot(COLUMNS - 230, ROWS - 150) < 9.0] *= light
    noise = np.random.default_rng(0).normal(0, 1.5, (24, *SHAPE))
    smooth = cv2.GaussianBlur(picture, (0, 0), 0.8)
    with open_video(np.rint(smooth + noise).clip(0).astype(np.uint8)) as video:
        scene, _ = _scene_and_scale(prepare_video(video))
    assert (scene.pole is not None) == found


def test_a_round_thing_beside_two_things_that_move_amid_the_picture_is_no_pole(tmp_path):
    """As `run` judges them: with no face in view, so few lines are no whiskers."""
    rng, frames = np.random.default_rng(0), []
    for angle in 0.1 * np.sin(np.linspace(0, 12, 24)):
        picture = np.where(np.hypot(COLUMNS - 270, ROWS - 30) < RADIUS, 10.0, 180.0)
        for y in (90, 150):
            along, across = COLUMNS - 80, ROWS - y - angle * (COLUMNS - 80)
            thickness = np.clip(1.5 - 1.4 * along / 150, 0, None) * (along > 0)
            picture *= np.exp(-thickness / 3 * np.exp(-(across**2) / 2.9))
        frames.append(np.rint(picture + rng.normal(0, 2, SHAPE)).astype(np.uint8))
    tifffile.imwrite(tmp_path / "a.tif", np.array(frames))
    with ExitStack() as opened:
        look = look_at(tmp_path / "a.tif", opened)
    assert look.names == ()
    assert look.pole is None


def test_pictures_too_small_for_whiskers_are_refused_in_words(tmp_path):
    (tmp_path / "b").mkdir()
    tifffile.imwrite(tmp_path / "a.tif", np.full((5, 15, 640), 200, np.uint8))
    with pytest.raises(InputError, match=r"a\.tif: has frames of 640×15 px: expected at least 16"):
        init_folder(tmp_path)
    tifffile.imwrite(tmp_path / "b" / "a.tif", np.full((5, 16, 16), 200, np.uint8))
    assert init_folder(tmp_path / "b")[0] == "looked at a.tif"


def test_a_first_session_says_what_is_a_guess_and_when_its_whiskers_count():
    document, notes = findings({"a.avi": Look(Path("a.avi"), scene(DISC), 25.0, ("w1", "w2"))})
    document["whisker"] = [{"name": "w1"}, {"name": "w2"}]
    text = session_text(settings_from(document), notes)
    (rate,) = [line for line in text.splitlines() if line.startswith("frames_per_second")]
    assert rate.endswith("GUESS, it is set at the camera or its trigger")
    (name,) = [line for line in text.splitlines() if line.startswith('name = "w1"')]
    assert "found in some frames" in name
    assert "`run` may know others" in name
    assert name.endswith("followed until one here has a dimension or another name")


def test_a_scale_without_a_pole_says_how_much_the_picture_would_show():
    bare = replace(scene(DISC), pole=None)
    _, notes = findings({"a.avi": Look(Path("a.avi"), bare, 12.5, ("w1",))})
    assert "as if the image showed 25.6 mm × 19.2 mm" in notes["recording.pixels_per_mm"]


def test_videos_of_one_name_are_told_apart():
    paths = [Path("one/a/trial.avi"), Path("one/b/trial.avi")]
    assert called_apart(paths) == ["a/trial.avi", "b/trial.avi"]
    assert called_apart(paths[:1]) == ["trial.avi"]
    looks = {name: Look(Path(name), scene(DISC), 25.0, ("w1",)) for name in called_apart(paths)}
    assert "in a/trial.avi, a pole at (" in findings(looks)[1]["pole.x_px"]


def test_videos_that_one_session_cannot_hold_for_are_named():
    first = Look(Path("a.avi"), scene(DISC), 25.0, ("w1",))
    turned = replace(first, path=Path("b.avi"), scene=replace(first.scene, face_side="top"))
    assert not list(_unlike({"a.avi": first, "b.avi": first}))
    (said,) = _unlike({"a.avi": first, "b.avi": turned})
    assert "320×240 px, face at the left (a.avi); 320×240 px, face at the top (b.avi)" in said


def test_a_video_without_whiskers_is_of_no_view_of_its_own():
    first = Look(Path("b.avi"), scene(DISC), 25.0, ("w1",))
    black = replace(first, path=Path("a.avi"), names=())
    other = replace(black, scene=replace(first.scene, face_side="top"))
    assert by_view({"a": other, "b": first}) == {first.view: {"b": first}}
    assert not list(_unlike({"a": other, "b": first}))
    assert [*by_view({"a": other, "b": black})] == [other.view, black.view]


def test_settings_are_for_the_view_that_shows_most():
    looks = {name: Look(Path(name), scene(DISC), 25.0, ("w1", "w2")) for name in "bc"}
    turned = replace(
        looks["b"], scene=replace(looks["b"].scene, face_side="top"), names=("w1",) * 3
    )
    view, *_ = by_view({"a": turned, **looks})
    assert view == looks["b"].view


def test_the_poles_place_is_written_where_no_other_trial_can_have_another():
    looks = {name: Look(Path(name), scene(DISC), 25.0, ("w1",)) for name in ("a.avi", "b.avi")}
    document, _ = findings(looks, all_videos=True)
    assert (document["pole"]["x_px"], document["pole"]["y_px"]) == (200.0, 90.0)
    document, notes = findings(looks, all_videos=False)
    assert "x_px" not in document["pole"]
    assert notes["pole.x_px"] == (
        "here: a pole at (200, 90) in a.avi, a pole at (200, 90) in b.avi"
    )


def looked_at(tmp_path, monkeypatch, showing):
    """Names of the videos that are looked at; `showing`: by number, its whiskers and pole."""
    bare = replace(scene(DISC), pole=None)
    for number in range(len(showing)):
        (tmp_path / f"{number:02d}.avi").write_bytes(b"video")
    said = []

    def look_at(path, opened):
        whiskers, pole = showing[int(Path(path).stem)]
        names = tuple(f"w{k + 1}" for k in range(whiskers))
        return Look(Path(path), scene(DISC) if pole else bare, 25.0, names)

    def preview_of(path, settings, seen):
        said.append(f"in the picture: {Path(path).name}")
        raise InputError("")

    monkeypatch.setattr(init, "look_at", look_at)
    monkeypatch.setattr(init, "preview_of", preview_of)
    with pytest.raises(InputError):
        init_folder(tmp_path, say=said.append)
    return [int(line.split()[2].partition(".")[0]) for line in said[:-1]], said[-1]


@pytest.mark.parametrize(
    ("showing", "numbers", "shown"),
    [
        ({0: (3, True), 4: (3, False), 8: (3, False)}, [0, 4, 8], "00.avi"),
        ({0: (3, False), 4: (3, False), 8: (3, False), 2: (3, True)}, [0, 4, 8, 2], "02.avi"),
        ({4: (3, True), 2: (2, True), 6: (3, True)}, [0, 4, 8, 2, 6], "04.avi"),
        ({8: (1, False)}, [0, 4, 8, 2, 6, 1, 3, 5, 7], "08.avi"),
    ],
)
def test_more_videos_are_looked_at_until_some_show_whiskers_and_one_a_pole(
    tmp_path, monkeypatch, showing, numbers, shown
):
    all_of = {number: showing.get(number, (0, False)) for number in range(9)}
    looked, picture = looked_at(tmp_path, monkeypatch, all_of)
    assert looked == numbers
    assert picture == f"in the picture: {shown}"


def test_not_all_of_many_videos_are_looked_at(tmp_path, monkeypatch):
    looked, _ = looked_at(tmp_path, monkeypatch, dict.fromkeys(range(40), (2, False)))
    assert len(looked) == init.MOST


def test_a_folder_that_cannot_be_written_is_refused_before_its_videos_are_looked_at(
    tmp_path, monkeypatch
):
    def refuse(folder):
        raise OSError(errno.EROFS, "")

    monkeypatch.setattr(whole_files, "try_writing", refuse)
    (tmp_path / "a.avi").touch()
    said = []
    with pytest.raises(InputError, match=r"write session\.toml and the preview there .Read-"):
        init_folder(tmp_path, say=said.append)
    assert said == []


def test_settings_that_were_saved_by_another_name_are_not_left_behind(tmp_path):
    (tmp_path / "a.avi").touch()
    (tmp_path / "session.toml.txt").write_text("[recording]\n")
    for overwrite in (False, True):
        with pytest.raises(InputError, match=r"but session\.toml\.txt: rename it"):
            init_folder(tmp_path, overwrite)
    assert not (tmp_path / "session.toml").exists()
