"""The measurement model of a thin dark line against naive code and rendered strips."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.detection import cross_sections, line_profile


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
    sums = np.zeros((line_profile.N_SUMS, n))
    background = np.full(image.shape, 180.0, np.float32)
    weight = np.ones_like(background)
    cross_sections.accumulate(
        image, background, weight, 1.0, x, y, n, np.full(n, cap), np.full(n, sigma), 3.0,
        True, sums,
    )  # fmt: skip
    a, b, se, misfit, info, score = (np.zeros(n) for _ in range(6))
    line_profile.window_amplitudes(sums, n, 5, a, b, se, misfit)
    line_profile.offset_information(sums, n, a, b, misfit, info, score)
    return score.sum() / info.sum(), a[n // 2], sums


def naive_sums(image, background, weight, x, y, cap, sigma, reach):
    """Sums over every node's row or column of pixels, once each: Σ w v² G², Σ w v², Σ w v² D y,
    Σ w v² y², and how many pixels."""
    found, before = np.zeros((5, len(x))), None
    for i, (tx, ty) in enumerate(zip(np.gradient(x), np.gradient(y), strict=True)):
        columns = abs(tx) >= abs(ty)
        fixed = int(np.floor((x if columns else y)[i] + 0.5))
        if (columns, fixed) == before or not 0 <= fixed < len(image):
            continue
        before = columns, fixed
        part = (slice(None), fixed) if columns else fixed
        centre = y[i] + (fixed - x[i]) * ty / tx if columns else x[i] + (fixed - y[i]) * tx / ty
        scale = (-tx if columns else ty) / np.hypot(tx, ty)
        off = np.arange(len(image)) - centre
        near = np.abs(off) <= (reach * sigma[i] + 1) / abs(scale)
        u = off[near] * scale / sigma[i]
        g, v = np.exp(-(u**2) / 2), background[part][near]
        w = weight[part][near] * v
        shade = np.minimum(v - image[part][near], cap[i] * v)
        found[:3, i] = (w * v * g * g).sum(), (w * v).sum(), (w * u * g / sigma[i] * shade).sum()
        found[3:, i] = (w / v * shade**2).sum(), near.sum()
    return found


@settings(max_examples=40, deadline=None)
@given(angle=st.floats(-np.pi, np.pi), n=st.integers(3, 300), seed=st.integers(0, 99))
def test_sums_are_those_of_plain_loops(angle, n, seed):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (61, 61)).astype(np.uint8)
    background, weight = rng.uniform(50, 255, (2, 61, 61)).astype(np.float32)
    x, y = nodes(angle, n) + rng.uniform(-9, 9, (2, 1))  # the long ones leave the picture
    cap, sigma = np.full(n, 0.6), rng.uniform(0.8, 1.6, n)
    sums = np.zeros((line_profile.N_SUMS, n))
    cross_sections.accumulate(image, background, weight, 1.0, x, y, n, cap, sigma, 3.0, True, sums)
    expected = naive_sums(image, background, weight, x, y, cap, sigma, 3.0)
    rows = line_profile.GG, line_profile.G11, line_profile.DY, line_profile.YY, line_profile.PIXELS
    for row, values in zip(rows, expected, strict=True):
        atol = 1e-5 * max(values.max(), 1)
        np.testing.assert_allclose(sums[row], values, rtol=1e-4, atol=atol)


@settings(max_examples=20, deadline=None)
@given(
    angle=st.floats(-np.pi, np.pi),
    times=st.sampled_from([1.0, 1.5, 2.0, 6.0]),
    amplitude=st.floats(0.0, 0.8),
    seed=st.integers(0, 99),
)
def test_a_place_counts_as_its_pixels_err(angle, times, amplitude, seed):
    """Noise of SD `times` that of the weights leaves a fraction 1/times² of the information."""
    noise = np.random.default_rng(seed).normal(0, times, (61, 61))
    image = (line_image(angle, 1.1, amplitude) + noise).astype(np.float32)
    background = np.full(image.shape, 180, np.float32)
    x, y = nodes(angle)
    n = len(x)
    sums = np.zeros((line_profile.N_SUMS, n))
    own = image, background, np.ones_like(background), 1.0, x, y, n, np.ones(n), np.full(n, 1.1)
    cross_sections.accumulate(*own, 3.0, False, sums)
    a, b, se, misfit, info, as_given, score = (np.zeros(n) for _ in range(7))
    line_profile.window_amplitudes(sums, n, 10, a, b, se, misfit)
    line_profile.offset_information(sums, n, a, b, misfit, info, score)
    line_profile.offset_information(sums, n, a, b, np.ones(n), as_given, score)
    assert misfit.min() >= 1
    expected = min(times**2, line_profile.MOST_MISFIT)
    assert np.median(misfit) == pytest.approx(expected, rel=0.35)
    np.testing.assert_allclose(info * misfit, as_given)


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
        n = sums.shape[1]
        a, b, se, misfit = np.zeros((4, n))
        line_profile.window_amplitudes(sums, n, 5, a, b, se, misfit)
        change, _ = line_profile.width_correction(sums, a, 3, n - 3)
        assert change == pytest.approx(np.log(1.2 / assumed), abs=0.05)


def test_a_shadow_takes_a_line_out_and_the_background_is_restored():
    background = np.full((61, 61), 180.0, np.float32)
    before = background.copy()
    image = line_image(0.7, 1.1, 0.5)
    x, y = nodes(0.7)
    line = x, y, len(x), np.full(len(x), 0.5), np.full(len(x), 1.1)
    shadow = line_profile.shadow(*line, background.shape)
    line_profile.darken(background, *shadow)
    middle = slice(22, 39), slice(22, 39)
    assert np.abs(background - image)[middle].max() < 1.5  # grey levels; 3σ are painted
    line_profile.restore(background, shadow[0], before)
    np.testing.assert_array_equal(background, before)
    line_profile.darken(background, *shadow)
    line_profile.lighten(background, *shadow)
    assert background == pytest.approx(before, rel=1e-6)


def test_frame_gain_sees_through_whiskers_and_flicker():
    rng = np.random.default_rng(0)
    background = rng.uniform(100, 200, (120, 160)).astype(np.float32)
    image = 0.93 * background + rng.normal(0, 2, background.shape)
    image[::10] *= 0.4
    mask = np.ones(background.shape, bool)
    points = line_profile.gain_points(background, mask, 3)
    gain = line_profile.frame_gain(np.clip(image, 0, 255).astype(np.uint8), *points)
    assert gain == pytest.approx(0.93, abs=0.006)
