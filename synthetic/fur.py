"""The face: a dark mass whose edge keeps its distance from the follicles, and its fur."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import ndtr

from synthetic.outlines import along_outline, distance_from_outline
from synthetic.scene import Face, Scene
from synthetic.strips import Strip, absorb, blank, cover_strip, step_table

_HAIR_STEP = 0.8  # px between the nodes of a fur hair
_BLURS = (1.0, 1.4, 2.0, 2.9)  # multiples of the optics' blur: fur lies before and behind focus
_MASS_BLUR = 1.6  # px, edge of the mass itself
_MASS_TRANSMISSION = 0.006
_RIM, _RIM_DEPTH = 0.9, 1.2e-3  # pale fur is brighter at the face's edge, so much and so far [m]


class FurHair(NamedTuple):
    """A short tapered curved hair: root [px], direction on the screen [rad] and curvature [1/px].

    `length` and `radius` (at the root) in px, `blur` SD in px, `sway` [rad] and `phase` [rad]
    of its own motion.
    """

    x: float
    y: float
    direction: float
    curvature: float
    length: float
    radius: float
    opacity: float
    blur: float
    sway: float
    phase: float


def pad_centre(scene: Scene) -> tuple[float, float]:
    """Middle of the follicles [px]."""
    x, y = scene.to_pixels(
        [hair.follicle_x for hair in scene.hairs], [hair.follicle_y for hair in scene.hairs]
    )
    return float(np.mean(x)), float(np.mean(y))


def distance_from_pad(face: Face, scale: float, centre, x_px, y_px):
    """Distance of points from the pad's wedge [px], negative inside, and place across it [px].

    The wedge {u ≤ −slope · max(|v| − pad/2, 0)}, u along the face's axis, v across, holds the
    follicles on its blunt edge; within the slope's angle, all ways from it to a curve of
    constant distance are alike.
    """
    cos, sin = np.cos(face.axis), np.sin(face.axis)
    dx, dy = x_px - centre[0], -(y_px - centre[1])
    u, v = dx * cos + dy * sin, dy * cos - dx * sin
    side = np.abs(v) - face.pad * scale / 2
    norm = np.hypot(1.0, face.slope)
    along_edge = (side - face.slope * u) / norm
    to_edge = (u + face.slope * side) / norm
    corner = (side > 0) & (along_edge <= 0)
    distance = np.where(side <= 0, np.maximum(u, to_edge), to_edge)
    return np.where(corner, np.hypot(u, side), distance), v


def _edge_point(face: Face, scale: float, centre, along, offset):
    """Point [px] and outward normal [rad] on the curve at `offset` [px] from the pad's wedge.

    `along` [px] runs across the face along the curve of offset hidden_length, from its middle.
    """
    hidden, half_pad = face.hidden_length * scale, face.pad * scale / 2
    opening = np.arctan(face.slope)
    way = abs(along) - half_pad
    turned = np.clip(way / hidden, 0.0, opening) if hidden > 0 else opening * (way > 0)
    rest = max(way - hidden * opening, 0.0)
    v = min(abs(along), half_pad) + offset * np.sin(turned) + rest * np.cos(opening)
    u = offset * np.cos(turned) - rest * np.sin(opening)
    v, turned = np.sign(along) * v, np.sign(along) * turned
    cos, sin = np.cos(face.axis), np.sin(face.axis)
    x, y = u * cos - v * sin, u * sin + v * cos
    return centre[0] + x, centre[1] - y, face.axis + turned


def face_transmission(scene: Scene, rng) -> np.ndarray:
    """Light that passes the face's solid mass, float32 (height, width), 0–1."""
    face, scale = scene.face, scene.camera.pixels_per_m
    if face.outline is not None:
        return outlined_transmission(scene)
    rows, columns = np.mgrid[: scene.camera.height, : scene.camera.width].astype(float)
    distance, v = distance_from_pad(face, scale, pad_centre(scene), columns, rows)
    # the edge wanders only where no whisker comes out
    away = np.clip((np.abs(v) / scale - face.pad / 2 - 2e-3) / 2e-3, 0.0, 1.0)
    wave = np.zeros_like(v)
    for wavelength in (1.1e-3, 2.3e-3, 4.7e-3):
        phase = rng.uniform(0, 2 * np.pi)
        wave += np.sin(2 * np.pi * v / (wavelength * scale) + phase) * wavelength * 0.03
    edge = (face.hidden_length + away * wave - 0.1e-3) * scale
    blur = np.hypot(_MASS_BLUR, scene.camera.blur_px)
    clear = ndtr((distance - edge) / blur)
    return (_MASS_TRANSMISSION + (1 - _MASS_TRANSMISSION) * clear).astype(np.float32)


