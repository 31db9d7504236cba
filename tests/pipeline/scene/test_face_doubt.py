"""A face that is not where session.toml says is told, and one that is makes no doubt."""

import re

import cv2
import numpy as np
import pytest

from pipeline.messages import face_message
from pipeline.run import analyse
from pipeline.scene.estimate import scene_from_frames
from pipeline.scene.face import thickening_towards
from pipeline.session.recording import Recording
from pipeline.session.session_file import settings_from
from pipeline.tracking.registry import find_roster
from pipeline.tracking.tracker import options_for
from synthetic.presets import make_trial
from synthetic.render import Renderer

SIDES = ("left", "bottom", "right", "top")  # from one to the next by a quarter turn
SCALE = 25.0  # px/mm
POLE_MM = 0.015  # tolerance of its thickness, told to 0.01 mm
NAMES = {"single": ["C2"], "row": ["C4", "C3", "C2", "C1"]}


def frames(preset, seed=3, every=40):
    """Rendered frames of whiskers with the face at the left, uint8 (k, height, width)."""
    trial = make_trial(preset, seed, 0)
    renderer = Renderer(trial.scene, trial.motion)
    return np.array([renderer.frame(i) for i in range(0, len(trial.motion), every)])


@pytest.fixture(scope="module", params=NAMES)
def seen(request):
    return request.param, frames(request.param)


def told(video, side, names):
    scene = scene_from_frames(video, Recording(1000.0, SCALE, side))
    options = options_for(Recording(1000.0, SCALE, side), [18e-3], [1.4e-3])
    return face_message([scene], find_roster(video, scene, options, names), side)


@pytest.mark.parametrize("turns", range(4))
def test_a_face_at_its_place_is_not_doubted(seen, turns):
    preset, video = seen
    turned = np.ascontiguousarray(np.rot90(video, turns, axes=(1, 2)))
    assert told(turned, SIDES[turns], NAMES[preset]) is None


@pytest.mark.parametrize("side", ["right", "top", "bottom"])
def test_a_face_elsewhere_is_told(seen, side):
    preset, video = seen
    message = told(video, side, NAMES[preset])
    assert f'[recording] face = "{side}"' in message
    assert 'write face = "left"' in message


def test_whiskers_without_a_face_in_view_tell_the_opposite_side():
    video = np.ascontiguousarray(frames("single")[:, :, 140:])  # without face and fur
    assert told(video, "left", ["C2"]) is None
    assert 'write face = "left"' in told(video, "right", ["C2"])


def test_an_object_on_the_wrong_side_is_no_face():
    video = np.ascontiguousarray(frames("row")[:, :, :320])
    video[:, :, -25:] = 10  # dark, where the whiskers reach it
    scene = scene_from_frames(video, Recording(1000.0, SCALE, "right"))
    roster = find_roster(video, scene, options_for(Recording(1000.0, SCALE, "right")))
    assert scene.likelier_side is None  # it passes for a face
    assert thickening_towards(roster) == "left"


@pytest.mark.parametrize(
    ("side", "scale", "words"),
    [
        ("left", SCALE, None),
        ("right", SCALE, 'write face = "left"'),
        ("left", 0.75 * SCALE, "mm thick, but [pole] diameter_mm = 0.5"),
    ],
)
def test_a_video_with_wrong_settings_says_so(tmp_path, side, scale, words):
    for i, frame in enumerate(frames("single", every=10)):
        cv2.imwrite(str(tmp_path / f"{i:03d}.png"), frame)
    recording = {"frames_per_second": 100.0, "pixels_per_mm": scale, "face": side}
    settings = settings_from({"recording": recording, "whisker": [{"name": "C2"}]})
    messages = [m for m in analyse(tmp_path, settings).messages if "no forces" not in m]
    if words is None:
        assert messages == []
    else:
        assert words in messages[0]
    if scale != SCALE:
        (thick,) = re.findall(r"pole looks ([0-9.]+) mm", messages[0])
        assert float(thick) == pytest.approx(0.5 * SCALE / scale, abs=POLE_MM)
