"""Scenes in which nothing can be measured, or not all the time; and scenes drawn at random."""

import functools
from typing import NamedTuple

import cv2
import numpy as np
import tifffile

from pipeline.errors import VideoError
from pipeline.run import analyse
from promises.children import each_in_child, last_line
from promises.trial import Effort, Tried
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.session import session_settings

FRAMES = 120
SEEDS = 3  # of every bad scene
RANDOM = 24
LONGEST_S = 900
MIDDLE = slice(45, 75)  # frames in which something happens
NEAR = 3  # frames by which a contact may begin before or end after a true one
FREE = "free"  # the preset without a touch
PRESETS = ("single", "noisy", "moving_fur", "near_miss", "close_touches", "slip_off", "border")


class Video(NamedTuple):
    """Frames of a rendered trial, the same without whiskers, and its settings."""

    frames: np.ndarray
    empty: np.ndarray
    settings: object
    touching: np.ndarray  # by frame, whether a whisker truly touches


def rendered(preset, seed) -> Video:
    """Render a short trial."""
    trial = make_trial(preset, seed, seed, frames=FRAMES)
    renderer = Renderer(trial.scene, trial.motion, seed=seed)
    frames = np.stack([renderer.frame(i) for i in range(FRAMES)])
    empty = [renderer.expose(renderer.without_whiskers(i), i) for i in range(FRAMES)]
    touching = np.any([hair.contact.state == "contact" for hair in trial.motion.hairs], axis=0)
    return Video(frames, np.stack(empty), session_settings(trial, renderer), touching)


# What may happen ------------------------------------------------------------------------------


def black(video, rng):
    """The lamp is off."""
    return np.zeros_like(video.frames)


def white(video, rng):
    """The camera is overexposed."""
    return np.full_like(video.frames, 255)


def noise(video, rng):
    """The cable is loose."""
    return rng.integers(0, 256, video.frames.shape, np.uint8)


def no_whisker(video, rng):
    """The whiskers are cut."""
    return video.empty


