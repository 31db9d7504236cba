"""A video's epochs as one."""

from types import SimpleNamespace

import numpy as np

from pipeline.detection.static_scene import PoleTrack, StaticScene
from pipeline.scene import pole_track
from pipeline.scene.epochs import Epoch, typical_epoch, without_poles


def _epoch(start, stop, pole):
    scene = SimpleNamespace(pole=pole and PoleTrack(*np.array(pole[:2])[:, None], pole[2]))
    return SimpleNamespace(start=start, stop=stop, scene=scene)


def test_pole_track_over_epochs():
    moving = SimpleNamespace(start=4, stop=6, scene=None)
    track = pole_track((_epoch(0, 4, None), moving, _epoch(6, None, (3.0, 4.0, 5.0))))
    np.testing.assert_array_equal(np.isnan(track.x_px), [True] * 6 + [False])
    assert (track.x_px[-1], track.y_px[-1], track.radius_px) == (3, 4, 5)
    assert pole_track((_epoch(0, None, None),)) is None


def _scene(pole=None):
    track = pole and PoleTrack(*np.array(pole[:2])[:, None], pole[2])
    mask = np.zeros((2, 2), bool)
    return StaticScene(np.ones((2, 2)), 0.0, 1.0, mask, mask, track, "left")


def test_the_typical_epoch_is_of_the_scene_that_holds_longest_with_a_pole_if_there_is_one():
    away, returns, once = _scene(), _scene((3.0, 4.0, 5.0)), _scene((9.0, 4.0, 5.0))
    epochs = (
        Epoch(0, 500, away),
        Epoch(500, 540, returns),
        Epoch(540, 550, None),
        Epoch(550, 610, once),
        Epoch(610, None, returns),
    )
    assert typical_epoch(epochs, 660) is epochs[4]  # 90 frames in all, of which 50 here
    assert typical_epoch(epochs, 645) is epochs[1]  # 75 frames, of which 40 here
    assert typical_epoch(epochs) is epochs[3]
    assert typical_epoch(without_poles(epochs), 660).scene is away
    assert typical_epoch((Epoch(0, None, away),)).scene is away


def test_a_scene_that_returns_stays_one_when_its_pole_is_refused():
    scene = _scene((3.0, 4.0, 5.0))
    first, moving, last = without_poles(
        [Epoch(0, 4, scene), Epoch(4, 6, None), Epoch(6, None, scene)]
    )
    assert first.scene is last.scene
    assert first.scene.pole is None
    assert moving.scene is None
