"""The model figures of Hires et al. 2013 as numbers.

Each `figure_N` returns a Table, or the traces behind the figure. Drawing is in `figures`,
the comparison with what is printed in `published`; `files` writes it all.
"""

from dataclasses import dataclass

import numpy as np

from whiskermodel.force_profiles import half_gaussian, ramp_and_hold, stick_slip
from whiskermodel.modes import modes
from whiskermodel.pulse_response import half_gaussian_extremes
from whiskermodel.response import Response
from whiskermodel.ringdown import fit_ringdown, youngs_modulus
from whiskermodel.statics import FRAMES, force_for_base_angle
from whiskermodel.supported import SupportedResponse
from whiskermodel.whisker import Whisker, mouse_c2, rat_c2

DT = 1e-5  # s, the paper's step for vibrations
N_MODES = 10
MILLI, MICRO, NANO = 1e3, 1e6, 1e9  # what to multiply SI by

MODE_TAPERS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
RATIO_COLUMNS = (
    "contact_mm",
    "duration_ms",
    "peak_force_uN",
    "frame",
    "modes",
    "vibration_max_ratio",
    "vibration_min_ratio",
)
FIGURE_7_CONTACTS = {6e-3: 10e-6, 9e-3: 10e-6, 12e-3: 2.5e-6, 15e-3: 0.5e-6}  # m: peak force, N
FIGURE_7_DURATION = 12e-3
FIGURE_8_CONTACT, FIGURE_8_FORCE = 12e-3, 2.5e-6
FIGURE_8_DURATIONS = (2.5e-3, 5e-3, 10e-3, 20e-3)
FIGURE_9_CONTACT = 32e-3
FIGURE_9_SLIPS = (0.25e-3, 0.5e-3, 1e-3, 2e-3, 4e-3)
FIGURE_10_CONTACT, FIGURE_10_ANGLE = 10e-3, np.deg2rad(12.0)
FIGURE_10_RAMPS = (48e-3, 24e-3, 12e-3, 4.8e-3, 2.4e-3)


@dataclass(frozen=True)
class Table:
    """Columns by name, all of one length."""

    columns: dict

    def __len__(self):
        return len(next(iter(self.columns.values())))

    def __getitem__(self, name):
        return np.asarray(self.columns[name])

    def rows(self):
        """Tuples, row by row."""
        return zip(*self.columns.values(), strict=True)

    @staticmethod
    def of_rows(names, rows):
        """The table of `rows`, tuples in the order of `names`."""
        return Table(dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)))


# Modes --------------------------------------------------------------------------------------


def mode_table():
    """p'/2 by every basis (modes.csv). A rigid rotation is the pinned end's mode 1, p' = 0."""
    rows = []
    for boundary in ("fixed", "pinned"):
        for taper in MODE_TAPERS:
            for basis, n_terms in (("paper", 60), ("complete", None), ("exact", None)):
                p = modes(taper, boundary, N_MODES, basis, n_terms).p_prime
                rows += [(boundary, taper, basis, k + 1, v / 2) for k, v in enumerate(p)]
    return Table.of_rows(("boundary", "taper", "basis", "mode", "p_prime_half"), rows)


def figure_2(n_modes=3):
    """The three lowest modes and their derivatives: cylinder and full cone, fixed and pinned.

    The pinned cone twice: as in the paper, and in the complete basis (without its rotation).
    """
    x = np.linspace(0, 1, 201)
    cases = [("fixed", 0.0, "exact"), ("fixed", 1.0, "complete"), ("pinned", 0.0, "exact")]
    cases += [("pinned", 1.0, "paper"), ("pinned", 1.0, "complete")]
    rows = []
    for boundary, taper, basis in cases:
        rigid = boundary == "pinned" and basis != "paper"
        some = modes(taper, boundary, n_modes + rigid, basis)
        # the paper normalises ∫Y² dx = 1, without the cone's weight
        fine = np.linspace(0, 1, 4001)
        norm = np.sqrt(np.trapezoid(some.shape(fine) ** 2, fine, axis=1))
        shapes = np.stack([some.shape(x, d) / norm[:, None] for d in range(4)])[:, int(rigid) :]
        for k in range(n_modes):
            shape = zip(x, *shapes[:, k], strict=True)
            rows += [(boundary, taper, basis, k + 1, *values) for values in shape]
    names = ("boundary", "taper", "basis", "mode", "x_over_length", "displacement")
    return Table.of_rows((*names, "slope", "curvature", "third_derivative"), rows)


# Ring-down ----------------------------------------------------------------------------------


