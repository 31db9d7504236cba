"""Whiskers in pictures without a face: drawn ones, and rendered ones with the face cut away."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from still_scene import scene_from_frames
from traced_lines import trace_templates
from usual_parameters import options_for

from pipeline.scene.virtual_face import mask_behind_whiskers
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking.registry import find_templates
from synthetic.presets import make_trial
from synthetic.render import Renderer

pytestmark = pytest.mark.slow

SCALE = 25.0  # px/mm
FOLLICLE = 50.0, 120.0  # px
START_PX = 0.7  # error of the edge where whiskers come over it
OFF_PX = 0.05  # RMS of a centreline
FOLLOWED = range(40, 80)


def drawn(angle, noise=2.0, length=300.0):
    """A straight whisker that turns about its first visible point, uint8 (240, 400)."""
    y, x = np.mgrid[:240, :400].astype(float)
    x, y = x - FOLLICLE[0], y - FOLLICLE[1]
    along = x * np.cos(angle) + y * np.sin(angle)
    across = y * np.cos(angle) - x * np.sin(angle)
    ends = 1 / (1 + np.exp(-2 * along)) / (1 + np.exp(2 * (along - length)))
    dark = 0.8 * (1 - 0.6 * along / length) * np.exp(-(across**2) / (2 * 1.1**2)) * ends
    rng = np.random.default_rng(int(1e4 * abs(angle)))
    image = 200 * (1 - dark) + rng.normal(0, noise, dark.shape)
    return np.clip(image, 0, 255).astype(np.uint8)


FRAMES = np.stack([drawn(angle) for angle in np.linspace(-0.3, 0.2, 9)])


class TestMask:
    @pytest.mark.parametrize("turns", range(4))
    @pytest.mark.parametrize("given", [True, False])
    def test_begins_where_the_whisker_does(self, turns, given):
        side = ("left", "bottom", "right", "top")[turns]
        frames = np.ascontiguousarray(np.rot90(FRAMES, turns, axes=(1, 2)))
        found, mask, thick = mask_behind_whiskers(
            frames, side if given else None, SCALE, DEFAULTS.scene
        )
        assert found == thick == side
        widths = np.rot90(mask, -turns).sum(axis=1)
        assert np.abs(widths - 0.5 - FOLLICLE[0]).max() < START_PX
        assert np.rot90(mask, -turns)[:, 0].all()

    def test_a_rod_that_stands_still_is_no_whisker(self):
        frames = FRAMES.copy()
        rows, columns = np.mgrid[:240, :400]
        rod = np.abs(columns - 200 - 0.3 * rows) < 4
        frames[:, rod & (rows < 200)] //= 4
        found, mask, thick = mask_behind_whiskers(frames, None, SCALE, DEFAULTS.scene)
        assert found == thick == "left"
        assert np.abs(mask.sum(axis=1) - 0.5 - FOLLICLE[0]).max() < START_PX

    def test_what_goes_on_beyond_the_pole_does_not_begin_there(self):
        frames = FRAMES.copy()
        rows, columns = np.mgrid[:240, :400]
        angle = np.linspace(-0.3, 0.2, 9)[6]
        pole = FOLLICLE[0] + 150 * np.cos(angle), FOLLICLE[1] + 150 * np.sin(angle)
        frames[:, np.hypot(columns - pole[0], rows - pole[1]) < 11] = 10
        _, mask, _ = mask_behind_whiskers(frames, "left", SCALE, DEFAULTS.scene)
        assert np.abs(mask.sum(axis=1) - 0.5 - FOLLICLE[0]).max() < START_PX

    def test_whiskers_that_never_move_show_no_side_for_sure(self):
        found, mask, thick = mask_behind_whiskers(FRAMES[:1], None, SCALE, DEFAULTS.scene)
        assert found == "left"
        assert mask.any()
        assert thick is None

    def test_nothing_in_view(self):
        frames = np.random.default_rng(0).normal(200, 2, (4, 240, 400)).astype(np.uint8)
        side, mask, thick = mask_behind_whiskers(frames, None, SCALE, DEFAULTS.scene)
        assert side == "left"
        assert thick is None
        assert not mask.any()


def test_whiskers_that_come_over_the_border_are_traced():
    trial = make_trial("noisy", 0, 0)
    renderer = Renderer(trial.scene, trial.motion)
    camera = trial.scene.camera
    follicle = trial.motion.centrelines(hair=0, frames=slice(0, 1))[0][0, 0]
    cut = int(follicle + 3.2 * camera.pixels_per_mm)  # beyond the face and its fur
    wide = np.array([renderer.frame(i)[:, cut:] for i in range(0, len(trial.motion), 25)])
    recording = Recording(camera.frames_per_second, camera.pixels_per_mm, "left")
    scene = scene_from_frames(wide, recording, 0.5e-3)
    options = options_for(recording, [18e-3], [3.2e-3])
    templates = find_templates(wide[::4], scene, options, ["C2"])
    # as videos give them; code for any other order of pixels takes half a minute to compile
    images = (np.ascontiguousarray(renderer.frame(i)[:, cut:]) for i in FOLLOWED)
    (lines,) = trace_templates(images, scene, templates, options, chunk_frames=10**6)
    assert len(lines) == len(FOLLOWED)
    for row, frame in enumerate(FOLLOWED):
        x, y = trial.motion.centrelines(hair=0, frames=slice(frame, frame + 1))
        truth = np.column_stack([x[0] - cut, y[0]])
        points = lines.row(row).astype(float)
        distance, _ = cKDTree(_densely(truth)).query(points)
        assert np.sqrt(np.mean(distance[:250] ** 2)) < OFF_PX
        assert points[0, 0] < 1.5  # begins at the border


def _densely(points, times=40):
    """Points of a curve, closer together."""
    at = np.linspace(0, len(points) - 1, times * len(points))
    return np.column_stack([np.interp(at, np.arange(len(points)), v) for v in points.T])
