"""How whiskers, follicles and pole move: whisking, and the touches and slips that follow from it.

Solved quasi-statically through the large-angle rod, frame by frame. No vibration or other motion
is added.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from synthetic.scene import Hair, Scene
from synthetic.strips import Strip
from whiskermodel.rod import RodContact, contact_shape, free_shape, solve_contact

_NODE_STEP_PX = 1.4
_BLOCK = 128  # frames whose shapes are computed at once
_SMEAR_NODES = 25
_FAR = 1.0  # m: where the pole stands while it is out of view
_LARGEST_DRIFT = 0.12e-3  # m, of a follicle


# Follicle ------------------------------------------------------------------------------------


def whisking(n, rate, rng, set_point=0.0, amplitude=0.25, frequency=14.0):
    """Base angle of free whisking [rad], (n,): a wandering set-point, modulated oscillation.

    `amplitude` [rad] is the half-range of a full whisk, `frequency` [Hz] its mean rate.
    """
    pace = frequency * (1 + 0.15 * smooth_noise(n, rate, 0.15, rng))
    phase = 2 * np.pi * np.cumsum(pace) / rate + rng.uniform(0, 2 * np.pi)
    strength = np.clip(0.75 + 0.35 * smooth_noise(n, rate, 0.12, rng), 0.1, 1.1)
    drift = 0.35 * amplitude * smooth_noise(n, rate, 0.25, rng)
    whisk = np.cos(phase) + 0.12 * np.cos(2 * phase + 0.8)
    return set_point + drift + amplitude * strength * whisk


def whisking_bouts(n, rate, rng, amplitude, frequency, rest_s, haste=0.0):
    """Swing from the rest angle in bouts with rests between them [rad], (n,), 0 at rest.

    `amplitude` [rad] is the half-range of a full whisk, `frequency` [Hz] its mean rate, `rest_s`
    the mean length of bouts and rests. With `haste`, turns are quick and the whisker dwells at
    both ends: most speed is (1 + haste) times that of a sine.
    """
    pace = frequency * (1 + 0.15 * smooth_noise(n, rate, 0.15, rng))
    phase = 2 * np.pi * np.cumsum(pace) / rate + rng.uniform(0, 2 * np.pi)
    wave = np.sin(phase)
    if haste:
        wave = np.tanh((1 + haste) * wave) / np.tanh(1 + haste)
    # on and off within half of a whisk
    lengths = rest_s * rate * rng.gamma(4.0, 0.25, int(n / (0.2 * rest_s * rate)) + 8)
    begun = np.searchsorted(np.cumsum(lengths), np.arange(n), "right") + rng.integers(2)
    strength = gaussian_filter1d((begun % 2).astype(float), 0.15 * rate / frequency)
    drift = 0.1 * amplitude * smooth_noise(n, rate, 0.25, rng)
    return drift + amplitude * strength * (1 + wave)


def smooth_noise(n, rate, time_constant, rng):
    """Gaussian noise (n,) of about unit SD that changes over `time_constant` [s]."""
    width = time_constant * rate
    pad = int(4 * width) + 1
    noise = gaussian_filter1d(rng.normal(size=n + 2 * pad), width)[pad : pad + n]
    return noise * np.sqrt(2 * np.sqrt(np.pi) * width)


def follicle_drift(n, rate, rng):
    """Slow wander of the follicle about its mean place [m], two arrays (n,)."""
    return tuple(_LARGEST_DRIFT * np.tanh(smooth_noise(n, rate, 0.2, rng)) for _ in range(2))


# Base motion → whisker -----------------------------------------------------------------------


@dataclass(frozen=True)
class HairMotion:
    """One whisker's equilibria in every frame, and the frames before which it slipped off."""

    contact: RodContact
    slips: tuple[int, ...] = ()


def solve_motion(hair: Hair, base, pole, side, guess=None):
    """Quasi-static equilibria of a driven whisker; it changes the pole's side where it slips.

    Parameters
    ----------
    base : (x, y, angle), each (frames,) [m, m, rad]
    pole : (x, y, radius) [m], the first two (frames,); a NaN pole is out of view
    side : +1, −1: on which side of the whisker the pole is at first
    guess : (contact arc length [m], force [N]), each (frames,), NaN for none: saves time

    Returns
    -------
    HairMotion
    """
    base_x, base_y, base_angle = base
    pole_x, pole_y, pole_radius = pole
    n, first, slips, parts = len(base_x), 0, [], []
    seen = np.isfinite(pole_x)
    while first < n:
        rest = slice(first, n)
        # a pole out of view: far off on its side, where it is surely free
        aside = base_angle[rest] + side * np.pi / 2
        x = np.where(seen[rest], pole_x[rest], base_x[rest] + _FAR * np.cos(aside))
        y = np.where(seen[rest], pole_y[rest], base_y[rest] + _FAR * np.sin(aside))
        solved = solve_contact(
            hair.whisker, [part[rest] for part in base], (x, y, pole_radius), side,
            hair.intrinsic_curvature, guess=guess and tuple(part[rest] for part in guess),
        )  # fmt: skip
        lost = np.flatnonzero(solved.state == "slipped")
        end = n if len(lost) == 0 else first + int(lost[0])
        if end == first and slips and slips[-1] == first:
            raise ValueError(f"frame {first}: the whisker has no place on either side of the pole")
        parts.append(solved.take(slice(0, end - first)))
        if end < n:
            slips.append(end)
            side = -side
        first = end
    return HairMotion(RodContact.joined(parts), tuple(slips))


