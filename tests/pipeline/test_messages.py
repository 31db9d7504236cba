"""What a person is told of one video."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.detection.static_scene import PoleTrack
from pipeline.messages import messages
from pipeline.session.session_file import settings_from

SCALE = 25.0  # px/mm
WHISKER = {"length_mm": 18.0, "cone_length_mm": 19.0, "base_radius_um": 37.0}
POLE = PoleTrack(np.full(1, 300.0), np.full(1, 200.0), 0.25 * SCALE)


def told(whiskers=({**WHISKER, "name": "C2"},), pole_xy=None, **changes):
    """Messages of a video of one whisker in which nothing is wrong, but for the `changes`."""
    given = {
        "n_frames": 100, "exact_count": True, "read": 100, "found": ("C2",), "pole": POLE,
        "tracked": 1.0, "across": 0, "contacts": ("C2",), "light": 200,
    } | changes  # fmt: skip
    settings = settings_from(
        {
            "recording": {"frames_per_second": 1000, "pixels_per_mm": SCALE, "face": "left"},
            "whisker": list(whiskers),
            "pole": dict(zip(("x_px", "y_px"), pole_xy, strict=True)) if pole_xy else {},
        }
    )
    tracked = np.arange(100) < 100 * given["tracked"]
    touch = SimpleNamespace(
        frames=pd.DataFrame({"whisker": "C2", "tracked": tracked}),
        evidence=pd.DataFrame({"whisker": "C2", "across": np.arange(100) < given["across"]}),
        contacts=pd.DataFrame({"whisker": list(given["contacts"])}),
    )
    names = tuple(w.name for w in settings.whisker) or given["found"]
    roster = [SimpleNamespace(samples=()) for _ in given["found"]]
    cast = SimpleNamespace(names=names, found=given["found"], roster=roster)
    followed = SimpleNamespace(cast=cast, n_frames=given["read"], pole=given["pole"])
    video = SimpleNamespace(n_frames=given["n_frames"], exact_count=given["exact_count"])
    scene = SimpleNamespace(background=np.full((4, 4), given["light"]), likelier_side=None)
    return list(messages(settings, touch, video, (SimpleNamespace(scene=scene),), followed))


def test_where_nothing_is_wrong_nothing_is_said():
    assert told() == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"read": 60}, "only 60 of 100 frames could be read"),
        ({"read": 1, "n_frames": 1}, "one frame only"),
        ({"found": ()}, 'no whisker found in any frame; is [recording] face = "left"'),
        ({"found": (), "light": 40}, "no whisker found in any frame; the picture is mostly dark"),
        ({"pole": None}, "no pole of 0.5 mm found, so no contacts"),
        ({"pole": PoleTrack(POLE.x_px, POLE.y_px, 0.3 * SCALE)}, "the pole looks 0.6 mm thick"),
        ({"across": 2, "contacts": ()}, "C2 passes over the pole at (300, 200) px in 2 frames"),
        ({"tracked": 0.5}, "C2 is tracked in 50 % of the frames only"),
        ({"whiskers": ()}, "no forces: there is no [[whisker]] table"),
        ({"whiskers": ({"name": "C2"},)}, "no forces for C2: no length_mm, cone_length_mm"),
        ({"whiskers": ({**WHISKER, "name": "C2"}, {**WHISKER, "name": "D2"})},
         "not found in any frame: D2"),
    ],
)  # fmt: skip
def test_each_fault_is_told_alone(changes, said):
    (message,) = told(**changes)
    assert message.startswith(said)


@pytest.mark.parametrize(
    "changes",
    [
        {"read": 60, "exact_count": False},  # the file's header only guesses
        {"across": 1, "contacts": ()},  # may be a mistake
        {"across": 50},  # it does touch
        {"across": 50, "contacts": (), "pole_xy": (300, 200)},  # a person says it is the pole
        {"tracked": 0.85},
    ],
)
def test_what_is_no_fault_is_not_told(changes):
    assert told(**changes) == []
