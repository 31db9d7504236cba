"""Tracing of rendered frames against their exact centrelines."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from still_scene import scene_from_frames
from traced_lines import trace_templates
from usual_parameters import options_for

from pipeline.kinematics.curvature import measure
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking.registry import find_templates
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.truth import frame_table

pytestmark = pytest.mark.slow

FRAMES = range(40, 200)  # holds two touches of `noisy`, trial 0
HIDDEN = 1.32e-3  # m, as written in the preset's session.toml


class Traced:
    """A rendered trial, its truth and what the tracker made of it."""

    def __init__(self, preset, seed, trial, frames, names=("C2",)):
        self.trial = make_trial(preset, seed, trial)
        renderer = Renderer(self.trial.scene, self.trial.motion)
        camera = self.trial.scene.camera
        self.recording = Recording(
            camera.frames_per_second, camera.pixels_per_mm, self.trial.scene.face.side
        )
        self.frames = np.array(frames)
        self.images = [renderer.frame(i) for i in frames]
        wide = np.array([renderer.frame(i) for i in range(0, len(self.trial.motion), 25)])
        self.scene = scene_from_frames(wide, self.recording, 0.5e-3, None, len(self.images))
        self.options = options_for(self.recording, [18e-3], [HIDDEN])
        self.templates = find_templates(wide[::4], self.scene, self.options, list(names))
        chunks = trace_templates(
            self.images, self.scene, self.templates, self.options, chunk_frames=10**6
        )
        self.lines = next(iter(chunks))

    def errors(self, row):
        """Signed distances [px] of a row's points from the true centreline, and its length."""
        frame = self.frames[self.lines.frame[row]]
        x, y = self.trial.motion.centrelines(hair=0, frames=slice(frame, frame + 1))
        truth = np.column_stack([x[0], y[0]])
        points = self.lines.row(row).astype(float)
        _, near = cKDTree(truth).query(points)
        near = np.clip(near, 1, len(truth) - 2)
        tangent = truth[near + 1] - truth[near - 1]
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        off = points - truth[near]
        return tangent[:, 1] * off[:, 0] - tangent[:, 0] * off[:, 1], near, len(truth)


@pytest.fixture(scope="module")
def noisy():
    return Traced("noisy", 0, 0, FRAMES)


def test_every_frame_is_traced_once(noisy):
    np.testing.assert_array_equal(noisy.lines.frame, np.arange(len(FRAMES)))
    assert noisy.lines.names == ("C2",)


def test_centreline_error(noisy):
    errors = np.abs(np.concatenate([noisy.errors(i)[0] for i in range(len(noisy.lines))]))
    assert np.median(errors) < 0.01  # px
    assert np.sqrt((errors**2).mean()) < 0.03  # px, to the faint tip
    assert np.percentile(errors, 95) < 0.06  # px


def test_visible_length_is_covered(noisy):
    for row in range(0, len(noisy.lines), 10):
        _, near, n = noisy.errors(row)
        first_visible = HIDDEN * noisy.recording.pixels_per_m
        assert near[0] < first_visible + 5  # px
        assert near[-1] > n - 40  # px: the last 1.5 mm fade into the noise


def test_points_are_a_pixel_apart_and_start_at_the_face(noisy):
    steps = np.hypot(*np.diff(noisy.lines.row(0), axis=0).T)
    assert np.abs(steps - 1).max() < 0.05  # px
    x, y = noisy.lines.row(0)[0]
    distance = np.abs(np.argwhere(noisy.scene.face_mask)[:, ::-1] - [x, y]).max(axis=1).min()
    assert distance < 2.5  # px


def test_curvature_and_its_standard_error(noisy):
    truth = frame_table(noisy.trial.motion).set_index("frame").loc[noisy.frames]
    got = measure(
        noisy.lines, noisy.recording, [HIDDEN], 5.5e-3, DEFAULTS.kinematics, noisy.scene.pole
    )
    off = got.curvature_per_m.to_numpy() - truth.curvature_per_m.to_numpy()
    free = ~truth.in_contact.to_numpy()
    assert np.std(off[free]) < 0.3  # 1/m
    assert abs(np.mean(off[free])) < 0.3  # 1/m: the follicle's place is known to some 0.05 mm
    assert np.mean(got.curvature_per_m_se[free]) == pytest.approx(np.std(off[free]), rel=0.35)


def test_chunks_hold_the_same_as_one_piece(noisy):
    chunks = list(
        trace_templates(
            noisy.images[:50], noisy.scene, noisy.templates, noisy.options, chunk_frames=20
        )
    )
    assert [len(c) for c in chunks] == [20, 20, 10]
    together = np.concatenate([c.x_px for c in chunks])
    np.testing.assert_array_equal(together, noisy.lines.x_px[: len(together)])