def slipping_whisker():
    """The whisker of Fig. 5, with the E at which it rings as published: 938 rad/s, d = 215 1/s."""
    cone = Whisker(17.14e-3, 17.14e-3, 37.15e-6, name="slipping C2")
    unit = modes(1.0, "fixed", 1).angular_frequency(cone)[0] / np.sqrt(cone.youngs_modulus)
    modulus = (938.0**2 + 215.0**2) / unit**2
    return Whisker(17.14e-3, 17.14e-3, 37.15e-6, modulus, name="slipping C2")


def figure_5(n_slips=8, noise=1.0, seed=5):
    """Simulated slips, their fits and E: traces, fits (Tables).

    A force at 10 mm lets go within a millisecond while the follicle stands still; the curvature
    at 6 mm is filmed at 1000 frames/s with `noise` [1/m, standard deviation].
    """
    rng, whisker = np.random.default_rng(seed), slipping_whisker()
    traces, fits = [], []
    for slip in range(1, n_slips + 1):
        time, curvature = _filmed_slip(whisker, rng)
        curvature = curvature + rng.normal(0, noise, len(time))
        fit = fit_ringdown(time, curvature)
        modulus = youngs_modulus(fit, whisker)
        rows = zip(time * MILLI, curvature, fit(time), strict=True)
        traces += [(slip, *values) for values in rows]
        estimates = (fit.damping_rate, fit.angular_frequency, modulus)
        scales = (1, 1, 1e-9)
        flat = [
            s * v for e, s in zip(estimates, scales, strict=True) for v in (e.value, e.low, e.high)
        ]
        fits.append((slip, *flat))
    names = [f"{n}{end}" for n in ("damping_per_s", "angular_frequency_rad_per_s",
             "youngs_modulus_GPa") for end in ("", "_low", "_high")]  # fmt: skip
    columns = ("slip", "time_ms", "curvature_change_per_m", "fitted_per_m")
    return Table.of_rows(columns, traces), Table.of_rows(("slip", *names), fits)


def _filmed_slip(whisker, rng, frames=25):
    """Times after the slip [s] and curvature at 6 mm [1/m] at 1000 frames/s."""
    hold, let_go = 60e-3, rng.uniform(0.8e-3, 1.5e-3)
    time = np.arange(0, 0.12, DT)
    rise = ramp_and_hold(time, 50e-3, 1.0)
    fall = np.clip((time - hold) / let_go, 0, 1)
    force = rng.uniform(6e-6, 12e-6) * rise * np.cos(np.pi / 2 * fall)
    force[fall == 1] = 0.0
    response = Response(whisker, "fixed", "clamped", N_MODES)
    bent = response.modes.shape(np.asarray(6e-3 / whisker.length), 2) / whisker.length**2
    curvature = bent @ response.amplitudes(10e-3, force, DT)
    first = np.searchsorted(time, hold + let_go + 1e-3 * rng.uniform(1, 2))
    pick = first + round(1e-3 / DT) * np.arange(frames)
    return time[pick] - time[first], curvature[pick]


# Displacement ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Figure6:
    """Fig. 6 for one boundary: y(x, t) [m] in its two parts, (points, time)."""

    boundary: str
    time: np.ndarray
    force: np.ndarray
    arc_length: np.ndarray
    steady: np.ndarray
    vibrational: np.ndarray


def figure_6(boundary, contact=9e-3, peak_force=20e-6, duration=16e-3):
    """Displacement during and after a typical contact; the duration is the median of Fig. 3."""
    whisker = mouse_c2()
    time = np.arange(0, 40e-3, DT)
    force = half_gaussian(time, duration, peak_force)
    x = np.linspace(0, whisker.length, 145)
    y = Response(whisker, boundary, "chord", N_MODES).displacement(contact, force, DT, x)
    return Figure6(boundary, time, force, x, y.steady, y.vibrational)


# Base moments -----------------------------------------------------------------------------------


def figure_7():
    """Ratio against contact position, 12 ms contacts; the paper's four with their forces."""
    sweep = np.arange(2.0, 17.51, 0.25) * 1e-3
    forces = [_force_at(c) for c in sweep]
    return _pulse_ratios(mouse_c2(), sweep, np.full(len(sweep), FIGURE_7_DURATION), forces)


def _force_at(contact):
    for c, force in FIGURE_7_CONTACTS.items():
        if abs(c - contact) < 1e-9:
            return force
    return 1e-6  # the ratio does not depend on it


def figure_8():
    """Ratio against duration, at 12 mm."""
    durations = np.unique(np.concatenate([np.geomspace(1e-3, 50e-3, 60), FIGURE_8_DURATIONS]))
    contact = np.full(len(durations), FIGURE_8_CONTACT)
    return _pulse_ratios(mouse_c2(), contact, durations, np.full(len(durations), FIGURE_8_FORCE))