def leaving(video, rng):
    """The whisker is there for a third of the time only."""
    return np.where(np.arange(FRAMES)[:, None, None] < FRAMES // 3, video.frames, video.empty)


def hand(video, rng):
    """Something large and dark crosses the picture."""
    frames = video.frames.copy()
    for i in range(MIDDLE.start, MIDDLE.stop):
        share = (i - MIDDLE.start) / (MIDDLE.stop - MIDDLE.start)
        centre = int(share * frames.shape[2]), int(frames.shape[1] * (0.3 + 0.4 * share))
        cv2.ellipse(frames[i], centre, (130, 60), 30, 0, 360, 40, -1, cv2.LINE_AA)
    return frames


def bump(video, rng):
    """The camera is pushed, and comes back."""
    frames = video.frames.copy()
    for i in range(MIDDLE.start, MIDDLE.start + 12):
        shift = rng.uniform(-6, 6, 2) * np.exp(-(i - MIDDLE.start) / 5)
        frames[i] = cv2.warpAffine(
            frames[i], np.float32([[1, 0, shift[0]], [0, 1, shift[1]]]), frames.shape[:0:-1],
            borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
    return frames


def flicker(video, rng):
    """The lamp flickers by a third."""
    light = rng.uniform(0.67, 1.0, FRAMES)[:, None, None]
    return (video.frames * light).astype(np.uint8)


def doubled(video, rng):
    """Frames are stored twice."""
    return video.frames[np.sort(np.r_[np.arange(FRAMES), rng.integers(0, FRAMES, 8)])]


def dropped(video, rng):
    """Frames are lost, and nothing says so."""
    return np.delete(video.frames, rng.integers(1, FRAMES - 1, 8), axis=0)


def blank_frames(video, rng):
    """Some frames are black."""
    frames = video.frames.copy()
    frames[rng.integers(0, FRAMES, 6)] = 0
    return frames


def no_pole(video, rng):
    """The pole is never there: what differs from the scene without it is painted over."""
    return _without_pole(video)


MUST_SAY = {  # words of which one is in the messages of such a video
    black: ("dark", "no whiskers"),
    white: ("no whiskers",),
    noise: ("whiskers", "tracked", "not known"),
    no_whisker: ("no whiskers", "not found"),
    leaving: ("in only part of the frames",),
    hand: (),
    bump: (),
    flicker: (),
    doubled: ("repeat",),
    dropped: (),
    blank_frames: ("black",),
    no_pole: ("no pole",),
}


def _without_pole(video):
    """Frames whose place of pole and rod shows what is beside it, mirrored."""
    light = np.median(video.empty, axis=0)
    dark = (light < 0.6 * np.median(light)).astype(np.uint8)
    dark[:, : light.shape[1] // 4] = 0  # the face
    dark = cv2.dilate(dark, np.ones((25, 25), np.uint8)).astype(bool)
    level = np.median(light[~dark])
    frames = video.frames.copy()
    rng = np.random.default_rng(0)
    frames[:, dark] = rng.normal(level, 2.5, (FRAMES, dark.sum())).clip(0, 255)
    return frames


# What comes of it -----------------------------------------------------------------------------


def try_scenes(folder, effort: Effort) -> Tried:
    """Analyse bad scenes without a touch."""
    seeds = range(effort.cases(SEEDS))
    events = [(FREE, event, seed) for event in MUST_SAY for seed in seeds]
    tried = Tried()
    _try(tried, folder, events)
    kinds = ", ".join(event.__name__.replace("_", " ") for event in MUST_SAY)
    tried.said = f"{kinds}; {tried.said}"
    return tried


def try_random(folder, effort: Effort) -> Tried:
    """Analyse scenes drawn at random, with something that happens in each."""
    rng, tried = np.random.default_rng([effort.seed, 4]), Tried()
    events = list(MUST_SAY)
    cases = [
        (str(rng.choice(PRESETS)), events[rng.integers(len(events))], int(rng.integers(1000)))
        for _ in range(effort.cases(RANDOM))
    ]
    _try(tried, folder, cases)
    return tried


def _try(tried, folder, cases):
    contacts = forces = 0
    for case, ending in zip(
        cases, each_in_child(functools.partial(_scene, folder), cases, LONGEST_S), strict=True
    ):
        preset, event, seed = case
        tried.cases += 1
        what = f"{preset}, {event.__name__}, {seed}"
        tried.check(not ending.fault, f"{what}: {last_line(ending.fault)}")
        faults, found, known = ending.value or ([], 0, 0)
        contacts, forces = contacts + found, forces + known
        tried.broken += [f"{what}: {fault}" for fault in faults]
    tried.said = f"{contacts} contacts found, {forces} of them with a force"


def _scene(folder, case):
    """What is wrong with the tables of a scene; contacts, and those of them with a force."""
    preset, event, seed = case
    video = rendered(preset, seed)
    path = folder / "scene.tif"
    tifffile.imwrite(path, event(video, np.random.default_rng(seed)), photometric="minisblack")
    try:
        analysis = analyse(path, video.settings)
    except VideoError as error:
        return [f"refused: {error}"] if preset == FREE else [], 0, 0
    contacts = analysis.contacts
    faults = [*_invented(contacts, video), *_numbers(analysis)]
    said = "; ".join(analysis.messages)
    words = MUST_SAY[event] if preset == FREE else ()
    if words and not any(word in said for word in words):
        faults.append(f"not said; the messages are: {said or 'none'}")
    return faults, len(contacts), int(contacts["peak_force_uN"].notna().sum())


def _invented(contacts, video):
    """Yield contacts where the whisker truly touches in no frame near."""
    for _, row in contacts.iterrows():
        stretch = slice(max(row["onset_frame"] - NEAR, 0), row["offset_frame"] + NEAR)
        if not video.touching[stretch].any():
            yield f"a contact in frames {row['onset_frame']}–{row['offset_frame']} is invented"


def _numbers(analysis):
    """Yield numbers that are infinite, and those that lack without a flag."""
    frames, contacts = analysis.frames, analysis.contacts
    for table in (frames, contacts):
        numbers = table.select_dtypes("number")
        infinite = numbers.columns[np.isinf(numbers.to_numpy(float)).any(axis=0)]
        if len(infinite):
            yield f"{infinite[0]} is infinite"
    lost = frames[~frames["tracked"]]
    for name in ("base_angle_deg", "curvature_per_m", "contact_force_uN"):
        if lost[name].notna().any():
            yield f"{name} is known in frames without a whisker"
    seen = frames[frames["tracked"]]
    if seen[["base_angle_deg", "follicle_x_px", "follicle_y_px"]].isna().any(axis=None):
        yield "a tracked whisker has no angle or place"
    without = contacts[contacts["peak_force_uN"].isna() & (contacts["flags"].fillna("") == "")]
    if len(without):
        yield "a contact has neither a force nor a flag"