def test_ends_are_measured_beside_the_same_lines_or_not(noisy):
    with_ends, without = (
        next(trace_templates(noisy.images[:5], noisy.scene, noisy.templates, options))
        for options in (noisy.options, replace(noisy.options, ends=False))
    )
    np.testing.assert_array_equal(without.x_px, with_ends.x_px)
    assert np.isnan(without.end_px).all()
    assert np.isfinite(with_ends.end_px).all()


def test_a_gap_without_whisker_is_a_gap_and_ends(noisy):
    empty = np.clip(noisy.scene.background, 0, 255).astype(np.uint8)
    images = [*noisy.images[:10], *[empty] * 30, *noisy.images[10:40]]
    lines = next(iter(trace_templates(images, noisy.scene, noisy.templates, noisy.options, 10**6)))
    assert not set(range(10, 40)) & set(lines.frame.tolist())
    assert set(range(62, 70)) <= set(lines.frame.tolist()), "found again within 22 frames"


def test_no_whisker_gives_no_template(noisy):
    rng = np.random.default_rng(0)
    image = noisy.scene.background + rng.normal(0, 2.5, noisy.scene.background.shape)
    image = np.clip(image, 0, 255).astype(np.uint8)
    assert find_templates([image] * 3, noisy.scene, noisy.options, ["C2"]) == []


@pytest.mark.parametrize("chunk_frames", [4, 10])
def test_where_no_line_is_followed_no_name_stays(noisy, chunk_frames):
    """Not even of what the first look took for a whisker."""
    empty = np.clip(noisy.scene.background, 0, 255).astype(np.uint8)
    what = noisy.scene, noisy.templates, noisy.options
    (lines,) = trace_templates([empty] * 6, *what, chunk_frames, given=())
    assert len(lines) == 0
    assert lines.names == ()


def test_whiskers_are_found_as_soon_as_the_light_is_on(noisy):
    dark = np.zeros_like(noisy.images[0])
    frames = [dark] * 6 + noisy.images[:4] + [dark] * 5 + noisy.images[4:8]
    (lines,) = trace_templates(frames, noisy.scene, noisy.templates, noisy.options)
    assert sorted(set(lines.frame.tolist())) == [*range(6, 10), *range(15, 19)]


@pytest.mark.parametrize("first", [0.2, 0.25, 0.3, 0.35])
def test_whiskers_that_cross_at_the_face_when_the_video_begins(first):
    rng = np.random.default_rng(1)
    rows, columns = np.mgrid[:320, :420]
    bases, start = (140.0, 165.0), 40.0  # px

    def frame(angles):
        light = np.where(columns < start, 8.0, 180.0)
        for base, angle in zip(bases, angles, strict=True):
            off = (rows - base) * np.cos(angle) - (columns - start) * np.sin(angle)
            along = (columns - start) * np.cos(angle) + (rows - base) * np.sin(angle)
            seen = (along > -20) & (along < 300)
            light *= 1 - 0.7 * seen * np.exp(-0.5 * off**2)
        return np.clip(np.rint(light + 2 * rng.normal(size=light.shape)), 0, 255).astype(np.uint8)

    recording = Recording(1000.0, 25.0, "left")
    known = np.array([frame(rng.uniform([0.0, -0.45], [0.45, 0.0])) for _ in range(40)])
    scene = scene_from_frames(known, recording, None, None, 5)
    options = options_for(recording, [14e-3, 14e-3], [HIDDEN, HIDDEN])
    templates = find_templates(known, scene, options, ["A", "B"])
    true = [(first - 0.01 * k, -first + 0.01 * k) for k in range(5)]
    (lines,) = trace_templates([frame(a) for a in true], scene, templates, options)
    assert len(lines) == 2 * len(true)
    for row in range(len(lines)):
        which = int(templates[lines.whisker[row]].base_xy[1] > np.mean(bases))
        angle = true[lines.frame[row]][which]
        x, y = lines.row(row).T
        off = (y - bases[which]) * np.cos(angle) - (x - start) * np.sin(angle)
        assert np.abs(off[5:]).max() < 1.0  # px
        assert len(x) > 250


def test_a_line_comes_back_from_another_whiskers_far_part_after_a_crossing():
    trial = make_trial("row", 20261123, 1, 400)  # C3 and C2 cross in frame 25
    renderer, camera = Renderer(trial.scene, trial.motion), trial.scene.camera
    images = np.array([renderer.frame(i) for i in range(40)])
    recording = Recording(camera.frames_per_second, camera.pixels_per_mm, trial.scene.face.side)
    scene = scene_from_frames(images, recording, None)
    hairs = trial.scene.hairs
    options = options_for(recording, [h.whisker.length for h in hairs], [HIDDEN] * len(hairs))
    templates = find_templates(images[::4], scene, options, [h.whisker.name for h in hairs])
    (lines,) = trace_templates(images, scene, templates, options)
    for row in range(len(lines)):
        x, y = trial.motion.centrelines(lines.whisker[row], [lines.frame[row]])
        away, _ = cKDTree(np.vstack([x, y]).T).query(lines.row(row))
        assert away.max() < 30, lines.frame[row]  # px; on C2's far part it would be 49