def outlined_transmission(scene: Scene) -> np.ndarray:
    """Light that passes a mass with an outline of its own, float32 (height, width), 0–1."""
    face, camera = scene.face, scene.camera
    blur = np.hypot(face.edge_blur * camera.pixels_per_m, np.hypot(_MASS_BLUR, camera.blur_px))
    distance = distance_from_outline(scene, face.outline)
    clear = ndtr(distance / blur)
    return (_MASS_TRANSMISSION + (1 - _MASS_TRANSMISSION) * clear).astype(np.float32)


def face_glow(scene: Scene, covered, rng) -> np.ndarray:
    """Light that a pale face throws back, float32 (height, width) in grey levels.

    `covered` (height, width), 0–1, is the share of the backlight that it takes away. Hairs of
    its coat lie on it, combed back.
    """
    face, scale = scene.face, scene.camera.pixels_per_m
    glow = (face.glow * scene.lights.level * covered).astype(np.float32)
    if face.outline is not None:
        depth = np.maximum(-distance_from_outline(scene, face.outline), 0.0)
        glow *= (1 + _RIM * np.exp(-depth / (_RIM_DEPTH * scale))).astype(np.float32)
    rows, columns = np.nonzero(covered > 0.5)
    count = rng.poisson(face.coat_per_mm2 * 1e6 * len(rows) / scale**2)
    back = face.axis + np.pi
    coat = [
        FurHair(
            columns[k],
            rows[k],
            back + 0.5 * np.sin((columns[k] + rows[k]) / (2.5e-3 * scale)) + rng.normal(0, 0.2),
            rng.normal(0, 150.0) / scale,
            face.hair_length * rng.gamma(4.0, 0.6) * scale,
            rng.uniform(15e-6, 45e-6) * scale,
            rng.uniform(0.1, 0.6),
            scene.camera.blur_px * _BLURS[rng.integers(2)],
            0.0,
            0.0,
        )
        for k in rng.integers(0, max(len(rows), 1), count)
    ]
    draw_hairs(glow, np.array(coat, float).reshape(-1, len(FurHair._fields)))
    return glow


def grow_fur(scene: Scene, rng) -> np.ndarray:
    """Draw the fur hairs of the face: a row each, columns as in FurHair."""
    face, scale = scene.face, scene.camera.pixels_per_m
    if face.outline is not None:
        return _outlined_fur(scene, rng)
    span = 1.2 * (scene.camera.width + scene.camera.height)
    count = rng.poisson(face.hairs_per_mm * span / scale * 1e3)
    lean = rng.choice([-1, 1]) * rng.uniform(0.25, 0.6)
    hairs = [_fur_hair(scene, rng, rng.uniform(-span / 2, span / 2), lean) for _ in range(count)]
    near = face.pad * scale / 2 + 3e-3 * scale
    for _ in range(face.long_hairs):
        hairs.append(_long_hair(scene, rng, rng.uniform(-near, near), lean))
    return np.array(hairs).reshape(-1, len(FurHair._fields))


def _outlined_fur(scene, rng):
    """Hairs at a face's outline, as likely everywhere along it, that lean back from its axis."""
    face, scale = scene.face, scene.camera.pixels_per_m
    x, y, normal, length = along_outline(scene, face.outline)
    hairs = []
    for _ in range(rng.poisson(face.hairs_per_mm * 1e3 * length / scale)):
        k = rng.integers(len(x))
        # halfway between straight out and straight back
        out = np.array([np.cos(normal[k]), np.sin(normal[k])])
        back = -np.array([np.cos(face.axis), np.sin(face.axis)])
        combed = np.arctan2(*(out + back + 1e-6)[::-1])
        depth = rng.uniform(0.05e-3, 0.4e-3) * scale
        hair = _fur_hair(scene, rng, 0.0, 0.0)
        hairs.append(
            hair._replace(
                x=x[k] - depth * np.cos(combed),
                y=y[k] + depth * np.sin(combed),
                direction=combed + rng.normal(0, 0.25),
            )
        )
    return np.array(hairs).reshape(-1, len(FurHair._fields))


