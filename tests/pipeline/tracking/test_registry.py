"""Which whiskers there are, and who is who, in a dense row that whisks fast."""

import warnings
from dataclasses import replace

import cv2
import numpy as np
import pytest
from still_scene import scene_from_frames
from traced_lines import trace_templates
from usual_parameters import options_for

from pipeline.detection.line import Line
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking import registry
from pipeline.tracking.given_lengths import GivenLengths
from pipeline.tracking.matching import Ruler
from pipeline.tracking.registry import (
    WhiskerTemplate,
    find_templates,
    gather,
    mostly_seen,
    named_as_given,
)
from pipeline.tracking.snout import anterior_first
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.scoring import line_scoring
from synthetic.truth import centreline_table, visibility_table

pytestmark = pytest.mark.slow

FRAMES = 180
NOISE_SD = 1.5  # grey levels, as in the preset
HIDDEN = 1.4e-3  # m


class Row:
    """Rendered frames of `dense_row`, their templates and traced lines, scored."""

    def __init__(self):
        trial = make_trial("dense_row", 0, 0, FRAMES)
        renderer = Renderer(trial.scene, trial.motion)
        self.images = np.array([renderer.frame(i) for i in range(FRAMES)])
        camera = trial.scene.camera
        recording = Recording(camera.frames_per_second, camera.pixels_per_mm, "left")
        self.names = list(trial.scene.names)
        self.scene = scene_from_frames(self.images[::5], recording, None, None, FRAMES)
        lengths = [hair.whisker.length for hair in trial.scene.hairs]
        self.options = options_for(recording, lengths, [HIDDEN] * len(lengths))
        self.templates = find_templates(self.images[::8], self.scene, self.options, self.names)
        lines = centreline_table(trial.motion)
        visible = visibility_table(trial.motion, renderer, lines)
        truth = line_scoring.visible_truth(lines, visible, camera.pixels_per_mm, NOISE_SD)
        chunks = trace_templates(
            self.images, self.scene, self.templates, self.options, chunk_frames=10**6
        )
        self.lines = next(iter(chunks))
        self.scores = line_scoring.score_lines(self.lines, truth)


@pytest.fixture(scope="module")
def row():
    return Row()


def test_all_whiskers_are_among_the_templates_in_order(row):
    assert [template.name for template in row.templates] == row.names
    bases = [template.base_xy[1] for template in row.templates]
    assert np.all(np.diff(bases) > -1.5)  # px: some leave the face at the same place


def test_what_is_dark_in_a_few_damaged_frames_does_not_hide_whiskers():
    share, strength = np.array([0.1, 0.9, 0.8, 1.0]), np.array([300.0, 10.0, 8.0, 1.0])
    np.testing.assert_array_equal(mostly_seen(share, strength, DEFAULTS.tracking), [1, 2])


def test_lengths_that_are_given_decide_the_order_whatever_the_thickness(row):
    options = replace(row.options, visible_px=row.options.visible_px[::-1])
    templates = find_templates(row.images[::8], row.scene, options, row.names[::-1])
    bases = {template.name: template.base_xy for template in templates}
    for template in row.templates:  # in which thickness says the same as length
        np.testing.assert_allclose(bases[template.name], template.base_xy)


def test_whiskers_keep_their_names_in_fast_whisking(row):
    rows = row.scores.rows
    wrong = (rows["nearest"] != rows["whisker"]).to_numpy()
    assert len(rows) > 0.97 * FRAMES * len(row.names)
    assert wrong.mean() < 0.015
    assert (row.scores.whiskers["covered"] >= 0.8).mean() > 0.95


def test_it_is_sure_mostly_and_then_right(row):
    rows = row.scores.rows
    wrong = (rows["nearest"] != rows["whisker"]).to_numpy()
    unsure = row.lines.confidence <= 0.5
    assert unsure.mean() < 0.1  # neighbours do lie upon each other at times
    assert wrong[~unsure].mean() < 0.015


