"""The rod integrated in steps, beside a general solver of its equation and differences of rods."""

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

from pipeline.forces.rod_integration import (
    LOADED,
    N_REST,
    ORIGIN,
    Place,
    empty_rod,
    integrate,
    nearest_to,
    point_at,
)
from pipeline.forces.rod_types import Arc, Beam, Load
from pipeline.kinematics.stations import N_STATIONS
from whiskermodel.whisker import mouse_c2

WHISKER = mouse_c2()
BEAM = Beam(WHISKER.length, WHISKER.cone_length, WHISKER.base_flexural_rigidity)
H = WHISKER.length / (N_STATIONS - 1)
C = 10.08e-3  # m, where the integration begins: between two stations
place_tolerance, angle_tolerance = 1e-7, 2e-5  # m, rad
slope_tolerance = 7e-3  # of the largest
FOURTH, SECOND = 12.0, 1.8  # times less an error of that order is, at least, in half the steps

CASES = [  # side, friction, force [N], origin [m] and how much of it came later
    (1.0, 0.0, 60e-6, 0.0, 0.0),
    (-1.0, 0.3, 40e-6, 0.17e-3, 0.1e-3),
    (1.0, -0.2, 90e-6, -0.12e-3, -0.3e-3),
    (0.0, 0.0, 0.0, 0.15e-3, 0.2e-3),
]


def parameters(force, offset=0.0):
    return np.array([offset, 0.4, 25.0, 14.0, -6.0, 4.0, force])


def integrated(p, case, finer=1):
    """Rod of stations `finer` times as many as usual."""
    side, friction, _, origin, moved = case
    rod, arc = empty_rod(finer * (N_STATIONS - 1) + 1), Arc(origin, moved, H / finer)
    integrate(p, BEAM, Load(side, friction), arc, Place(C, 3e-3, -2e-3), rod)
    return rod


def solved(p, case):
    """x, y, angle, (3, stations + 1), at the usual stations and, last, the follicle."""
    side, friction, _, origin, moved = case
    x0, y0 = 3e-3 - p[0] * np.sin(p[1]), -2e-3 + p[0] * np.cos(p[1])
    normal, tangent = (-np.sin(p[1]), np.cos(p[1])), (np.cos(p[1]), np.sin(p[1]))
    fx, fy = (p[-1] * (friction * t - side * n) for t, n in zip(tangent, normal, strict=True))

    def slope(s, state, bends):
        x, y, angle = state
        share = 2 * (s + origin - moved) / WHISKER.length - 1
        curvature = legendre.legval(share, p[2 : 2 + N_REST])
        if bends:
            moment = (x0 - x) * fy - (y0 - y) * fx
            curvature += moment / WHISKER.flexural_rigidity(s + origin)
        return np.cos(angle), np.sin(angle), curvature

    out = np.empty((3, N_STATIONS + 1))
    s = np.append(H * np.arange(N_STATIONS), -origin)
    for beyond, end in ((False, -1e-3), (True, WHISKER.length)):
        way = solve_ivp(
            slope, (C, end), (x0, y0, p[1]), "DOP853", args=(side != 0 and not beyond,),
            rtol=1e-11, atol=1e-13, dense_output=True, max_step=H,
        )  # fmt: skip
        out[:, (s > C) == beyond] = way.sol(s[(s > C) == beyond])
    return out


@pytest.mark.parametrize("case", CASES)
def test_a_rod_lies_where_a_general_solver_puts_it(case):
    """To fourth order in the steps."""
    p, errors = parameters(case[2], offset=20e-6), []
    true = solved(p, case)
    for finer in (1, 2):
        rod = integrated(p, case, finer)
        stations = np.stack([rod.x, rod.y, rod.angle])[:, ::finer]
        errors.append(np.abs(np.column_stack([stations, rod.follicle[:3]]) - true))
        np.testing.assert_allclose(rod.cos, np.cos(rod.angle), atol=1e-9)
        np.testing.assert_allclose(rod.sin, np.sin(rod.angle), atol=1e-9)
    coarse, fine = (each.max(axis=1) for each in errors)
    assert (coarse < (place_tolerance, place_tolerance, angle_tolerance)).all()
    assert (coarse >= FOURTH * fine - 1e-11).all()
    assert np.ptp(true[2]) > 1 or case[0] == 0  # rad: bent a lot