def _fur_hair(scene, rng, along, lean):
    face, scale = scene.face, scene.camera.pixels_per_m
    depth = rng.uniform(0.05e-3, 0.4e-3)
    offset = (face.hidden_length - 0.1e-3 - depth) * scale
    x, y, normal = _edge_point(face, scale, pad_centre(scene), along, offset)
    tufted = 0.35 * np.sin(along / (0.21e-3 * scale)) + 0.2 * np.sin(along / (0.083e-3 * scale))
    return FurHair(
        x,
        y,
        normal + lean + tufted + rng.normal(0, 0.16),
        rng.normal(0, 250.0) / scale,
        (depth + face.hair_length * rng.gamma(4.0, 0.25)) * scale,
        rng.uniform(12e-6, 32e-6) * scale,
        rng.uniform(0.75, 0.98),
        scene.camera.blur_px * _BLURS[rng.integers(len(_BLURS))],
        rng.normal(0, 1.0),
        rng.uniform(0, 2 * np.pi),
    )


def _long_hair(scene, rng, along, lean):
    hair = _fur_hair(scene, rng, along, 0.5 * lean)
    scale = scene.camera.pixels_per_m
    return hair._replace(
        length=rng.uniform(1.2e-3, 2.6e-3) * scale,
        radius=rng.uniform(7e-6, 13e-6) * scale,
        direction=hair.direction + rng.normal(0, 0.25),
        blur=scene.camera.blur_px * _BLURS[rng.integers(2)],
    )


def stray_hairs(scene: Scene, rng) -> np.ndarray:
    """Draw short unwanted hairs that lie about in the picture, a row each as in FurHair."""
    scale, hairs = scene.camera.pixels_per_m, []
    for _ in range(scene.stray_hairs):
        hairs.append(
            FurHair(
                rng.uniform(0.3, 0.95) * scene.camera.width,
                rng.uniform(0.05, 0.95) * scene.camera.height,
                rng.uniform(0, 2 * np.pi),
                rng.normal(0, 300.0) / scale,
                rng.uniform(0.6e-3, 2.5e-3) * scale,
                rng.uniform(7e-6, 14e-6) * scale,
                rng.uniform(0.5, 0.95),
                scene.camera.blur_px * _BLURS[rng.integers(3)],
                0.0,
                0.0,
            )
        )
    return np.array(hairs).reshape(-1, len(FurHair._fields))


def draw_hairs(transmission, hairs, sway=0.0, shift=(0.0, 0.0)) -> None:
    """Multiply `transmission` by the light that passes every hair, rows as in FurHair.

    `sway` [rad] turns each hair about its root by its own share; `shift` (x, y) [px] moves all.
    """
    cover, touched = blank(*transmission.shape)
    for blur in np.unique(hairs[:, 7]):
        steps = step_table(float(blur))
        some = hairs[hairs[:, 7] == blur]
        some = some[_in_picture(some, transmission.shape, steps.reach)]
        _draw_alike(transmission, cover, touched, some, sway, shift, steps)


def _in_picture(hairs, shape, reach):
    """Rows of `hairs` (as in FurHair) that may darken a pixel."""
    margin = hairs[:, 4] + reach
    inside = (hairs[:, 0] > -margin) & (hairs[:, 0] < shape[1] + margin)
    return inside & (hairs[:, 1] > -margin) & (hairs[:, 1] < shape[0] + margin)


@njit(cache=True, nogil=True)
def _draw_alike(light, cover, touched, hairs, sway, shift, steps):
    """Multiply `light` by hairs of one blur; rows of `hairs` as in FurHair."""
    for k in range(len(hairs)):
        x0, y0, direction, bend, length, radius, opacity = hairs[k, :7]
        n = max(int(length / max(_HAIR_STEP, steps.blur)) + 1, 3)
        s = np.linspace(0.0, length, n)
        angle = direction + sway * hairs[k, 8] + bend * s
        step = s[1]
        x = (
            x0
            + shift[0]
            + step * (np.cumsum(np.cos(angle)) - 0.5 * (np.cos(angle) + np.cos(angle[0])))
        )
        y = (
            y0
            + shift[1]
            - step * (np.cumsum(np.sin(angle)) - 0.5 * (np.sin(angle) + np.sin(angle[0])))
        )
        half_width = radius * (1 - 0.93 * s / length)
        curvature, smear = np.full(n, bend), np.zeros(n)
        strip = Strip(x, y, angle, curvature, half_width, smear)
        count = cover_strip(cover, touched, strip, steps)
        absorb(light, cover, touched, count, opacity)
