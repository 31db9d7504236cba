"""Neighbouring lines fitted together: against the joint solution, and where they were drawn."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from left_face import DARK, scene_of_left_face
from usual_parameters import options_for

from pipeline.detection import neighbours
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel, lines_in_background
from pipeline.detection.line import Line, Workspace
from pipeline.detection.neighbours import fit_together
from pipeline.detection.refinement import refine_held
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording

N, FACE = 30, 20  # nodes; columns
LIGHT, NOISE, SIGMA = 180.0, 2.0, 1.2
SLOPES = -0.005, 0.005  # of two whiskers about row 60: 1 px apart at the face, 4 px at the tips


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 6))
def test_lines_come_to_rest_where_one_fit_of_all_would_put_them(seed, count):
    rng = np.random.default_rng(seed)
    sharing = np.triu(rng.random((count, count)) < 0.5, 1)
    sharing |= sharing.T
    beside = np.where(sharing, rng.uniform(-1, 1, sharing.shape), 0)
    beside *= 0.5 / np.maximum(np.abs(beside).sum(axis=1, keepdims=True), 0.5)
    own = rng.uniform(-3, 3, count)  # places are own + beside @ places
    alone = ~sharing.any(axis=1)
    own[alone] = 0
    lines = [SimpleNamespace(x=np.arange(float(N)), y=np.zeros(N), n=N) for _ in range(count)]
    fitted = []

    def fit(k):
        fitted.append(k)
        lines[k].y[:] = own[k] + beside[k] @ [line.y[0] for line in lines]

    fit_together(lines, sharing, fit)
    joint = np.linalg.solve(np.eye(count) - beside, own)
    assert np.abs([line.y[0] for line in lines] - joint).max() < 2 * neighbours.STAYS_PX
    assert not set(fitted) & set(np.flatnonzero(alone))


def lines_at(slopes, off):
    """Straight lines from the face, each so far off where a whisker is drawn [px]."""
    for slope, wrong in zip(slopes, off, strict=True):
        line = Line.empty(400)
        line.n = 280
        line.x[: line.n] = FACE + np.arange(line.n)
        line.y[: line.n] = 60 + np.sign(slope) / 2 + slope * np.arange(line.n) + wrong
        line.amplitude[:], line.sigma[:] = 0.3, SIGMA
        yield line


def drawn(slopes):
    """A picture of whiskers that leave the face."""
    y, x = np.mgrid[:120, :320]
    image = np.full(x.shape, LIGHT)
    for line in lines_at(slopes, (0, 0)):
        place = np.interp(x[0], line.x[: line.n], line.y[: line.n])
        image *= 1 - 0.3 * np.exp(-0.5 * ((y - place) / SIGMA) ** 2) * (x < 300)
    image[:, :FACE] = DARK
    image += np.random.default_rng(0).normal(0, NOISE, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("off", [(0.6, -0.4), (-0.5, 0.8), (0.5, 0.5)])
def test_whiskers_that_leave_the_face_together_are_both_where_they_were_drawn(off):
    scene = scene_of_left_face((120, 320), FACE, LIGHT, NOISE)
    model, image = ImageModel.from_scene(scene, DEFAULTS.detection), drawn(SLOPES)
    options = options_for(Recording(1000.0, 25.0, "left"))
    workspace = Workspace(400, options.spacing_px)
    lines, sharing = list(lines_at(SLOPES, off)), ~np.eye(2, dtype=bool)
    frame = Frame(image, model, 1.0, options, workspace)
    with lines_in_background(model, lines):

        def fit(k):
            refine_held(frame, lines[k])

        fit_together(lines, sharing, fit)
    for line, true in zip(lines, lines_at(SLOPES, (0, 0)), strict=True):
        off = line.y[: line.n] - np.interp(line.x[: line.n], true.x[:280], true.y[:280])
        assert line.n > 270
        assert np.sqrt(np.mean(off[:270] ** 2)) < 0.1  # px
