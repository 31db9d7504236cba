"""Scenes as labs record them before whiskers are trimmed: the whole face and what stands about.

Whiskers of rows B to D overlap and cross. Their lengths and thicknesses follow row and column as
in rats (Belli et al. 2017, J Neurophysiol 117:1807), in mice in proportion to C2. All places are
px of a picture of the stated size, so that they can be read off a frame.
"""

from dataclasses import replace

import numpy as np

from synthetic.motion import Motion, smooth_noise, whisking_bouts
from synthetic.outlines import rounded
from synthetic.scene import Camera, Codec, Face, Hair, Lights, Scene, Shape
from synthetic.staging import CURVED, Setting, base_path, driven_motion
from whiskermodel.whisker import Whisker, mouse_c2

_HIDDEN = 1.1e-3  # m from a follicle to the edge of the face


def pad_whisker(name: str, like: Whisker | None = None) -> Whisker:
    """A whisker by its row (A–E) and column, e.g. "C2", of a rat, or of whom `like` is the C2.

    Belli et al. 2017: length = 43 + 1.8 row − 7.6 column [mm], base diameter = 0.041
    + 0.002 length + 0.011 row − 0.0039 column [mm]; row A is 1. `like` scales both.
    """
    length, radius = _belli(name)
    if like is not None:
        c2_length, c2_radius = _belli("C2")
        length, radius = length * like.length / c2_length, radius * like.base_radius / c2_radius
    return Whisker(length, length / 0.95, radius, name=name)


def _belli(name):
    """Length and base radius [m] of a rat's whisker."""
    row, column = "ABCDE".index(name[0]) + 1, int(name[1])
    length = 43 + 1.8 * row - 7.6 * column
    diameter = 0.041 + 0.002 * length + 0.011 * row - 0.0039 * column
    return 1e-3 * length, 0.5e-3 * diameter


def _in_metres(corners, camera: Camera, shift=(0.0, 0.0)):
    """Corners in px as corners in m."""
    return tuple(
        ((x + shift[0]) / camera.pixels_per_m, -(y + shift[1]) / camera.pixels_per_m)
        for x, y in corners
    )


def _hair(setting, camera, whisker, place, direction, opacity, bend) -> Hair:
    """A whisker that leaves the face at `place` [px] in a direction [rad]."""
    (edge,) = _in_metres([place], camera)
    drawn = setting.rng.uniform(0.93, 1.05)
    whisker = replace(
        whisker, length=drawn * whisker.length, cone_length=drawn * whisker.cone_length
    )
    return Hair(
        whisker,
        tuple(bend * np.array(CURVED) * 18e-3 / whisker.length),
        edge[0] - _HIDDEN * np.cos(direction),
        edge[1] - _HIDDEN * np.sin(direction),
        opacity=opacity,
    )


def _driven(setting, scene, angles) -> Motion:
    """Motion of whiskers with base angles [rad] over time, follicles wandering a little."""
    frames, rng = setting.frames, setting.rng
    drives = [
        (*base_path(scene, hair, frames, rng), angle)
        for hair, angle in zip(scene.hairs, angles, strict=True)
    ]
    return driven_motion(scene, drives)


# Mouse, face at the top ----------------------------------------------------------------------

