"""Young's modulus and damping from how a whisker rings after slips (Hires et al. 2013, Fig. 5).

The curvature at one place oscillates at the frequency of the first mode. Higher modes, which
decay no faster, are superimposed and fitted too. E follows from the frequency and the dimensions.
There are more modes than the frames resolve; the change caused by leaving out one overtone counts
as an error common to all slips.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from pipeline.calibrate.slips import Slip, tracked
from whiskermodel.modes import modes
from whiskermodel.ringdown import Estimate, RingdownFit, fit_ringdown, youngs_modulus
from whiskermodel.whisker import Whisker

OVERTONES = 2  # that are fitted
LONGEST_PERIODS = 4.0  # of the usual first mode, that are fitted
LEAST_PERIODS = 1.5
LEAST_FRAMES_PER_PERIOD = 3.0
USUAL_MODULUS = 3e9  # Pa
MODULI = (0.3e9, 15e9)  # Pa, between which it is looked for
NEAR = (0.8, 1.25)  # of the frequency found without overtones
WIDEST = 0.25  # half-width of the interval of E, of E, that still counts
BACKGROUND = 2  # offset and drift of the rest curvature
Z95 = 1.96
LEAST_SE = 0.05  # 1/m, of a curvature


class TooShortError(ValueError):
    """A slip with too few frames for a fit; the message says why."""


@dataclass(frozen=True)
class SlipFit:
    """A ring-down after one slip.

    Attributes
    ----------
    slip : which
    fit, simpler : the fit, and that with one overtone less
    angular_frequency, damping : [rad/s, 1/s], intervals widened by what these differ
    undamped : angular frequency [rad/s], likewise
    time, curvature : what was fitted [s, 1/m]
    """

    slip: Slip
    fit: RingdownFit
    simpler: RingdownFit
    angular_frequency: Estimate
    damping: Estimate
    undamped: Estimate
    time: np.ndarray
    curvature: np.ndarray

    def youngs_modulus(self, whisker: Whisker, boundary) -> Estimate:
        """E [Pa] of a whisker in such a follicle."""
        return youngs_modulus(self.undamped, whisker, boundary)


@dataclass(frozen=True)
class Pooled:
    """Several slips together.

    Attributes
    ----------
    angular_frequency, undamped : [rad/s], with the damping and without
    damping : [1/s]
    youngs_modulus : [Pa]
    n : how many
    """

    angular_frequency: Estimate
    damping: Estimate
    undamped: Estimate
    youngs_modulus: Estimate
    n: int


def check_frame_rate(frames_per_second, whisker: Whisker, boundary) -> None:
    """ValueError where the frame rate is too low for the ring-down of this whisker."""
    frequency = first_frequency(whisker, boundary, USUAL_MODULUS) / (2 * np.pi)
    least = LEAST_FRAMES_PER_PERIOD * frequency
    if frames_per_second < least:
        raise ValueError(
            f"{frames_per_second:g} frames/s cannot carry a ring-down of whisker {whisker.name}: "
            f"it swings at about {frequency:.0f} Hz, expected at least {least:.0f} frames/s; film "
            "slips at a higher frame rate"
        )


def first_frequency(whisker: Whisker, boundary, modulus) -> float:
    """Undamped angular frequency [rad/s] of the first oscillating mode, at E = `modulus` [Pa]."""
    shapes = modes(whisker.taper, boundary, 2)
    usual = shapes.angular_frequency(whisker)
    first = usual[0] if usual[0] > 0 else usual[1]
    return float(first * np.sqrt(modulus / whisker.youngs_modulus))


def fit_slip(slip: Slip, boundary="fixed") -> SlipFit:
    """Fit the ring-down after one slip.

    Parameters
    ----------
    boundary : "fixed", "pinned" or the follicle's stiffness in units of E I0/L

    Raises
    ------
    TooShortError
        Where its frames are too few for the fit.
    """
    settings = slip.video.settings
    whisker = whisker_of(settings, slip.whisker)
    rate = settings.recording.frames_per_second
    period = 2 * np.pi / first_frequency(whisker, boundary, USUAL_MODULUS)
    time, curvature, se = _signal(slip, rate, period)
    first = _fit_first(time, curvature, se, whisker, boundary)
    simpler, fit = _fit_all(time, curvature, se, first, _ratios(whisker, boundary))
    names = "angular_frequency", "damping_rate", "undamped_angular_frequency"
    estimates = (_widened(getattr(fit, name), getattr(simpler, name)) for name in names)
    found = SlipFit(slip, fit, simpler, *estimates, time, curvature)
    _check_fit(found, found.youngs_modulus(whisker, boundary))
    return found


def whisker_of(settings, name) -> Whisker:
    """The whisker of a session, ValueError while a dimension is missing."""
    given = {whisker.name: whisker for whisker in settings.whisker}
    if name not in given or given[name].missing_dimensions:
        missing = given[name].missing_dimensions if name in given else ("length_mm",)
        raise ValueError(
            f"whisker {name}: {', '.join(missing)} missing in session.toml; Young's modulus needs "
            "the whisker's dimensions: measure them (`whiskerforce calibrate geometry`), run again"
        )
    return given[name].si()


def _signal(slip, rate, period):
    """Time [s], curvature change [1/m] and its standard error from the slip on."""
    frames = slip.frames
    frames = frames[frames["frame"] < slip.first + LONGEST_PERIODS * period * rate]
    free = len(frames) / rate
    if free < LEAST_PERIODS * period:
        raise TooShortError(
            f"free for {1e3 * free:.0f} ms only; expected at least "
            f"{1e3 * LEAST_PERIODS * period:.0f} ms ({LEAST_PERIODS:g} periods)"
        )
    known = frames[tracked(frames)]
    least = 4 + BACKGROUND + 2
    if len(known) < least:
        raise TooShortError(
            f"followed in {len(known)} of {len(frames)} frames only; expected at least {least}"
        )
    se = known["curvature_change_per_m_se"].to_numpy(float)
    se = np.where(np.isfinite(se), np.maximum(se, LEAST_SE), np.nanmedian([*se, 1.0]))
    columns = "time_s", "curvature_change_per_m"
    return *(known[c].to_numpy(float) for c in columns), se


def _fit_first(time, curvature, se, whisker, boundary):
    """The first mode alone: which frequency it is about."""
    low, high = (first_frequency(whisker, boundary, modulus) for modulus in MODULI)
    half_rate = np.pi / np.median(np.diff(time))
    return fit_ringdown(
        time, curvature, BACKGROUND, signal_se=se, frequency_range=(low, min(high, half_rate))
    )


def _fit_all(time, curvature, se, first, ratios):
    """The first mode with as many overtones as the frames resolve, and with one more: two fits."""
    count = min(OVERTONES, max((len(time) - 6 - BACKGROUND) // 2, 0))
    near = [share * first.angular_frequency.value for share in NEAR]
    return [
        fit_ringdown(time, curvature, BACKGROUND, ratios[:k], se, frequency_range=near)
        for k in (max(count - 1, 0), count)
    ]


def _widened(estimate, other) -> Estimate:
    """An estimate whose 95 % interval holds what `other` differs from it, as a standard error."""
    more = Z95 * abs(estimate.value - other.value)
    half = np.hypot((estimate.high - estimate.low) / 2, more)
    return Estimate(estimate.value, estimate.value - half, estimate.value + half)


def _ratios(whisker, boundary):
    """Frequencies of the overtones over that of the first mode that oscillates."""
    p = modes(whisker.taper, boundary, OVERTONES + 2).p_prime
    p = p[p > 0]
    return tuple(p[1 : OVERTONES + 1] / p[0])


def _check_fit(fit, modulus):
    """TooShortError where the frames do not determine the frequency."""
    if fit.damping.low <= 0:
        raise TooShortError("no swing that clearly dies away; does the whisker slip there?")
    half = (modulus.high - modulus.low) / 2
    if not (half < WIDEST * modulus.value and MODULI[0] < modulus.value < MODULI[1]):
        raise TooShortError(
            f"the frames do not determine its frequency: E {1e-9 * modulus.value:.2f} ± "
            f"{1e-9 * half:.2f} GPa"
        )


# Together ------------------------------------------------------------------------------------


def pool(fits: list[SlipFit], whisker: Whisker, boundary="fixed") -> Pooled:
    """All slips together, with the error that they share."""
    frequency = _pooled(fits, "angular_frequency")
    damping = _pooled(fits, "damping_rate")
    undamped = _pooled(fits, "undamped_angular_frequency")
    modulus = youngs_modulus(undamped, whisker, boundary)
    return Pooled(frequency, damping, undamped, modulus, len(fits))


def _pooled(fits, name) -> Estimate:
    """One unknown of all slips: their mean, and what one overtone less would make of it."""
    mean, simpler = (
        pooled_estimate([getattr(getattr(each, which), name) for each in fits])
        for which in ("fit", "simpler")
    )
    return _widened(mean, simpler)


def pooled_estimate(estimates) -> Estimate:
    """Mean of estimates by their inverse variances, to which that between them is added.

    The variance between them is DerSimonian and Laird's, the interval Hartung and Knapp's.
    """
    if len(estimates) == 1:
        return estimates[0]
    value = np.array([e.value for e in estimates])
    variance = np.array([((e.high - e.low) / 2 / Z95) ** 2 for e in estimates])
    variance = np.maximum(variance, 1e-12 * value**2)
    n, weight = len(value), 1 / variance
    mean = weight @ value / weight.sum()
    excess = weight @ (value - mean) ** 2 - (n - 1)
    between = max(excess / (weight.sum() - (weight**2).sum() / weight.sum()), 0.0)
    weight = 1 / (variance + between)
    mean = float(weight @ value / weight.sum())
    spread = weight @ (value - mean) ** 2 / (n - 1) / weight.sum()
    half = float(stdtrit(n - 1, 0.975) * np.sqrt(spread))
    return Estimate(mean, mean - half, mean + half)


def moduli_by_follicle(together: Pooled, whisker: Whisker, stiffnesses):
    """Yield (κ, Young's modulus [Pa]) for each follicle stiffness κ in units of E I0/L.

    The first mode that oscillates is the first of non-zero frequency: for κ = 0, the pinned end,
    the second.
    """
    for stiffness in stiffnesses:
        yield stiffness, youngs_modulus(together.undamped, whisker, stiffness)
