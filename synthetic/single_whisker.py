"""Scenes of one whisker, each with one difficulty, and what it does in them.

A function takes the `Setting` of a trial and returns its `Motion`; `presets` names them.
"""

from dataclasses import replace

import numpy as np

from synthetic.motion import Motion, pole_visits, smooth_noise, whisking
from synthetic.ringing import ringing_motion
from synthetic.scene import Camera, Face, Hair, Lights, Scene
from synthetic.staging import (
    MARGIN,
    NOISE,
    base_path,
    c2_scene,
    draw_touches,
    driven_motion,
    follicle_to_pole,
    scene_touches,
    table_of,
    touching_motion,
)
from synthetic.touches import Touch, force_table, grazing_angle
from whiskermodel.whisker import mouse_c2


def c2_touching(setting, count=9, **changes) -> Motion:
    """Touches drawn at random; `changes` of the scene as `c2_scene` takes them."""
    scene = c2_scene(setting, **changes)
    return touching_motion(setting, scene, scene_touches(setting, scene, count))


# Touches -------------------------------------------------------------------------------------


def faint_touch(setting):
    """Touches near the tip, of a few tenths of a µN to the little that it can bear."""
    arc_length = setting.rng.uniform(12.5e-3, 16e-3)
    scene = c2_scene(setting, arc_length)
    touches = scene_touches(setting, scene, 8, forces=(0.15e-6, 6e-6), durations=(6, 90))
    return touching_motion(setting, scene, touches)


def close_touches(setting):
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


def resting(setting):
    """A whisker that hardly moves but for a few touches: 1°, 2° or 4° back from the pole."""
    rest = np.deg2rad((1.0, 2.0, 4.0)[setting.trial % 3])
    scene = c2_scene(setting)
    touches = scene_touches(setting, scene, 3, durations=(8, 60), forces=(3e-6, 30e-6))
    return touching_motion(setting, scene, touches, rest=rest)


def large_deflection(setting):
    """Touches close to the largest force that the whisker bears before it slips off."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 9.5e-3), -0.25 * setting.side)
    largest = table_of(scene).bearable_force(1000)
    touches = scene_touches(
        setting, scene, 7, forces=(0.4 * largest, largest), durations=(25, 110)
    )
    return touching_motion(setting, scene, touches)


def slip_off(setting):
    """The whisker is pushed past the pole and comes back against its other side."""
    arc_length = setting.rng.uniform(10.5e-3, 15e-3)
    scene = c2_scene(setting, arc_length, -0.25 * setting.side)
    base, graze, far, phase = _past_the_pole(setting, scene, (0.05, 0.25), 0.2, (160, 320))
    turn = -0.3 + (far + 0.3) * 0.5 * (1 - np.cos(phase))
    return driven_motion(scene, [(*base, graze + setting.side * turn)])


def _past_the_pole(setting, scene, beyond, unevenness, period):
    """What a whisker needs to be pushed past its pole, again and again.

    beyond : range of the turn [rad] after that at which it slips off; unevenness : of the pace;
    period : range [frames]. Returns the base's path, the angle that grazes the pole, the turn from
    there to the farthest point [rad], and the phase of the whisking.
    """
    hair, pole, side, rng = scene.hairs[0], scene.pole, setting.side, setting.rng
    base = base_path(scene, hair, setting.frames, rng)
    table = force_table(hair, hair.follicle_x, hair.follicle_y, pole.x, pole.y, pole.radius, side)
    graze = grazing_angle(hair, pole.x - base[0], pole.y - base[1], pole.radius, side)
    far = table.turn[-1] + rng.uniform(*beyond)
    pace = 1 + unevenness * smooth_noise(setting.frames, 1e3, 0.3, rng)
    return base, graze, far, 2 * np.pi * np.cumsum(pace) / rng.uniform(*period)


def ringdown(setting):
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
    base, graze, far, phase = _past_the_pole(setting, scene, (0.15, 0.3), 0.15, (300, 400))
    turn = -far * np.cos(phase)
    return ringing_motion(driven_motion(scene, [(*base, graze + setting.side * turn)]))


def near_miss(setting):
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


def free(setting):
    """Free whisking beside a pole that is never touched."""
    scene = c2_scene(setting, setting.rng.uniform(7e-3, 12e-3), 0.35 * setting.side)
    hair, side = scene.hairs[0], setting.side
    base = base_path(scene, hair, setting.frames, setting.rng)
    free = whisking(setting.frames, scene.camera.frames_per_second, setting.rng, -0.1 * side, 0.22)
    top = np.max(side * free)
    free -= side * max(top - 0.33, 0.0)
    return driven_motion(scene, [(*base, free)])


def moving_pole(setting):
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


def moving_fur(setting):
    """Fur that moves with the whisker, long hairs, dust and a flickering lamp."""
    return c2_touching(
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


def orientation_place(setting):
    """A sub-folder per side of the face; the stem says the direction."""
    degrees = _direction(setting)
    return _facing(degrees), f"orientation_{setting.trial:03d}_{degrees:+03d}deg"


def orientation(setting):
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


def passing(setting):
    """A whisker that passes in front of or behind the pole and its rod without touching."""
    scene = c2_scene(setting, 9e-3, 0.1 * setting.side, hair={"touches": False})
    base = base_path(scene, scene.hairs[0], setting.frames, setting.rng)
    free = whisking(setting.frames, 1e3, setting.rng, 0.15 * setting.side, 0.35, 9.0)
    return driven_motion(scene, [(*base, free)])
