"""Scene and motion → grey pictures, frame by frame.

Every object lets a share of the backlight pass; the shares multiply. Whiskers are drawn by exact
area coverage of the blurred strip (strips.py); where objects in focus meet, see composing.py.
"""

from dataclasses import replace
from functools import lru_cache
from math import erf, sqrt

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr, ndtri

from synthetic.composing import POLE_TRANSMISSION, TILE, FinePatch, meeting_tiles
from synthetic.fur import draw_hairs, face_glow, face_transmission, grow_fur, stray_hairs
from synthetic.outlines import shape_transmission
from synthetic.scene import Codec, Scene
from synthetic.strips import absorb, blank, cover_disc, cover_strip, step_table

_NORMALS = ndtri((np.arange(65536) + 0.5) / 65536).astype(np.float32)
_STRETCH = 2048  # px whose noise is drawn at once; it stays in the cache


class Renderer:
    """Draws the frames of one scene and motion.

    Parameters
    ----------
    scene : Scene
    motion : synthetic.motion.Motion of the same scene
    seed : int, of the noise; by default the scene's
    still : light of a photograph, with its pole but without whiskers, and the same without the
        animal, float32 (height, width) each: stands for all of the scene but the whiskers

    Frames come in any order and are the same each time: the noise of a frame depends on seed
    and frame number only.
    """

    def __init__(self, scene: Scene, motion, seed: int | None = None, still=None):
        self.scene, self.motion = scene, motion
        self.seed = scene.seed if seed is None else seed
        drawn = _still_picture(_without_pole(scene)) if still is None else (*still, (), None)
        self._open, self.background, self._fur, self._glow = drawn
        self._pole = scene.pole if still is None else None
        self._cover, self._touched = blank(*self._open.shape)
        self._steps = step_table(scene.camera.blur_px)
        self._fine = FinePatch(scene.camera.blur_px)
        self._flicker = _flicker(scene, len(motion), np.random.default_rng([scene.seed, 2]))
        # as last made, each with the pole's place or the frame that it is for
        self._shade, self._opened = (None, ()), (None, self._open)
        self._still_pole = (
            self._with_pole(self._open, motion.pole_x[0], motion.pole_y[0])
            if motion.pole_is_still and not scene.face.moving
            else None
        )

    def __len__(self):
        return len(self.motion)

    def frame(self, i: int) -> np.ndarray:
        """Frame `i` as the camera gives it, uint8 (height, width)."""
        return self.expose(self.light(i), i)

    def expose(self, light, i: int) -> np.ndarray:
        """What the camera makes of the `light` of frame `i`, uint8 (height, width)."""
        camera = self.scene.camera
        return _expose(
            light,
            np.float32(self._flicker[i]),
            np.float32(camera.black_level + 0.5),  # with rounding
            np.float32(camera.noise_gain),
            np.float32(camera.read_noise**2),
            _NORMALS,
            _mix(self.seed, i),
        )

    def light(self, i: int) -> np.ndarray:
        """Frame `i` before flicker, black level and noise, float32 (height, width)."""
        instants = self.motion.instants(i)
        if instants == 1:
            return self._light(i, 0)
        return sum(self._light(i, instant) for instant in range(instants)) / np.float32(instants)

    def _light(self, i, instant):
        """Light of one instant of the exposure of frame `i`."""
        opened = self.opened(i)
        pole_x, pole_y = self.motion.pole_x[i], self.motion.pole_y[i]
        behind_rod, with_pole = self._still_pole or self._with_pole(opened, pole_x, pole_y)
        light = with_pole.copy()
        strips = [self.motion.strip(h, i, instant) for h in range(len(self.scene.hairs))]
        for hair, strip in zip(self.scene.hairs, strips, strict=True):
            self._draw(light, strip, hair.opacity)
        self._compose(light, behind_rod, strips, pole_x, pole_y)
        for hair, strip in zip(self.scene.hairs, strips, strict=True):
            if hair.particle is not None and i < (hair.particle.falls_off or i + 1):
                self._draw_particle(light, hair, strip)
        if self._glow is not None:
            light += self._glow
        return light

    def without_whiskers(self, i: int) -> np.ndarray:
        """Light of frame `i` with pole and rod but without whiskers, float32 (height, width).

        What a pale face throws back is left out: it does not pass whiskers.
        """
        still = self._still_pole
        place = self.motion.pole_x[i], self.motion.pole_y[i]
        return (still or self._with_pole(self.opened(i), *place))[1]

    def opened(self, i: int) -> np.ndarray:
        """Light without pole and whiskers; the fur moves where the scene says so."""
        moving = self.scene.face.moving
        if not moving:
            return self._open
        if self._opened[0] != i:
            opened = self._open.copy()
            across = self.scene.face.axis + np.pi / 2
            way = moving * self.scene.camera.pixels_per_m * self.motion.fur_phase[i]
            shift = (way * np.cos(across), -way * np.sin(across))
            draw_hairs(opened, self._fur, 0.12 * self.motion.fur_phase[i], shift)
            self._opened = i, opened
        return self._opened[1]

    def _draw(self, light, strip, opacity):
        count = cover_strip(self._cover, self._touched, strip, self._steps)
        absorb(light, self._cover, self._touched, count, opacity)

    def _draw_particle(self, light, hair, strip):
        """Multiply `light` by the particle that sticks to a whisker."""
        particle, scale = hair.particle, self.scene.camera.pixels_per_m
        x, y, angle = strip[:3]
        share = particle.arc_length / hair.whisker.length * (len(x) - 1)
        px, py, turn = (np.interp(share, np.arange(len(x)), part) for part in (x, y, angle))
        radius = particle.radius * scale
        px, py = (
            px + particle.aside * radius * np.sin(turn),
            py + particle.aside * radius * np.cos(turn),
        )
        reach = int(np.ceil(radius + 5 * self.scene.camera.blur_px)) + 1
        left, top = max(int(px) - reach, 0), max(int(py) - reach, 0)
        part = light[top : int(py) + reach + 1, left : int(px) + reach + 1]
        cover = np.zeros_like(part)
        cover_disc(cover, px - left, py - top, radius, self._steps)
        part *= 1 - hair.opacity * cover

    def _with_pole(self, opened, x, y):
        """Light behind the rod, and behind rod and pole, at (x, y) [m]; NaN: out of view."""
        if self._pole is None or not np.isfinite(x):
            return opened, opened
        if self._shade[0] != (x, y):
            self._shade = (x, y), self._pole_shade(x, y)
        rod, disc = self._shade[1]
        behind_rod = opened * rod
        return behind_rod, behind_rod * disc

    def _pole_shade(self, x, y):
        """Shares of the light that pass the rod and the pole at (x, y) [m]."""
        pole, scale = self._pole, self.scene.camera.pixels_per_m
        px, py = self.scene.to_pixels(x, y)
        rod, disc = np.ones_like(self._open), np.zeros_like(self._open)
        if pole.rod_direction is not None:
            sizes = np.array([pole.radius, pole.rod_radius]) * scale
            _draw_rod(rod, px, py, pole.rod_direction, *sizes, pole.rod_blur_px)
        cover_disc(disc, px, py, pole.radius * scale, self._steps)
        return rod, 1 - (1 - POLE_TRANSMISSION) * disc

    def _compose(self, light, behind_rod, strips, pole_x, pole_y):
        """Redo the places where objects in focus meet, on a finer grid."""
        disc, scale = None, self.scene.camera.pixels_per_m
        if self._pole is not None and np.isfinite(pole_x):
            disc = (*self.scene.to_pixels(pole_x, pole_y), self._pole.radius * scale)
        meeting = meeting_tiles(light.shape, strips, disc, 3 * self.scene.camera.blur_px + 2)
        opacities = [hair.opacity for hair in self.scene.hairs]
        for top, left in meeting:
            rows, columns = slice(top, top + TILE), slice(left, left + TILE)
            behind = behind_rod[rows, columns]
            if behind.max() < 2:
                continue
            through = self._fine.transmission(left, top, strips, opacities, disc)
            light[rows, columns] = behind * through[: behind.shape[0], : behind.shape[1]]


