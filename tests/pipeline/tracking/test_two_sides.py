"""Rows on both sides of a face, each with names of its own."""

import measuring
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from usual_parameters import options_for

from pipeline.detection.line import Line
from pipeline.run import analyse
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.session.session_file import read_session
from pipeline.tables import Centrelines
from pipeline.tracking import two_sides
from pipeline.tracking.given_lengths import GivenLengths
from pipeline.tracking.registry import WhiskerTemplate
from synthetic.scoring import line_scoring
from synthetic.session import render_session

OPTIONS = options_for(Recording(500.0, 16.0, "top"))


def template(base, direction, length, seen=6):
    """A straight whisker, `length` [px] long; its direction [rad] is 0 downwards."""
    along = np.arange(length)[:, None] * [np.sin(direction), np.cos(direction)]
    line = Line.empty(400)
    line.x[:length], line.y[:length] = (base + along).T
    line.n, line.amplitude[:length] = length, 0.1
    return WhiskerTemplate("", np.array(base, float), float(length), (line,) * seen)


def row(side, lengths):
    """Whiskers from snout to eye, on the left (−1) or right (1) of a snout at (360, 200)."""
    places = [(360 + side * (60 + 5 * k), 200 - 8 * k) for k in range(len(lengths))]
    directions = side * np.radians(np.linspace(40, 110, len(lengths)))
    return [template(*each) for each in zip(places, directions, lengths, strict=True)]


LENGTHS = 60, 80, 110, 150, 200  # px, anterior to posterior


def named(templates, names, longest=None):
    return named_and_beside(templates, names, longest)[0]


def named_and_beside(templates, names, longest=None):
    sides = two_sides.names_by_side(names, "top")
    return two_sides.named_by_side(templates, sides, "top", OPTIONS, GivenLengths(longest or {}))


def test_names_tell_the_side():
    names = ["right_C1", "left_w1", "right_w2"]
    assert two_sides.names_by_side(names, "top") == (["left_w1"], ["right_C1", "right_w2"])
    assert two_sides.names_by_side(["upper_a", "lower_b"], "left") == (["upper_a"], ["lower_b"])
    assert two_sides.names_by_side(["left_w1", "C2"], "top") is None
    assert two_sides.names_by_side(["left_w1"], "left") is None
    assert two_sides.names_by_side(None, "top") is None


def test_each_side_has_its_own_names_from_snout_to_eye():
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    names = [f"{side}_{k}" for side in ("right", "left") for k in range(5)]
    found = {each.name: each for each in named([*right[::-1], *left], names)}
    for side, templates in (("left", left), ("right", right)):
        for k, each in enumerate(templates):
            assert found[f"{side}_{k}"].base_xy == pytest.approx(each.base_xy)


def test_lengths_tell_where_names_run_the_other_way():
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    names = [f"{side}_{k}" for side in ("left", "right") for k in range(5)]
    longest = {f"left_{k}": float(px) for k, px in enumerate(LENGTHS[::-1])}
    longest |= {f"right_{k}": float(px) for k, px in enumerate(LENGTHS)}
    found = {each.name: each for each in named([*left, *right], names, longest)}
    for name, each in found.items():
        assert each.visible_px == longest[name] == each.longest_px


def test_arcs_tell_where_the_lengths_are_not_known():
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    names = [f"{side}_C{k}" for side in ("left", "right") for k in range(1, 6)]
    found = {each.name: each for each in named([*left, *right], names)}
    for name, each in found.items():
        assert each.visible_px == LENGTHS[::-1][int(name[-1]) - 1]


def test_of_each_side_the_best_seen_are_named():
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    seldom = template((290, 215), -1.2, 150, seen=1)
    found = named([seldom, *left, *right], ["left_a", "right_a", "right_b"])
    assert [each.name for each in found] == ["left_a", "right_a", "right_b"]
    assert found[0].visible_px == 200


