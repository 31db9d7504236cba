"""One row of whiskers, or the two sides of a face."""

import numpy as np
import pytest
from usual_parameters import options_for

from pipeline.identity.features import ANGLE
from pipeline.identity.sides import Sides
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from pipeline.tracking.matching import Ruler

OPTIONS = options_for(Recording(500.0, 16.0, "top"))
RULER = Ruler.of("top", OPTIONS)


def at(x, y):
    """A place [px] beside the tip of the snout."""
    return np.array([300.0 + x, 200.0 + y])


class Drawn:
    def __init__(self, points):
        self.points = points


class WhiskerTemplate:
    def __init__(self, base, direction, length=150):
        points = base + np.arange(length)[:, None] * [np.sin(direction), np.cos(direction)]
        self.base_xy, self.samples = points[0], (Drawn(points),)


def row(side, directions):
    """Whiskers 5 px apart from snout to eye, on the left (−1) or right (1) of a snout."""
    bases = [at(side * (60 + 5 * k), -8 * k) for k in range(len(directions))]
    return [WhiskerTemplate(base, side * d) for base, d in zip(bases, directions, strict=True)]


def lines_of(templates):
    points = [template.samples[0].points for template in templates]
    counts = [len(p) for p in points]
    x, y = np.concatenate(points).T.astype(np.float32)
    rows = np.arange(len(templates), dtype=np.int32)
    offsets = np.append(0, np.cumsum(counts))
    return Centrelines(
        names=(), frame=0 * rows, whisker=rows, offsets=offsets, x_px=x, y_px=y,
        se_px=None, confidence=np.ones(len(templates), np.float32),
    )  # fmt: skip


def sides_of(templates, may_be_two=True):
    return Sides.of(templates, RULER, "top", OPTIONS.pixels_per_m, may_be_two, DEFAULTS.identity)


def test_two_sides_are_two_rows_whose_angles_grow_towards_the_eye():
    directions = np.radians([40, 60, 80, 95, 110])
    left, right = row(-1, directions), row(1, directions)
    sides = sides_of([*left, *right])
    assert sides.names == ("left_", "right_")
    side, features = sides.features(lines_of([*left, *right]))
    assert side.tolist() == [0] * 5 + [1] * 5
    for own in (slice(0, 5), slice(5, 10)):
        assert (np.diff(features[own, ANGLE]) > 0).all()
    assert features[:5, ANGLE] == pytest.approx(features[5:, ANGLE], abs=np.radians(1))


def test_a_fan_on_one_side_is_one_row():
    fan = [WhiskerTemplate(at(8 * k, 0), np.radians(30 * (k - 2))) for k in range(5)]
    assert sides_of(fan).names == ("",)


def test_two_groups_that_grow_the_same_way_are_one_row():
    fan = [WhiskerTemplate(at(x, 0), 0.02 * k) for k, x in enumerate([0, 10, 20, 120, 130, 140])]
    assert sides_of(fan).names == ("",)


def test_named_whiskers_are_one_row():
    directions = np.radians([40, 60, 80, 95, 110])
    assert sides_of([*row(-1, directions), *row(1, directions)], False).names == ("",)
