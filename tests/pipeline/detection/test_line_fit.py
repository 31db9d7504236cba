"""Following one whisker across what hides it, on pictures drawn from the exact profile."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from traced_lines import trace_templates
from usual_parameters import options_for

from pipeline.detection import line_fit, line_profile
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line, Workspace
from pipeline.detection.refinement import refine
from pipeline.detection.static_scene import PoleTrack, StaticScene
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking import bends
from pipeline.tracking.registry import find_templates
from pipeline.tracking.tracker import Tracker

FACE, TIP = 40, 520  # columns
ROD, ROD_END = range(250, 350), 185  # its columns, and the row at which it ends
BELOW = 0.12  # rad: so far turned, the whisker passes below the rod
LIGHT, NOISE, SIGMA = 180.0, 2.0, 1.1


def height_of(x, turn):
    """Row of the whisker in column x: bent, and turned about its base by `turn` [rad]."""
    return 150 + 3e-4 * (x - FACE) ** 2 + turn * (x - FACE)


def picture(rod_light, turn=0.0, tip=TIP, seed=0):
    """A whisker from the face on the left, and a vertical rod that lets some light through."""
    y, x = np.mgrid[:300, :600]
    slope = 6e-4 * (x - FACE) + turn
    off = (y - height_of(x, turn)) / np.hypot(1, slope)
    image = bare(rod_light) * (1 - 0.4 * np.exp(-0.5 * (off / SIGMA) ** 2) * (x < tip))
    image += np.random.default_rng(seed).normal(0, NOISE, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def bare(rod_light):
    background = np.full((300, 600), LIGHT)
    background[:, :FACE] = 8
    background[:ROD_END, ROD] = rod_light
    return background


def scene(rod_light):
    face, rod = np.zeros((2, 300, 600), bool)
    face[:, :FACE] = True
    rod[:ROD_END, ROD] = True
    background = bare(rod_light).astype(np.float32)
    return StaticScene(background, 0.0, NOISE**2 + 1 / 12, face, rod, None, "left")


def tracker(rod_light):
    options = options_for(Recording(1000.0, 25.0, "left"))
    whole = [picture(rod_light, turn, seed=k) for k, turn in enumerate((BELOW, 0.14, 0.16))]
    templates = find_templates(np.array(whole), scene(rod_light), options, ["C2"])
    return Tracker(scene(rod_light), templates, options)


def line_in(tracker, image):
    (track,) = tracker.step(image)
    return track.line


def error(line, turn):
    """RMS distance from the true line where the rod does not hide it [px]."""
    free = ~np.isin(np.rint(line.points[:, 0]), ROD)
    x, y = line.points[free].T
    off = (y - height_of(x, turn)) / np.hypot(1, 6e-4 * (x - FACE) + turn)
    return np.sqrt((off**2).mean())


def test_the_part_beyond_an_opaque_rod_is_found_again_at_once():
    follow = tracker(rod_light=15)
    assert line_in(follow, picture(15, BELOW)).points[-1, 0] > TIP - 15
    for turn in (0.09, 0.06, 0.04, 0.03):
        line = line_in(follow, picture(15, turn, tip=ROD.start))
        assert line.points[-1, 0] == pytest.approx(ROD.start, abs=8)  # px
    line = line_in(follow, picture(15, 0.02))
    assert line.points[-1, 0] > TIP - 15  # px
    assert error(line, 0.02) < 0.05  # px


def test_nothing_is_invented_beyond_a_rod():
    follow = tracker(rod_light=15)
    line_in(follow, picture(15, BELOW))
    for k in range(40):
        line = line_in(follow, picture(15, 0.05 - 1e-3 * k, tip=ROD.start, seed=k))
        assert line.points[-1, 0] < ROD.start + 8  # px


def test_a_whisker_is_followed_across_a_rod_that_lets_light_through():
    follow = tracker(rod_light=80)
    for turn in (0.0, 0.01, 0.02):
        line = line_in(follow, picture(80, turn, tip=ROD.stop - 30))
    assert line.points[-1, 0] == pytest.approx(ROD.stop - 30, abs=12)  # px


@pytest.mark.parametrize(("seen", "end"), [(18, 100), (40, 180)])
def test_the_wider_a_gap_the_more_must_be_seen_beyond_it(seen, end):
    n, sums = 180, np.ones((line_profile.N_SUMS, 180))
    sums[line_profile.G11, 100:140] = 0  # behind a rod
    amplitude = np.zeros(n)
    amplitude[:100] = amplitude[140 : 140 + seen] = 0.5
    fit = line_fit.Fit(30, np.inf, np.inf, False, faintest=0.012, unseen=12, half=7, steps=4)
    found = line_fit.visible_end(amplitude, np.full(n, 0.02), sums, n, 100, fit)
    assert found == pytest.approx(end, abs=fit.half // 2 + 1)


def test_obstacles_are_not_searched_and_their_edges_not_used():
    model = ImageModel.from_scene(scene(80), DEFAULTS.detection)
    assert not model.usable[:ROD_END, ROD].any()
    assert (model.weight[: ROD_END - 4, ROD.start + 4 : ROD.stop - 4] > 0).all()
    assert (model.weight[:ROD_END, ROD.start] == 0).all()
    assert not ImageModel.from_scene(scene(15), DEFAULTS.detection).weight[:ROD_END, ROD].any()


def test_a_hidden_tip_turns_with_the_line():
    along = np.arange(300.0)
    whole_x, whole_y = along, 4e-4 * along**2
    turn, n = np.radians(10), 180
    x, y = np.zeros((2, 400))
    x[:n] = np.cos(turn) * whole_x[:n] - np.sin(turn) * whole_y[:n] + 5
    y[:n] = np.sin(turn) * whole_x[:n] + np.cos(turn) * whole_y[:n] + 7
    weight = np.ones((200, 400), np.float32)
    arguments = x, y, np.ones(400), n, whole_x, whole_y, np.ones(300), 300, weight, 30
    assert line_fit.carry_on(*arguments) == n, "nothing hides the tip"
    weight[:, int(x[n - 1]) + 10 : int(x[n - 1]) + 60] = 0
    assert line_fit.carry_on(*arguments) == 300
    true_x = np.cos(turn) * whole_x - np.sin(turn) * whole_y + 5
    true_y = np.sin(turn) * whole_x + np.cos(turn) * whole_y + 7
    assert np.hypot(x[:300] - true_x, y[:300] - true_y).max() < 0.01  # px


def parallel_whiskers(rows):
    """Straight whiskers that leave the face in the given rows."""
    y = np.arange(300.0)[:, None]
    image = np.full((300, 600), LIGHT)
    for row in rows:
        image[:, :TIP] *= 1 - 0.4 * np.exp(-0.5 * ((y - row) / SIGMA) ** 2)
    image[:, :FACE] = 8
    image += np.random.default_rng(len(rows)).normal(0, NOISE, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def test_a_lost_whisker_is_not_sought_on_the_wrong_side_of_another():
    empty, options = scene(LIGHT), options_for(Recording(1000.0, 25.0, "left"))
    empty.obstacle_mask[:] = False
    both = [parallel_whiskers((100, 118))] * 3
    templates = find_templates(np.array(both), empty, options, ["a", "b"])
    images = 40 * [parallel_whiskers((100, 118))] + 25 * [parallel_whiskers((80, 100))]
    (lines,) = trace_templates(images, empty, templates, options)
    rows = {0: [], 1: []}
    for whisker, frame, start in zip(lines.whisker, lines.frame, lines.offsets, strict=False):
        rows[whisker].append((frame, round(float(lines.y_px[start]))))
    always, lost = sorted(rows.values(), key=len, reverse=True)
    assert always == [(k, 100) for k in range(65)]
    assert lost == [(k, 118) for k in range(40)], "what is seen at row 80 must be another hair"


@pytest.mark.parametrize(("kappa", "hook"), [(60.0, False), (150.0, False), (500.0, True)])
def test_a_line_that_turns_sharply_at_its_base_is_no_whisker(kappa, hook):
    follow = tracker(rod_light=15)
    line = line_in(follow, picture(15, BELOW)).copy()
    angle = kappa * np.minimum(np.arange(line.n) / 25e3, 2e-3)
    line.x[: line.n], line.y[: line.n] = (
        40 + np.cumsum(np.cos(angle)),
        50 + np.cumsum(np.sin(angle)),
    )
    assert bends.hooked(line.x, line.y, line.n, follow.follower.bends) == hook


def distance_from_walls(shape=(120, 120)):
    """How much farther than 6 px from a face above row 20 and a body left of column 20 [px]."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    return np.minimum(x, y) - 20 - 6


