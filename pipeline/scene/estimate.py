"""The static scene of a video: background, face, pole, obstacles."""

from dataclasses import replace
from functools import cached_property, partial
from typing import NamedTuple

import cv2
import numpy as np

from pipeline.detection.static_scene import PoleTrack, StaticScene
from pipeline.errors import VideoError
from pipeline.scene.background import estimate_background, fringe_px, without_whiskers
from pipeline.scene.circle_fit import Pole
from pipeline.scene.codec_noise import noise_excess
from pipeline.scene.dust import is_passed_over
from pipeline.scene.epochs import Epoch
from pipeline.scene.face import darkest_sides, find_face, likelier_side
from pipeline.scene.masks import dilated, opened, opened_beyond_border, regions
from pipeline.scene.moving_fur import moving_fur
from pipeline.scene.pole_doubts import doubt
from pipeline.scene.pole_search import SURE, PoleCheck, find_pole, likeness
from pipeline.scene.preparation import N_FRAMES, PreparedVideo, prepare_video, without_black
from pipeline.scene.scale import working_scale
from pipeline.scene.states import Survey, periods
from pipeline.scene.virtual_face import mask_behind_whiskers
from pipeline.scene.whisker_pad import bears_whiskers, face_of
from pipeline.session.parameters import DEFAULTS, Parameters, SceneParams
from pipeline.session.recording import Recording

FRAMES_PER_SAMPLE = 50  # of a long video, to see when large things move
MOST_SAMPLES = 1000
OTHER_SIZES = (0.6, 1.6, 0.4, 2.5)  # of the expected one, tried in this order


def survey(
    prepared: PreparedVideo, recording: Recording, params: SceneParams = DEFAULTS.scene
) -> Survey:
    """Sample frames of the whole video, for scene and whiskers; those of a short one are read."""
    scale = working_scale(prepared.video.shape, recording.pixels_per_mm)
    seen = Survey(prepared.video.shape, scale, params, prepared.part)
    n_samples = (prepared.video.n_frames or 0) // FRAMES_PER_SAMPLE
    sampled = zip(prepared.indices, prepared.frames, strict=True)
    if n_samples > N_FRAMES:
        sampled = without_black(prepared.video.sampled(min(n_samples, MOST_SAMPLES)))
    for index, frame in sampled:
        seen.add(index, frame)
    return seen


def find_scenes(
    video,
    recording: Recording,
    pole_diameter_m=0.5e-3,
    pole_xy=None,
    still: "StillStates | None" = None,
    params: Parameters = DEFAULTS,
) -> tuple[Epoch, ...]:
    """Find what does not move in a video, in each period between movements of large things.

    Parameters
    ----------
    video : pipeline.video.open.Video
    recording : frame rate, scale, side of the face (None: find it)
    pole_diameter_m : [m]; None: there is no pole
    pole_xy : (x, y) [px] of the pole where session.toml gives it
    still : `still_states` of the video's `survey`; found where it is not given
    params : the parameters of all rooms

    Returns
    -------
    epochs, without gaps, from frame 0 on. Where a state of the scene returns (the pole away
    again), it is the same StaticScene.

    Raises
    ------
    VideoError
        If `pole_xy` is outside of the picture.
    """
    _check_place(video, pole_xy)
    if still is None:
        seen = survey(prepare_video(video), recording, params.scene)
        still = still_states(seen, recording, params)
    seen = still.survey
    radius = pole_diameter_m and 0.5e3 * pole_diameter_m * recording.pixels_per_mm
    place = seen.part.place(pole_xy) if seen.part and pole_xy else pole_xy
    n_frames = video.n_frames or 1
    found = [each.scene(radius, place, n_frames) for each in still.scenes]
    scenes = found if seen.part is None else [seen.part.whole(each) for each in found]
    settled = round(params.scene.settled_s * recording.frames_per_second)
    in_place = [_pole_check(scene) for scene in scenes]
    parts = periods(video, seen, still.states, in_place, settled)
    return tuple(
        Epoch(part.start, part.stop, None if part.state is None else scenes[part.state])
        for part in parts
    )


