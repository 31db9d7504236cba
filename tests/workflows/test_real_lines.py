"""Lines beside labels whose answer is known."""

import itertools
import json

import numpy as np
import pytest
import real_lines
from real_lines import LabelledFrame


def row(y, start, stop):
    """A straight line at height y."""
    return np.array([[start, y], [stop, y]], float)


def frame(*kinds, **others):
    """Labels of 115 px, of which 100 px count, 50 px from each other."""
    whiskers = tuple((kind, row(50 * k, 0, 115)) for k, kind in enumerate(kinds))
    return LabelledFrame(7, whiskers, **others)


def scored(labelled, *lines):
    return real_lines.score([labelled], {7: list(lines), 8: [row(25, 0, 100)]})


def test_a_whisker_is_found_along_one_line_only():
    labelled = frame("clear", "faint", "clear")
    lines = row(1, 0, 115), row(50.5, 0, 61), row(50.5, 61, 122), row(102.6, 0, 115)
    found = scored(labelled, *lines)
    assert found.found == {"clear": [True, False], "faint": [False]}
    assert found.wrong == [1]  # the one 2.6 px away
    assert np.median(found.distances) == pytest.approx(1.0)
    assert found.cells() == ["1 of 2 (50%)", "0 of 1 (0%)", "1.00", "1.00"]


def test_sixty_percent_beyond_the_base_are_needed():
    for reached, enough in ((15 + 59 - 3, False), (15 + 61, True)):
        assert scored(frame("clear"), row(0, -60, reached)).found["clear"] == [enough]
    assert scored(frame("clear"), row(0, 45, 145)).found["clear"] == [True]


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        (row(25, 0, 100), 1),
        (row(25, 0, 59.9), 0),  # too short to be judged
        (row(0, 70, 170), 1),  # 45 + 2.5 of 100 px are along the label
        (row(0, 60, 160), 0),  # 55 + 2.5
        (row(80, 0, 100), 0),  # along a hair that is not judged
        (row(25, 200, 300), 0),  # in an ignored polygon
        (row(25, 171, 299), 0),  # with 29 px outside of it
        (row(25, 165, 299), 1),
    ],
)
def test_wrong_lines(line, wrong):
    polygon = np.array([[200, 0], [300, 0], [300, 60], [200, 60]])
    labelled = frame("clear", unjudged=(row(80, 0, 115),), ignored=(polygon,))
    assert scored(labelled, line).wrong == [wrong]


def test_every_line_is_wrong_where_there_is_nothing():
    nothing = scored(frame(), row(0, 0, 100), row(50, 0, 100))
    assert nothing.wrong == [2]
    assert nothing.cells() == ["–", "–", "2.00", "–"]
    assert real_lines.score((), {}).cells() == ["–"] * 4


def test_distances_are_those_to_the_nearest_of_many_points():
    rng = np.random.default_rng(3)
    line, points = np.cumsum(rng.normal(0, 5, (12, 2)), axis=0), rng.normal(0, 20, (30, 2))
    part = np.linspace(0, 1, 2001)[:, None]
    many = np.concatenate([a + part * (b - a) for a, b in itertools.pairwise(line)])
    nearest = np.hypot(*(points[:, None] - many).transpose(2, 0, 1)).min(axis=1)
    assert real_lines.distance(points, line) == pytest.approx(nearest, abs=0.01)  # px


def test_labels_are_read_by_video(tmp_path):
    path = tmp_path / "labels.json"
    whisker = {"id": 0, "kind": "faint", "xy": [[0, 1], [2, 3]]}
    entry = {
        "video": "a",
        "frame": 3,
        "whiskers": [whisker],
        "ignore": [],
        "unjudged": [[[1, 1]] * 2],
    }
    path.write_text(json.dumps([entry, {**entry, "video": "b"}, {**entry, "frame": 5}]), "utf-8")
    labels = real_lines.read_labels(path)
    assert {video: [f.frame for f in frames] for video, frames in labels.items()} == {
        "a": [3, 5],
        "b": [3],
    }
    ((kind, points),) = labels["b"][0].whiskers
    assert kind == "faint"
    assert points.tolist() == [[0, 1], [2, 3]]
    assert len(labels["b"][0].unjudged) == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("no JSON", "a JSON list"),
        ('[{"video": "a", "whiskers": []}]', "'frame'"),
        ('[{"video": "a", "frame": 1, "whiskers": [{"kind": "clear"}]}]', "'xy'"),
        (
            '[{"video": "a", "frame": 1, '
            '"whiskers": [{"kind": "plain", "xy": [[0, 0], [1, 1]]}]}]',
            "'plain': expected clear or faint",
        ),
        (
            '[{"video": "a", "frame": 1, '
            '"whiskers": [{"kind": "clear", "xy": [0, 1]}]}]',
            r"shape \(2,\)",
        ),
    ],
)  # fmt: skip
def test_unusable_labels_are_named(tmp_path, text, said):
    path = tmp_path / "labels.json"
    path.write_text(text, "utf-8")
    with pytest.raises(ValueError, match=said):
        real_lines.read_labels(path)
