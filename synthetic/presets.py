"""Named kinds of sessions: each makes the scene and the motion of one trial from a seed.

`single` and `noisy` are the plain cases, `fig3` the paper's population of contacts; the others
each hold one difficulty against a tracker or a contact detector.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from synthetic.cheek import dusty_motion
from synthetic.motion import Motion, pole_visits, smooth_noise, whisking
from synthetic.paper_session import paper_place, paper_trial
from synthetic.ringing import ringing_motion
from synthetic.scene import Camera, Codec, Face, Hair, Lights, Pole, Scene
from synthetic.staging import (
    CURVED,
    FRAMES,
    MARGIN,
    NOISE,
    Setting,
    base_path,
    c2_scene,
    draw_touches,
    driven_motion,
    follicle_to_pole,
    pole_for_touch,
    row_hairs,
    scene_touches,
    table_of,
    touching_motion,
)
from synthetic.touches import Touch, drive_touches, force_table, grazing_angle
from synthetic.variation import varied_motion
from synthetic.whole_faces import mouse_face_on_top, rat_both_sides
from whiskermodel.whisker import Whisker, mouse_c2


def _one_folder(setting):
    """Place of a trial's video where all of a session lie together: (sub-folder, stem)."""
    return "", f"{setting.preset}_{setting.trial:03d}"


@dataclass(frozen=True)
class Preset:
    """A named kind of session.

    Attributes
    ----------
    make : Setting → Motion of a trial
    trials : how many trials show all of it
    meaning : what it holds
    place : Setting → (sub-folder, stem) of the trial's video; a sub-folder per session.toml
    """

    make: Callable[[Setting], Motion]
    trials: int
    meaning: str
    place: Callable[[Setting], tuple[str, str]] = _one_folder


@dataclass(frozen=True)
class Trial:
    """One video to be: the sub-folder of its session, its stem, and the motion."""

    group: str
    stem: str
    motion: Motion

    @property
    def scene(self) -> Scene:
        """The motion's scene."""
        return self.motion.scene


def make_trial(preset: str, seed: int, trial: int, frames: int = FRAMES) -> Trial:
    """Return trial number `trial` (from 0) of a preset, the same for the same arguments.

    `frames` is the length of the video (`fig3` takes what its touches need).
    Raises ValueError for an unknown preset, with the names of those that exist.
    """
    rng = np.random.default_rng([seed, trial, 7])
    setting = Setting(preset, seed, trial, rng, frames)
    found = find_preset(preset)
    return Trial(*found.place(setting), found.make(setting))


def trial_place(preset: str, seed: int, trial: int) -> tuple[str, str]:
    """Sub-folder and stem of a trial's video, without working out its motion."""
    return find_preset(preset).place(Setting(preset, seed, trial))


def noisy_with(codec: Codec) -> Preset:
    """The preset `noisy`, the same scenes and motion, stored by another codec."""

    def make(setting):
        return _c2_touching(setting, codec=codec)

    return Preset(make, 4, f"as noisy, {codec.name}")


def find_preset(preset: str) -> Preset:
    """Return the preset of that name; ValueError names those that exist."""
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    return PRESETS[preset]


def _c2_touching(setting, count=9, **changes) -> Motion:
    scene = c2_scene(setting, **changes)
    return touching_motion(setting, scene, scene_touches(setting, scene, count))


# Plain ---------------------------------------------------------------------------------------


def _single(setting):
    return _c2_touching(setting, camera=Camera())


def _noisy(setting):
    return _c2_touching(setting)


def _low_contrast(setting):
    return _c2_touching(setting, hair={"opacity": 0.3})


def _coarse(setting):
    camera = Camera(pixels_per_mm=18.0).with_noise_sd(NOISE)
    return _c2_touching(setting, camera=camera)


def _h264(setting):
    return _c2_touching(setting, codec=Codec("h264", crf=23))


def _mjpeg(setting):
    return _c2_touching(setting, codec=Codec("mjpeg", quality=4))


# Touches -------------------------------------------------------------------------------------


def _faint_touch(setting):
    """Touches near the tip, of a few tenths of a µN to the little that it can bear."""
    arc_length = setting.rng.uniform(12.5e-3, 16e-3)
    scene = c2_scene(setting, arc_length)
    touches = scene_touches(setting, scene, 8, forces=(0.15e-6, 6e-6), durations=(6, 90))
    return touching_motion(setting, scene, touches)


