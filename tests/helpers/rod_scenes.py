"""Places on whiskers that touch a pole, of rods whose forces are known."""

from dataclasses import replace

import numpy as np

from pipeline.detection.line_end import PLACES_PX
from pipeline.forces import rod_fit
from pipeline.kinematics.stations import N_STATIONS, Stations
from whiskermodel import rod
from whiskermodel.whisker import mouse_c2

POLE_RADIUS = 0.25e-3
CURVATURE_AT = 5.5e-3
REST = (12.0, 1800.0)
SD = 0.004e-3 / 25  # m, of a place: 0.004 px


def touching(push, distance=9e-3, side=1, origin=0.0, friction=0.0, whisker=None):
    """RodContact and its stations, free of noise, of a whisker turned `push` into a pole."""
    whisker = whisker or mouse_c2()
    push = np.atleast_1d(push)
    n = len(push)
    x, y, angle = rod.free_shape(whisker, 0, 0, 0.0, np.array([distance]), REST)
    reach = side * (POLE_RADIUS + whisker.radius(distance))
    pole = x[0] - reach * np.sin(angle[0]), y[0] + reach * np.cos(angle[0])
    truth = rod.solve_contact(
        whisker, (0, 0, side * push), (*pole, POLE_RADIUS), side, REST, friction=friction
    )
    s = np.linspace(0, whisker.length, N_STATIONS)
    x, y, _ = rod.contact_shape(whisker, truth, np.clip(s + origin, 0, whisker.length))
    information = np.full(x.shape, SD**-2)
    information[:, :7] = 0
    information[:, -2:] = 0
    information[np.hypot(x - pole[0], y - pole[1]) < POLE_RADIUS + 0.2e-3] = 0
    nearest = np.where(truth.touching, truth.contact_arc_length, distance) - origin
    places = Stations(
        names=("C2",),
        spacing=np.array([s[1]]),
        frame=np.arange(n),
        whisker=np.zeros(n, int),
        x=x,
        y=y,
        information=information,
        first=np.full(n, s[7]),
        last=np.full(n, s[-3]),
        origin=np.full(n, origin),
        pole_x=np.full(n, pole[0]),
        pole_y=np.full(n, pole[1]),
        pole_radius=POLE_RADIUS,
        pixel=40e-6,
        distance=np.zeros(n),
        nearest=nearest,
        side=np.full(n, side),
        extended=np.zeros(n, bool),
        interpolated=np.zeros(n, bool),
        end_px=np.full((n, len(PLACES_PX)), np.nan, np.float16),
    )
    return truth, places


def known_rest(n, sd=1e-3, whisker=None):
    """Prior of a rest shape that is known to `sd` [1/m] in each coefficient."""
    half = (whisker or mouse_c2()).length / 2
    weights = np.zeros((1, rod_fit.N_REST))
    weights[0, :2] = REST[0] + REST[1] * half, REST[1] * half
    cov = np.broadcast_to(np.eye(rod_fit.N_REST) * sd**2, (n, *[rod_fit.N_REST] * 2))
    return rod_fit.RestPrior(weights, 0.0, 1.0, np.zeros((n, rod_fit.N_REST)), cov)


def noisy(places, rng):
    """Places moved by noise across the whisker (and along it, which must not matter)."""
    shape = places.x.shape
    return replace(
        places, x=places.x + rng.normal(0, SD, shape), y=places.y + rng.normal(0, SD, shape)
    )
