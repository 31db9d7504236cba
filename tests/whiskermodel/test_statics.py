"""Closed forms of static bending against Eq. 17 as printed, quadrature and limits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from whiskermodel.statics import (
    force_for_base_angle,
    steady_base_angle,
    steady_moment,
    steady_shape,
)
from whiskermodel.whisker import Whisker, mouse_c2

tapers = st.floats(0.05, 1.0)
contacts = st.floats(0.05, 0.97)  # c in units of L


def cone(taper):
    return Whisker(length=18e-3, cone_length=18e-3 / taper, base_radius=37e-6)


def printed_eq_17(whisker, c, x):
    """ỹ_s of Eq. 17 as it stands in the paper, chord frame."""
    cone, d = whisker.cone_length, whisker.cone_length**4 / whisker.base_flexural_rigidity
    if x > c:
        return -d / 6 * c**2 / (cone**2 * (cone - c) ** 2) * (x - c)
    linear = ((c + cone) * x + (cone - c) * (c + 2 * cone)) / (cone**2 * (cone - c))
    return d / 6 * ((3 * x - c - 2 * cone) / (cone - x) ** 2 + linear)


@given(tapers, contacts, st.floats(0, 0.999))
def test_chord_shape_is_the_printed_equation_17(taper, c, x):
    whisker = cone(taper)
    c, x = c * whisker.length, x * whisker.length
    scale = abs(printed_eq_17(whisker, c, whisker.length * 0.9999)) + 1e-3
    difference = steady_shape(whisker, c, x) - printed_eq_17(whisker, c, x)
    assert abs(difference) < 1e-8 * scale  # m/N; the printed form loses digits near the cylinder


@given(tapers, contacts)
def test_curvature_is_moment_over_rigidity(taper, c):
    whisker = cone(taper)
    c = c * whisker.length
    x = np.linspace(0, 0.99, 31) * whisker.length
    expected = steady_moment(c, x) / whisker.flexural_rigidity(x)
    np.testing.assert_allclose(steady_shape(whisker, c, x, 2), expected, rtol=1e-9)


@given(tapers, contacts, st.floats(0.01, 0.99))
def test_slope_and_displacement_integrate_the_curvature(taper, c, x):
    whisker = cone(taper)
    c, x = c * whisker.length, x * whisker.length
    for derivative, tolerance in ((1, 1e-9), (0, 1e-9)):
        value = steady_shape(whisker, c, x, derivative, frame="clamped")
        points = [c] if c < x else None
        integral, _ = quad(
            lambda s, d=derivative + 1: float(steady_shape(whisker, c, s, d, "clamped")),
            0, x, points=points, epsabs=0, epsrel=1e-11, limit=200,
        )  # fmt: skip
        assert value == pytest.approx(integral, rel=tolerance)


@given(tapers, contacts, st.floats(0.01, 0.99))
def test_curvature_integrates_the_third_derivative(taper, c, x):
    whisker = cone(taper)
    c, x = c * whisker.length, x * c * whisker.length
    change = steady_shape(whisker, c, x, 2) - steady_shape(whisker, c, 0.0, 2)
    integral, _ = quad(lambda s: float(steady_shape(whisker, c, s, 3)), 0, x, epsrel=1e-11)
    assert change == pytest.approx(
        integral, rel=1e-8, abs=1e-8 * c / whisker.base_flexural_rigidity
    )


def test_the_tip_is_on_the_whisker_and_straight():
    whisker, c = mouse_c2(), 9e-3
    tip, inner = (steady_shape(whisker, c, x) for x in (whisker.length, 12e-3))
    slope = steady_shape(whisker, c, whisker.length, 1)
    assert tip - inner == pytest.approx(slope * (whisker.length - 12e-3))
    assert steady_shape(whisker, c, whisker.length, 3) == 0
    assert steady_shape(whisker, c, c, 3) > 0  # at its jump: as inside


def test_base_values_of_equations_57_and_59():
    whisker, c = mouse_c2(), 9e-3
    rigidity, cone_length = whisker.base_flexural_rigidity, whisker.cone_length
    assert steady_shape(whisker, c, 0.0, 2) == pytest.approx(-c / rigidity)
    assert steady_shape(whisker, c, 0.0, 3) == pytest.approx((1 - 4 * c / cone_length) / rigidity)
    expected = cone_length * c**2 / (3 * (cone_length - c) * rigidity)
    assert steady_base_angle(whisker, c) == pytest.approx(expected)
    assert steady_shape(whisker, c, 0.0, 1) == pytest.approx(expected)


def test_chord_frame_meets_the_chord_and_is_smooth_at_the_contact():
    whisker, c = mouse_c2(), 12e-3
    height = steady_shape(whisker, c, 5e-3)
    assert steady_shape(whisker, c, 0.0) == 0
    assert abs(steady_shape(whisker, c, c)) < 1e-12 * height
    slopes = steady_shape(whisker, c, np.array([c, c + 1e-9]), 1)
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-6)


def test_cylinder_is_equation_13():
    whisker = Whisker(length=18e-3, cone_length=np.inf, base_radius=37e-6)
    c, x = 10e-3, np.linspace(0, 10e-3, 11)
    expected = (c**2 - (c - x) ** 2) * (c - x) / (6 * whisker.base_flexural_rigidity)
    np.testing.assert_allclose(steady_shape(whisker, c, x), expected, rtol=1e-12, atol=1e-12)
    nearly = Whisker(length=18e-3, cone_length=18e-3 / 1e-9, base_radius=37e-6)
    np.testing.assert_allclose(
        steady_shape(nearly, c, x), steady_shape(whisker, c, x), rtol=1e-7, atol=1e-12
    )


def test_force_for_a_base_angle():
    whisker, c = mouse_c2(), 9e-3
    force = force_for_base_angle(whisker, c, np.deg2rad(5.0))
    assert steady_base_angle(whisker, c) * force == pytest.approx(np.deg2rad(5.0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"contact_arc_length": 18e-3}, r"contact_arc_length .* 0\.018 m"),
        ({"contact_arc_length": -1e-3}, r"contact_arc_length .* -0\.001 m"),
        ({"contact_arc_length": np.nan}, "contact_arc_length must be finite"),
        ({"arc_length": 19e-3}, r"arc_length must lie from 0 to .* 0\.018 m"),
        ({"derivative": 4}, "derivative must be 0, 1, 2 or 3, got 4"),
        ({"frame": "lab"}, "frame must be one of chord, clamped, got 'lab'"),
    ],
)
def test_impossible_arguments_are_named(arguments, message):
    given_arguments = {"contact_arc_length": 9e-3, "arc_length": 5e-3} | arguments
    with pytest.raises(ValueError, match=message):
        steady_shape(mouse_c2(), **given_arguments)
