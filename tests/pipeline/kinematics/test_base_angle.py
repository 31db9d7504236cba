"""Base angles of whiskers known in closed form: in noise, under fur, at a wrong scale, in time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter1d
from usual_parameters import measure_stations

from pipeline.kinematics import base_angle
from pipeline.kinematics.base_angle import measure_base
from pipeline.numerics.angles import continuous, jitter, wrap_angle
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from pipeline.tracking.whiskers import nominal_whisker

PX_PER_MM = 16.0
HIDDEN_MM, VISIBLE_PX = 1.4, 260
FRAMES = 300
BENT = 25.0  # 1/m
SD = 0.1  # px, of a point
FUR_PX = 12.0  # of the first visible part
clean_angle = 0.02  # degrees
noisy_angle = 0.3  # degrees, SD
steady_angle = 0.3  # degrees, of one frame beside its neighbours
follicle_tolerance = 1.0  # px


def swing(frames=FRAMES, about=-40.0, by=25.0):
    """Base angle [rad] of a whisker that whisks."""
    return np.radians(about + by * np.sin(2 * np.pi * np.arange(frames) / 90))


def whisker_lines(rng, angle, sd=0.0, fur=0.0, bent=BENT, frame=None, n=VISIBLE_PX):
    """Visible parts of a whisker of constant curvature `bent` [1/m], one or (frames,).

    It turns about its follicle at (60, 200) px. Fur draws the first part aside by `fur` px at
    the first point, differently every few frames.
    """
    frames = len(angle)
    s = HIDDEN_MM * PX_PER_MM + np.arange(n)
    kappa = np.broadcast_to(bent, frames)[:, None] / (1e3 * PX_PER_MM)
    turned = kappa * s / 2
    chord = s * np.sinc(turned / np.pi)
    x = 60 + chord * np.cos(angle[:, None] + turned)
    y = 200 - chord * np.sin(angle[:, None] + turned)
    drawn = gaussian_filter1d(rng.normal(size=frames), 3) * fur * 3.3
    clings = np.exp(-2 * (np.arange(n) / FUR_PX) ** 2)
    offset = rng.normal(0, sd, (frames, n)) + np.outer(drawn, clings)
    return Centrelines(
        names=("C2",),
        frame=np.arange(frames) if frame is None else frame,
        whisker=np.zeros(frames, np.int32),
        offsets=n * np.arange(frames + 1),
        x_px=x.ravel(),
        y_px=y.ravel(),
        se_px=np.full(frames * n, max(sd, 0.01)),
        confidence=np.ones(frames),
        offset_px=offset.ravel(),
        information=np.full(frames * n, max(sd, 0.01) ** -2),
    )


def measured(lines, scale=1.0):
    """The base as measured at a scale that is `scale` times the true one."""
    recording = Recording(1000.0, PX_PER_MM * scale, "left")
    whisker = nominal_whisker("C2", VISIBLE_PX / recording.pixels_per_m, 1e-3 * HIDDEN_MM)
    places = measure_stations(lines, recording, [whisker], [1e-3 * HIDDEN_MM]).of("C2")
    return measure_base(
        places, recording.pixels_per_m, DEFAULTS.kinematics
    ), recording.pixels_per_m


def errors(base, px_per_m, angle, bent=BENT):
    """Error of the angle [degrees] where the whisker passes the reported follicle."""
    s = np.linspace(-2.5, 2.5, 501) * PX_PER_MM
    turned = bent / (1e3 * PX_PER_MM) * s / 2
    chord = s * np.sinc(turned / np.pi)
    x = 60 + chord * np.cos(angle[:, None] + turned)
    y = 200 - chord * np.sin(angle[:, None] + turned)
    away = np.hypot(x - px_per_m * base.x[:, None], y + px_per_m * base.y[:, None])
    nearest = away.argmin(axis=1)
    return np.degrees(base.angle - angle - 2 * turned[nearest]), away.min(axis=1)


def test_a_clean_whisker_is_measured_exactly():
    angle = swing()
    base, px_per_m = measured(whisker_lines(np.random.default_rng(0), angle))
    off, _ = errors(base, px_per_m, angle)
    assert np.abs(off).max() < clean_angle
    away = np.hypot(px_per_m * base.x - 60, px_per_m * base.y + 200)
    assert away.max() < 0.2  # px


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("fur", [0.0, 0.5])
def test_noise_fur_and_a_wrong_scale_are_in_the_standard_error(scale, fur):
    angle = swing()
    lines = whisker_lines(np.random.default_rng(1), angle, SD, fur)
    base, px_per_m = measured(lines, scale)
    off, away = errors(base, px_per_m, angle)
    assert off.std() < noisy_angle
    assert np.degrees(jitter(base.angle, lines.frame)) < steady_angle
    assert np.mean(np.abs(off) < 1.96 * np.degrees(base.angle_se)) > 0.9
    assert np.sqrt(np.mean(away**2)) < follicle_tolerance


def test_a_resting_whisker_changes_by_no_more_than_its_standard_error():
    angle = np.full(FRAMES, np.radians(30.0))
    base, _ = measured(whisker_lines(np.random.default_rng(2), angle, SD, 0.5))
    change, error = np.diff(base.angle), base.angle_se
    assert np.mean(np.abs(change) < 1.96 * np.hypot(error[1:], error[:-1])) > 0.95
    assert np.degrees(error.max()) < 5.0
    assert np.degrees(jitter(base.angle, np.arange(FRAMES))) < steady_angle


def test_a_base_that_bends_as_no_whisker_grows_is_not_believed(monkeypatch):
    def error(seed, n=60, start_px=15.0):
        """Median error [degrees] of a short piece whose start lies aside alike in all frames."""
        rng, angle = np.random.default_rng(seed), swing(120)
        bent = rng.normal(0, 30)
        lines = whisker_lines(rng, angle, 1.0, bent=bent, n=n)
        aside = rng.normal(0, 1.5) * np.exp(-((np.arange(n) / start_px) ** 2))
        lines = replace(lines, offset_px=lines.offset_px + np.tile(aside, len(angle)))
        return np.median(errors(*measured(lines), angle, bent)[0])

    def rms():
        return np.sqrt(np.mean([error(seed) ** 2 for seed in range(12)]))

    believed_less = rms()
    for name in ("GROWN_PER_M", "GROWN_PER_M2"):
        monkeypatch.setattr(base_angle, name, 1e9)
    assert believed_less < min(12.0, 0.6 * rms())


def test_a_touch_stays_sudden():
    """Bent from one frame to the next in a clean picture: nothing is smoothed."""
    rng, angle = np.random.default_rng(3), swing()
    bent = BENT + np.where(np.arange(FRAMES) % 100 < 80, 0.0, 30.0)
    base, _ = measured(whisker_lines(rng, angle, 0.01, bent=bent))
    assert np.degrees(np.abs(base.angle - angle).max()) < 0.2


def test_the_angle_is_continuous_where_the_whisker_points_left_and_after_gaps():
    angle = swing(about=175.0)
    frame = np.arange(FRAMES) + 40 * (np.arange(FRAMES) >= 150)
    base, _ = measured(whisker_lines(np.random.default_rng(4), angle, SD, frame=frame))
    np.testing.assert_allclose(np.degrees(base.angle), np.degrees(angle), atol=5 * noisy_angle)


@pytest.mark.parametrize("seed", range(4))
def test_the_angle_is_continuous_where_few_pixels_are_seen_for_a_moment(seed):
    """A curve through them may turn several times before it reaches the window's middle."""
    rng, short = np.random.default_rng(seed), 60
    lines = whisker_lines(rng, swing(), SD)
    x, y, information = (
        each.reshape(FRAMES, -1) for each in (lines.x_px, lines.y_px, lines.information)
    )
    for frame in range(3, FRAMES, 5):
        information[frame, short:] = 0
        turn = rng.uniform(-3, 3) + np.linspace(0, rng.uniform(-3, 3), short)
        x[frame, :short] = 80 + np.cumsum(np.cos(turn))
        y[frame, :short] = 200 + np.cumsum(np.sin(turn))
    base, _ = measured(lines)
    known = np.isfinite(base.angle)
    assert known[np.arange(FRAMES) % 5 != 3].all()
    assert np.abs(np.diff(base.angle[known])).max() <= np.pi
    assert np.nanmax(np.abs(base.visible - base.angle)) <= np.pi


