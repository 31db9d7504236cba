"""Strips against a rasteriser of its own: nearest points on a fine grid, blurred, averaged."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from synthetic.strips import Strip, absorb, blank, cover_disc, cover_strip, step_table

FINE = 8  # sub-pixels per pixel of the brute-force picture
cover_tolerance = 5e-3  # share of the light, brute force's own grain included
centreline_tolerance = 0.001  # px, mean shift of the picture across the strip
SIZE = (64, 80)
INNER = (slice(9, -9), slice(9, -9))  # brute force knows nothing beyond the border


def curve(start, direction, curvature, length, n):
    """Circular arc in pixels (y down): x, y, angle, counter-clockwise on the screen."""
    s = np.linspace(0, length, n)
    angle = direction + curvature * s
    if curvature == 0:
        x, y = s * np.cos(direction), s * np.sin(direction)
    else:
        x = (np.sin(angle) - np.sin(direction)) / curvature
        y = (np.cos(direction) - np.cos(angle)) / curvature
    return s, start[0] + x, start[1] - y, angle


def draw(start, direction, curvature, length, radii, blur, smear=0.0):
    s, x, y, angle = curve(start, direction, curvature, length, int(length / 0.7) + 2)
    radius = np.interp(s, [0, length], radii)
    cover, touched = blank(*SIZE)
    strip = Strip(x, y, angle, np.full(len(s), curvature), radius, np.full(len(s), smear))
    cover_strip(cover, touched, strip, step_table(blur))
    return cover


def brute_force(start, direction, curvature, length, radii, blur):
    """Nearest of 20000 points of the curve for every sub-pixel; the strip's ends are flat."""
    s, x, y, _ = curve(start, direction, curvature, length, 20000)
    row, column = np.mgrid[: SIZE[0] * FINE, : SIZE[1] * FINE]
    places = (np.column_stack([column.ravel(), row.ravel()]) + 0.5) / FINE - 0.5
    reach, tree = max(radii) + 1.0, cKDTree(np.column_stack([x, y]))
    centres = np.argwhere(np.ones(SIZE))[:, ::-1]
    near = np.isfinite(tree.query(centres, distance_upper_bound=reach + 1.0)[0]).reshape(SIZE)
    near = near.repeat(FINE, axis=0).repeat(FINE, axis=1).ravel()  # elsewhere no sub-pixel is
    distance, nearest = np.full(len(places), np.inf), np.full(len(places), len(s))
    distance[near], nearest[near] = tree.query(places[near], distance_upper_bound=reach)
    radius = np.interp(s, [0, length], radii)[np.minimum(nearest, len(s) - 1)]
    distance[(nearest == 0) | (nearest >= len(s) - 1)] = np.inf
    # an edge sub-pixel counts by the part of it that lies inside
    inside = np.clip((radius - distance) * FINE + 0.5, 0, 1).reshape(row.shape)
    return to_pixels(inside, blur)


def to_pixels(fine, blur):
    blurred = gaussian_filter(fine, blur * FINE, truncate=6, mode="nearest")
    return blurred.reshape(SIZE[0], FINE, SIZE[1], FINE).mean((1, 3))


def shift_across(picture, reference, direction):
    """Mean shift [px] of `picture` against `reference` along the strip's normal."""
    picture, reference = picture[INNER], reference[INNER]
    gy, gx = np.gradient(reference)
    along_normal = -np.sin(direction) * gx - np.cos(direction) * gy
    return -np.sum((picture - reference) * along_normal) / np.sum(along_normal**2)


@pytest.mark.slow
@pytest.mark.parametrize("direction", np.deg2rad([0, 2, 17, 45, 90, 133, -88]))
@pytest.mark.parametrize("curvature", [0.004, -0.004])  # 1/px: 100 1/m at 25 px/mm
def test_strip_equals_supersampled_polygon(direction, curvature):
    # a strip that crosses the whole picture, so that its ends stay out of it
    middle = np.array([SIZE[1] / 2 - 0.3, SIZE[0] / 2 + 0.2])
    start = middle - 60 * np.array([np.cos(direction), -np.sin(direction)])
    problem = (start, direction - 60 * curvature, curvature, 120, (0.9, 0.35), 0.7)
    picture, reference = draw(*problem), brute_force(*problem)
    assert np.abs(picture - reference)[INNER].max() < cover_tolerance
    assert abs(shift_across(picture, reference, direction)) < centreline_tolerance


