"""How lines of one frame are compared: which run along each other, and which are only blur."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.detection.detect import Wanted, detect_crowded
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line, Workspace
from pipeline.detection.line_choice import is_ghost, is_turned, shared_fraction
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from synthetic.presets import make_trial
from synthetic.render import Renderer

LIMIT = 120
AT_CROSSING = (694, 912)  # frames of a rendered trial in which two ridges turn off onto each other
ON_WHISKER_PX = 2.0


def line(points, amplitude=0.5):
    """A `Line` through points (n, 2) [px]."""
    out = Line.empty(LIMIT)
    out.n = len(points)
    out.x[: out.n], out.y[: out.n] = np.asarray(points, float).T
    out.amplitude[:] = amplitude
    return out


def straight(angle, n, start=(0.0, 0.0)):
    """Nodes 1 px apart."""
    return np.add(start, np.arange(n)[:, None] * [np.cos(angle), np.sin(angle)])


@settings(deadline=None, max_examples=60)
@given(
    angles=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    lengths=st.tuples(st.integers(1, LIMIT), st.integers(1, LIMIT)),
    near=st.floats(0.5, 6.0),
)
def test_the_share_of_nodes_near_another_line(angles, lengths, near):
    one, other = (straight(a, n) for a, n in zip(angles, lengths, strict=True))
    apart = np.hypot(*(one[::3, None] - other[None, ::2]).transpose(2, 0, 1)).min(axis=1)
    away = np.abs(apart - near) > 1e-9  # on the edge, rounding decides
    got = shared_fraction(line(one), line(other), near) * len(apart)
    assert (apart[away] < near).sum() - 1e-9 <= got <= (apart < near).sum() + (~away).sum() + 1e-9


def test_no_nodes_are_near_nothing():
    some, none = line(straight(0, 30)), line(np.empty((0, 2)))
    assert shared_fraction(some, none) == 0
    assert shared_fraction(none, some) == 0


@pytest.mark.parametrize(
    ("strength", "away_px", "ghost"),
    [(0.9, 1.0, True), (1.1, 1.0, False), (0.9, 5.0, False), (0.5, 5.0, True), (0.5, 9.0, False)],
)
def test_a_ghost_is_faint_and_beside_a_dark_line(strength, away_px, ghost):
    dark = line(straight(0.2, 80), 0.6)
    faint = line(straight(0.2, 60, (0, away_px)), strength * DEFAULTS.detection.blur_share * 0.6)
    assert is_ghost(faint, [line(straight(-1, 80)), dark], DEFAULTS.detection) == ghost
    assert not is_ghost(dark, [faint], DEFAULTS.detection)


@pytest.mark.parametrize(("beside", "ghost"), [(36, False), (54, True)])
def test_a_faint_line_that_leaves_a_dark_one_is_no_ghost(beside, ghost):
    along = straight(0, beside, (0, 1.5))
    faint = np.concatenate([along, straight(0.6, 60 - beside, along[-1] + 0.6)])
    assert is_ghost(line(faint, 0.2), [line(straight(0, 80), 0.6)], DEFAULTS.detection) == ghost


@pytest.mark.slow
def test_whiskers_that_cross_are_found_with_their_own_far_parts():
    trial = make_trial("crossing", 100, 0)
    renderer, scale = Renderer(trial.scene, trial.motion), trial.scene.camera.pixels_per_mm
    still = np.array([renderer.frame(i) for i in range(0, 1000, 100)])
    recording = Recording(1000.0, scale, "left")
    lengths = [hair.whisker.length for hair in trial.scene.hairs]
    model = ImageModel.from_scene(scene_from_frames(still, recording, None), DEFAULTS.detection)
    options = options_for(recording, lengths, [1.4e-3] * 3)
    workspace = Workspace(1200, options.spacing_px)
    for frame in AT_CROSSING:
        image = renderer.frame(frame)
        at = Frame(image, model, model.gain(image), options, workspace)
        found = detect_crowded(at, wanted=Wanted(enough=3))
        whiskers = [np.vstack(trial.motion.centrelines(k, [frame])).T for k in range(3)]
        assert sorted(nearest_whisker(each.points, whiskers) for each in found) == [0, 1, 2]


def nearest_whisker(points, whiskers):
    """The whisker that nearly all of a line lies on; −1 where there is none."""
    apart = [np.hypot(*(w[:, None] - points).transpose(2, 0, 1)).min(axis=0) for w in whiskers]
    share = [np.mean(each < ON_WHISKER_PX) for each in apart]
    return int(np.argmax(share)) if max(share) > 0.95 else -1


@pytest.mark.parametrize(
    ("direction", "near", "far", "turned"),
    [
        ((0, 1), 1.0, 0.5, False),
        ((0, -1), 0.5, 1.0, True),
        ((0, 1), 1.0, 1.0, False),  # cut short by the body, hardly tapered: off the face's side
        ((0, -1), 1.0, 1.0, True),
        ((1, 0), 1.0, 1.05, True),
        ((0, 1), 1.0, 1.5, True),  # from the body to the face
        ((0.3, -1), 1.0, 0.5, False),  # grows towards the face's side, as a rat's do
    ],
)
def test_a_line_between_face_and_body_begins_at_its_thick_end_or_at_the_face(
    direction, near, far, turned
):
    line = Line.empty(100)
    line.n, steps = 80, np.arange(80)
    line.x[:80], line.y[:80] = 50 + steps * direction[0], 50 + steps * direction[1]
    line.thickness[:40], line.thickness[40:80] = near, far
    assert is_turned(line, (0, 1), DEFAULTS.detection.thickens) == turned
