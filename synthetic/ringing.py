"""Whiskers that ring after they slip off the pole, as the beam model has it.

At the release the whisker is bent as the rod against the pole; from then on its bending away from
rest is a sum of the fixed cone's modes, each of which starts at its share of that shape, at rest,
and dies away: η_k(t) = a_k e^(−dt) [cos p_d t + (d/p_d) sin p_d t], p_d² = p_k² − d². The shares
follow from the bending moment M at the release, ρ0 L p_k² a_k = ∫ M φ_k'' ds/L². Modes add their
curvature, so that the whisker keeps its length.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson

from synthetic.motion import Motion, curvature_along
from whiskermodel.modes import modes
from whiskermodel.response import quadrature_about
from whiskermodel.rod import contact_shape, solve_contact

MODES = 20
INSTANTS = 8  # of an exposure
LONGEST_S = 0.04  # that ringing is followed: less than a thousandth is left
_HALVINGS = 12  # of the frame in which the whisker is released


@dataclass(frozen=True)
class Ringing:
    """One whisker's ringing after a slip.

    Attributes
    ----------
    first, end : frames with it (half-open)
    release : its start, in frames
    amplitudes : a_k (modes,) [m]
    """

    first: int
    end: int
    release: float
    amplitudes: np.ndarray


class RingingMotion(Motion):
    """Motion whose whiskers ring after their slips.

    Parameters
    ----------
    scene, hairs, pole_x, pole_y : as for Motion
    """

    def __init__(self, scene, hairs, pole_x, pole_y):
        super().__init__(scene, hairs, pole_x, pole_y)
        self._modes = [modes(h.whisker.taper, "fixed", MODES) for h in scene.hairs]
        self.ringings = [
            [_ringing(self, h, slip) for slip in hair.slips if slip]
            for h, hair in enumerate(self.hairs)
        ]

    def instants(self, frame):
        """Instants of the exposure that a frame's light is the mean of."""
        rings = any(self._ringing_in(h, frame) for h in range(len(self.hairs)))
        return INSTANTS if rings else 1

    def curvature(self, hair, s):
        """True curvature [1/m], (frames, points), at arc lengths `s` (points,) [m]."""
        out = super().curvature(hair, s)
        for each in self.ringings[hair]:
            for frame in range(each.first, each.end):
                out[frame] += self._added(hair, each, float(frame), s)[1]
        return out

    def _centrelines(self, hair, contact):
        x, y = super()._centrelines(hair, contact)
        s = np.linspace(0, self.scene.hairs[hair].whisker.length, x.shape[1])
        if len(contact) != len(self):  # some frames only: none of them rings
            return x, y
        for each in self.ringings[hair]:
            for frame in range(each.first, each.end):
                rest = contact.take(slice(frame, frame + 1))
                added = self._added(hair, each, float(frame), s)
                bent = _bent(self.scene.hairs[hair].whisker, rest, s, added[0])
                x[frame], y[frame] = self.scene.to_pixels(*bent[:2])
        return x, y

    def centrelines(self, hair, frames=None):
        """True centrelines [px], follicle → tip, 1 px apart: x, y (frames, points)."""
        x, y = super().centrelines(hair)
        return (x, y) if frames is None else (x[frames], y[frames])

    def _shape(self, hair, frame, instant=0):
        x, y, angle, curvature, smear = super()._shape(hair, frame)
        each = self._ringing_in(hair, frame)
        if each is None:
            return x, y, angle, curvature, smear
        camera, s = self.scene.camera, self._nodes[hair]
        exposure = camera.exposure_s * camera.frames_per_second  # in frames
        at = frame + exposure * ((instant + 0.5) / INSTANTS - 0.5)
        rest = self.hairs[hair].contact.take(slice(frame, frame + 1))
        whisker, half = self.scene.hairs[hair].whisker, 0.5 * exposure / INSTANTS
        before, now, after = (
            _bent(whisker, rest, s, self._added(hair, each, t, s)[0])
            for t in (at - half, at, at + half)
        )
        way = (after[1] - before[1]) * np.cos(now[2]) - (after[0] - before[0]) * np.sin(now[2])
        bend = curvature + self._added(hair, each, at, s)[1]
        return *now, bend, np.abs(way) * camera.pixels_per_m

    def _ringing_in(self, hair, frame):
        """The ringing of a whisker in a frame, or None."""
        for each in self.ringings[hair]:
            if each.first <= frame < each.end:
                return each
        return None

    def _added(self, hair, each, frame, s):
        """Angle [rad] and curvature [1/m] that a ringing adds at `s` at a time in frames."""
        whisker, shapes = self.scene.hairs[hair].whisker, self._modes[hair]
        t = max(frame - each.release, 0.0) / self.scene.camera.frames_per_second
        d = whisker.damping_rate
        p = np.sqrt(shapes.angular_frequency(whisker) ** 2 - d**2)
        eta = each.amplitudes * np.exp(-d * t) * (np.cos(p * t) + d / p * np.sin(p * t))
        x = np.clip(s / whisker.length, 0, 1)
        return (
            eta @ shapes.shape(x, 1) / whisker.length,
            eta @ shapes.shape(x, 2) / whisker.length**2,
        )