@pytest.mark.slow
@pytest.mark.parametrize("blur", [0.5, 1.0, 1.8])
def test_other_blurs(blur):
    problem = ((-10.0, 45.0), 0.35, -0.003, 120, (0.7, 0.4), blur)
    assert np.abs(draw(*problem) - brute_force(*problem))[INNER].max() < cover_tolerance


def test_tip_ends_where_it_ends():
    problem = ((-10.0, 35.0), 0.1, 0.002, 55, (0.6, 0.3), 0.7)
    picture, reference = draw(*problem), brute_force(*problem)
    length_tolerance = 0.05  # px
    assert abs(picture[INNER].sum() - reference[INNER].sum()) / 0.6 < length_tolerance
    assert np.abs(picture - reference)[INNER].max() < 0.02


def test_curvature_bends_counter_clockwise_on_the_screen():
    cover = draw((5.0, 40.0), 0.0, 0.01, 60, (0.8, 0.8), 0.7)
    rows = np.arange(SIZE[0])
    near, far = (np.sum(cover[:, i] * rows) / cover[:, i].sum() for i in (8, 55))
    assert far < near - 5  # px: it rises on the screen, where y points down


def test_smear_widens_without_shifting():
    sharp = draw((-10.0, 30.0), 0.2, 0.0, 110, (0.5, 0.5), 0.7)
    smeared = draw((-10.0, 30.0), 0.2, 0.0, 110, (0.5, 0.5), 0.7, smear=2.0)
    inner = slice(10, 60)
    assert smeared[:, inner].sum() == pytest.approx(sharp[:, inner].sum(), rel=2e-3)
    assert abs(shift_across(smeared, sharp, 0.2)) < centreline_tolerance
    rows = np.arange(SIZE[0])[:, None] - (SIZE[0] - 1) / 2
    spread = [
        (c * rows**2).sum(0) / c.sum(0) - ((c * rows).sum(0) / c.sum(0)) ** 2
        for c in (sharp[:, inner], smeared[:, inner])
    ]
    wanted = 2.0**2 / 12 / np.cos(0.2) ** 2  # px², a box of the smear's width
    assert np.median(spread[1] - spread[0]) == pytest.approx(wanted, rel=0.1)


def test_disc_equals_supersampled_disc():
    x, y, radius, blur = 33.3, 27.8, 6.25, 0.7
    cover, _ = blank(*SIZE)
    cover_disc(cover, x, y, radius, step_table(blur))
    row, column = np.mgrid[: SIZE[0] * FINE, : SIZE[1] * FINE]
    distance = np.hypot((column + 0.5) / FINE - 0.5 - x, (row + 0.5) / FINE - 0.5 - y)
    reference = to_pixels(np.clip((radius - distance) * FINE + 0.5, 0, 1), blur)
    assert np.abs(cover - reference).max() < cover_tolerance


def test_absorb_multiplies_and_clears():
    cover, touched = blank(*SIZE)
    n = 40
    still = np.zeros(n)
    strip = Strip(np.linspace(10, 40, n), np.full(n, 20.0), still, still, np.full(n, 1.5), still)
    count = cover_strip(cover, touched, strip, step_table(0.7))
    peak = cover.max()
    light = np.full(SIZE, 100.0, np.float32)
    absorb(light, cover, touched, count, 0.5)
    assert light.min() == pytest.approx(100 * (1 - 0.5 * peak), rel=1e-6)
    assert not cover.any()


def test_step_table_refuses_no_blur():
    with pytest.raises(ValueError, match="blur must be > 0 px, got 0"):
        step_table(0)
