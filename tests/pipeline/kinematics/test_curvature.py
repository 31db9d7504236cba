"""Curvature and follicle of centrelines whose truth is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from pipeline.detection.static_scene import PoleTrack
from pipeline.kinematics.curvature import measure
from pipeline.kinematics.follicle import follicles
from pipeline.numerics.angles import wrap_angle
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines

RECORDING = Recording(1000.0, 25.0, "left")
HIDDEN = 1.4e-3  # m


def curve(base_angle, curvature, slope=0.0, length=17.5e-3, kink_at=None):
    """Nodes [px], 1 px apart, of κ(s) = curvature + slope s; κ falls to zero from a kink on."""
    scale = RECORDING.pixels_per_m
    s = np.arange(0, length, 1e-3 / scale * 10)
    kappa = curvature + slope * s
    if kink_at is not None:
        kappa = kappa * np.clip(1 - s / kink_at, 0, None)
    ds = s[1] - s[0]
    theta = base_angle + np.concatenate([[0], np.cumsum((kappa[1:] + kappa[:-1]) / 2 * ds)])
    middle = (theta[1:] + theta[:-1]) / 2
    x = 100 + scale * np.concatenate([[0], np.cumsum(np.cos(middle) * ds)])
    y = 300 - scale * np.concatenate([[0], np.cumsum(np.sin(middle) * ds)])
    at = np.arange(HIDDEN, length - 1e-4, 1 / scale)
    return np.column_stack([np.interp(at, s, x), np.interp(at, s, y)]), kappa, s


def measured(lines, pole=None):
    """Curvature in every row of the lines."""
    return measure(lines, RECORDING, [HIDDEN], 5.5e-3, DEFAULTS.kinematics, pole)


def one_row(points, offset=None, sd=0.03):
    n = len(points)
    f32 = np.float32
    return Centrelines(
        names=("C2",),
        frame=np.zeros(1, np.int32),
        whisker=np.zeros(1, np.int32),
        offsets=np.array([0, n]),
        x_px=points[:, 0].astype(f32),
        y_px=points[:, 1].astype(f32),
        se_px=np.full(n, sd, f32),
        confidence=np.ones(1, f32),
        offset_px=np.zeros(n, f32) if offset is None else offset.astype(f32),
        information=np.full(n, sd**-2, f32),
    )


@pytest.mark.parametrize("angle", np.radians([-170, -85, -30, 0, 45, 90, 135]))
@pytest.mark.parametrize("kappa", [-60.0, 0.0, 25.0])
def test_arc_of_constant_curvature(angle, kappa):
    points, _, _ = curve(angle, kappa)
    got = measured(one_row(points)).iloc[0]
    assert got.curvature_per_m == pytest.approx(kappa, abs=0.15)  # 1/m; float32 nodes
    scale = RECORDING.pixels_per_m
    x, y, turn = follicles(
        one_row(points), np.array([HIDDEN * scale]), scale, DEFAULTS.kinematics
    )[0]
    assert abs(np.degrees(wrap_angle(turn - angle))) < 0.05
    assert np.hypot(x - 100, y - 300) < 0.03  # px


def test_counter_clockwise_on_the_screen_is_positive():
    points, _, _ = curve(0.0, 30.0)
    assert points[-1, 1] < points[0, 1], "the whisker should bend upwards on the screen"
    got = measured(one_row(points)).iloc[0]
    assert got.curvature_per_m > 29


def test_changing_curvature_is_read_at_its_place():
    points, kappa, s = curve(0.2, 10.0, slope=4000.0)
    got = measured(one_row(points)).iloc[0]
    assert got.curvature_per_m == pytest.approx(np.interp(5.5e-3, s, kappa), abs=0.3)  # 1/m


def test_a_pole_ends_the_window_at_its_kink():
    contact = 7.5e-3
    points, kappa, s = curve(0.0, 120.0, kink_at=contact)
    node = round((contact - HIDDEN) * RECORDING.pixels_per_m)
    pole = PoleTrack(points[node : node + 1, 0], points[node : node + 1, 1] + 6.3, 6.25)
    truth = np.interp(5.5e-3, s, kappa)
    with_pole = measured(one_row(points), pole).iloc[0]
    without = measured(one_row(points)).iloc[0]
    assert with_pole.curvature_per_m == pytest.approx(truth, abs=0.4)  # 1/m
    assert abs(without.curvature_per_m - truth) > 3 * abs(with_pole.curvature_per_m - truth)


def test_standard_error_covers():
    points, _, _ = curve(0.1, 20.0)
    rng = np.random.default_rng(5)
    n, sd, trials = len(points), 0.05, 400
    off, reported = [], []
    for _ in range(trials):
        row = one_row(points, rng.normal(0, sd, n), sd)
        got = measured(row).iloc[0]
        off.append(got.curvature_per_m - 20.0)
        reported.append(got.curvature_per_m_se)
    inside = np.mean(np.abs(off) < 1.96 * np.array(reported))
    assert 0.92 < inside <= 0.98


def many_rows(points, offsets, sd):
    """The same line in many frames, with errors `offsets` (frames, nodes) [px]."""
    frames, n = offsets.shape
    line = one_row(np.tile(points, (frames, 1)), offsets.ravel(), sd)
    return replace(
        line,
        frame=np.arange(frames, dtype=np.int32),
        whisker=np.zeros(frames, np.int32),
        offsets=n * np.arange(frames + 1),
        confidence=np.ones(frames, np.float32),
    )


@pytest.mark.parametrize("reach", [0.0, 1.5, 2.5])
def test_standard_error_covers_errors_that_run_along_the_line(reach):
    """Codecs smear the noise: here by a Gaussian of SD `reach` px."""
    points, _, _ = curve(0.1, 20.0)
    noise = np.random.default_rng(3).normal(0, 0.05, (400, len(points)))
    if reach:
        noise = gaussian_filter1d(noise, reach, axis=1)
    got = measured(many_rows(points, noise, noise.std()))
    off = np.abs(got.curvature_per_m - 20.0)
    assert 0.92 < np.mean(off < 1.96 * got.curvature_per_m_se) < 0.99
    white = np.mean(off < 1.96 * got.curvature_per_m_se.median() / np.sqrt(max(3.5 * reach, 1)))
    assert reach == 0 or white < 0.85, "as if white, the errors would be far too small"


def test_standard_error_holds_what_is_not_known_of_the_hidden_length():
    """The bend of a loaded whisker changes by tens of 1/m per mm."""
    points, _, _ = curve(0.0, 100.0, slope=-10e3, length=10e-3)
    got = measured(one_row(points, sd=1e-3)).iloc[0]
    assert got.curvature_per_m_se == pytest.approx(0.05e-3 * 10e3, rel=0.1)  # 1/m


def test_whisker_too_short_for_the_place_gives_nan():
    points, _, _ = curve(0.0, 10.0, length=5e-3)
    got = measured(one_row(points)).iloc[0]
    assert np.isnan(got.curvature_per_m)