# What stands still ---------------------------------------------------------------------------


def _without_pole(scene: Scene) -> Scene:
    """The same scene with any pole and codec: its still picture does not depend on them."""
    return replace(scene, pole=None, codec=Codec())


@lru_cache(maxsize=8)
def _still_picture(scene: Scene):
    """What does not move in a scene's pictures, made once for all trials of a session.

    Returns
    -------
    opened : light without pole and whiskers, float32 (height, width), with fur that does not move
    background : the same without the animal; both with dust and hairs that lie about
    fur : its hairs, a row for each, as FurHair
    glow : light that a pale face throws back, (height, width); None for a black one
    """
    rng = np.random.default_rng([scene.seed, 1])
    background = _background(scene, rng)
    opened = background * face_transmission(scene, rng)
    still = stray_hairs(scene, rng)
    fur = grow_fur(scene, rng)
    for light in (opened, background):
        draw_hairs(light, still)
    _draw_dust((opened, background), scene, rng)
    if not scene.face.moving:
        draw_hairs(opened, fur)
    for shape in scene.shapes:
        opened *= shape_transmission(scene, shape)
    glow = _glow(scene, fur, rng) if scene.face.glow else None
    for each in (opened, background, fur, glow):
        if each is not None:
            each.flags.writeable = False
    return opened, background, fur, glow