_MOUSE = (  # name, place where it leaves the face [px of 640 × 480], direction at rest [degrees]
    ("D1", (118, 131), -121),
    ("C1", (126, 131), -117),
    ("B1", (136, 131), -112),
    ("D2", (149, 129), -110),
    ("C2", (158, 128), -105),
    ("B2", (168, 120), -101),
    ("D3", (180, 110), -97),
    ("C3", (187, 109), -90),
    ("B3", (200, 107), -83),
    ("D4", (212, 104), -75),
    ("C4", (225, 101), -62),
    ("B4", (240, 97), -48),
)
_MOUSE_FACE = (
    (-60, -60), (365, -60), (371, 64), (327, 82), (286, 93), (244, 96), (209, 106), (182, 109),
    (160, 128), (127, 133), (84, 138), (-60, 142),
)  # fmt: skip
_BODY = (
    (-60, 120), (84, 132), (87, 175), (97, 230), (104, 284), (78, 368), (58, 412), (80, 540),
    (-60, 540),
)  # fmt: skip
_BAR = (
    (366, 131), (330, 186), (292, 254), (262, 322), (240, 392), (216, 540), (262, 540), (284, 402),
    (310, 330), (345, 262), (374, 208), (394, 174), (386, 148), (374, 130),
)  # fmt: skip
_SPOUT = ((365, 49), (525, 38), (525, 72), (365, 69))
_HOLDER = ((520, 28), (700, 22), (700, 76), (520, 80))
_CLAMP = ((462, -60), (700, -60), (700, 12), (540, 14), (464, 34))
_CORNER = ((585, 500), (700, 400), (700, 500))


def mouse_face_on_top(setting: Setting) -> Motion:
    """Twelve untrimmed whiskers of a head-fixed mouse below its black face; no pole.

    A body hides the ends of the posterior ones; a bar, a spout and its holder are dark, too. Long
    rests, then whisking of several degrees per frame; H.264 whose quality changes.
    """
    rng, frames, rate = setting.rng, setting.frames, 200.0
    camera = Camera(640, 480, 12.0, rate, 1.15, 5e-4, black_level=2.0).with_noise_sd(1.0)
    rest = [np.deg2rad(degrees + rng.normal(0, 4)) for *_, degrees in _MOUSE]
    hairs = tuple(
        _hair(
            setting, camera, pad_whisker(name, mouse_c2()), place, direction, 0.8,
            rng.uniform(0.2, 1.7),
        )
        for (name, place, _), direction in zip(_MOUSE, rest, strict=True)
    )  # fmt: skip
    shapes = _mouse_shapes(camera, rng)
    face = Face(
        "top", outline=_in_metres(rounded(_MOUSE_FACE, 1), camera), hairs_per_mm=3.0,
        hair_length=0.3e-3, edge_blur=0.08e-3,
    )  # fmt: skip
    scene = Scene(
        camera,
        Lights(150.0, 0.5),
        face,
        hairs,
        codec=Codec("h264", crf=17, uneven_frames=40),
        shapes=shapes,
        clutter=4,
        seed=setting.seed,
    )
    together = whisking_bouts(frames, rate, rng, np.deg2rad(12), 14.0, 0.3)
    angles = [
        direction
        + rng.uniform(0.75, 1.1) * together
        + np.deg2rad(2) * smooth_noise(frames, rate, 0.1, rng)
        for direction in rest
    ]
    return _driven(setting, scene, angles)


def _mouse_shapes(camera, rng) -> tuple[Shape, ...]:
    """Body and apparatus, parts of which lie elsewhere in every trial."""
    bar_shift = rng.uniform(-10, 10, 2)
    things = (
        (rounded(_BODY), rng.uniform(-4, 4, 2), 0.02, 2.0),
        (rounded(_BAR), bar_shift, 0.02, 1.5),
        (_SPOUT, (0.0, 0.0), 0.45, 1.5),
        (_HOLDER, (0.0, 0.0), 0.25, 2.0),
        (_CLAMP, (0.0, 0.0), 0.02, 3.0),
        (_CORNER, rng.uniform(-15, 15, 2), 0.02, 3.0),
    )
    return tuple(
        Shape(_in_metres(corners, camera, shift), passing, blur)
        for corners, shift, passing, blur in things
    )


# Rat from above ------------------------------------------------------------------------------