def test_a_long_recording_is_measured_part_by_part_with_a_continuous_angle(monkeypatch):
    angle = swing(about=180.0)
    lines = whisker_lines(np.random.default_rng(6), angle, SD)
    monkeypatch.setattr(base_angle, "PART_ROWS", 110)
    base, _ = measured(lines)
    np.testing.assert_allclose(np.degrees(np.diff(base.angle - angle)), 0, atol=5 * noisy_angle)
    off = np.degrees(wrap_angle(base.angle - angle))
    np.testing.assert_allclose(off, 0, atol=5 * noisy_angle)


def test_continuous_leaves_unknown_angles_and_lies_about_zero():
    got = np.degrees(continuous(np.radians([350, np.nan, 10, 20, 170, -170])))
    np.testing.assert_allclose(got, [-10, np.nan, 10, 20, 170, 190])


def test_few_frames_and_short_lines_are_measured_as_far_as_they_go():
    angle = swing(4)
    lines = whisker_lines(np.random.default_rng(5), angle, SD)
    base, _ = measured(lines)
    assert np.isfinite(base.angle).all()
    assert np.degrees(np.abs(base.angle - angle).max()) < 5.0


def test_frames_that_the_codec_repeats_are_measured():
    """All misfits are the same: there is no scatter to learn the noise's colour from."""
    lines = whisker_lines(np.random.default_rng(7), np.full(60, np.radians(-40.0)))
    same = np.random.default_rng(8).normal(0, SD, VISIBLE_PX)
    base, _ = measured(replace(lines, offset_px=np.tile(same, 60)))
    assert np.isfinite(base.angle_se).all()
    assert np.degrees(np.abs(base.angle - np.radians(-40.0)).max()) < 5.0