def _glow(scene: Scene, fur, rng) -> np.ndarray:
    """Light that a pale face throws back, where no other thing is before it."""
    passing = face_transmission(scene, rng)
    draw_hairs(passing, fur)
    glow = face_glow(scene, 1 - passing, rng)
    for shape in scene.shapes:
        glow *= shape_transmission(scene, shape)
    return glow


def _background(scene: Scene, rng) -> np.ndarray:
    """Uneven backlight: a slope, a darker border and soft clouds, float32 (height, width)."""
    height, width = scene.camera.height, scene.camera.width
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    direction = rng.uniform(0, 2 * np.pi)
    cx, cy = rng.uniform(-0.3, 0.3, 2)
    clouds = gaussian_filter(rng.normal(size=(height, width)), min(height, width) / 9)
    clouds /= np.abs(clouds).max()
    shape = 0.5 * (np.cos(direction) * x + np.sin(direction) * y)
    shape += 0.45 - 0.6 * ((x - cx) ** 2 + (y - cy) ** 2) + 0.25 * clouds
    light = scene.lights.level * (1 + scene.lights.unevenness * shape)
    return np.clip(light, 0.2 * scene.lights.level, 240.0).astype(np.float32)


def _draw_dust(lights, scene, rng):
    """Multiply each of the `lights` by small soft specks."""
    height, width = lights[0].shape
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    for _ in range(scene.clutter):
        x, y = rng.uniform(0.15, 1) * width, rng.uniform(0, 1) * height
        radius, blur = rng.uniform(0.6, 3.0), scene.camera.blur_px * rng.uniform(1.0, 3.0)
        reach = radius + 6 * blur  # farther away, a 32-bit number does not feel it
        across, down = (slice(max(int(v - reach), 0), max(int(v + reach) + 2, 0)) for v in (x, y))
        distance = np.hypot(columns[down, across] - x, rows[down, across] - y)
        speck = rng.uniform(0.2, 0.8) * ndtr((radius - distance) / blur).astype(np.float32)
        for light in lights:
            light[down, across] *= 1 - speck


