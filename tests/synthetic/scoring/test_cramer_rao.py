"""Bounds against exact cases, the pixels' own Fisher matrix, and maximum likelihood."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

from synthetic.scene import Camera, Hair
from synthetic.scoring import cramer_rao
from synthetic.strips import Strip, absorb, blank, cover_strip, step_table

HEIGHT, WIDTH = 90, 260
LIGHT, OPACITY = 176.0, 0.95
ARC = np.arange(30.0, 231.0)  # px: the strip's part in the picture that is used
AT = 130.0
RADII = (0.9, 0.4)  # px, at both ends of ARC
CAMERA = Camera(width=WIDTH, height=HEIGHT).with_noise_sd(2.5)
pixel_tolerance = 0.03  # share: sums over pixels against integrals across the line
monte_carlo_tolerance = 0.12  # share of an SD; three standard errors of 320 draws


def test_profile_of_an_axis_parallel_strip_is_blur_and_pixel():
    def exact(d):
        return quad(lambda q: ndtr((d + q + 0.6) / 0.7) - ndtr((d + q - 0.6) / 0.7), -0.5, 0.5)[0]

    distance, share, _ = cramer_rao.line_profile(0.6, 0.7)
    some = [int(np.argmin(np.abs(distance - d))) for d in (0.0, 0.5, 1.3, 2.5)]
    assert share[some] == pytest.approx([exact(distance[k]) for k in some], abs=1e-3)
    assert np.trapezoid(share, distance) == pytest.approx(1.2, rel=1e-3)  # the strip's width


def test_wide_edges_hold_twice_the_information_of_one():
    # a strip much wider than its blur: each edge holds ∫ step'² = 1/(2√π σ)
    camera = Camera(blur_px=3.0, noise_gain=0.0, read_noise=2.0)
    found = cramer_rao.offset_information(40.0, 100.0, camera)
    sigma = np.sqrt(9 + 1 / 12)
    expected = 2 * 100**2 / (2 * np.sqrt(np.pi) * sigma) / (4 + cramer_rao.ROUNDING_VARIANCE)
    assert found == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(("degree", "factor"), [(2, 45 / 8), (3, 45 / 8), (4, 2205 / 32)])
def test_polynomials_in_a_symmetric_window_have_closed_forms(degree, factor):
    # Var v''(0) = 4 · factor / (j w⁵), from Legendre polynomials on [−w, w]
    arc = np.linspace(-50, 50, 20001)
    found = cramer_rao.polynomial_bound(arc, 3.0, 0.0, degree)
    assert found == pytest.approx(2 * np.sqrt(factor / (3.0 * 50**5)), rel=1e-3)


def test_more_freedom_never_helps_and_more_whisker_never_hurts():
    arc = np.arange(0.0, 400.0)
    information = np.linspace(1500, 100, 400)
    by_degree = [cramer_rao.polynomial_bound(arc, information, 100.0, d) for d in range(2, 9)]
    assert np.all(np.diff(by_degree) >= -1e-12)
    by_knots = [cramer_rao.spline_bound(arc, information, 100.0, k) for k in (150, 100, 60, 40)]
    assert np.all(np.diff(by_knots) > 0)
    shorter = cramer_rao.spline_bound(arc[:300], information[:300], 100.0, 60)
    assert shorter >= by_knots[2] * (1 - 1e-9)


def test_a_spline_without_inner_knots_is_a_quartic():
    arc = np.arange(0.0, 120.0)
    assert cramer_rao.spline_bound(arc, 2.0, 60.0, 500) == pytest.approx(
        cramer_rao.polynomial_bound(arc, 2.0, 60.0, 4), rel=1e-9
    )


def test_bad_arguments():
    with pytest.raises(ValueError, match="degree"):
        cramer_rao.polynomial_bound(ARC, 1.0, AT, 1)
    with pytest.raises(ValueError, match="radius_px"):
        cramer_rao.line_profile(0.0, 0.7)


# Pixels --------------------------------------------------------------------------------------


def picture(coefficients):
    """Noise-free picture of the strip v(x) = Σ c_k ((x − AT)/100)^k, up on the screen."""
    x = np.arange(0.0, WIDTH, 0.7)
    shape = np.polynomial.Polynomial(coefficients, domain=[AT - 100, AT + 100])
    slope = shape.deriv()(x)
    curvature = shape.deriv(2)(x) / (1 + slope**2) ** 1.5
    radius = np.interp(x, ARC[[0, -1]], RADII)
    cover, touched = blank(HEIGHT, WIDTH)
    still = np.zeros(len(x))
    strip = Strip(x, HEIGHT / 2 - shape(x), np.arctan(slope), curvature, radius, still)
    count = cover_strip(cover, touched, strip, step_table(CAMERA.blur_px))
    light = np.full((HEIGHT, WIDTH), LIGHT, np.float32)
    absorb(light, cover, touched, count, OPACITY)
    return light[:, 30:231].astype(float).ravel()


TRUE = np.array([0.3, 5.0, 9.0, 1.5, -1.0])  # px: slope about 0.05, curvature about 1/550 px


def derivatives(coefficients):
    step = 0.02 * np.eye(len(TRUE))
    return np.stack(
        [(picture(coefficients + d) - picture(coefficients - d)) / 0.04 for d in step], axis=1
    )


@pytest.fixture(scope="module")
def model():
    light = picture(TRUE)
    variance = CAMERA.read_noise**2 + CAMERA.noise_gain * light + cramer_rao.ROUNDING_VARIANCE
    return light, variance, derivatives(TRUE)


def analytic_bound():
    radius = np.interp(ARC, ARC[[0, -1]], RADII)
    information = [cramer_rao.offset_information(r, LIGHT, CAMERA, OPACITY) for r in radius]
    return cramer_rao.polynomial_bound(ARC, np.array(information), AT, 4)


def test_bound_agrees_with_the_pixels_fisher_matrix(model):
    _, variance, jacobian = model
    fisher = jacobian.T @ (jacobian / variance[:, None])
    sd = 2e-4 * np.sqrt(np.linalg.inv(fisher)[2, 2])
    assert sd == pytest.approx(analytic_bound(), rel=pixel_tolerance)


@pytest.mark.slow
def test_maximum_likelihood_reaches_the_bound_and_not_more(model):
    light, variance, jacobian = model
    rng = np.random.default_rng(11)
    weighted = jacobian / variance[:, None]
    solve = np.linalg.solve(weighted.T @ jacobian, weighted.T)
    found = []
    for _ in range(320):
        noisy = np.rint(light + rng.normal(0, np.sqrt(variance - cramer_rao.ROUNDING_VARIANCE)))
        estimate = TRUE + rng.normal(0, 0.02, len(TRUE))
        for _ in range(3):
            estimate = estimate + solve @ (noisy - picture(estimate))
        found.append(estimate[2] * 2e-4)
    assert np.std(found) == pytest.approx(analytic_bound(), rel=monte_carlo_tolerance)
    assert np.mean(found) == pytest.approx(TRUE[2] * 2e-4, abs=4 * analytic_bound() / np.sqrt(320))


# A whisker -----------------------------------------------------------------------------------


def test_bounds_scale_with_the_noise_and_ignore_the_direction():
    hair = Hair()
    quiet = Camera(noise_gain=0.0, read_noise=1.0)
    loud = Camera(noise_gain=0.0, read_noise=2.0)
    a, b = (cramer_rao.curvature_bounds(hair, 176.0, c) for c in (quiet, loud))
    ratio = np.sqrt((4 + 1 / 12) / (1 + 1 / 12))
    assert {k: b[k] / a[k] for k in a} == pytest.approx(dict.fromkeys(a, ratio))
    oblique = cramer_rao.curvature_bounds(hair, 176.0, quiet, direction=np.pi / 4)
    assert oblique["quadratic ±2 mm"] == pytest.approx(a["quadratic ±2 mm"], rel=0.01)


def test_quadratic_bound_of_a_noisy_whisker():
    # contrast about 100 grey levels at 5.5 mm, noise SD 2.5: about 0.15 1/m by hand
    hair = Hair(opacity=0.95)
    found = cramer_rao.curvature_bounds(hair, 176.0, Camera().with_noise_sd(2.5))[
        "quadratic ±2 mm"
    ]
    assert found == pytest.approx(0.15, abs=0.02)
