"""A whisker's geometry and material: a truncated cone of one elastic material."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Whisker:
    """A tapered whisker, r(s) = r0 (1 − s/L_in), cut at s = L (Hires et al. 2013, Eq. 14).

    Parameters
    ----------
    length : float
        L, follicle to the (cut) tip [m].
    cone_length : float
        L_in, follicle to the extrapolated apex [m]; ``inf`` is a cylinder.
    base_radius : float
        r0 [m].
    youngs_modulus : float
        E [Pa].
    density : float
        ρ [kg/m³].
    damping_rate : float
        d = γ/2 [1/s].
    name : str
        What the lab calls it, e.g. "C2".

    Raises
    ------
    ValueError
        Where a value is not possible; it names the argument, its value and the allowed range.
    """

    length: float
    cone_length: float
    base_radius: float
    youngs_modulus: float = 3.0e9
    density: float = 1000.0
    damping_rate: float = 215.0
    name: str = "whisker"

    def __post_init__(self):
        for argument in ("length", "base_radius", "youngs_modulus", "density"):
            value = getattr(self, argument)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{argument} must be positive and finite, got {value!r}")
        if not (np.isfinite(self.damping_rate) and self.damping_rate >= 0):
            raise ValueError(f"damping_rate must be finite and >= 0, got {self.damping_rate!r}")
        if not self.cone_length >= self.length:
            raise ValueError(
                f"cone_length must be at least the length (taper = length/cone_length in 0–1), "
                f"got cone_length {self.cone_length!r} m with length {self.length!r} m"
            )

    @property
    def taper(self) -> float:
        """λ = L/L_in: 0 for a cylinder, 1 for a full cone."""
        return self.length / self.cone_length

    @property
    def base_second_moment(self) -> float:
        """I0 = π r0⁴/4 [m⁴]."""
        return np.pi * self.base_radius**4 / 4

    @property
    def base_flexural_rigidity(self) -> float:
        """E I0 [N m²]."""
        return self.youngs_modulus * self.base_second_moment

    @property
    def base_linear_density(self) -> float:
        """ρ0 = ρ π r0² [kg/m]."""
        return self.density * np.pi * self.base_radius**2

    def radius(self, arc_length):
        """Radius r(s) [m] at `arc_length` [m] from the follicle; zero from the apex on."""
        return self.base_radius * np.maximum(1 - np.asarray(arc_length) / self.cone_length, 0.0)

    def second_moment(self, arc_length):
        """Second moment of area I(s) = π r⁴/4 [m⁴] at `arc_length` [m]."""
        return np.pi * self.radius(arc_length) ** 4 / 4

    def flexural_rigidity(self, arc_length):
        """E I(s) [N m²] at `arc_length` [m]."""
        return self.youngs_modulus * self.second_moment(arc_length)


def mouse_c2() -> Whisker:
    """The mouse C2 whisker of all the paper's mouse simulations."""
    return Whisker(length=18e-3, cone_length=18e-3 / 0.95, base_radius=37e-6, name="C2")


def rat_c2(length: float = 0.95 * 37e-3) -> Whisker:
    """The paper's rat C2 whisker; ramp-and-hold stimuli use it cut at 13 mm."""
    return Whisker(
        length=length, cone_length=37e-3, base_radius=70e-6, density=1140.0, name="rat C2"
    )