def _close_touches(setting):
    """Bouts of brief touches with three or four free frames between them."""
    scene, rng = c2_scene(setting), setting.rng
    table, onset, touches = table_of(scene), 20, []
    while True:
        for _ in range(rng.integers(2, 4)):
            length = int(rng.integers(4, 25))
            if onset + length + MARGIN > setting.frames:
                return touching_motion(setting, scene, touches)
            peak = rng.uniform(0.08, 0.5) * min(table.bearable_force(length), 30e-6)
            touches.append(Touch(onset, length, float(peak)))
            onset += length + int(rng.integers(3, 5))
        onset += int(rng.integers(25, 60))


def _resting(setting):
    """A whisker that hardly moves but for a few touches: 1°, 2° or 4° back from the pole."""
    rest = np.deg2rad((1.0, 2.0, 4.0)[setting.trial % 3])
    scene = c2_scene(setting)
    touches = scene_touches(setting, scene, 3, durations=(8, 60), forces=(3e-6, 30e-6))
    return touching_motion(setting, scene, touches, rest=rest)


def _large_deflection(setting):
    """Touches close to the largest force that the whisker bears before it slips off."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 9.5e-3), -0.25 * setting.side)
    largest = table_of(scene).bearable_force(1000)
    touches = scene_touches(
        setting, scene, 7, forces=(0.4 * largest, largest), durations=(25, 110)
    )
    return touching_motion(setting, scene, touches)


def _slip_off(setting):
    """The whisker is pushed past the pole and comes back against its other side."""
    arc_length = setting.rng.uniform(10.5e-3, 15e-3)
    scene = c2_scene(setting, arc_length, -0.25 * setting.side)
    hair, pole, side = scene.hairs[0], scene.pole, setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    table = force_table(hair, hair.follicle_x, hair.follicle_y, pole.x, pole.y, pole.radius, side)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    far = table.turn[-1] + setting.rng.uniform(0.05, 0.25)
    pace = 1 + 0.2 * smooth_noise(setting.frames, 1e3, 0.3, setting.rng)
    phase = 2 * np.pi * np.cumsum(pace) / setting.rng.uniform(160, 320)
    turn = -0.3 + (far + 0.3) * 0.5 * (1 - np.cos(phase))
    return driven_motion(scene, [(*base, graze + side * turn)])


def _ringdown(setting):
    """The whisker slips off a near pole again and again, and rings; 150 µs exposure."""
    camera = Camera(exposure_s=150e-6).with_noise_sd(NOISE)
    of_session = np.random.default_rng([setting.seed, 13])
    whisker = replace(
        mouse_c2(),
        youngs_modulus=of_session.uniform(2e9, 4e9),
        damping_rate=of_session.uniform(150, 260),
    )
    arc_length = setting.rng.uniform(9.5e-3, 12e-3)
    scene = c2_scene(
        setting, arc_length, -0.25 * setting.side, camera=camera, hair={"whisker": whisker}
    )
    hair, pole, side = scene.hairs[0], scene.pole, setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    table = force_table(hair, hair.follicle_x, hair.follicle_y, pole.x, pole.y, pole.radius, side)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    far = table.turn[-1] + setting.rng.uniform(0.15, 0.3)
    pace = 1 + 0.15 * smooth_noise(setting.frames, 1e3, 0.3, setting.rng)
    phase = 2 * np.pi * np.cumsum(pace) / setting.rng.uniform(300, 400)
    turn = -far * np.cos(phase)
    return ringing_motion(driven_motion(scene, [(*base, graze + side * turn)]))


def _near_miss(setting):
    """The whisker comes within 0.02–0.3 mm of the pole in every whisk and does not touch it."""
    scene, rng, rate = c2_scene(setting), setting.rng, Camera().frames_per_second
    hair, pole, side = scene.hairs[0], scene.pole, setting.side
    base = base_path(scene, hair, setting.frames, rng)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    least = np.exp(np.interp(_unit_noise(setting, 0.08), [0, 1], np.log([0.02e-3, 0.3e-3])))
    swing = 0.15 + 0.2 * _unit_noise(setting, 0.1)
    phase = 2 * np.pi * np.cumsum(10 + 6 * _unit_noise(setting, 0.2)) / rate
    turn = least / follicle_to_pole(scene) + swing * 0.5 * (1 + np.cos(phase))
    return driven_motion(scene, [(*base, graze - side * turn)])


def _unit_noise(setting, time_constant):
    """Smooth noise between 0 and 1, (frames,)."""
    noise = smooth_noise(setting.frames, Camera().frames_per_second, time_constant, setting.rng)
    return 0.5 + 0.5 * np.tanh(noise)


def _free(setting):
    """Free whisking beside a pole that is never touched."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 12e-3), 0.35 * setting.side)
    hair, side = scene.hairs[0], setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    free = whisking(setting.frames, scene.camera.frames_per_second, setting.rng, -0.1 * side, 0.22)
    top = np.max(side * free)
    free -= side * max(top - 0.33, 0.0)
    return driven_motion(scene, [(*base, free)])