@njit(cache=True)
def _draw_rod(light, x, y, direction, pole_radius, rod_radius, far_blur):
    """Multiply `light` by the rod's shadow, the more blurred the farther from the pole."""
    height, width = light.shape
    c, s = np.cos(direction), np.sin(direction)
    length = 14.0 * pole_radius  # the blur is complete there
    root2 = np.sqrt(2.0)
    for j in range(height):
        for i in range(width):
            dx, dy = i - x, -(j - y)
            u, v = dx * c + dy * s, abs(dy * c - dx * s)
            blur = 1.2 + (far_blur - 1.2) * min(max(u / length, 0.0), 1.0)
            if u < -3 * blur or v > rod_radius + 4 * blur:
                continue
            edge = erf((v + rod_radius) / (root2 * blur)) - erf((v - rod_radius) / (root2 * blur))
            start = 0.5 + 0.5 * erf((u - 0.3 * pole_radius) / (root2 * 1.8))
            light[j, i] *= 1 - 0.5 * 0.985 * edge * start


def _flicker(scene, n, rng):
    """Lamp's brightness in every frame (frames,), 1 on average."""
    lights, t = scene.lights, np.arange(n) / scene.camera.frames_per_second
    ripple = np.sin(2 * np.pi * lights.flicker_hz * t + rng.uniform(0, 2 * np.pi))
    drift = np.sin(2 * np.pi * 0.7 * t + rng.uniform(0, 2 * np.pi))
    return 1 + lights.flicker * (0.7 * ripple + 0.7 * drift)


# Noise ---------------------------------------------------------------------------------------


def _mix(seed: int, frame: int) -> np.ndarray:
    """Two 32-bit numbers from seed and frame."""
    return np.random.SeedSequence([seed, frame]).generate_state(2, np.uint32)


@njit(cache=True, nogil=True)
def _expose(light, gain, black, noise_gain, read_variance, normals, key):
    """Grey levels with photon noise (its Gaussian limit) and read noise, cut to uint8."""
    flat = light.ravel()
    out = np.empty(flat.size, np.uint8)
    bits, deviates = np.empty(_STRETCH // 2, np.uint32), np.empty(_STRETCH, np.float32)
    for first in range(0, flat.size, _STRETCH):
        end = min(first + _STRETCH, flat.size)
        _draw_bits(bits, first, key[0], key[1])
        for k in range(len(bits)):  # two 16-bit draws from each number
            deviates[2 * k] = normals[bits[k] & np.uint32(0xFFFF)]
            deviates[2 * k + 1] = normals[bits[k] >> np.uint32(16)]
        _add_noise(
            out[first:end], flat[first:end], deviates, gain, black, noise_gain, read_variance
        )
    return out.reshape(light.shape)


@njit(cache=True, nogil=True)
def _draw_bits(bits, first, key, other_key):
    """Fill `bits` with random numbers: a counter, mixed by multiplications with two keys."""
    for k in range(len(bits)):
        x = np.uint32(np.uint32(first + k) * np.uint32(0x9E3779B1)) + key
        x = np.uint32(x)
        x = np.uint32(x ^ (x >> np.uint32(16)))
        x = np.uint32(x * np.uint32(0x21F0AAAD)) ^ other_key
        x = np.uint32(x ^ (x >> np.uint32(15)))
        x = np.uint32(x * np.uint32(0x735A2D97))
        bits[k] = np.uint32(x ^ (x >> np.uint32(15)))


@njit(cache=True, nogil=True)
def _add_noise(out, light, deviates, gain, black, noise_gain, read_variance):
    """Write the grey level of every pixel; `black` includes what rounding adds."""
    for k in range(len(light)):
        mean = gain * light[k]
        value = black + mean + sqrt(read_variance + noise_gain * mean) * deviates[k]
        out[k] = np.uint8(np.int32(min(max(value, np.float32(0)), np.float32(255))))
