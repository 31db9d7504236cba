"""The picture that `init` makes: its names are those of session.toml, and doubts are said."""

from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np

from pipeline.app import init
from pipeline.app.preview import Preview, preview_of
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
        init, "look_at", lambda path: init.Look(path, SCENE, 10.0, seen[Path(path).name])
    )
    drawn = ("w1", "w2", "w3")  # when followed, more whiskers are seen than at first sight
    monkeypatch.setattr(init, "preview_of", lambda path, settings: preview(path, drawn))
    said = "\n".join(init.init_folder(tmp_path))
    assert [each.name for each in read_session(tmp_path / "session.toml").whisker] == [*drawn]
    assert "b.avi is in the picture" in said
    assert "3 whiskers (w1, w2, w3)" in said


def test_names_that_are_not_in_the_picture_are_said():
    (found,) = preview("a.avi", ("w1", "w2"), drawn=("w2",)).words()
    assert found.endswith("; not in the picture's frame: w1")
    (found,) = preview("a.avi", ("w1", "w2")).words()
    assert "not in" not in found


def test_where_no_whisker_is_found_it_says_what_a_run_would_say(tmp_path):
    frame = np.full((120, 160), 180, np.uint8)
    frame[:, :30] = 10
    for i in range(12):
        cv2.imwrite(str(tmp_path / f"{i:02d}.png"), frame)
    _, doubt = preview_of(tmp_path, settings_from({"recording": RECORDING})).words()
    assert doubt.startswith("no whiskers found; what was seen is something dark at the left")