@pytest.mark.parametrize(
    ("begin", "end", "clear"),
    [
        ((36, 20), (20, 40), True),  # a short whisker in the corner, from the face to the body
        ((23, 20), (23, 60), False),  # along the body
        ((40, 24), (90, 20), False),  # along the face
        ((22, 30), (27, 70), False),  # hardly off the body
        ((60, 20), (60, 30), True),  # short, straight off the face
        ((60, 20), (90, 80), True),
    ],
)
def test_a_line_may_be_near_an_edge_but_not_along_it(begin, end, clear):
    n = int(np.hypot(*np.subtract(end, begin)))
    x, y = np.linspace(begin, end, n).T.copy()
    assert line_fit.is_clear(x, y, n, distance_from_walls()) == clear


@pytest.mark.parametrize(
    ("corners", "kept"),
    [
        ([(70, 20), (24, 60), (23, 100)], 1),  # off the face to the body, then on along it
        ([(70, 20), (21, 60)], 2),  # ends at the body
        ([(22, 20), (22, 70), (60, 110)], 3),  # between them at its base, in the open at its end
        ([(70, 20), (24, 60), (22, 70)], 3),  # touches the body with its tip alone
    ],
)
def test_what_a_line_adds_along_an_edge_at_its_end_is_cut(corners, kept):
    parts = [_straight(a, b) for a, b in pairwise(corners)]
    x, y = np.concatenate(parts).T.copy()
    n = line_fit.without_edge(x, y, len(x), distance_from_walls())
    wanted = sum(map(len, parts[:kept]))
    assert abs(n - wanted) <= line_fit.ALONG


