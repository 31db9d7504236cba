"""Contacts per second of the dynamic model, compared with convolution, FFT and PyElastica.

    python workflows/benchmark_model.py
    python workflows/benchmark_model.py --elastica-python elastica/bin/python

The task: steady and vibrational base moment of half-Gaussian contacts of a mouse whisker, with 10
modes, 60 ms at 10 µs. Ours does 10,000 of them; the others as many as it takes to measure them:

(a) direct convolution of the paper's integrals (Eq. 49) at its step of 10 µs, contact by contact,
    mode by mode, F'' and F' by differences;
(b) the same by FFT; and, for fairness, the best that FFTs can do: the modes' kernels transformed
    once and for all, and summed before a single inverse transform;
(c) PyElastica, one contact, 50 elements (see elastica_contact.py): a stretch of it, scaled up.

All on one thread, in CPU time, so that a busy machine does not matter much.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy looks

import argparse  # noqa: E402
import json  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import time  # noqa: E402
from functools import partial  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from scipy.signal import fftconvolve  # noqa: E402

from whiskermodel import (  # noqa: E402
    HalfGaussianMoments,
    Response,
    half_gaussian,
    half_gaussian_moments,
    mouse_c2,
)

DT, SAMPLES, N_MODES = 1e-5, 6000, 10
BATCH = 1000
TARGETS = {"a": 500, "b": 20, "c": 10_000}


def contacts(n, seed=0):
    """Contact arc lengths [m], peak forces [N], durations [s] over the paper's ranges."""
    rng = np.random.default_rng(seed)
    durations = np.exp(rng.uniform(np.log(5e-3), np.log(55e-3), n))
    return rng.uniform(6e-3, 15e-3, n), rng.uniform(1.8e-6, 44.4e-6, n), durations


# The ways to do it ------------------------------------------------------------------------------


def ours(response, c, peak, duration):
    """Closed form, a batch of contacts at a time into the same memory; returns the last batch."""
    moments = HalfGaussianMoments(response, np.arange(SAMPLES) * DT)
    out = np.empty((2, BATCH, SAMPLES))
    for start in range(0, len(c), BATCH):
        rows = slice(start, start + BATCH)
        n = len(c[rows])
        moments(c[rows], peak[rows], duration[rows], out=out[:, :n])
    return out


def ours_sampled(response, c, peak, duration):
    """The recursion for any sampled force, all four loads; forces made beforehand."""
    force = half_gaussian(np.arange(SAMPLES) * DT, duration, peak)
    return lambda: response.base_loads(c, force, DT)


class PapersIntegrals:
    """Eqs 49 and 55 at the paper's step."""

    def __init__(self, response):
        self.response, d = response, response.whisker.damping_rate
        p = response.angular_frequency[:, None]
        t = np.arange(SAMPLES) * DT
        rate = np.sqrt(p**2 - d**2)
        self.damping, self.time = d, t
        self.kernels = np.exp(-d * t) * np.sin(rate * t) / rate * DT
        self.size = 2 * SAMPLES
        self.transformed = np.fft.rfft(self.kernels, self.size)

    def drive(self, peak, duration):
        """F and F'' + 2d F', by differences."""
        force = half_gaussian(self.time, duration, peak)
        slope = np.diff(force, append=0.0) / DT
        second = np.diff(force, n=2, prepend=0.0, append=0.0) / DT**2
        return force, second + 2 * self.damping * slope

    def direct(self, c, peak, duration):
        """(a)"""
        force, drive = self.drive(peak, duration)
        weights = self.response.base_moment_weights(c)
        vibrational = np.zeros(SAMPLES)
        for weight, kernel in zip(weights, self.kernels, strict=True):
            vibrational -= weight * np.convolve(drive, kernel)[:SAMPLES]
        return -c * force, vibrational

    def fft(self, c, peak, duration):
        """(b)"""
        force, drive = self.drive(peak, duration)
        integrals = fftconvolve(drive[None, :], self.kernels, axes=1)[:, :SAMPLES]
        return -c * force, -self.response.base_moment_weights(c) @ integrals

    def best_fft(self, c, peak, duration):
        """(b), one transform forth and one back per contact."""
        force, drive = self.drive(peak, duration)
        kernel = self.response.base_moment_weights(c) @ self.transformed
        vibrational = np.fft.irfft(np.fft.rfft(drive, self.size) * kernel, self.size)[:SAMPLES]
        return -c * force, -vibrational


