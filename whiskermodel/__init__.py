"""Whisker mechanics: statics, modes, response. Needs NumPy, SciPy and Numba only."""

from whiskermodel.force_profiles import half_gaussian, ramp_and_hold, stick_slip
from whiskermodel.modes import Modes, modes
from whiskermodel.pulse_response import (
    HalfGaussianMoments,
    half_gaussian_extremes,
    half_gaussian_moments,
)
from whiskermodel.response import BaseLoads, Displacement, Response, base_loads
from whiskermodel.ringdown import Estimate, RingdownFit, fit_ringdown, youngs_modulus
from whiskermodel.statics import (
    force_for_base_angle,
    steady_base_angle,
    steady_moment,
    steady_shape,
)
from whiskermodel.supported import SupportedContact, SupportedResponse
from whiskermodel.whisker import Whisker, mouse_c2, rat_c2

__all__ = [
    "BaseLoads",
    "Displacement",
    "Estimate",
    "HalfGaussianMoments",
    "Modes",
    "Response",
    "RingdownFit",
    "SupportedContact",
    "SupportedResponse",
    "Whisker",
    "base_loads",
    "fit_ringdown",
    "force_for_base_angle",
    "half_gaussian",
    "half_gaussian_extremes",
    "half_gaussian_moments",
    "modes",
    "mouse_c2",
    "ramp_and_hold",
    "rat_c2",
    "steady_base_angle",
    "steady_moment",
    "steady_shape",
    "stick_slip",
    "youngs_modulus",
]