@pytest.mark.filterwarnings("error::RuntimeWarning")  # of lines without nodes
def test_whiskers_beside_each_other_are_not_taken_for_one_broad_one(monkeypatch):
    n = 1000
    trial = make_trial("dense_row", 3, 0, n)
    renderer = Renderer(trial.scene, trial.motion)
    chosen = np.arange(0, n, n // 24)[:24]
    images = np.array([renderer.frame(i) for i in chosen])
    camera = trial.scene.camera
    recording = Recording(camera.frames_per_second, camera.pixels_per_mm, "left")
    scene = scene_from_frames(images, recording, None, None, n)
    lengths = [hair.whisker.length for hair in trial.scene.hairs]
    options = options_for(recording, lengths, [HIDDEN] * len(lengths))
    groups = []
    monkeypatch.setattr(registry, "gather", lambda *a: groups.extend(gather(*a)) or groups)
    templates = find_templates(images, scene, options, list(trial.scene.names), chosen)
    frame_of = {
        id(line): chosen[k] for g in groups for k, line in zip(g.frames, g.lines, strict=True)
    }
    truth = centreline_table(trial.motion)
    for template in templates:
        true = [_nearest(line, truth, frame_of[id(line)]) for line in template.samples]
        assert true.count(template.name) > 0.8 * len(true), template.name


PX_PER_MM = 25.0


def whisking(*drawn, frames=12):
    """Frames of hairs on a face at the left: (y [px], length [mm], grey level, frames) of each.

    All of them whisk by ±8° but those whose last number is 0: these are seen in all frames, still.
    """
    images, rng = [], np.random.default_rng(4)
    for k, angle in enumerate(np.radians(np.linspace(-8, 8, frames))):
        picture = np.full((300, 400), 180, np.uint8)
        picture[:, :40] = 8
        for y, length_mm, grey, seen in drawn:
            if seen and k >= seen:
                continue
            length, turn = length_mm * PX_PER_MM, angle if seen else 0.0
            tip = 40 + length * np.cos(turn), y - length * np.sin(turn)
            ends = [tuple(round(16 * v) for v in end) for end in ((40, y), tip)]
            cv2.line(picture, *ends, grey, 1, cv2.LINE_AA, 4)
        noisy = cv2.GaussianBlur(picture.astype(float), (0, 0), 0.7)
        images.append(np.uint8(np.clip(noisy + rng.normal(0, 1.5, picture.shape), 0, 255)))
    return np.array(images)


@pytest.mark.parametrize(
    ("names", "drawn"),
    [
        (None, [(200, 13, 30, 12), (130, 3.75, 70, 12), (90, 2, 50, 12)]),
        (["a", "b"], [(200, 13, 30, 12), (130, 5, 70, 5), (30, 4, 70, 0)]),
    ],
)
def test_a_short_anterior_whisker_is_one_and_a_hair_of_the_fur_is_none(names, drawn):
    images = whisking(*drawn)
    recording = Recording(500.0, PX_PER_MM, "left")
    scene = scene_from_frames(images, recording, None, None, len(images))
    templates = find_templates(images, scene, options_for(recording), names)
    assert [round(template.base_xy[1], -1) for template in templates] == [130, 200]  # px


def straight(follicle_y, angle, length, thickness):
    """A line (`detection.Line`) to the right, 1.4 mm from its follicle at (35, follicle_y) px."""
    line = Line.empty(300)
    line.n = length
    s = 1e3 * HIDDEN * 17.5 + np.arange(length)
    line.x[:length], line.y[:length] = 35 + s * np.cos(angle), follicle_y - s * np.sin(angle)
    line.thickness[:], line.amplitude[:] = thickness, 0.3
    return line


@pytest.mark.parametrize(("width", "turned"), [(500, True), (180, False)])
def test_a_whisker_that_the_border_cuts_does_not_decide_the_order(width, turned):
    templates = []
    for y, length, thickness in ((100, 150, 1.0), (150, 120, 1.2)):
        line = straight(y, 0.0, length, thickness)
        templates.append(WhiskerTemplate("", line.points[0], length, (line,) * 5))
    # in the other order they would be more alike, seen 150 and 120 px long
    given = {"a": 150.0, "b": 180.0}
    tips_seen = np.zeros((240, width), bool)
    tips_seen[12:-12, 12:-12] = True
    found = named_as_given(anterior_first(templates, None), GivenLengths(given, tips_seen))
    assert [template.name for template in found] == ["a", "b"]
    assert [template.longest_px for template in found] == [150.0, 180.0]
    assert (found[0].visible_px == 120) == turned


@pytest.mark.parametrize(("names", "turned"), [("ab", True), (("C1", "C2"), False)])
def test_arcs_tell_the_order_of_whiskers_without_lengths(names, turned):
    templates = []
    for y, length, thickness in ((100, 150, 1.2), (150, 120, 1.0)):
        line = straight(y, 0.0, length, thickness)
        templates.append(WhiskerTemplate("", line.points[0], length, (line,) * 5))
    given = dict.fromkeys(names, np.inf)  # by their letters: anterior to posterior
    found = named_as_given(anterior_first(templates, None), GivenLengths(given))
    assert [template.name for template in found] == list(names)
    assert (found[0].visible_px == 120) == turned


def test_a_whisker_that_moves_by_itself_is_one_whisker():
    rng = np.random.default_rng(3)
    sizes = [(100, 180, 0.9), (130, 220, 1.1), (160, 260, 1.3)]
    angles = rng.choice([-0.2, 0.2], (24, 3)) + rng.normal(0, 0.02, (24, 3))
    found = [
        [straight(y, a, n, thick) for (y, n, thick), a in zip(sizes, row, strict=True)]
        for row in angles
    ]
    ruler = Ruler.of("left", options_for(Recording(1000.0, 17.5, "left")))
    groups = gather(found, ruler)
    assert sorted(len(g.frames) for g in groups) == [24, 24, 24]
    for group in groups:
        assert np.ptp([line.n for line in group.lines]) == 0
    # two that are seen together stay two, however alike
    beside = [[straight(100, a, 180, 0.9), straight(103, a + 0.4, 180, 0.9)] for a in angles[:, 0]]
    assert len(gather(beside, ruler)) == 2


def _nearest(line, truth, frame):
    """Name of the true whisker that most of a line lies on."""
    rows = np.flatnonzero(truth.frame == frame)
    near = [
        np.median(
            np.hypot(*(line.points[::3, None] - truth.row(r)[None]).transpose(2, 0, 1)).min(axis=1)
        )
        for r in rows
    ]
    return truth.names[truth.whisker[rows[int(np.argmin(near))]]]


def test_a_part_that_no_line_shows_is_unknown_without_a_warning():
    """Nothing is printed by NumPy where no line of a whisker shows its thickness."""
    group = registry._Group()
    for frame, thickness in enumerate((np.nan, np.nan, np.nan)):
        group.add(frame, None, np.array([10.0 + frame, 0.2, thickness, 4.0]), 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_allclose(group.signature, [11.0, 0.2, np.nan, 4.0])


def test_a_group_of_lines_apart_from_all_others_is_hair_where_it_is_weak_or_seldom():
    def group(y, frames):
        lines = [_drawn(y, 100) for _ in range(frames)]
        return registry._Group(list(range(frames)), lines, [np.zeros(4)] * frames)

    row = [group(10.0 * k, 20) for k in range(12)]
    apart = 12 * 10.0 + 40.0  # px: two fifths of a line's length from the last one
    for frames, hair in ((5, True), (20, False)):
        found = registry._are_hairs([*row, group(apart, frames)])
        assert found.tolist() == [False] * 12 + [hair]
    assert registry._are_hairs([]).shape == (0,)


def _drawn(y, length):
    """A straight line that begins at x = 0."""
    line = Line.empty(length)
    line.n, line.x[:], line.y[:], line.amplitude[:] = length, np.arange(length), y, 0.5
    return line