def _pulse_ratios(whisker, contacts, durations, forces):
    rows = []
    for frame in FRAMES:
        response = Response(whisker, "fixed", frame, N_MODES)
        peak, high, low = half_gaussian_extremes(response, contacts, forces, durations)
        for i in range(len(contacts)):
            rows.append((contacts[i] * MILLI, durations[i] * MILLI, forces[i] * MICRO, frame,
                         N_MODES, high[i] / abs(peak[i]), low[i] / abs(peak[i])))  # fmt: skip
    return Table.of_rows(RATIO_COLUMNS, rows)


def pulse_loads(contact, peak_force, duration, end=60e-3):
    """BaseLoads of one half-Gaussian contact of the mouse whisker (Figs 7b, 8)."""
    force = half_gaussian(np.arange(0, end, DT), duration, peak_force)
    return Response(mouse_c2(), "fixed", "chord", N_MODES).base_loads(contact, force, DT)


def slip_loads(slip_duration, frame="chord", events=2):
    """BaseLoads of a stick-slip of the rat whisker (Fig. 9c)."""
    force = stick_slip(np.arange(0, 60e-3, DT), slip_duration, events=events)
    return Response(rat_c2(), "fixed", frame, N_MODES).base_loads(FIGURE_9_CONTACT, force, DT)


def slip_deflection(slip_duration):
    """Displacement at 16 mm [m] during a stick-slip (Fig. 9b)."""
    force = stick_slip(np.arange(0, 60e-3, DT), slip_duration)
    response = Response(rat_c2(), "fixed", "chord", N_MODES)
    return response.displacement(FIGURE_9_CONTACT, force, DT, np.array([16e-3])).total[0]


def ramp_loads(ramp_duration, frame="chord"):
    """BaseLoads of a 12° ramp of the trimmed rat whisker (Fig. 10c)."""
    whisker = rat_c2(length=13e-3)
    hold = float(force_for_base_angle(whisker, FIGURE_10_CONTACT, FIGURE_10_ANGLE))
    force = ramp_and_hold(np.arange(0, 100e-3, DT), ramp_duration, hold)
    return Response(whisker, "fixed", frame, N_MODES).base_loads(FIGURE_10_CONTACT, force, DT)


def figure_9():
    """Ratios of the stick-slips; `duration_ms` is the slip's."""
    return _load_ratios(slip_loads, FIGURE_9_SLIPS, FIGURE_9_CONTACT)


def figure_10():
    """Ratios of the ramps; `duration_ms` is the ramp's, `peak_force_uN` the holding force."""
    return _load_ratios(ramp_loads, FIGURE_10_RAMPS, FIGURE_10_CONTACT)


def _load_ratios(loads_of, durations, contact):
    rows = []
    for frame in FRAMES:
        for duration in durations:
            loads = loads_of(duration, frame)
            rows.append((contact * MILLI, duration * MILLI, loads.force.max() * MICRO, frame,
                         N_MODES, *loads.vibration_extremes()))  # fmt: skip
    return Table.of_rows(RATIO_COLUMNS, rows)


def figure_11(n_contacts=88, n_durations=121):
    """Peak |vibrational| over peak |steady| moment on a grid, mouse and rat (a Table)."""
    rows = []
    for species, whisker in (("mouse", mouse_c2()), ("rat", rat_c2())):
        contacts = np.linspace(0.1, 0.97, n_contacts) * whisker.length
        durations = np.geomspace(0.5e-3, 120e-3, n_durations)
        c, duration = (a.ravel() for a in np.meshgrid(contacts, durations, indexing="ij"))
        response = Response(whisker, "fixed", "chord", N_MODES)
        peak, high, low = half_gaussian_extremes(response, c, 1e-6, duration, ringing=20e-3)
        ratio = np.maximum(high, -low) / np.abs(peak)
        rows += [(species, *row) for row in zip(c * MILLI, duration * MILLI, ratio, strict=True)]
    return Table.of_rows(("species", "contact_mm", "duration_ms", "vibration_ratio"), rows)


@dataclass(frozen=True)
class Comparison:
    """One contact in the paper's model and in the contact-consistent one."""

    contact: float
    duration: float
    paper: object
    held: object


def figure_supported():
    """Contacts of Figs 7 and 8 in both models, as Comparisons."""
    out = []
    for contact, duration in ((6e-3, 12e-3), (9e-3, 12e-3), (12e-3, 5e-3), (15e-3, 12e-3)):
        paper = pulse_loads(contact, 1e-6, duration, end=40e-3)
        held = SupportedResponse(mouse_c2(), contact, "fixed", "chord", N_MODES)
        out.append(Comparison(contact, duration, paper, held.loads(paper.force, DT)))
    return out
