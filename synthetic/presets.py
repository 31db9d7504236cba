"""Named kinds of sessions: each makes the scene and the motion of one trial from a seed.

`single` and `noisy` are the plain cases, `fig3` the paper's population of contacts; the others
each hold one difficulty against a tracker or a contact detector.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from synthetic import rows, single_whisker
from synthetic.cheek import dusty_motion
from synthetic.motion import Motion
from synthetic.paper_session import paper_place, paper_trial
from synthetic.scene import Camera, Codec, Scene
from synthetic.single_whisker import c2_touching
from synthetic.staging import FRAMES, NOISE, Setting
from synthetic.variation import varied_motion
from synthetic.whole_faces import mouse_face_on_top, rat_both_sides


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
    return Preset(partial(c2_touching, codec=codec), 4, f"as noisy, {codec.name}")


def find_preset(preset: str) -> Preset:
    """Return the preset of that name; ValueError names those that exist."""
    if preset not in PRESETS:
        raise ValueError(f"preset must be one of {', '.join(PRESETS)}, got {preset!r}")
    return PRESETS[preset]


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


_COARSE = Camera(pixels_per_mm=18.0).with_noise_sd(NOISE)

PRESETS = {
    "single": Preset(
        partial(c2_touching, camera=Camera()),
        4,
        "one C2 whisker, little noise, touches from both sides",
    ),
    "noisy": Preset(c2_touching, 4, "the same with noise of 2.5 grey levels"),
    "fig3": Preset(
        paper_trial, 10, "the paper's population of contacts; five mice, five poles", paper_place
    ),
    "low_contrast": Preset(
        partial(c2_touching, hair={"opacity": 0.3}), 2, "a translucent whisker"
    ),
    "row": Preset(rows.row, 2, "four whiskers in a row"),
    "crossing": Preset(rows.crossing, 2, "whiskers that cross and lie upon each other"),
    "moving_fur": Preset(single_whisker.moving_fur, 2, "moving fur, dust, stray hairs, flicker"),
    "orientation": Preset(
        single_whisker.orientation,
        13,
        "directions from -90 to 90 degrees",
        single_whisker.orientation_place,
    ),
    "faint_touch": Preset(single_whisker.faint_touch, 2, "faint touches near the tip"),
    "close_touches": Preset(single_whisker.close_touches, 2, "touches three or four frames apart"),
    "resting": Preset(single_whisker.resting, 3, "a whisker almost at rest, a few touches"),
    "h264": Preset(
        partial(c2_touching, codec=Codec("h264", crf=23)),
        2,
        "H.264 at the quality that x264 takes by itself (crf 23)",
    ),
    "mjpeg": Preset(partial(c2_touching, codec=Codec("mjpeg", quality=4)), 2, "MJPG"),
    "slip_off": Preset(
        single_whisker.slip_off, 2, "the whisker slips past the pole and comes back"
    ),
    "ringdown": Preset(single_whisker.ringdown, 4, "the whisker slips off the pole and rings"),
    "dust": Preset(dusty_motion, 4, "a dust particle on the whisker, a cheek that moves"),
    "large_deflection": Preset(
        single_whisker.large_deflection, 2, "forces near the largest possible"
    ),
    "coarse": Preset(partial(c2_touching, camera=_COARSE), 2, "18 px/mm"),
    "moving_pole": Preset(single_whisker.moving_pole, 2, "the pole comes late and leaves"),
    "near_miss": Preset(single_whisker.near_miss, 2, "near the pole, never touching"),
    "free": Preset(single_whisker.free, 2, "free whisking beside a pole"),
    "dense_row": Preset(rows.dense_row, 2, "eleven whiskers, coarsely seen, in fast whisking"),
    "mouse_face_on_top": Preset(
        mouse_face_on_top, 4, "twelve untrimmed whiskers below a black face, body, bar, H.264"
    ),
    "rat_both_sides": Preset(
        rat_both_sides, 4, "pale snout from above, twelve untrimmed whiskers a side, H.264"
    ),
    "border": Preset(rows.border, 2, "whiskers cut by the border, out of view at times"),
    "passing": Preset(
        single_whisker.passing, 2, "a whisker that passes in front of the pole and its rod"
    ),
    "varied": Preset(_varied, 8, "cameras, light, dust and codecs at random", _varied_place),
}