def _moving_pole(setting):
    """The pole comes in after a while, is touched, and is withdrawn before the end."""
    way = 11e-3
    scene = c2_scene(setting)
    direction = scene.pole.rod_direction
    away = way * np.cos(direction), way * np.sin(direction)
    scene = replace(scene, pole=replace(scene.pole, away_x=away[0], away_y=away[1]))
    travel = int(0.12 * setting.frames)
    start, end = int(0.15 * setting.frames), int(0.85 * setting.frames)
    path = pole_visits(scene, setting.frames, [(start, end)], travel)
    inside = end - start - 2 * travel
    touches = draw_touches(setting.rng, inside, 6, table_of(scene), durations=(4, 50))
    shifted = [replace(t, onset=t.onset + start + travel) for t in touches]
    return touching_motion(setting, scene, shifted, pole_path=path)


# Surroundings --------------------------------------------------------------------------------


def _moving_fur(setting):
    """Fur that moves with the whisker, long hairs, dust and a flickering lamp."""
    return _c2_touching(
        setting,
        face={"moving": 0.15e-3, "long_hairs": 14, "hair_length": 0.6e-3},
        lights=Lights(unevenness=0.3, flicker=0.015),
        clutter=25,
        stray_hairs=4,
    )


_DIRECTIONS = np.arange(-90, 91, 15)  # degrees


def _direction(setting):
    return int(_DIRECTIONS[setting.trial % len(_DIRECTIONS)])


def _facing(degrees):
    """Side of the picture that the face of a whisker of this direction stands on."""
    return {-1: "top", 0: "left", 1: "bottom"}[round(degrees / 91)]


def _orientation_place(setting):
    degrees = _direction(setting)
    return _facing(degrees), f"orientation_{setting.trial:03d}_{degrees:+03d}deg"


def _orientation(setting):
    """One direction of the whisker per trial, from −90° to 90° in steps of 15°.

    The whisker sweeps a few degrees about it, through directions along, nearly along and across
    the picture's axes.
    """
    size, degrees = 640, _direction(setting)
    direction = np.deg2rad(degrees)
    camera = Camera(width=size, height=size).with_noise_sd(NOISE)
    half, scale = size / 2, camera.pixels_per_m
    follicle = (
        (half - 215 * np.cos(direction)) / scale,
        -(half + 215 * np.sin(direction)) / scale,
    )
    hair = Hair(mouse_c2(), (0.5, 100.0), *follicle)
    face = Face(_facing(degrees), direction)
    scene = Scene(camera, Lights(), face, (hair,), None, seed=setting.seed)
    base = base_path(scene, hair, setting.frames, setting.rng)
    rate = camera.frames_per_second
    sweep = whisking(setting.frames, rate, setting.rng, amplitude=np.deg2rad(4.0))
    return driven_motion(scene, [(*base, direction + sweep)])


