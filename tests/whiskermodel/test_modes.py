"""Modes: published tables, exact against complete, stability, boundaries between the limits."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import roots_legendre

from whiskermodel.modes import follicle_stiffness, modes
from whiskermodel.paper.cylinder_modes import cylinder_functions, cylinder_wavenumbers
from whiskermodel.whisker import Whisker, mouse_c2

TEN_DIGITS = 1e-10  # relative

# p'/2 of the full cone
PUBLISHED_FIXED = np.array([4.359, 10.571, 19.229, 30.342, 43.920, 60.005])  # paper, 60 functions
TIMOSHENKO_FIXED = np.array([4.359, 10.573, 19.225, 30.339, 43.921, 59.956])
PUBLISHED_PINNED = np.array([2.877, 11.211, 20.792, 33.056, 47.903, 65.538])
CONVERGED_FIXED = np.array([4.359629, 10.572831, 19.226886, 30.340069, 43.916996, 59.959382])
CONVERGED_PINNED = np.array([0, 7.703418, 15.875311, 26.429858, 39.422779, 54.869483])


def gauss(n):
    nodes, weights = roots_legendre(n)
    return (nodes + 1) / 2, weights / 2


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
@pytest.mark.parametrize("taper", [0.3, 0.5, 0.7, 0.9, 0.95, 0.99, 0.9999, 1.0])
def test_exact_and_complete_agree_to_ten_digits(taper, boundary):
    exact = modes(taper, boundary, 6, "exact").p_prime
    complete = modes(taper, boundary, 6, "complete").p_prime
    np.testing.assert_allclose(complete, exact, rtol=TEN_DIGITS, atol=0)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.05, 1.0), st.floats(0.01, 100.0))
def test_exact_and_complete_agree_for_any_follicle(taper, stiffness):
    exact = modes(taper, stiffness, 6, "exact").p_prime
    np.testing.assert_allclose(modes(taper, stiffness, 6).p_prime, exact, rtol=TEN_DIGITS)


@pytest.mark.parametrize(
    ("taper", "boundary"),
    [(0.0, "fixed"), (0.0, "pinned"), *product((0.5, 0.95, 1.0), ("fixed", "pinned", 3.0))],
)
def test_exact_and_complete_shapes_agree_in_all_derivatives(taper, boundary):
    x = np.linspace(0, 1, 101)
    exact, complete = (modes(taper, boundary, 10, basis) for basis in ("exact", "complete"))
    for derivative, tolerance in enumerate((1e-9, 1e-9, 1e-8, 1e-7)):
        expected = exact.shape(x, derivative)
        error = np.abs(complete.shape(x, derivative) - expected).max()
        assert error < tolerance * np.abs(expected).max()


def test_converged_rows_to_six_decimals():
    assert np.abs(modes(1.0, "fixed", 6).p_prime / 2 - CONVERGED_FIXED).max() <= 0.5e-6
    assert np.abs(modes(1.0, "pinned", 6).p_prime / 2 - CONVERGED_PINNED).max() <= 0.5e-6


def test_timoshenko_row():
    converged = modes(1.0, "fixed", 6).p_prime / 2
    np.testing.assert_allclose(converged, TIMOSHENKO_FIXED, rtol=2e-4)


def test_paper_basis_reproduces_the_published_rows():
    fixed = modes(1.0, "fixed", 6, "paper", n_terms=60).p_prime / 2
    np.testing.assert_allclose(fixed, PUBLISHED_FIXED, rtol=1e-3)
    pinned = modes(1.0, "pinned", 6, "paper", n_terms=60).p_prime / 2
    np.testing.assert_allclose(pinned, PUBLISHED_PINNED, rtol=1e-3)
    np.testing.assert_allclose(pinned[1:], PUBLISHED_PINNED[1:], atol=1e-3)
    assert pinned[0] == pytest.approx(2.879, abs=1e-3)


def test_papers_pinned_basis_keeps_sinking_below_the_published_row():
    counts = (30, 60, 120, 240)
    pinned = [modes(1.0, "pinned", 1, "paper", n_terms=n).p_prime[0] for n in counts]
    fixed = [modes(1.0, "fixed", 1, "paper", n_terms=n).p_prime[0] for n in counts]
    assert (np.diff(pinned) < -0.02).all()
    assert np.abs(np.diff(fixed)).max() < 1e-5


def test_paper_basis_converges_from_above_for_the_fixed_end():
    exact = modes(0.95, "fixed", 6, "exact").p_prime
    error = [modes(0.95, "fixed", 6, "paper", n_terms=n).p_prime - exact for n in (20, 40, 80)]
    assert (np.array(error) > 0).all()
    assert (error[2] < error[1]).all()
    assert (error[1] < error[0]).all()


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
def test_taper_zero_is_the_cylinder(boundary):
    k = cylinder_wavenumbers(boundary, 8)
    first = modes(0.0, boundary, 9).p_prime[1 if boundary == "pinned" else 0 :][:8]
    np.testing.assert_allclose(first, k**2, rtol=1e-12)


def test_published_wavenumbers():
    fixed = [1.875, 4.694, 7.855, 10.996, 14.137, 17.279]
    pinned = [3.927, 7.069, 10.210, 13.352, 16.493]
    np.testing.assert_allclose(cylinder_wavenumbers("fixed", 6), fixed, atol=0.5e-3)
    np.testing.assert_allclose(cylinder_wavenumbers("pinned", 5), pinned, atol=0.5e-3)


@pytest.mark.parametrize("boundary", ["fixed", "pinned"])
def test_cylinder_functions_are_stable_to_mode_100(boundary):
    x, weights = gauss(600)
    y = cylinder_functions(boundary, 100, x)
    np.testing.assert_allclose((y * weights) @ y.T, np.eye(100), atol=1e-11)
    k = cylinder_wavenumbers(boundary, 100)[:, None]
    np.testing.assert_allclose(cylinder_functions(boundary, 100, x, 4) / k**4, y, atol=1e-11)
    held = (0, 1) if boundary == "fixed" else (0, 2)
    for derivative, end in [(held[0], 0.0), (held[1], 0.0), (2, 1.0), (3, 1.0)]:
        value = cylinder_functions(boundary, 100, np.array([end]), derivative)
        np.testing.assert_allclose(value / k**derivative, 0, atol=2e-13)


@settings(max_examples=20, deadline=None)
@given(
    st.one_of(st.just(1.0), st.floats(0.0, 0.99999)),
    st.one_of(st.sampled_from(["fixed", "pinned"]), st.floats(1e-3, 1e3)),
)
def test_modes_are_orthonormal_and_diagonal_in_energy(taper, boundary):
    some = modes(taper, boundary, 8)
    breaks = np.concatenate([1 - np.geomspace(1, 1e-6, 12), [1.0]])
    nodes, weights = gauss(40)
    x = (breaks[:-1, None] + np.diff(breaks)[:, None] * nodes).ravel()
    w = (np.diff(breaks)[:, None] * weights).ravel()
    phi, bent = some.shape(x), some.shape(x, 2)
    np.testing.assert_allclose((phi * w * (1 - taper * x) ** 2) @ phi.T, np.eye(8), atol=1e-10)
    energy = (bent * w * (1 - taper * x) ** 4) @ bent.T
    if 0 < some.follicle_stiffness < np.inf:
        slope = some.at_base(1)
        energy += some.follicle_stiffness * np.outer(slope, slope)
    scale = np.maximum(some.p_prime[-1] ** 2, 1)
    np.testing.assert_allclose(energy / scale, np.diag(some.p_prime**2) / scale, atol=1e-10)


@pytest.mark.parametrize("stiffness", [1e-3, 0.5, 20.0])
def test_compliant_follicle_meets_its_end_condition(stiffness):
    some = modes(0.95, stiffness, 8)
    np.testing.assert_allclose(some.at_base(2), stiffness * some.at_base(1), rtol=1e-6)


def test_frequencies_rise_from_pinned_to_fixed_with_the_stiffness():
    rows = [modes(0.95, k, 6).p_prime for k in ("pinned", 1e-2, 1.0, 10.0, 1e3, "fixed")]
    assert (np.diff(rows, axis=0) > 0).all()
    np.testing.assert_allclose(modes(0.95, 1e9, 6).p_prime, rows[-1], rtol=1e-8)
    np.testing.assert_allclose(modes(0.95, 1e-9, 6).p_prime[1:], rows[0][1:], rtol=1e-8)


def test_soft_follicle_swings_as_a_rigid_body():
    # p'² = κ/∫x²(1−x)² dx = 30 κ
    assert modes(1.0, 1e-8, 2).p_prime[0] == pytest.approx(np.sqrt(30e-8), rel=1e-6)


@pytest.mark.slow
def test_many_modes():
    complete, exact = (modes(0.95, "fixed", 80, basis).p_prime for basis in ("complete", "exact"))
    np.testing.assert_allclose(complete, exact, rtol=1e-9)


def test_physical_frequency_is_equation_39():
    whisker = mouse_c2()
    some = modes(whisker.taper, "fixed", 3)
    wave_speed = np.sqrt(whisker.youngs_modulus / whisker.density)
    expected = some.p_prime / 2 * whisker.base_radius / whisker.length**2 * wave_speed
    np.testing.assert_allclose(some.angular_frequency(whisker), expected)


def test_follicle_stiffness_in_newton_metres():
    whisker = Whisker(length=20e-3, cone_length=21e-3, base_radius=40e-6)
    rigidity = whisker.base_flexural_rigidity
    assert follicle_stiffness(rigidity / 20e-3 * 7, whisker) == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"taper": 1.01}, r"taper must be in 0–1, got 1\.01"),
        ({"taper": -0.1}, r"taper must be in 0–1, got -0\.1"),
        ({"taper": np.nan}, "taper must be in 0–1, got nan"),
        ({"n_modes": 0}, "n_modes must be a whole number >= 1, got 0"),
        ({"n_modes": 2.5}, r"n_modes must be a whole number >= 1, got 2\.5"),
        ({"boundary": "free"}, "boundary must be 'fixed', 'pinned' or .* got 'free'"),
        ({"boundary": -1.0}, r"boundary .* >= 0, got -1\.0"),
        ({"basis": "fourier"}, "basis must be one of complete, paper, exact, got 'fourier'"),
        ({"basis": "paper", "boundary": 1.0}, r"basis 'paper' .* stiffness 1\.0"),
        ({"n_terms": 5}, "n_terms must be a whole number >= 13, got 5"),
    ],
)
def test_impossible_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        modes(**({"taper": 0.95} | arguments))