_RAT = (  # the same for the side on the right of a picture of 720 × 500
    ("B1", (447, 212), 46),
    ("C1", (445, 219), 40),
    ("D1", (444, 226), 35),
    ("B2", (443, 233), 30),
    ("C2", (442, 240), 25),
    ("D2", (441, 246), 20),
    ("B3", (439, 252), 14),
    ("C3", (436, 257), 8),
    ("D3", (432, 263), 2),
    ("B4", (427, 270), -6),
    ("C4", (420, 279), -14),
    ("D4", (411, 290), -25),
)
_MIDDLE = 355  # px, column that the rat is alike on both sides of
_RAT_SIDE = (  # half of its outline, from above to the nose
    (495, -60), (498, 80), (488, 130), (466, 178), (448, 208), (444, 238), (433, 266), (407, 299),
    (388, 320), (386, 344), (366, 350),
)  # fmt: skip
_EYE = (443, 125, 20, 28, 0.35)  # middle, half-axes [px], tilt [rad]
_SCREW = (512, 30, 36, 36, 0.2)


def rat_both_sides(setting: Setting) -> Motion:
    """A pale rat's snout from above, backlit, twelve untrimmed whiskers on each side; no pole.

    Fur covers the bases, faint tips leave the picture. Slow whisks with quick turns, of several
    degrees per frame, not quite alike on both sides; H.264 whose quality changes.
    """
    rng, frames, rate = setting.rng, setting.frames, 500.0
    camera = Camera(720, 500, 8.5, rate, 1.0, 5e-4, black_level=2.0).with_noise_sd(1.4, 150.0)
    hairs, angles = [], []
    swings = _rat_swings(frames, rate, rng)
    for side, swing in zip(("right", "left"), swings, strict=True):
        for name, place, degrees in _RAT:
            x, rest, forward = place[0], np.deg2rad(degrees + rng.normal(0, 4)), -1
            if side == "left":
                x, rest, forward = 2 * _MIDDLE - x, np.pi - rest, 1
            whisker = replace(pad_whisker(name), name=f"{side}_{name}")
            bend = rng.uniform(-0.6, 0.6)
            hairs.append(_hair(setting, camera, whisker, (x, place[1]), rest, 0.36, bend))
            own = np.deg2rad(2) * smooth_noise(frames, rate, 0.06, rng)
            angles.append(rest + forward * rng.uniform(0.75, 1.0) * swing + own)
    scene = Scene(
        camera,
        Lights(152.0, 0.02),
        _rat_face(camera),
        tuple(hairs),
        codec=Codec("h264", crf=17, uneven_frames=60),
        shapes=_rat_things(camera),
        seed=setting.seed,
    )
    return _driven(setting, scene, angles)


def _rat_swings(frames, rate, rng):
    """Forward swing of the whiskers on both sides [rad], two arrays (frames,)."""
    together = whisking_bouts(frames, rate, rng, np.deg2rad(29), 6.0, 0.15, haste=2.5)
    return [
        rng.uniform(0.8, 1.1) * together + np.deg2rad(3) * smooth_noise(frames, rate, 0.08, rng)
        for _ in range(2)
    ]


def _rat_face(camera) -> Face:
    mirrored = [(2 * _MIDDLE - x, y) for x, y in reversed(_RAT_SIDE)]
    return Face(
        "top", outline=_in_metres(rounded([*_RAT_SIDE, *mirrored]), camera),
        hairs_per_mm=12.0, hair_length=1.2e-3, edge_blur=0.4e-3, glow=0.32, coat_per_mm2=8.0,
    )  # fmt: skip


def _rat_things(camera) -> tuple[Shape, ...]:
    """Both eyes, and the screws of the head's implant."""
    out = []
    for (x, y, a, b, tilt), corners, dark in ((_EYE, 24, 0.15), (_SCREW, 6, 0.3)):
        turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
        u, v = a * np.cos(turn), b * np.sin(turn)
        right = [
            (x + p * np.cos(tilt) - q * np.sin(tilt), y + p * np.sin(tilt) + q * np.cos(tilt))
            for p, q in zip(u, v, strict=True)
        ]
        left = [(2 * _MIDDLE - x, y) for x, y in right]
        out += [Shape(_in_metres(side, camera), dark, 2.0) for side in (right, left)]
    return tuple(out)
