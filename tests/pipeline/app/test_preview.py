"""The picture that `init` makes: its names are those of session.toml, and doubts are said."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from pipeline.app import init
from pipeline.app.preview import Preview, _doubts, draw, preview_of, whiskers_in
from pipeline.detection.static_scene import PoleTrack
from pipeline.errors import VideoError
from pipeline.session.input_settings import guesses_left
from pipeline.session.inputs import find_inputs
from pipeline.session.session_file import read_session, settings_from

SCENE = SimpleNamespace(pole=None, face_side="left", face_mask=np.zeros((40, 60), bool))
RECORDING = {"frames_per_second": 1000.0, "pixels_per_mm": 10.0, "face": "left"}


def preview(path, names, drawn=None, doubts=()):
    """A preview with a line for each of the names that are drawn."""
    lines = {
        name: np.array([[0.0, 9.0], [40.0, 9.0]]) for name in (names if drawn is None else drawn)
    }
    frame, settings = np.zeros((40, 60), np.uint8), settings_from({"recording": RECORDING})
    return Preview(path, settings, SCENE, frame, lines, frozenset(lines), tuple(names), doubts)


def test_settings_have_the_names_in_the_picture_of_the_video_with_most_whiskers(
    tmp_path, monkeypatch
):
    seen = {"a.avi": ("w1",), "b.avi": ("w1", "w2"), "c.avi": ()}
    for name in seen:
        (tmp_path / name).write_bytes(b"video")
    monkeypatch.setattr(
        init, "look_at", lambda path, opened: init.Look(path, SCENE, 10.0, seen[Path(path).name])
    )
    drawn = ("w1", "w2", "w3")  # when followed, more whiskers are seen than at first sight
    monkeypatch.setattr(init, "preview_of", lambda path, settings, seen: preview(path, drawn))
    said = "\n".join(init.init_folder(tmp_path))
    assert [each.name for each in read_session(tmp_path / "session.toml").whisker] == [*drawn]
    assert "b.avi is in the picture" in said
    assert "3 whiskers (w1, w2, w3)" in said
    (guessed,) = guesses_left(find_inputs([tmp_path]))
    assert "frames_per_second, pixels_per_mm, diameter_mm: still marked as a GUESS" in guessed


def test_a_video_that_cannot_be_read_is_left_out_and_named(tmp_path, monkeypatch):
    (tmp_path / "a.avi").write_bytes(b"no video")
    (tmp_path / "b.avi").write_bytes(b"video")
    said = []

    def look_at(path, opened):
        if Path(path).name == "a.avi":
            raise VideoError(path, "it is a text file")
        return init.Look(path, SCENE, 10.0, ("w1",))

    monkeypatch.setattr(init, "look_at", look_at)
    monkeypatch.setattr(init, "preview_of", lambda path, settings, seen: preview(path, ("w1",)))
    (looked, *_) = init.init_folder(tmp_path, say=said.append)
    assert f"left out: {tmp_path / 'a.avi'}: it is a text file" in said
    assert "a.avi" not in looked


def test_names_that_are_not_in_the_picture_are_said():
    (found,) = preview("a.avi", ("w1", "w2"), drawn=("w2",)).words()
    assert found.endswith("; not in the picture's frame: w1")
    (found,) = preview("a.avi", ("w1", "w2")).words()
    assert "not in" not in found


def test_whiskers_of_the_session_that_are_nowhere_are_not_counted():
    shown = replace(preview("a.avi", ("C1", "C2", "C3"), drawn=("C1",)), unseen=("C2", "C3"))
    (found,) = shown.words()
    assert found.endswith(", 1 whisker (C1); in none of the frames looked at: C2, C3")


@pytest.mark.parametrize("given", [[], [{"name": "C2"}]])
def test_where_no_whisker_is_found_it_says_what_a_run_would_say(given, tmp_path):
    frame = np.full((120, 160), 180, np.uint8)
    frame[:, :30] = 10
    for i in range(12):
        cv2.imwrite(str(tmp_path / f"{i:02d}.png"), frame)
    settings = settings_from({"recording": RECORDING, "whisker": given})
    found, doubt = preview_of(tmp_path, settings).words()
    assert "0 whiskers" in found
    assert found.endswith("in none of the frames looked at: C2") == bool(given)
    assert doubt.startswith("no whiskers found; what was seen is something dark at the left")


def chunk(names, confidence):
    """`Centrelines` of two frames, all names in each, as sure as given."""
    return SimpleNamespace(
        names=names, whisker=np.tile(np.arange(len(names)), 2), confidence=np.tile(confidence, 2)
    )


def test_lines_that_are_never_known_to_be_a_whisker_get_no_table():
    first = chunk(("left_w1", "left_w2", "right_w1", "right_w2"), [0.9, 0.4, 0.4, 0.4])
    later = chunk(("left_w1", "left_w2", "right_w1", "right_w2"), [0.9, 0.4, 0.8, 0.4])
    assert whiskers_in([first, later]) == ("left_w1", "right_w1")
    assert whiskers_in([]) == ()


def test_numbers_of_whiskers_have_no_gaps():
    assert whiskers_in([chunk(("w1", "w2", "w3", "w4"), [0.9, 0.4, 0.6, 0.4])]) == (
        "w1",
        "w2",
        "w3",
    )


def test_a_line_that_is_no_whiskers_has_no_number_in_the_picture(monkeypatch):
    written = []
    monkeypatch.setattr(
        "pipeline.app.preview.put_text", lambda picture, text, *_: written.append(text)
    )
    draw(preview(Path("a.avi"), ("w1",), drawn=("w1", "w2")))
    assert "w1" in written
    assert "?" in written
    assert "w2" not in written


def test_an_order_that_is_guessed_is_doubted_before_a_run(monkeypatch):
    monkeypatch.setattr("pipeline.app.preview.settings_doubt", lambda *_: None)
    settings = settings_from({"recording": RECORDING, "whisker": [{"name": "a"}, {"name": "b"}]})
    found = SimpleNamespace(found=("a", "b"), templates=(None, None), given=("a", "b"))
    video, pole = SimpleNamespace(width=60, height=40), PoleTrack(np.ones(1), np.ones(1), 10.0)
    seen = SimpleNamespace(video=video, epochs=(), whisker_set=found, other_pole=None)
    (doubt,) = _doubts(settings, seen, SimpleNamespace(pole=None))
    assert doubt.startswith("the order of a to b along the face is guessed")
    seen.other_pole = pole
    said = "looks 2 mm thick (20 px, at 1, 1 px), but [pole] diameter_mm = 0.5: correct"
    missing = "no pole of 0.5 mm (5 px) found, so no contacts; what may be one"
    for each, what in ((pole, "the pole"), (None, missing)):
        size, _ = _doubts(settings, seen, SimpleNamespace(pole=each))
        assert size.startswith(f"{what} {said}")
