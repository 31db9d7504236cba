"""Which end of a row of whiskers is the snout's."""

import warnings

import numpy as np
import pytest

from pipeline.detection.line import Line
from pipeline.tracking.registry import WhiskerTemplate
from pipeline.tracking.snout import anterior_first, snout_of, thins_out


def template(place, length=150, thickness=1.0):
    """A whisker straight off a face at the left, `place` px down it."""
    line = Line.empty(400)
    line.n = length
    line.x[:length], line.y[:length] = 20 + np.arange(length), place
    line.thickness[:] = thickness
    return WhiskerTemplate("", line.points[0], length, (line,) * 3)


def places(templates):
    return [each.base_xy[1] for each in templates]


@pytest.mark.parametrize("thickness", [(1.0, 1.2, 1.4), (1.4, 1.2, 1.0)])
@pytest.mark.parametrize(
    ("snout", "order"), [("top", [50, 90, 130]), ("bottom", [130, 90, 50])]
)  # fmt: skip
def test_a_given_snout_is_the_anterior_end_whatever_whiskers_look_like(thickness, snout, order):
    row = [template(p, thickness=t) for p, t in zip((50, 90, 130), thickness, strict=True)]
    row = anterior_first(row, snout)
    assert places(row) == order
    assert snout_of(row, "left") == snout


@pytest.mark.parametrize(
    ("thickness", "length", "turned"),
    [
        ((1.0, 1.2, 1.4), (150, 150, 150), False),
        ((1.4, 1.2, 1.0), (150, 150, 150), True),
        ((1.0, 1.0, 1.0), (120, 150, 180), False),
        ((1.0, 1.0, 1.0), (180, 150, 120), True),
        ((1.4, np.nan, 1.0), (100, 150, 200), True),  # thickness first, where it is known
        ((np.nan, np.nan, 1.0), (180, 150, 120), True),
    ],
)
def test_else_it_is_where_whiskers_are_thinner_or_shorter(thickness, length, turned):
    row = [
        template(50 + 40 * k, *each) for k, each in enumerate(zip(length, thickness, strict=True))
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # none of means of nothing
        assert thins_out(row) == turned
        found = anterior_first(row, None)
    assert places(found) == ([130, 90, 50] if turned else [50, 90, 130])
    assert snout_of(found, "left") == ("bottom" if turned else "top")


def test_a_lone_whisker_does_not_show_where_the_snout_is():
    assert snout_of([template(50)], "left") is None
    assert snout_of([], "left") is None