def _bent(whisker, rest, s, added_angle):
    """x, y [m], angle (points,) of the whisker at rest, turned by `added_angle` at `s`."""
    x, y, angle = (part[0] for part in contact_shape(whisker, rest, s))
    angle = angle + added_angle
    x = x[0] + cumulative_simpson(np.cos(angle), x=s, initial=0)
    y = y[0] + cumulative_simpson(np.sin(angle), x=s, initial=0)
    return x, y, angle


def _ringing(motion, h, slip) -> Ringing:
    """The ringing of whisker `h` that begins before frame `slip`."""
    contact, whisker = motion.hairs[h].contact, motion.scene.hairs[h].whisker
    release, held = _release(motion.scene.hairs[h], contact, slip)
    longest = slip + round(LONGEST_S * motion.scene.camera.frames_per_second)
    touching = np.flatnonzero(contact.touching[slip:longest])
    end = slip + int(touching[0]) if len(touching) else min(longest, len(contact))
    x, weights = quadrature_about(held.contact_arc_length[0] / whisker.length, 120)
    s = x * whisker.length
    bent = curvature_along(whisker, held, s)[0]
    rest = np.polynomial.polynomial.polyval(s, held.intrinsic_curvature[0])
    moment = whisker.flexural_rigidity(s) * (bent - rest)
    shapes = motion._modes[h]
    work = shapes.shape(x, 2) @ (weights * moment) / whisker.length
    inertia = whisker.base_linear_density * whisker.length
    return Ringing(slip, end, release, work / inertia / shapes.angular_frequency(whisker) ** 2)


def _release(hair, contact, slip):
    """When the whisker slips, in frames, and its last equilibrium against the pole."""
    last = contact.take(slice(slip - 1, slip))
    held, low, high = last, 0.0, 1.0
    for _ in range(_HALVINGS):
        part = (low + high) / 2
        names = "base_x", "base_y", "base_angle", "pole_x", "pole_y"
        pairs = (getattr(contact, name)[slip - 1 : slip + 1] for name in names)
        *base, pole_x, pole_y = ((1 - part) * a + part * b for a, b in pairs)
        solved = solve_contact(
            hair.whisker, base, (pole_x, pole_y, last.pole_radius[0]), int(last.side[0]),
            hair.intrinsic_curvature, guess=held,
        )  # fmt: skip
        if solved.touching[0]:
            held, low = solved, part
        else:
            high = part
    return slip - 1 + high, held


def ringing_motion(motion: Motion) -> RingingMotion:
    """The same motion, with whiskers that ring after their slips."""
    return RingingMotion(motion.scene, motion.hairs, motion.pole_x, motion.pole_y)