@pytest.mark.filterwarnings("error")
def test_one_side_alone_may_be_named():
    right = row(1, LENGTHS)
    found, beside = named_and_beside([*row(-1, LENGTHS), *right], ["left_a", "left_b"])
    assert beside == right
    assert [each.name for each in found] == ["left_a", "left_b"]
    assert all(each.base_xy[0] < 360 for each in found)


def test_one_row_is_not_two():
    names = ["left_a", "right_a", "right_b"]
    assert named(row(1, LENGTHS), names) is None


def test_a_place_belongs_to_the_side_that_its_base_is_on():
    places = [3.0, 10.0, 10.1, -4.0]
    assert list(two_sides.side_of(places, (10.0,))) == [0, 0, 1, 0]
    assert list(two_sides.side_of(places, ())) == [0, 0, 0, 0]
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    along = np.array([1.0, 0.0])
    cuts = two_sides.cuts_between([*right, *left], along, DEFAULTS.identity)
    assert two_sides.sides_of([*right, *left], along, cuts) == [left, right]


ALONG = np.array([1.0, 0.0])


@pytest.mark.parametrize("far", [1, 60, 300])
def test_hairs_at_the_ears_do_not_make_two_sides_one(far):
    left, right = row(-1, LENGTHS), row(1, LENGTHS)
    hairs = [template((360 + 100 * s + far * s, 100), s * 1.8, 60) for s in (-1, 1)]
    (cut,) = two_sides.cuts_between([*right, *left, *hairs], ALONG, DEFAULTS.identity)
    assert cut == pytest.approx(360)


@given(count=st.integers(2, 9), spacing=st.floats(1, 30), spread=st.floats(0.2, 2.2))
def test_whiskers_evenly_along_a_face_are_one_row(count, spacing, spread):
    directions = np.linspace(-spread, spread, count)
    even = [template((spacing * k, 200), each, 80) for k, each in enumerate(directions)]
    assert two_sides.cuts_between(even, ALONG, DEFAULTS.identity) == ()


def test_whiskers_without_names_are_counted_on_each_side():
    left, right = row(-1, LENGTHS[:3]), row(1, LENGTHS)
    names = two_sides.counted_names([*right, *left], "top", OPTIONS)
    assert names == ("left_w1", "left_w2", "left_w3", *(f"right_w{k}" for k in range(1, 6)))
    assert two_sides.counted_names(left, "top", OPTIONS) == ("w1", "w2", "w3")
    assert two_sides.counted_names([], "top", OPTIONS) == ()


FRAMES = 12


@pytest.fixture(scope="module")
def rats(tmp_path_factory):
    """Rendered videos of two rats."""
    folder = tmp_path_factory.mktemp("rats")
    paths = render_session(folder, "rat_both_sides", 11, 2, frames=FRAMES)
    return [measuring.RenderedVideo.of(path, folder) for path in paths]


@pytest.mark.slow
@pytest.mark.parametrize("given", [("left", "right"), ("right",)])
def test_whiskers_of_rendered_rats_get_names_of_their_own_side(rats, given):
    same, most = [], 12 * len(given) * FRAMES * len(rats)
    for rat in rats:
        settings, chunks = read_session(rat.path.parent / "session.toml"), []
        settings = settings.model_copy(
            update={"whisker": [w for w in settings.whisker if w.name.split("_")[0] in given]}
        )
        analyse(rat.path, settings, keep=chunks.append)
        lines: Centrelines = measuring.join_chunks(chunks)
        known = lines.confidence >= 0.5
        near = np.array(line_scoring.score_lines(lines, rat.lines()).rows["nearest"])[known]
        name = np.array(lines.names)[lines.whisker][known]
        same += [a.split("_")[0] == b.split("_")[0] for a, b in zip(name, near, strict=True)]
    assert np.mean(same) > 0.97
    assert len(same) > 0.8 * most
