"""A video's epochs as one."""

from types import SimpleNamespace

import numpy as np

from pipeline.detection.static_scene import PoleTrack
from pipeline.scene import pole_track


def _epoch(start, stop, pole):
    scene = SimpleNamespace(pole=pole and PoleTrack(*np.array(pole[:2])[:, None], pole[2]))
    return SimpleNamespace(start=start, stop=stop, scene=scene)


def test_pole_track_over_epochs():
    moving = SimpleNamespace(start=4, stop=6, scene=None)
    track = pole_track((_epoch(0, 4, None), moving, _epoch(6, None, (3.0, 4.0, 5.0))))
    np.testing.assert_array_equal(np.isnan(track.x_px), [True] * 6 + [False])
    assert (track.x_px[-1], track.y_px[-1], track.radius_px) == (3, 4, 5)
    assert pole_track((_epoch(0, None, None),)) is None
