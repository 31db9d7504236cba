"""Numbers that the whisker model gives for random inputs: whether a change of its code alters any.

    python workflows/mutant_numbers.py whiskermodel/rod.py SEED FILE.npy

`mutants` compares those of a changed copy with those of the code as it is. Inputs are as wide as
what the model takes: cones and cylinders, any follicle, brief and long contacts, noisy swings.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from whiskermodel import (
    Response,
    SupportedResponse,
    Whisker,
    fit_ringdown,
    half_gaussian,
    half_gaussian_extremes,
    half_gaussian_moments,
    modes,
    mouse_c2,
    ramp_and_hold,
    youngs_modulus,
)
from whiskermodel.modes import supported_modes
from whiskermodel.rod import contact_shape, solve_contact

CONTACTS, FITS, MODES, RESPONSES = 1000, 200, 40, 20  # inputs of each kind


def all_of(result) -> list[np.ndarray]:
    """Every field of a result."""
    return [np.asarray(value) for value in vars(result).values()]


def whiskers(rng, count):
    """Cones of random dimensions, every fourth as good as a cylinder."""
    for k in range(count):
        length = rng.uniform(8e-3, 50e-3)
        taper = rng.uniform(0.5, 1.0) if k % 4 else 1e-6
        damping = rng.choice([0.0, 100.0, 215.0, 1000.0])
        yield Whisker(length, length / taper, rng.uniform(15e-6, 120e-6), damping_rate=damping)


def contacts(rng):
    """State, force, loads, place and shape of rods against poles; half of them from a guess."""
    out = []
    for whisker in whiskers(rng, 4):
        n, length = CONTACTS, whisker.length
        base = *rng.uniform(-1e-3, 1e-3, (2, n)), rng.uniform(-1.4, 1.4, n)
        way = base[2] + rng.uniform(-0.5, 0.5, n)
        reach = rng.uniform(0.02, 1.1, n) * length
        pole = base[0] + reach * np.cos(way), base[1] + reach * np.sin(way)
        args = whisker, base, (*pole, rng.uniform(0, 0.6e-3, n)), rng.choice([-1, 1], n)
        bend = np.stack([rng.uniform(-1, 1, n) / length, rng.uniform(-2, 2, n) / length**2], 1)
        friction = rng.uniform(-0.3, 0.3, n)
        plain = solve_contact(*args, bend, friction)
        near = rng.uniform(0.8, 1.2, (2, n)) * [plain.contact_arc_length, plain.contact_force]
        guessed = solve_contact(*args, bend, friction, guess=near)
        for one in (plain, guessed):
            names = ("free", "contact", "slipped", "unreachable")
            state = np.array([names.index(state) for state in one.state])
            out += all_of(replace(one, state=state))
        out += contact_shape(whisker, plain, np.linspace(0, length, 7))
    return out


def fits(rng):
    """Every estimate of ring-downs: few and many frames, noise, higher modes, what lies below."""
    out = []
    for k in range(FITS):
        n, d = rng.integers(18, 150), rng.uniform(10, 500)
        time = np.arange(n) * 1e-3
        p = rng.uniform(300, 0.95 * np.pi * 1e3)
        overtones = (2.46, 4.62)[: k % 3]
        signal = np.exp(-d * time) * np.sin(p * time + rng.uniform(-3, 3))
        for ratio in overtones:
            swing = np.sqrt(ratio**2 * (p**2 + d**2) - d**2)
            signal += rng.normal(0, 0.4) * np.exp(-d * time) * np.sin(swing * time)
        signal += rng.normal(0, rng.choice([1e-3, 0.02, 0.05]), n)
        se = rng.uniform(0.5, 2, n) if rng.random() < 0.5 else None
        fit = fit_ringdown(time, signal, k % 4 % 3, overtones, se)
        for name in ("damping_rate", "angular_frequency", "amplitude", "offset"):
            estimate = getattr(fit, name)
            out += [[estimate.value, estimate.low, estimate.high]]
        errors = rng.uniform(0, 0.3e-3), rng.uniform(0, 1e-6)
        modulus = youngs_modulus(fit, mouse_c2(), ("fixed", "pinned", 3.0)[k % 3], *errors)
        out += [[fit.residual_sd, np.cos(fit.phase.value)]]
        out += [[modulus.value, modulus.low, modulus.high]]
    return out


def shapes(rng):
    """Frequencies, and shapes with their derivatives, of every basis and any follicle."""
    out, x = [], np.linspace(0, 1, 23)
    for k in range(MODES):
        taper = (0.0, 1.0, 1 - 1e-4, rng.uniform(0, 1))[k % 4]
        boundary = ("fixed", "pinned", 10 ** rng.uniform(-2, 3))[k % 3]
        count = int(rng.integers(1, 13))
        some = [modes(taper, boundary, count)]
        some += [supported_modes(taper, rng.uniform(0.05, 0.95), boundary, count)]
        if k % 3 < 2:
            some += [modes(taper, boundary, count, "paper")]
        if k % 3 < 2 or taper > 0.1:
            some += [modes(taper, boundary, count, "exact")]
        out += [one.p_prime for one in some]
        out += [one.shape(x, d) for one in some for d in range(4)]
    return out


def responses(rng):
    """Loads and displacements of random forces, sampled or pulses, free or held by the pole."""
    out = []
    for k, whisker in enumerate(whiskers(rng, RESPONSES)):
        c, dt = rng.uniform(0.1, 0.9) * whisker.length, 5e-5
        unit = whisker.base_flexural_rigidity / whisker.length
        boundary = ("fixed", "pinned", unit * 10 ** rng.uniform(-2, 3))[k % 3]
        frame = "chord" if k % 3 == 1 else ("chord", "clamped")[k % 2]
        response, time = Response(whisker, boundary, frame), np.arange(0, 60e-3, dt)
        duration = rng.uniform(0.5e-3, 40e-3)
        pulse = half_gaussian(time, duration, 1.0, 1e-3)
        x = np.linspace(0, whisker.length, 5)
        for force in (pulse, ramp_and_hold(time, 3e-3, 1.0), rng.normal(0, 1, 50)):
            loads = response.base_loads(c, force, dt, substeps=3)
            out += [*all_of(loads), loads.moment, loads.shear, loads.angle]
            out += [loads.vibration_extremes(), response.amplitude_rates(c, force, dt)]
            out += all_of(response.displacement(c, force, dt, x))
        held = SupportedResponse(whisker, c, boundary, frame)
        for force in (pulse, ramp_and_hold(time, 3e-3, 1.0)):
            out += all_of(held.loads(force, dt)) + all_of(held.displacement(force, dt, x))
        some = rng.uniform(0.5e-3, 40e-3, 6)
        out += half_gaussian_moments(response, c, np.ones(6), some, time)
        out += [half_gaussian_extremes(response, c, np.ones(6), some)]
    return out


NUMBERS = {
    **dict.fromkeys(("rod", "rod_equilibrium", "rod_shapes"), contacts),
    **dict.fromkeys(("modes", "polynomial_modes", "bessel_modes"), shapes),
    **dict.fromkeys(("response", "supported", "modal_filter", "pulse_response"), responses),
    "ringdown": fits,
}


def numbers(path: str, seed: int) -> np.ndarray | None:
    """All numbers of a file's random inputs, in one row; None where it has no such inputs."""
    room, _, stem = path.removesuffix(".py").rpartition("/")
    if room != "whiskermodel" or stem not in NUMBERS:
        return None
    parts = NUMBERS[stem](np.random.default_rng(seed))
    scaled = [np.ravel(part) / (np.nanmax(np.abs(part), initial=0.0) or 1.0) for part in parts]
    sizes = [np.nanmax(np.abs(part), initial=0.0) for part in parts]
    return np.concatenate([*scaled, np.log(np.maximum(sizes, 1e-300))])


if __name__ == "__main__":
    found = numbers(sys.argv[1], int(sys.argv[2]))
    if found is not None:
        np.save(Path(sys.argv[3]), found)