def _row(setting, count=4, spacing=1.3e-3, fan=0.2, own=0.05):
    """Four whiskers that whisk together, each a little in its own way; C2 touches the pole."""
    rng, frames = setting.rng, setting.frames
    hairs = row_hairs(count, spacing, 2.0e-3, -9.8e-3)
    c2 = hairs[-2]
    place = pole_for_touch(c2, 0.1 - 0.5 * fan, rng.uniform(7.5e-3, 10e-3), 1)
    scene = Scene(
        Camera(width=704).with_noise_sd(NOISE),
        face=Face("left", pad=spacing * (count - 1)),
        hairs=hairs,
        pole=Pole(*place, rod_direction=rng.uniform(1.1, 1.4)),
        seed=setting.seed,
    )
    touches = draw_touches(rng, frames, 7, table_of(scene, c2), durations=(4, 60))
    base = base_path(scene, c2, frames, rng)
    angle, _ = drive_touches(c2, base, (*place, scene.pole.radius), 1, touches, rng, rest=0.35)
    drives = []
    for hair in hairs:
        if hair is c2:
            drives.append((*base, angle))
            continue
        rank = (hair.follicle_y - c2.follicle_y) / spacing
        wobble = own * smooth_noise(frames, scene.camera.frames_per_second, 0.05, rng)
        share = 0.9 if rank < 0 else 1.05
        swing = share * (angle - angle.mean()) + wobble
        drives.append((*base_path(scene, hair, frames, rng), angle.mean() + fan * rank + swing))
    return driven_motion(scene, drives)


def _crossing(setting):
    """Two whiskers that cross and lie upon each other, and one beside them; no pole."""
    rng, frames = setting.rng, setting.frames
    spacing = 1.6e-3
    hairs = row_hairs(3, spacing, 2.0e-3, -9.6e-3)
    hairs = tuple(
        replace(hair, intrinsic_curvature=tuple(sign * np.array(hair.intrinsic_curvature)))
        for hair, sign in zip(hairs, (-0.5, -1, 1), strict=True)  # C3, C2, C1
    )
    scene = Scene(
        Camera().with_noise_sd(NOISE),
        Lights(),
        Face("left", pad=2 * spacing),
        hairs,
        None,
        seed=setting.seed,
    )
    set_points = {"C2": 0.0, "C1": 0.02, "C3": 0.25}
    drives = []
    for hair in hairs:
        own = whisking(frames, 1e3, rng, set_points[hair.whisker.name], 0.2, rng.uniform(8, 14))
        drives.append((*base_path(scene, hair, frames, rng), own))
    return driven_motion(scene, drives)


_DENSE = (  # length, base radius, place along the face from its middle [m], set point [degrees]
    (8e-3, 22e-6, 2.1e-3, 38),
    (9e-3, 23e-6, 1.7e-3, 30),
    (10e-3, 25e-6, 1.45e-3, 25),
    (12e-3, 28e-6, 1.0e-3, 19),
    (13e-3, 30e-6, 0.55e-3, 10),
    (15e-3, 32e-6, 0.3e-3, 6),
    (16e-3, 34e-6, -0.25e-3, -2),
    (18e-3, 37e-6, -0.6e-3, -7),
    (20e-3, 40e-6, -1.1e-3, -16),
    (21e-3, 41e-6, -1.35e-3, -20),
    (22e-3, 43e-6, -2.0e-3, -30),
)


def _dense_row(setting):
    """Eleven whiskers of several rows seen from above, coarsely, in fast whisking; no pole.

    8 px/mm and 500 frames/s: some lie upon each other for a while, all move by up to 5 degrees
    from frame to frame, and the picture's border cuts some.
    """
    rng, frames, rate = setting.rng, setting.frames, 500.0
    camera = Camera(320, 240, 8.0, rate, 0.8, 5e-4).with_noise_sd(1.5)
    hairs = tuple(
        Hair(
            Whisker(length, length / 0.95, radius, name=f"W{i + 1}"),
            tuple(rng.uniform(-0.6, 0.9) * np.array(CURVED) * 18e-3 / length),
            4.0e-3,
            place - 15e-3,
        )
        for i, (length, radius, place, _) in enumerate(_DENSE)
    )
    face = Face("left", pad=4.5e-3)
    scene = Scene(camera, Lights(), face, hairs, None, seed=setting.seed)
    together = whisking(frames, rate, rng, 0.0, np.deg2rad(22), 15.0)
    drives = []
    for hair, (*_, degrees) in zip(hairs, _DENSE, strict=True):
        own = np.deg2rad(1.5) * smooth_noise(frames, rate, 0.04, rng)
        angle = np.deg2rad(degrees) + rng.uniform(0.85, 1.1) * together + own
        drives.append((*base_path(scene, hair, frames, rng), angle))
    return driven_motion(scene, drives)