def test_a_base_that_slid_along_the_skin_comes_back():
    moved_out = np.ones((300, 600))
    moved_out[:, FACE : FACE + 6] = 0.6  # of the light passes the edge of the skin
    x = np.arange(FACE + 8.0, FACE + 200)
    whisker = np.column_stack([x, height_of(x, 0.0)])
    slid = np.concatenate([_straight((FACE + 3, 110), whisker[0]), whisker])
    base = refined(picture(LIGHT) * moved_out, slid).points[0]
    assert base == pytest.approx([FACE, height_of(FACE, 0.0)], abs=2.0)  # px


def test_a_whisker_that_hardly_leaves_the_face_is_measured_from_its_base_on():
    begin, off = (FACE, 40), np.radians(20.0)  # from the face's edge
    nodes = _straight(begin, np.add(begin, 200 * np.array([np.sin(off), np.cos(off)])))
    y, x = np.mgrid[:300, :600]
    away = (x - begin[0]) * np.cos(off) - (y - begin[1]) * np.sin(off)
    line = refined(bare(LIGHT) * (1 - 0.4 * np.exp(-0.5 * (away / SIGMA) ** 2)), nodes)
    known = line.information[: line.n] > 0
    near = line.points[:, 0] < FACE + 7
    assert known[near].mean() > 0.8 * known.mean()  # some nodes share their row of pixels


def refined(image, nodes):
    """The line that is fitted to a picture of the bare scene from rough `nodes` (n, 2) on."""
    options = options_for(Recording(1e3, 25.0, "left"))
    model = ImageModel.from_scene(scene(LIGHT), options.params.detection)
    workspace = Workspace(700, options.spacing_px)
    line = Line.empty(workspace.limit)
    line.n = len(nodes)
    line.x[: line.n], line.y[: line.n] = nodes.T
    line.amplitude[:], line.sigma[:] = 0.4, SIGMA
    for _ in range(6):
        refine(Frame(image.astype(np.uint8), model, 1.0, options, workspace), line)
    return line


def _straight(begin, end):
    """Nodes 1 px apart from `begin` to `end`, which is not among them."""
    return np.linspace(begin, end, int(np.hypot(*np.subtract(end, begin))), endpoint=False)


def test_a_tip_that_lies_against_a_thick_pole_is_kept():
    x0, y0, radius = 300.0, 150.0, 25.0
    far = np.hypot(*np.meshgrid(np.arange(600) - x0, np.arange(300) - y0))
    dark = np.where(far < radius, 5, bare(LIGHT)).astype(np.float32)
    before = replace(scene(LIGHT), background=dark, obstacle_mask=far < radius)
    pole = PoleTrack(np.full(1, x0), np.full(1, y0), radius)
    x = np.arange(FACE, x0 + 12)  # passes at the pole's edge, and ends 12 px farther
    y = np.full(len(x), y0 - radius - 1)
    kept = [
        line_fit.without_edge(
            x, y, len(x), ImageModel.from_scene(each, DEFAULTS.detection).off_edges
        )
        for each in (before, replace(before, pole=pole))
    ]
    assert kept[0] < len(x) - 16  # anything else as large is an edge
    assert kept[1] == len(x)


@pytest.mark.parametrize("seed", range(3))
def test_a_dark_hair_at_the_base_hardly_turns_a_faint_whisker(seed):
    """It begins 12 px beside the straight whisker and meets it 15 px off the face."""
    y, x = np.mgrid[:300, :600]
    image = bare(LIGHT) * (1 - 0.05 * np.exp(-0.5 * ((y - 150) / SIGMA) ** 2) * (x < 400))
    along, across = np.array([15.0, 12.0]) / np.hypot(15, 12)
    beside = (y - 138) * along - (x - FACE) * across
    is_hair = (FACE < x) & (x < FACE + 15)
    image *= 1 - 0.3 * np.exp(-0.5 * (beside / SIGMA) ** 2) * is_hair
    image += np.random.default_rng(seed).normal(0, NOISE, image.shape)
    image = np.clip(np.rint(image), 0, 255).astype(np.uint8)

    nothing = np.zeros(image.shape, bool)
    model = ImageModel.from_scene(replace(scene(LIGHT), obstacle_mask=nothing), DEFAULTS.detection)
    options = options_for(Recording(1000.0, 12.5, "left"))
    workspace = Workspace.for_picture(image.shape, options.spacing_px)
    line = Line.empty(workspace.limit)
    line.n = 350
    line.x[: line.n], line.y[: line.n] = FACE + np.arange(line.n), 150.0
    line.amplitude[:], line.sigma[:] = 0.05, SIGMA
    for _ in range(6):
        refine(Frame(image, model, 1.0, options, workspace), line)
    dx, dy = line.points[15] - line.points[0]
    angle = abs(np.degrees(np.arctan2(dy, dx)))
    assert angle < 1  # 8 if the misfit is left out, 37 to 44 if bends cost nothing either