def elastica(interpreter, simulate_ms):
    """(c): what elastica_contact.py prints, or None and why not."""
    script = Path(__file__).with_name("elastica_contact.py")
    command = [interpreter, str(script), "--simulate-ms", str(simulate_ms)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        return None, f"{interpreter} does not start: {error.strerror}"
    if done.returncode == 0:
        return json.loads(done.stdout.splitlines()[-1]), ""
    if "No module named 'elastica'" in done.stderr:
        return None, (
            f"PyElastica is not installed for {interpreter}: pip install pyelastica, or name "
            f"another interpreter with --elastica-python"
        )
    return None, f"{script.name} failed: {done.stderr.strip().splitlines()[-1]}"


# Measuring --------------------------------------------------------------------------------------


def cpu_time(work):
    """CPU seconds of `work()`, and what it returns."""
    start = time.process_time()
    result = work()
    return time.process_time() - start, result


def per_second(work, cases):
    """Cases per CPU second, over as many as take one."""
    done, spent = 0, 0.0
    while spent < 1.0:
        seconds, _ = cpu_time(partial(work, *cases[done % len(cases)]))
        done, spent = done + 1, spent + seconds
    return done / spent


def bounds(n):
    """CPU seconds of the bare parts for n contacts: matrix products, writing the results."""
    rng = np.random.default_rng(0)
    left, right = rng.normal(size=(64, 76)), rng.normal(size=(76, SAMPLES))
    out = np.empty((64, SAMPLES))
    # series and ringing while in contact, on average a third of the time; the force; then ringing
    sizes = ((76, SAMPLES // 3), (28, SAMPLES // 3), (20, SAMPLES * 3 // 4))
    flat = out.ravel()
    products, _ = cpu_time(
        lambda: [
            np.matmul(left[:, :k], right[:k, :m], out=flat[: 64 * m].reshape(64, m))
            for _ in range(n // 64)
            for k, m in sizes
        ]
    )
    result = np.empty((2, BATCH, SAMPLES))
    writing, _ = cpu_time(lambda: [result.fill(i) for i in range(n // BATCH)])
    return products, writing


def agreement(response, c, peak, duration):
    """Largest difference of (a) from ours over the peak steady moment."""
    t = np.arange(SAMPLES) * DT
    _, closed = half_gaussian_moments(response, c, peak, duration, t)
    _, direct = PapersIntegrals(response).direct(c, peak, duration)
    return np.abs(closed[0] - direct).max() / (c * peak)


def elastica_agreement(result):
    """Largest difference of its shape from ours, over the largest displacement."""
    t = np.arange(0, result["simulated_s"] + 1e-7, 1e-7)
    force = half_gaussian(t, 12e-3, 10e-6)
    x = np.clip(result["x_m"], 0, mouse_c2().length)
    y = Response(mouse_c2(), frame="clamped", n_modes=40).displacement(9e-3, force, 1e-7, x)
    difference = np.abs(y.total[:, -1] - result["y_m"]).max()
    return difference / np.abs(y.total[:, -1]).max()


# Report -----------------------------------------------------------------------------------------


def line(name, rate, own_rate, target=None):
    """One row: contacts per second, and how many times faster ours is."""
    factor = own_rate / rate
    aim = (
        "" if target is None else f"   aim {target:,}×: {'met' if factor >= target else 'missed'}"
    )
    return f"{name:<52}{rate:>14.6g} contacts/s{factor:>14,.1f}×{aim}"


def main():
    """Measure all and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--contacts", type=int, default=10_000)
    parser.add_argument("--elastica-python", default=sys.executable, metavar="PATH")
    parser.add_argument("--elastica-ms", type=float, default=0.5, help="how much of 60 ms to run")
    arguments = parser.parse_args()
    response = Response(mouse_c2(), n_modes=N_MODES)
    some = contacts(arguments.contacts)
    cases = list(zip(*contacts(50, seed=1), strict=True))

    ours(response, *(s[:BATCH] for s in some))  # touches the memory once
    spent, _ = cpu_time(lambda: ours(response, *some))
    own = len(some[0]) / spent
    few = tuple(s[:200] for s in some)
    sampled, _ = cpu_time(ours_sampled(response, *few))
    integrals = PapersIntegrals(response)
    print(line(f"whiskermodel, {len(some[0]):,} half-Gaussian contacts", own, own))
    print(line("whiskermodel, any sampled force, four loads", 200 / sampled, own))
    print(line("(a) direct convolution", per_second(integrals.direct, cases), own, TARGETS["a"]))
    print(line("(b) FFT", per_second(integrals.fft, cases), own, TARGETS["b"]))
    print(line("(b) FFT, transforms shared", per_second(integrals.best_fft, cases), own))
    result, why = elastica(arguments.elastica_python, arguments.elastica_ms)
    if result is None:
        print(f"(c) not measured. {why}")
    else:
        name = f"(c) PyElastica {result['version']}, {result['dt_s'] * 1e9:.2f} ns steps"
        print(line(name, 1 / result["cpu_s_per_60_ms"], own, TARGETS["c"]))
    print()
    print(f"(a) differs from ours by {agreement(response, *cases[0]):.1e} of the steady peak")
    if result is not None:
        print(f"(c) differs from ours by {elastica_agreement(result):.1e} of the largest "
              f"displacement, {result['simulated_s'] * 1e3:g} ms into the contact")  # fmt: skip
    products, writing = bounds(len(some[0]))
    print(
        f"Bound now: of {spent:.2f} s, bare matrix products of this size take {products:.2f} s, "
        f"filling memory of the results' size {writing:.2f} s"
    )


if __name__ == "__main__":
    main()