def still_states(
    seen: Survey, recording: Recording, params: Parameters = DEFAULTS
) -> "StillStates":
    """What stands still in each state of a video, of its `survey`, whatever pole is there."""
    states, frames = seen.settled()
    scale = working_scale(frames[0].shape[1:], recording.pixels_per_mm)
    cut = frames if seen.part is None else [seen.part.cut(some) for some in frames]
    return StillStates(seen, states, [StillState(f, recording.face, scale, params) for f in cut])


def _check_place(video, pole_xy):
    """Raise if the pole's place in session.toml is outside the picture."""
    height, width = video.shape
    if pole_xy is not None and not (0 <= pole_xy[0] < width and 0 <= pole_xy[1] < height):
        raise VideoError(
            video.path,
            f"[pole] x_px, y_px = {pole_xy[0]:g}, {pole_xy[1]:g} in session.toml is outside the "
            f"picture: expected x_px from 0 to {width - 1}, y_px from 0 to {height - 1}; correct "
            "both, or leave them out",
        )


def _pole_check(scene):
    """Return a function of a frame: is the scene's pole (if any) in its place?"""
    if scene.pole is None:
        return lambda frame: True
    place = scene.pole.x_px[0], scene.pole.y_px[0], scene.pole.radius_px
    return PoleCheck(*place, scene.background).in_place


class StillStates(NamedTuple):
    """A video's survey, the state of each of its samples, int (k,), and what is still in each."""

    survey: Survey
    states: np.ndarray
    scenes: list["StillState"]


class StillState:
    """What stands still in a few frames in which only whiskers move: face, background.

    Parameters
    ----------
    frames : uint8 (k, height, width)
    face : side of the face; None: find it
    scale : for lengths in the scene [px/mm]
    params : the parameters of all rooms
    """

    def __init__(self, frames, face: str | None, scale: float, params: Parameters):
        self.frames, self.scale, self.params = frames, scale, params
        self.background = estimate_background(frames, scale, params.scene)
        self.side, self.face, self.animal, self.likelier = _face(
            self.background, frames, face, scale, params
        )

    def scene(self, radius_px: float | None, pole_xy=None, n_frames: int = 1) -> StaticScene:
        """The scene, with the pole if there is one of about this radius; None: there is none."""
        if radius_px is None:
            return self._without_pole
        masks = self.face, self.animal
        pole, refused = _pole(self.background, self.frames, radius_px, pole_xy, masks)
        if pole is None:
            return replace(self._without_pole, refused_poles=refused)
        return self._with(pole, n_frames)

    @cached_property
    def _without_pole(self):
        return self._with(None)

    def _with(self, pole, n_frames=1) -> StaticScene:
        background, face, animal, scale = self.background, self.face, self.animal, self.scale
        own = self.params.scene
        obstacles = find_obstacles(background.transmission, face, pole, scale, own)
        disc = _disc(pole, face.shape)
        # a whisker may end on the body: that, with its fringe, is nothing it could be part of
        things = _apart_from(obstacles & ~dilated(animal, fringe_px(scale)), disc)
        light = without_whiskers(background, face, scale, own, animal.any(), disc, things)
        return StaticScene(
            background=light,
            noise_gain=background.noise_gain,
            noise_floor=background.noise_floor,
            face_mask=face,
            obstacle_mask=obstacles,
            pole=_constant_track(pole, n_frames),
            face_side=self.side,
            noise_excess=noise_excess(background, self.frames, obstacles, face),
            likelier_side=self.likelier,
            moving_fur=moving_fur(light, self.frames, face | obstacles, scale, own),
            face_seen=bool(animal.any()),
            pole_likeness=0.0 if pole is None else likeness(pole),
        )


def _pole(background, frames, radius_px, pole_xy, masks):
    """The pole, None where none is seen; and what was refused: x, y [px] and why.

    `masks`: bool (height, width), of what stands for the face and of the animal.
    """
    face, animal = masks
    transmission, reasons = background.transmission, []
    noise = background.noise_floor, background.noise_gain
    passed_over = partial(is_passed_over, background=background.image, noise=noise, frames=frames)

    def refused(pole):
        reason = doubt(pole, transmission, animal)
        if reason:
            reasons.append((pole.x_px, pole.y_px, reason))
        return reason is not None

    pole = find_pole(transmission, radius_px, pole_xy, face | animal, passed_over, refused)
    return pole, tuple(reasons) if pole is None else ()


