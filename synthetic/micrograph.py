"""Micrographs of plucked whiskers whose dimensions are known.

A whisker is drawn by exact area coverage behind the blur of the optics (strips.py), then come
dust, uneven light, tiles that do not quite fit, noise and rounding to grey levels.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d

from synthetic.strips import Strip, absorb, blank, cover_disc, cover_strip, step_table
from whiskermodel.rod import free_shape
from whiskermodel.whisker import Whisker, mouse_c2

_MARGIN_PX = 70
_ROUNDEST = 0.35  # of the radius at the root's end


@dataclass(frozen=True)
class Micrograph:
    """A picture to be taken of one plucked whisker.

    Parameters
    ----------
    whisker : geometry; its length ends at the (cut) tip
    curvature : κ0(s) = k0 + k1 s + … [1/m, 1/m², …]
    pixels_per_mm : scale
    direction : of the base on the screen, counter-clockwise [rad]
    opacity : share of the light that the whisker takes away
    blur_px : SD of the optics' Gaussian [px]
    light, noise_sd : grey levels of the bright ground and of its noise
    unevenness : range of the light over the picture, share of its mean
    tiles : columns of tiles that the picture was stitched from
    tile_step, tile_shift_px : SD of their brightness (share) and of their shift each way
    dust_on, dust_beside : specks on the whisker and elsewhere
    roughness : SD of the radius about the cone (share), correlated over `rough_length` [m]
    root : length of the narrowing root [m]
    core : transmission of a bright core, 0.5 of the radius wide
    bright : a bright whisker on a dark ground
    scale_bar_mm : length of a scale bar in a corner; 0: none
    seed : of all that is random
    """

    whisker: Whisker = field(default_factory=mouse_c2)
    curvature: tuple[float, ...] = (20.0,)
    pixels_per_mm: float = 200.0
    direction: float = 0.0
    opacity: float = 0.85
    blur_px: float = 1.0
    light: float = 190.0
    noise_sd: float = 2.5
    unevenness: float = 0.2
    tiles: int = 1
    tile_step: float = 0.03
    tile_shift_px: float = 0.5
    dust_on: int = 0
    dust_beside: int = 10
    roughness: float = 0.0
    rough_length: float = 0.1e-3
    root: float = 0.0
    core: float = 0.0
    bright: bool = False
    scale_bar_mm: float = 0.0
    seed: int = 0

    def centreline(self):
        """True centreline x, y [px], angle [rad], curvature [1/px], arc length [m], about 1 px."""
        scale = 1e3 * self.pixels_per_mm
        count = int(self.whisker.length * scale / 0.7) + 2
        s = np.linspace(0, self.whisker.length, count)
        x, y, angle = free_shape(self.whisker, 0.0, 0.0, self.direction, s, self.curvature)
        bend = np.polynomial.polynomial.polyval(s, self.curvature)
        x, y = x * scale, -y * scale
        return x - x.min() + _MARGIN_PX, y - y.min() + _MARGIN_PX, angle, bend / scale, s

    def picture(self) -> np.ndarray:
        """The micrograph, uint8 (height, width)."""
        rng = np.random.default_rng([self.seed, 11])
        x, y, angle, bend, s = self.centreline()
        shape = int(y.max()) + _MARGIN_PX, int(x.max()) + _MARGIN_PX
        radius = self._radius(s, rng) * 1e3 * self.pixels_per_mm
        specks = self._specks(x, y, shape, rng)
        passed = np.empty(shape, np.float32)
        edges = np.linspace(0, shape[1], self.tiles + 1).astype(int)
        for left, right in pairwise(edges):
            right_by, down_by = rng.normal(scale=self.tile_shift_px * (self.tiles > 1), size=2)
            gain = 1 + rng.normal(scale=self.tile_step) if self.tiles > 1 else 1.0
            moved = x + right_by, y + down_by, angle, bend
            whole = self._transmission(shape, moved, radius, specks)
            passed[:, left:right] = gain * whole[:, left:right]
        return self._exposed(passed, rng)

    def _radius(self, s, rng):
        """Radius [m] at arc lengths `s` [m]."""
        radius = self.whisker.radius(s)
        if self.roughness:
            width = self.rough_length / (s[1] - s[0])
            rough = gaussian_filter1d(rng.normal(size=len(s)), width)
            radius = radius * (1 + self.roughness * rough * np.sqrt(2 * np.sqrt(np.pi) * width))
        if self.root:
            radius = radius * (1 - (1 - _ROUNDEST) * np.clip(1 - s / self.root, 0, 1) ** 2)
        return radius

    def _specks(self, x, y, shape, rng):
        """Dust: x, y, radius [px] of each speck."""
        at = rng.integers(len(x), size=self.dust_on)
        reach = 1e3 * self.pixels_per_mm * self.whisker.base_radius
        on = (
            x[at] + rng.normal(scale=reach, size=len(at)),
            y[at] + rng.normal(scale=reach, size=len(at)),
        )
        beside = (
            rng.uniform(0, shape[1], self.dust_beside),
            rng.uniform(0, shape[0], self.dust_beside),
        )
        places = [np.concatenate(pair) for pair in zip(on, beside, strict=True)]
        return [*places, rng.uniform(1.0, 1.2 * reach + 1, len(places[0]))]

    def _transmission(self, shape, line, radius, specks):
        """Share of the light that passes whisker and dust."""
        passed = np.ones(shape, np.float32)
        cover, touched = blank(*shape)
        steps = step_table(self.blur_px)
        still = np.zeros_like(radius)
        parts = [(radius, self.opacity)]
        if self.core:  # light that goes through the middle
            parts.append((0.5 * radius, -self.core * self.opacity / (1 - self.opacity)))
        for width, opacity in parts:
            count = cover_strip(cover, touched, Strip(*line, width, still), steps)
            absorb(passed, cover, touched, count, opacity)
        dust = np.zeros(shape, np.float32)
        for speck in zip(*specks, strict=True):
            cover_disc(dust, *speck, steps)
        return passed * (1 - 0.7 * dust)

    def _exposed(self, passed, rng):
        """Grey levels of the light that passed."""
        height, width = passed.shape
        slope = rng.normal(size=2)
        v, u = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
        uneven = (slope[0] * u + slope[1] * v) / np.abs(slope).sum() + 0.4 * (u**2 + v**2) - 0.3
        light = self.light * (1 + 0.5 * self.unevenness * uneven)
        if self.bright:
            passed, light = 1.12 - passed, light
        grey = light * passed + self.noise_sd * rng.normal(size=passed.shape)
        if self.scale_bar_mm:
            bar = round(self.scale_bar_mm * self.pixels_per_mm)
            grey[height - 24 : height - 16, 20 : 20 + bar] = 0.0 if not self.bright else 255.0
        return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def random_micrograph(seed: int, **changes) -> Micrograph:
    """A micrograph drawn at random: whisker, bend, scale, light, tiles, dust, roughness."""
    rng = np.random.default_rng([seed, 12])
    length = rng.uniform(6e-3, 14e-3)
    whisker = Whisker(length, length / rng.uniform(0.85, 0.99), rng.uniform(25e-6, 60e-6))
    values = {
        "whisker": whisker,
        "curvature": (rng.uniform(-60, 60), rng.uniform(-2000, 2000)),
        "pixels_per_mm": round(rng.uniform(120, 220), 1),
        "direction": rng.uniform(-np.pi, np.pi),
        "opacity": rng.uniform(0.5, 0.9),
        "blur_px": rng.uniform(0.7, 1.8),
        "noise_sd": rng.uniform(1, 4),
        "unevenness": rng.uniform(0, 0.4),
        "tiles": int(rng.integers(1, 6)),
        "dust_on": int(rng.integers(0, 6)),
        "roughness": float(rng.choice([0.0, 0.01, 0.02])),
        "bright": bool(rng.random() < 0.3),
        "seed": seed,
    }
    return Micrograph(**{**values, **changes})
