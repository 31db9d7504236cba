"""One line or two: of a whisker that motion has made broad, and of two that run together."""

import numpy as np
import pytest
from left_face import DARK, scene_of_left_face
from usual_parameters import options_for

from pipeline.detection import new_lines
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line, Workspace
from pipeline.detection.one_or_two import one_for_two
from pipeline.session.recording import Recording

FACE, TIP, ROW = 20, 300, 60  # columns, row
LIGHT, NOISE, SIGMA = 180.0, 2.0, 1.2
STEPS = np.linspace(-0.5, 0.5, 41)  # through the time that the shutter is open


def seen(rows, travel, dark=0.3):
    """A picture of straight whiskers that travel by so many px while the shutter is open."""
    y, x = np.mgrid[:120, :320]
    light = np.ones(x.shape)
    for row in rows:
        passing = [1 - dark * np.exp(-0.5 * ((y - row - k * travel) / SIGMA) ** 2) for k in STEPS]
        light *= np.where(x < TIP, np.mean(passing, axis=0), 1)
    image = np.where(x < FACE, DARK, LIGHT * light)
    image += np.random.default_rng(0).normal(0, NOISE, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def line_at(row, dark):
    line = Line.empty(400)
    line.n = TIP - FACE
    line.x[: line.n], line.y[: line.n] = np.arange(FACE, TIP), row
    line.amplitude[:], line.sigma[:] = dark, SIGMA
    return line


def answer(image, rows, dark):
    """What stands for two lines in these rows."""
    scene = scene_of_left_face(image.shape, FACE, LIGHT, NOISE)
    options, lines = options_for(Recording(1000.0, 25.0, "left")), [line_at(y, dark) for y in rows]
    model = ImageModel.from_scene(scene, options.params.detection)
    frame = Frame(image, model, 1.0, options, Workspace(400, options.spacing_px))
    return one_for_two(frame, *lines)


@pytest.mark.parametrize("travel", [2.0, 3.0, 4.0])  # px
def test_one_line_stands_for_two_on_the_edges_of_a_blurred_whisker(travel):
    edges = ROW - travel / 2 + 0.5, ROW + travel / 2 - 0.5
    one = answer(seen([ROW], travel), edges, dark=0.15)
    assert one is not None
    assert np.median(one.y[: one.n]) == pytest.approx(ROW, abs=0.1)  # px
    assert one.n == pytest.approx(TIP - FACE, abs=8)  # px


@pytest.mark.parametrize("apart", [3.5, 5.0, 7.0])  # px
def test_two_whiskers_beside_each_other_stay_two(apart):
    rows = ROW - apart / 2, ROW + apart / 2
    assert answer(seen(rows, 0.0), rows, dark=0.3) is None


def test_a_line_that_has_run_away_stands_for_none(monkeypatch):
    image, rows = seen([ROW], 2.0), (ROW - 0.5, ROW + 0.5)
    assert answer(image, rows, dark=0.15) is not None
    initialise = new_lines.initialise_line

    def lengthened(*at):
        line = initialise(*at)
        more = slice(line.n, line.n + 100)  # as if it passed the face by
        line.x[more], line.y[more] = line.x[line.n - 1], ROW + np.arange(100)
        line.n += 100
        return line

    monkeypatch.setattr(new_lines, "initialise_line", lengthened)
    assert answer(image, rows, dark=0.15) is None