def pole_of_another_size(frames, scene, radius_px, scale, params) -> Pole | None:
    """What is surely a pole's end, but not about as thick as expected; None where nothing is.

    Parameters
    ----------
    frames : uint8 (k, height, width), of a video in which no pole was found
    scene : its `StaticScene`
    radius_px : expected radius [px]
    scale : for lengths in the scene [px/mm]
    params : `SceneParams`
    """
    background = estimate_background(frames, scale, params)
    elsewhere = scene.background <= 0  # what the settings leave out of the picture
    masks = scene.face_mask | elsewhere, scene.face_mask & scene.face_seen
    found = (_pole(background, frames, radius_px * k, None, masks)[0] for k in OTHER_SIZES)
    return next((pole for pole in found if pole is not None and likeness(pole) > SURE), None)


def _face(background, frames, given_side, scale, params):
    """Where the whiskers begin: the side of the picture, a mask of the face, one of the animal.

    Where no animal is seen, that mask is empty, and what stands for the face lies behind the
    whiskers' thick ends. Last, the side that is likelier than the one given, or None.
    """
    transmission, own = background.transmission, params.scene
    sides = [given_side] if given_side else darkest_sides(transmission, own)
    seen = _animal(background, frames, sides, scale, params)
    animal = seen.face_mask
    if animal.any():
        face, behind = face_of(animal, frames, seen, params.detection)
        return given_side or behind or seen.face_side, face, animal, None
    side, face, thick_side = mask_behind_whiskers(frames, given_side, scale, own)
    return side, face, animal, likelier_side(transmission, side, thick_side, scale, own)


def _animal(background, frames, sides, scale, params) -> StaticScene:
    """What does not move, with the animal as its face, on the first of the sides that has one.

    What whiskers that move do not come out of is no animal: a rig, a bar, a screw. Where there is
    none, the first side and an empty mask.
    """
    for side in sides:
        mask = find_face(background.transmission, side, scale, params.scene)
        if mask.any():
            seen = _seen_with(mask, background, side, scale, params.scene)
            if bears_whiskers(mask, frames, seen, params.detection):
                return seen
    return _seen_with(np.zeros_like(mask), background, sides[0], scale, params.scene)


def _seen_with(animal, background, side, scale, params) -> StaticScene:
    """What does not move, with a mask taken for the animal."""
    return StaticScene(
        background=without_whiskers(background, animal, scale, params),
        noise_gain=background.noise_gain,
        noise_floor=background.noise_floor,
        face_mask=animal,
        obstacle_mask=find_obstacles(background.transmission, animal, None, scale, params),
        pole=None,
        face_side=side,
    )


def find_obstacles(transmission, face, pole, pixels_per_mm, params) -> np.ndarray:
    """Pixels of dark static things that are neither face nor thin, bool (height, width)."""
    radius = round(0.5 * params.thinnest_obstacle_mm * pixels_per_mm)
    dark = opened(transmission < params.opaque, radius) & ~face
    labels = regions(dark)
    keep = np.bincount(labels.ravel()) > params.least_obstacle_mm2 * pixels_per_mm**2
    # along the face there is always a fringe of fur, half dark: only what is thick counts there
    fringe = np.zeros(len(keep), bool)
    fringe[labels[dilated(face, radius)]] = True
    fringe[labels[opened_beyond_border(dark, params.tuft_mm * pixels_per_mm)]] = False
    keep &= ~fringe
    keep[0] = False
    mask = keep[labels]
    if pole is not None:
        mask |= _disc(pole, mask.shape)
    return mask & ~face


def _disc(pole, shape):
    """The pole's pixels, bool (height, width); None without a pole."""
    if pole is None:
        return None
    around = np.zeros(shape, np.uint8)
    sixteenths = (round(16 * pole.x_px), round(16 * pole.y_px)), round(16 * pole.radius_px)
    return cv2.circle(around, *sixteenths, 1, cv2.FILLED, shift=4) > 0


def _apart_from(obstacles, disc):
    """Obstacles that are not connected with the pole's disc, bool (height, width)."""
    if disc is None:
        return obstacles
    labels = regions(obstacles | disc)
    return obstacles & ~np.isin(labels, np.unique(labels[disc]))


def _constant_track(pole, n_frames):
    if pole is None:
        return None
    return PoleTrack(np.full(n_frames, pole.x_px), np.full(n_frames, pole.y_px), pole.radius_px)