def _border(setting):
    """Whiskers that the picture's border cuts, and that leave the picture altogether."""
    rng, frames = setting.rng, setting.frames
    camera = Camera(width=400, height=320).with_noise_sd(NOISE)
    hairs = row_hairs(2, 2.2e-3, 2.0e-3, -6.6e-3)
    scene = Scene(camera, Lights(), Face("left", pad=2.2e-3), hairs, None, seed=setting.seed)
    drives = []
    for hair, set_point in zip(hairs, (0.35, -0.75), strict=True):  # C2, C1
        own = whisking(frames, 1e3, rng, set_point, 0.4, 7.0)
        drives.append((*base_path(scene, hair, frames, rng), own))
    return driven_motion(scene, drives)


def _passing(setting):
    """A whisker that passes before or behind the pole and its rod without touching."""
    scene = c2_scene(setting, 9e-3, 0.1 * setting.side, hair={"touches": False})
    base = base_path(scene, scene.hairs[0], setting.frames, setting.rng)
    free = whisking(setting.frames, 1e3, setting.rng, 0.15 * setting.side, 0.35, 9.0)
    return driven_motion(scene, [(*base, free)])


# All at random -------------------------------------------------------------------------------

_VARIED = (
    "noisy",
    "row",
    "crossing",
    "slip_off",
    "moving_pole",
    "passing",
    "close_touches",
    "near_miss",
)


def _varied(setting):
    """The motion of another preset in a picture drawn at random."""
    motion = PRESETS[_VARIED[setting.trial % len(_VARIED)]].make(setting)
    return varied_motion(motion, setting.rng)


def _varied_place(setting):
    """Every video in a folder of its own: scales and whiskers differ."""
    stem = f"varied_{setting.trial:03d}_{_VARIED[setting.trial % len(_VARIED)]}"
    return stem, stem


PRESETS = {
    "single": Preset(_single, 4, "one C2 whisker, little noise, touches from both sides"),
    "noisy": Preset(_noisy, 4, "the same with noise of 2.5 grey levels"),
    "fig3": Preset(
        paper_trial, 10, "the paper's population of contacts; five mice, five poles", paper_place
    ),
    "low_contrast": Preset(_low_contrast, 2, "a translucent whisker"),
    "row": Preset(_row, 2, "four whiskers in a row"),
    "crossing": Preset(_crossing, 2, "whiskers that cross and lie upon each other"),
    "moving_fur": Preset(_moving_fur, 2, "moving fur, dust, stray hairs, flicker"),
    "orientation": Preset(
        _orientation, 13, "directions from -90 to 90 degrees", _orientation_place
    ),
    "faint_touch": Preset(_faint_touch, 2, "faint touches near the tip"),
    "close_touches": Preset(_close_touches, 2, "touches three or four frames apart"),
    "resting": Preset(_resting, 3, "a whisker almost at rest, a few touches"),
    "h264": Preset(_h264, 2, "H.264 at the quality that x264 takes by itself (crf 23)"),
    "mjpeg": Preset(_mjpeg, 2, "MJPG"),
    "slip_off": Preset(_slip_off, 2, "the whisker slips past the pole and comes back"),
    "ringdown": Preset(_ringdown, 4, "the whisker slips off the pole and rings"),
    "dust": Preset(dusty_motion, 4, "a dust particle on the whisker, a cheek that moves"),
    "large_deflection": Preset(_large_deflection, 2, "forces near the largest possible"),
    "coarse": Preset(_coarse, 2, "18 px/mm"),
    "moving_pole": Preset(_moving_pole, 2, "the pole comes late and leaves"),
    "near_miss": Preset(_near_miss, 2, "near the pole, never touching"),
    "free": Preset(_free, 2, "free whisking beside a pole"),
    "dense_row": Preset(_dense_row, 2, "eleven whiskers, coarsely seen, in fast whisking"),
    "mouse_face_on_top": Preset(
        mouse_face_on_top, 4, "twelve untrimmed whiskers below a black face, body, bar, H.264"
    ),
    "rat_both_sides": Preset(
        rat_both_sides, 4, "pale snout from above, twelve untrimmed whiskers a side, H.264"
    ),
    "border": Preset(_border, 2, "whiskers cut by the border, out of view at times"),
    "passing": Preset(_passing, 2, "a whisker that passes before the pole and its rod"),
    "varied": Preset(_varied, 8, "cameras, light, dust and codecs at random", _varied_place),
}
