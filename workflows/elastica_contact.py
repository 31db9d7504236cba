"""One half-Gaussian contact of the mouse whisker in PyElastica, 50 elements: time per second.

    python workflows/elastica_contact.py --simulate-ms 0.05

Started by benchmark_model.py, if need be with another interpreter that has PyElastica, and
therefore with no import from this project. Prints one line of JSON. The explicit scheme's step is
set by the thinnest elements, near the tip; it is found by halving until a trial run stays small.
"""

import argparse
import contextlib
import io
import json
import time
from importlib.metadata import version

import elastica as ea
import numpy as np

# In units of 0.1 mm, 1 ms and 1 µg: PyElastica takes what is small in SI for zero
METRE, SECOND, KILOGRAM = 1e4, 1e3, 1e9
NEWTON = KILOGRAM * METRE / SECOND**2
LENGTH, CONE_LENGTH, BASE_RADIUS = 18e-3 * METRE, 18e-3 / 0.95 * METRE, 37e-6 * METRE
MODULUS, DENSITY, DAMPING = 3e9 * NEWTON / METRE**2, 1e3 * KILOGRAM / METRE**3, 215 / SECOND
ELEMENTS = 50
CONTACT, PEAK, DURATION = 9e-3 * METRE, 10e-6 * NEWTON, 12e-3 * SECOND


class Contact(ea.NoForces):
    """The contact force, shared between the two nodes beside c."""

    def __init__(self, nodes, shares, peak=PEAK):
        super().__init__()
        self.nodes, self.shares, self.peak = nodes, shares, peak

    def apply_forces(self, system, time=0.0):
        """Add F(t) to the nodes."""
        u = 2 * float(time) / DURATION - 1
        force = self.peak * (2 * np.exp(-np.log(2) * u * u) - 1) if abs(u) < 1 else 0.0
        for node, share in zip(self.nodes, self.shares, strict=True):
            system.external_forces[1, node] -= share * force


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):
    """What PyElastica needs to hold together."""


def build(dt):
    """The clamped whisker with its load, ready to run at step `dt` [ms]."""
    simulator = Simulator()
    middle = (np.arange(ELEMENTS) + 0.5) * LENGTH / ELEMENTS
    rod = ea.CosseratRod.straight_rod(
        ELEMENTS,
        np.zeros(3),
        np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 1.0, 0.0]),
        LENGTH,
        BASE_RADIUS * (1 - middle / CONE_LENGTH),
        DENSITY,
        youngs_modulus=MODULUS,
        shear_modulus=MODULUS / 3,
    )
    simulator.append(rod)
    simulator.constrain(rod).using(
        ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    place = CONTACT / (LENGTH / ELEMENTS)
    node = int(place)
    simulator.add_forcing_to(rod).using(
        Contact, (node, node + 1), (node + 1 - place, place - node)
    )
    simulator.dampen(rod).using(
        ea.AnalyticalLinearDamper, uniform_damping_constant=2 * DAMPING, time_step=dt
    )
    simulator.finalize()
    return simulator, rod


def run(dt, steps):
    """Simulate; returns the rod and the CPU time taken [s]."""
    simulator, rod = build(dt)
    start = time.process_time()
    with np.errstate(all="ignore"):
        ea.integrate(ea.PositionVerlet(), simulator, dt * steps, steps, progress_bar=False)
    return rod, time.process_time() - start


def stable_step():
    """The largest of 2⁻ⁿ × 10⁻⁸ s at which 0.1 ms of contact does not blow up [ms]."""
    dt = 1e-8 * SECOND
    while True:
        rod, _ = run(dt, round(0.1 / dt))
        if np.abs(rod.position_collection[1]).max() < 1e-5 * METRE:  # NaN is not either
            return dt
        dt /= 2


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--simulate-ms", type=float, default=0.5, help="how much to simulate")
    arguments = parser.parse_args()
    with contextlib.redirect_stdout(io.StringIO()):
        run(1e-9 * SECOND, 2)  # compilation
        dt = stable_step()
        steps = round(arguments.simulate_ms / dt)
        rod, seconds = run(dt, steps)
    result = {
        "dt_s": dt / SECOND,
        "simulated_s": steps * dt / SECOND,
        "cpu_s": seconds,
        "cpu_s_per_60_ms": seconds / (steps * dt) * 60,
        "x_m": (rod.position_collection[0] / METRE).tolist(),
        "y_m": (rod.position_collection[1] / METRE).tolist(),
        "version": version("pyelastica"),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