@given(st.integers(0, 2**32 - 1))
def test_a_video_ends_at_no_base_however_unevenly_it_is_known(seed):
    """Information differs by 1e16 along a line and from frame to frame; its sums are rounded."""
    rng = np.random.default_rng(seed)
    lines = whisker_lines(rng, swing(13), SD, n=90)
    uneven = 10.0 ** np.repeat(rng.choice([-8, 0, 8], (13, 9)), 10, axis=1).ravel()
    base, _ = measured(replace(lines, information=lines.information * uneven), 2.0)
    known = np.isfinite(base.angle)
    assert (base.angle_se[known] > 0).all()
    assert (base.visible_se[known] > 0).all()


def test_a_base_that_no_frame_shows_is_unknown():
    lines = whisker_lines(np.random.default_rng(9), swing(4), SD)
    seen = lines.information.reshape(4, -1).copy()
    seen[:, 16:160] = 0.0  # behind a rod: what is seen beyond it is no base
    base, _ = measured(replace(lines, information=seen.ravel()))
    assert np.isnan(base.angle).all()


def test_an_angle_that_is_known_to_no_quarter_turn_is_unknown():
    lines = whisker_lines(np.random.default_rng(10), swing(60), SD)
    seen = lines.information.reshape(60, -1).copy()
    seen[30] *= 1e-10
    base, _ = measured(replace(lines, information=seen.ravel()))
    for values in vars(base).values():
        assert np.flatnonzero(np.isnan(values)).tolist() == [30]


def test_jitter_is_the_error_of_one_frame():
    rng = np.random.default_rng(6)
    smooth = swing(20000, by=5.0)
    seen = smooth + rng.normal(0, 0.1, 20000)
    assert jitter(seen, np.arange(20000)) == pytest.approx(0.1, rel=0.05)
    assert np.isnan(jitter(smooth[:40], 2 * np.arange(40)))