def differences(p, case, q, size, finer):
    """How far stations move along their normals per unit of `q`, and the follicle.

    A parameter, or the origin, with which the rest shape moves.
    """
    start, rods = integrated(p, case, finer), []
    for step in (-size, size):
        moved = step if q == ORIGIN else 0.0
        further = *case[:3], case[3] + moved, case[4] + moved
        rods.append(
            integrated(p + (step - moved) * np.eye(LOADED + 1)[q, :LOADED], further, finer)
        )
    before, after = rods
    along = (after.y - before.y) * start.cos - (after.x - before.x) * start.sin
    base = (after.follicle - before.follicle) / (2 * size)
    return start, along / (2 * size), base


@pytest.mark.parametrize("case", CASES)
def test_derivatives_by_parameters_are_as_two_rods_differ(case):
    """At a contact held where it is; the load turns with the whisker there. To second order."""
    p, sizes = parameters(case[2]), (1e-7, 1e-5, *[1e-2] * N_REST, 1e-9, 1e-7)
    for q in (*range(LOADED if case[0] else LOADED - 1), ORIGIN):
        errors = []
        for finer in (1, 2):
            rod, along, base = differences(p, case, q, sizes[q], finer)
            moved = np.append(rod.shift[q] - along, rod.base[:2, q] - base[:2])
            errors.append((np.abs(moved).max(), abs(rod.base[2, q] - base[2])))
            limit = (slope_tolerance * np.abs(along).max(), 3 * slope_tolerance * abs(base[2]))
            assert (errors[-1] < np.array(limit) + 1e-9).all()
        rounding = 1e-4 * np.array(limit) + 1e-8
        assert (errors[0] >= SECOND * np.array(errors[1]) - rounding).all()


def circle(radius=5e-3):
    """Stations on a circle, its centre at the origin of the plane; x, y, angle."""
    turned = np.arange(N_STATIONS) * H / radius
    return radius * np.cos(turned), radius * np.sin(turned), turned + np.pi / 2


@pytest.mark.parametrize("at", [0.0, 3.2, 40.5, N_STATIONS - 1.3])
def test_between_stations_lies_an_arc(at):
    x, y, angle = point_at(*circle(), H, at * H)
    assert np.hypot(x, y) == pytest.approx(5e-3, abs=1e-8)  # to the chord's error of κ³h⁴
    assert np.arctan2(y, x) == pytest.approx(
        np.mod(at * H / 5e-3 + np.pi, 2 * np.pi) - np.pi, abs=1e-5
    )
    assert angle == pytest.approx(at * H / 5e-3 + np.pi / 2)


@pytest.mark.parametrize(("start", "reach"), [(20.0, 4e-3), (31.0, 6e-3), (37.0, 4e-3)])
def test_a_pole_lies_square_to_the_nearest_place(start, reach):
    """From a start some stations off, on either side; of a pole out of reach, the start."""
    x, y, angle = circle()
    turned = 28.7 * H / 5e-3
    pole = reach * np.cos(turned), reach * np.sin(turned)
    parts = x, y, np.cos(angle), np.sin(angle), H, start * H
    assert nearest_to(*parts, *pole) == pytest.approx(28.7 * H, abs=1e-3 * H)
    line = np.arange(N_STATIONS) * H, 0 * x, 0 * x + 1, 0 * x, H, start * H
    assert nearest_to(*line, -1e-3, 1e-3) == start * H
