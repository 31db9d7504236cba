"""The measurement model of a thin dark line against naive code and rendered strips."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline import profiles


def line_image(angle, sigma, amplitude, level=180.0, size=61, offset=0.0):
    """A straight Gaussian line through the image's centre, moved by `offset` along its normal."""
    rows, columns = np.mgrid[:size, :size]
    c = (size - 1) / 2
    nx, ny = np.sin(-angle), -np.cos(angle)  # tangent (cos, −sin) on the screen; normal (ty, −tx)
    u = (columns - c) * nx + (rows - c) * ny - offset
    return level * (1 - amplitude * np.exp(-(u**2) / (2 * sigma**2)))


def nodes(angle, n=41, size=61):
    i = np.arange(n) - (n - 1) / 2
    c = (size - 1) / 2
    return c + i * np.cos(angle), c - i * np.sin(angle)


def measured_offset(image, angle, sigma, cap=1.0):
    x, y = nodes(angle)
    n = len(x)
    sums = np.zeros((n, profiles.N_SUMS))
    background = np.full(image.shape, 180.0, np.float32)
    weight = np.ones_like(background)
    profiles.accumulate(
        image, background, weight, 1.0, x, y, n, np.full(n, cap), np.full(n, sigma), 3.0, sums
    )
    a, b, se, info, score = (np.zeros(n) for _ in range(5))
    profiles.window_amplitudes(sums, n, 5, a, b, se)
    profiles.offset_information(sums, n, a, b, info, score)
    return score.sum() / info.sum(), a[n // 2], sums


@settings(max_examples=40, deadline=None)
@given(
    angle=st.floats(-np.pi, np.pi),
    offset=st.floats(-0.3, 0.3),
    amplitude=st.floats(0.05, 0.8),
    sigma=st.floats(0.8, 1.6),
)
def test_offset_and_absorbance_at_every_orientation(angle, offset, amplitude, sigma):
    image = line_image(angle, sigma, amplitude, offset=offset)
    got, absorbance, _ = measured_offset(image, angle, sigma)
    # one Gauss–Newton step: its error is of third order in offset/σ
    assert got == pytest.approx(offset, abs=0.01 + 0.25 * abs(offset) ** 2)  # px
    assert absorbance == pytest.approx(amplitude, rel=0.1)


def test_width_correction_has_the_right_sign_and_size():
    image = line_image(0.3, 1.2, 0.5)
    for assumed in (1.0, 1.1, 1.3):
        _, _, sums = measured_offset(image, 0.3, assumed)
        n = len(sums)
        a, b, se = np.zeros(n), np.zeros(n), np.zeros(n)
        profiles.window_amplitudes(sums, n, 5, a, b, se)
        change = profiles.width_correction(sums, n, a, b, 3, n - 3)
        assert change == pytest.approx(np.log(1.2 / assumed), abs=0.05)


def test_paint_takes_a_line_out_and_unpaint_restores():
    background = np.full((61, 61), 180.0, np.float32)
    before = background.copy()
    image = line_image(0.7, 1.1, 0.5)
    x, y = nodes(0.7)
    pixels, values = np.zeros(5000, np.int64), np.zeros(5000, np.float32)
    n = len(x)
    count = profiles.paint(
        background, x, y, n, np.full(n, 0.5), np.full(n, 1.1), pixels, values, 0
    )
    middle = slice(22, 39), slice(22, 39)
    assert np.abs(background - image)[middle].max() < 1.5  # grey levels; 3σ are painted
    profiles.unpaint(background, pixels, values, count)
    np.testing.assert_array_equal(background, before)


def test_frame_gain_sees_through_whiskers_and_flicker():
    rng = np.random.default_rng(0)
    background = rng.uniform(100, 200, (120, 160)).astype(np.float32)
    image = 0.93 * background + rng.normal(0, 2, background.shape)
    image[::10] *= 0.4
    mask = np.ones(background.shape, bool)
    gain = profiles.frame_gain(np.clip(image, 0, 255).astype(np.uint8), background, 3, mask)
    assert gain == pytest.approx(0.93, abs=0.006)


def test_closeness_is_the_share_of_near_nodes():
    x = np.arange(100.0)
    y = np.zeros(100)
    other = np.where(x < 50, 0.5, 30.0)
    assert profiles.closeness(x, y, 100, x, other, 100, 3.0, 1) == pytest.approx(0.5, abs=0.05)


@settings(deadline=None)
@given(
    apart=st.floats(0, 60),
    turn=st.floats(-3, 3),
    shift=st.floats(-80, 80),
    near=st.floats(1, 20),
)
def test_come_near_never_misses_lines_that_do(apart, turn, shift, near):
    t = np.arange(120.0)
    first = np.array([t, 0 * t])
    second = np.array([shift + t * np.cos(turn), apart + t * np.sin(turn)])
    least = np.hypot(*(first[:, :, None] - second[:, None, :])).min()
    said = profiles.come_near(*first, len(t), *second, len(t), near)
    if least <= near:
        assert said
    if least > near + 18:
        assert not said
