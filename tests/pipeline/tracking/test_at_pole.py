"""Of several whiskers, the only one in session.toml is the one that touches the pole."""

from types import SimpleNamespace

import numpy as np
import pytest
from row_trials import NAMES, SCALE, frames_of, row_motion, whisker_under

from pipeline import analyse
from pipeline.detection.static_scene import PoleTrack
from pipeline.tracking.at_pole import NEAR_MM, NEVER, nearness
from synthetic.truth import frame_table

FOLLICLE_PX = 2.0
FRAMES = 120
POLE = PoleTrack(np.array([50.0]), np.array([40.0]), 6.0)


def whisker(name, **dimensions):
    recording = {"frames_per_second": 1000.0, "pixels_per_mm": SCALE, "face": "left"}
    return {"recording": recording, "whisker": [{"name": name, **dimensions}]}


C2 = {"length_mm": 18.0, "cone_length_mm": 18.947, "base_radius_um": 37.0}


def touched(motion):
    """Numbers of contacts of each true whisker."""
    edges = (np.diff(hair.contact.touching.astype(int), prepend=0) for hair in motion.hairs)
    return {name: int((each == 1).sum()) for name, each in zip(NAMES, edges, strict=True)}


@pytest.mark.slow
@pytest.mark.e2e
@pytest.mark.parametrize("dimensions", [C2, {}])
@pytest.mark.parametrize("touch_at", [8e-3, 12e-3])
def test_the_whisker_that_touches_the_pole_is_the_one_that_is_named(touch_at, dimensions):
    motion = row_motion(touch_at, frames=FRAMES)
    found = analyse(frames_of(motion), whisker("C2", **dimensions))
    lines = [(frame, xy) for each in found.lines for frame, _, xy in each.each()]
    assert {whisker_under(motion, frame, xy) for frame, xy in lines} == {"C2"}
    assert len(lines) > 0.95 * FRAMES
    assert len(found.contacts) == touched(motion)["C2"] > 2
    truth = frame_table(motion, 5.5e-3).query("whisker == 'C2'")
    away = found.frames["follicle_y_px"].to_numpy() - truth["follicle_y_px"].to_numpy()
    assert abs(np.median(away)) < FOLLICLE_PX  # follicles are 26 px apart
    (said,) = [message for message in found.messages if "seen at a time" in message]
    assert "which one is C2 is a guess, from how near each comes to the pole" in said


@pytest.mark.slow
@pytest.mark.e2e
def test_without_a_pole_it_is_the_one_that_is_seen_best():
    motion = row_motion(frames=FRAMES)
    found = analyse(frames_of(motion), whisker("C1"))
    lines = [(frame, xy) for each in found.lines for frame, _, xy in each.each()]
    assert {whisker_under(motion, frame, xy) for frame, xy in lines} == {"C1"}  # the longest


@pytest.mark.slow
@pytest.mark.e2e
@pytest.mark.parametrize("touch_at", [8e-3, None])
def test_with_a_table_for_each_it_is_the_same_with_and_without_a_pole(touch_at):
    """As docs/naming.md says of trials without a pole."""
    settings = whisker("C2", **C2)
    settings["recording"]["snout"] = "top"
    settings["whisker"] = [{"name": "C3"}, *settings["whisker"], {"name": "C1"}]
    motion = row_motion(touch_at, seed=1, frames=FRAMES)
    found = analyse(frames_of(motion), settings | {"analysis": {"follow": ["C2"]}})
    lines = [(frame, xy) for each in found.lines for frame, _, xy in each.each()]
    assert {whisker_under(motion, frame, xy) for frame, xy in lines} == {"C2"}
    assert len(lines) > 0.95 * FRAMES
    assert not [message for message in found.messages if "guess" in message]


def line_at(gap_px, first=0.0):
    """A line that passes the pole so far from its surface, with a node at x = `first` [px]."""
    x = np.arange(first, first + 101.0)
    return SimpleNamespace(x=x, y=np.full_like(x, 40 + 6 + gap_px), n=len(x))


def test_nearness_is_the_share_of_frames_in_which_it_lies_at_the_pole():
    near, far = line_at(-0.5), line_at(1e4)
    scale = 25e3  # px/m
    assert nearness([near, near, far], [POLE] * 3, 4, scale) == pytest.approx(NEVER + 0.5)
    assert nearness([near, near], [POLE, None], 2, scale) == pytest.approx(NEVER + 0.5)
    assert nearness([near], [None], 1, scale) == NEVER
    beside = line_at(NEAR_MM * 25)
    assert nearness([beside], [POLE], 1, scale) == pytest.approx(NEVER + np.exp(-1))


def test_nearness_hardly_depends_on_where_the_nodes_are():
    """Distances to the nodes are nearly those to the line."""
    lost_px = 0.02 + 1e-3
    at_node, between = (
        nearness([line_at(1.0, first)], [POLE], 1, 25e3) - NEVER for first in (0, 0.5)
    )
    assert 0 <= NEAR_MM * 25 * np.log(at_node / between) < lost_px