class Motion:
    """All motion of one video: `hairs` (HairMotion each), the pole's place, the fur's phase.

    `pole_x`, `pole_y` are (frames,) [m], NaN while the pole is out of view.
    """

    def __init__(self, scene: Scene, hairs, pole_x, pole_y):
        self.scene, self.hairs = scene, tuple(hairs)
        self.pole_x, self.pole_y = np.asarray(pole_x, float), np.asarray(pole_y, float)
        for hair in self.hairs:
            if len(hair.contact) != len(self.pole_x):
                raise ValueError(
                    f"hairs must have {len(self.pole_x)} frames like the pole, got "
                    f"{len(hair.contact)}"
                )
        angle = self.hairs[0].contact.base_angle if self.hairs else np.zeros(len(self.pole_x))
        self.fur_phase = np.tanh(2.5 * (angle - angle.mean()))
        self._nodes = [_nodes(scene, hair) for hair in scene.hairs]
        self._blocks, self._lines = {}, {}

    def __len__(self):
        return len(self.pole_x)

    @property
    def pole_is_still(self) -> bool:
        """Whether the pole stands in one place, or is out of view, all the time."""
        return all(
            np.array_equal(p, np.full_like(p, p[0]), equal_nan=True)
            for p in (self.pole_x, self.pole_y)
        )

    def instants(self, frame: int) -> int:
        """Instants of the exposure that a frame's light is the mean of."""
        return 1

    def strip(self, hair: int, frame: int, instant: int = 0) -> Strip:
        """Nodes of a whisker's picture."""
        x, y, angle, curvature, smear = self._shape(hair, frame, instant)
        camera, s = self.scene.camera, self._nodes[hair]
        radius = self.scene.hairs[hair].whisker.radius(s) * camera.pixels_per_m
        px, py = self.scene.to_pixels(x, y)
        return Strip(px, py, angle, curvature / camera.pixels_per_m, radius, smear)

    def centrelines(self, hair: int, frames=None):
        """True centrelines [px], follicle → tip, 1 px apart: x, y (frames, points)."""
        if frames is not None:
            return self._centrelines(hair, self.hairs[hair].contact.take(frames))
        if hair not in self._lines:
            self._lines[hair] = self._centrelines(hair, self.hairs[hair].contact)
        return self._lines[hair]

    def _centrelines(self, hair, contact):
        length = self.scene.hairs[hair].whisker.length
        points = max(round(length * self.scene.camera.pixels_per_m), 1) + 1
        s = np.linspace(0, length, points)
        parts = [
            contact_shape(self.scene.hairs[hair].whisker, contact.take(rows), s)[:2]
            for rows in _blocks(len(contact))
        ]
        x, y = (np.concatenate(p) for p in zip(*parts, strict=True))
        return self.scene.to_pixels(x, y)

    def curvature(self, hair: int, s):
        """True curvature [1/m], (frames, points), at arc lengths `s` (points,) [m]."""
        return curvature_along(self.scene.hairs[hair].whisker, self.hairs[hair].contact, s)

    def _shape(self, hair, frame, instant=0):
        """x, y [m], angle, curvature [1/m], smear [px] of one frame at the nodes."""
        block = self._block(hair, frame // _BLOCK)
        return tuple(part[frame % _BLOCK] for part in block)

    def _block(self, hair, block):
        if self._blocks.get(hair, (None,))[0] != block:
            rows = slice(block * _BLOCK, min((block + 1) * _BLOCK, len(self)))
            part = self.hairs[hair].contact.take(rows)
            whisker, s = self.scene.hairs[hair].whisker, self._nodes[hair]
            x, y, angle = contact_shape(whisker, part, s)
            curvature = curvature_along(whisker, part, s, (x, y))
            self._blocks[hair] = (block, (x, y, angle, curvature, self._smear(hair, rows)))
        return self._blocks[hair][1]

    def _smear(self, hair, rows):
        """Way across the tangent during the exposure [px], (frames, nodes).

        Of the ways to the frame before and after the lesser counts: no smear where it jumps.
        """
        camera, n = self.scene.camera, len(self)
        around = np.clip(np.arange(rows.start - 1, rows.stop + 1), 0, n - 1)
        nodes = self._nodes[hair]
        coarse = np.linspace(0, nodes[-1], _SMEAR_NODES)
        part = self.hairs[hair].contact.take(around)
        x, y, angle = contact_shape(self.scene.hairs[hair].whisker, part, coarse)
        nx, ny = -np.sin(angle[1:-1]), np.cos(angle[1:-1])
        dx, dy = np.diff(x, axis=0), np.diff(y, axis=0)
        way = np.minimum(*(np.abs(dx[k] * nx + dy[k] * ny) for k in (slice(-1), slice(1, None))))
        way *= camera.exposure_s * camera.frames_per_second * camera.pixels_per_m
        return np.stack([np.interp(nodes, coarse, row) for row in way])


def _blocks(n):
    """Slices of at most _BLOCK frames that make up n."""
    return [slice(first, min(first + _BLOCK, n)) for first in range(0, n, _BLOCK)]


def _nodes(scene, hair):
    """Arc lengths [m] at which a whisker's shape is kept for drawing."""
    length_px = hair.whisker.length * scene.camera.pixels_per_m
    return np.linspace(0, hair.whisker.length, int(np.ceil(length_px / _NODE_STEP_PX)) + 1)


def curvature_along(whisker, contact: RodContact, s, place=None):
    """True curvature [1/m], (frames, points), at arc lengths `s` (points,) [m].

    κ = κ0 + (r_c − r) × F / E I(s), the load's part up to the contact only; `place` may hold
    x, y at `s` where they are known already.
    """
    x, y = contact_shape(whisker, contact, s)[:2] if place is None else place
    powers = s[:, None] ** np.arange(contact.intrinsic_curvature.shape[1])
    rest = contact.intrinsic_curvature @ powers.T
    touching = contact.touching
    force = (-contact.side * np.where(touching, contact.contact_force, 0.0))[:, None]
    angle = np.where(touching, contact.contact_angle, 0.0)[:, None]
    fx, fy = -force * np.sin(angle), force * np.cos(angle)
    rx = np.where(touching, contact.contact_x, 0.0)[:, None] - x
    ry = np.where(touching, contact.contact_y, 0.0)[:, None] - y
    loaded = s <= np.where(touching, contact.contact_arc_length, -1.0)[:, None]
    moment = np.where(loaded, rx * fy - ry * fx, 0.0)
    return rest + moment / whisker.flexural_rigidity(s)


def still_pole(scene: Scene, n: int):
    """Place of a pole that does not move, NaN without one: two arrays (n,) [m]."""
    if scene.pole is None:
        return np.full(n, np.nan), np.full(n, np.nan)
    return np.full(n, scene.pole.x), np.full(n, scene.pole.y)


def pole_visits(scene: Scene, n: int, visits, travel: int):
    """Place of a pole that comes in and is withdrawn; NaN while it is out of the picture.

    Parameters
    ----------
    visits : list of (first, end) frames between which it is on its way or in its place
    travel : frames that each way takes, from `away` to its place or back

    Returns
    -------
    pole_x, pole_y : (n,) [m]
    """
    pole, frame = scene.pole, np.arange(n)
    there = np.zeros(n)
    for first, end in visits:
        ramp = np.clip(np.minimum(frame - first, end - frame) / travel, 0, 1)
        there = np.maximum(there, ramp**2 * (3 - 2 * ramp))
    x, y = pole.x + (1 - there) * pole.away_x, pole.y + (1 - there) * pole.away_y
    px, py = scene.to_pixels(x, y)
    margin = 1.5 * pole.radius * scene.camera.pixels_per_m + 6
    out = (px < -margin) | (px > scene.camera.width + margin)
    out |= (py < -margin) | (py > scene.camera.height + margin)
    return np.where(out, np.nan, x), np.where(out, np.nan, y)


def side_of_pole(hair: Hair, base_x, base_y, base_angle, pole_x, pole_y) -> int:
    """+1 where the pole lies to the left of the free whisker, seen from follicle to tip, or −1."""
    s = np.linspace(0, hair.whisker.length, 200)
    x, y, angle = free_shape(hair.whisker, base_x, base_y, base_angle, s, hair.intrinsic_curvature)
    nearest = np.argmin(np.hypot(x - pole_x, y - pole_y))
    across = np.cos(angle[nearest]) * (pole_y - y[nearest])
    across -= np.sin(angle[nearest]) * (pole_x - x[nearest])
    return 1 if across >= 0 else -1
