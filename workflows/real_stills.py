"""Contacts and forces of rendered whiskers in photographs of real rigs.

    python workflows/real_stills.py STILL.png … --labels tests/data/stills_by_eye.json

In each still the whiskers that an eye has followed are painted over with what lies beside them. In
their places rendered whiskers of about their length and bend move, and one of them touches the
photographed pole. So face, fur, light, pole and rod are real, while contacts and forces are known.
Others cross the touching one, or pass over the pole without touching it.

Each video is processed by `whiskerforce run`, with a table for every whisker in session.toml.
Lengths and hidden lengths there are off by what the standard errors assume. Whiskers do not turn
farther from frame to frame than at 500 frames/s.

Labels are those of `real_lines.py`, in the order along the face, and with each still `face` (the
side), `pole` (about where: x, y, radius [px]) and `touches` (number of the whisker that does).

How to read the table: *edges*: contacts whose onset and offset are both exact, or off by at most
one frame; *within*: peaks within 4 % or 0.1 µN; *coverage*: true peaks within ±1.96 standard
errors; in brackets the range of single videos.
"""

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import measuring
import numpy as np
import other_truth
import over_videos
import pages
import pandas as pd
import wrong_settings

from pipeline.numerics.robust import robust_sd
from pipeline.session.session_file import write_session
from synthetic.encode import video_suffix, write_video
from synthetic.motion import side_of_pole, smooth_noise
from synthetic.presets import Trial
from synthetic.render import Renderer
from synthetic.scene import Camera, Codec, Face, Hair, Lights, Pole, Scene
from synthetic.scoring import table_scoring
from synthetic.session import session_settings
from synthetic.staging import Setting, base_path, driven_motion, scene_touches, touching_motion
from synthetic.touches import UnreachableForceError
from synthetic.truth import contact_table
from whiskermodel.whisker import Whisker

FRAMES, RATE, SCALE = 400, 500.0, 22.0  # frames/s; px/mm, of unknown stills
BLUR_PX = 0.8
HIDDEN_PX = 33.0  # from the follicle to where a whisker leaves the face
BEYOND_BORDER = 1.3  # times what is seen, where the border cuts a whisker
NEAR_BORDER = 3  # px
BASE_RADIUS, LENGTH = 46e-6, 27e-3  # m: thickness grows with the square root of the length
TOUCHES, FORCES, DURATIONS = 9, (0.3e-6, 20e-6), (6, 80)  # N; frames
PAINTED_PX, FACE_GREY = 9, 12  # width of what is painted over; what is darker gets no light
OWN_WAY = 0.04  # rad, by which the other whiskers leave the way of the touching one
WITHIN, LEAST_UN = 0.04, 0.1
VIDEO = "whisker"  # as `other_truth.process` wants it called


# The photograph --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Still:
    """A photograph without its whiskers, and what an eye has seen in it.

    Attributes
    ----------
    name, face : of the file, without its ending; side of the picture
    light, without_face : float32 (height, width) [grey levels]
    noise : SD of a pixel in the light [grey levels]
    pole : x, y, radius [px]
    whiskers : points (n, 2) of each, base → tip [px]
    touches : number of the whisker that touches the pole
    """

    name: str
    face: str
    light: np.ndarray
    without_face: np.ndarray
    noise: float
    pole: tuple[float, float, float]
    whiskers: tuple
    touches: int


def read_still(path, labels) -> Still:
    """The still of a file, with its entry of the labels' list."""
    photo = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if photo is None:
        raise ValueError(f"{path}: no picture that can be read")
    name = Path(path).stem
    own = [entry for entry in labels if entry["video"] == name]
    if not own:
        raise ValueError(f"{name}: not among the labels")
    whiskers = tuple(np.array(each["xy"], float) for each in own[0]["whiskers"])
    hidden = np.zeros(photo.shape, np.uint8)
    for points in whiskers:
        cv2.polylines(hidden, [np.rint(points).astype(np.int32)], False, 255, PAINTED_PX)
    painted = cv2.inpaint(photo, hidden, 5, cv2.INPAINT_TELEA)
    smooth = cv2.fastNlMeansDenoising(painted, None, 4, 5, 15).astype(np.float32)
    lit = smooth > np.median(smooth)
    rough = painted - cv2.GaussianBlur(painted.astype(np.float32), (0, 0), 2)
    beyond = cv2.GaussianBlur(cv2.dilate(smooth, np.ones((61, 61))), (0, 0), 15)
    return Still(
        name=name,
        face=own[0]["face"],
        light=smooth,
        without_face=np.maximum(beyond, smooth),
        noise=float(robust_sd(rough[lit])),
        pole=pole_in(smooth, *own[0]["pole"]),
        whiskers=whiskers,
        touches=own[0]["touches"],
    )


def pole_in(light, x, y, radius) -> tuple[float, float, float]:
    """Circle (x, y, radius) [px] through the half levels of a pole's free edge, from near it."""
    angles, away = np.radians(np.arange(0, 360, 4)), np.arange(0.3, 1.8, 0.01) * radius
    px, py = x + np.outer(np.cos(angles), away), y + np.outer(np.sin(angles), away)
    rays = cv2.remap(light, px.astype(np.float32), py.astype(np.float32), cv2.INTER_CUBIC)
    inside, outside = rays[:, :20].mean(axis=1), np.median(rays[:, -30:], axis=1)
    free = outside > 0.8 * np.quantile(outside, 0.75)  # not where the rod is
    at = np.argmax(rays > 0.5 * (inside + outside)[:, None], axis=1)
    points = np.array([(px[k, at[k]], py[k, at[k]]) for k in np.flatnonzero(free)])
    near = np.ones(len(points), bool)
    for _ in range(5):
        design = np.column_stack([2 * points[near], np.ones(near.sum())])
        x, y, rest = np.linalg.lstsq(design, (points[near] ** 2).sum(axis=1), rcond=None)[0]
        radius = np.sqrt(rest + x**2 + y**2)
        near = np.abs(np.hypot(*(points - (x, y)).T) - radius) < 1.0
    return float(x), float(y), float(radius)


# Whiskers in it --------------------------------------------------------------------------------


def hair_like(points, name, touches, shape) -> tuple[Hair, float]:
    """A whisker like one followed by eye (n, 2) [px], and the angle of its base [rad]."""
    arc = np.append(0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    s = np.arange(0, arc[-1], 1.0)
    x, y = (np.interp(s, arc, values) for values in points.T)
    angle = np.unwrap(np.arctan2(-np.gradient(y), np.gradient(x)))  # y of the mechanics is up
    metres = 1e-3 / SCALE
    slope, first, at_base = np.polyfit((s + HIDDEN_PX) * metres, angle, 2)
    (width, height), tip = shape[::-1], points[-1]
    cut = min(*tip, width - 1 - tip[0], height - 1 - tip[1]) < NEAR_BORDER
    length = (arc[-1] * (BEYOND_BORDER if cut else 1.0) + HIDDEN_PX) * metres
    radius = BASE_RADIUS * np.sqrt(length / LENGTH)
    follicle = points[0] - HIDDEN_PX * np.array([np.cos(at_base), -np.sin(at_base)])
    whisker = Whisker(length, length / 0.95, radius, name=name)
    bend = float(first), float(2 * slope)
    place = follicle[0] * metres, -follicle[1] * metres
    return Hair(whisker, bend, *place, opacity=0.9, touches=touches), float(at_base)


def motion_in(still: Still, seed: int, codec: Codec):
    """The `Motion` of a still's whiskers, from a seed; None where a touch is not possible."""
    own = still.touches
    made = [
        hair_like(points, f"w{k + 1}", k == own, still.light.shape)
        for k, points in enumerate(still.whiskers)
    ]
    order = [own, *(k for k in range(len(made)) if k != own)]
    hairs, angles = zip(*(made[k] for k in order), strict=True)
    metres, (x, y, radius) = 1e-3 / SCALE, still.pole
    height, width = still.light.shape
    level = float(np.median(still.light[still.light > FACE_GREY]))
    camera = Camera(width, height, SCALE, RATE, BLUR_PX, black_level=0.0)
    scene = Scene(
        camera.with_noise_sd(still.noise, level),
        Lights(level),
        Face(still.face, angles[0]),
        hairs,
        Pole(x * metres, -y * metres, radius * metres, rod_direction=None),
        codec,
        seed=seed,
    )
    follicle = hairs[0].follicle_x, hairs[0].follicle_y
    side = side_of_pole(hairs[0], *follicle, angles[0], scene.pole.x, scene.pole.y)
    rng = np.random.default_rng(seed)
    setting = Setting("real_stills", seed, 0 if side > 0 else 1, rng, FRAMES)
    touches = scene_touches(setting, scene, TOUCHES, forces=FORCES, durations=DURATIONS)
    try:
        alone = touching_motion(setting, scene, touches)
    except UnreachableForceError:
        return None
    touching = alone.hairs[0].contact
    turn = touching.base_angle - angles[0]  # of the whole row
    drives = [(touching.base_x, touching.base_y, touching.base_angle)]
    for hair, angle in zip(hairs[1:], angles[1:], strict=True):
        own_way = OWN_WAY * smooth_noise(FRAMES, RATE, 0.1, rng)
        drives.append((*base_path(scene, hair, FRAMES, rng), angle + turn + own_way))
    return driven_motion(scene, drives)


# Found and true --------------------------------------------------------------------------------


def compared(still: Still, seed: int, codec: Codec):
    """`ContactMatch` of a video with the seed; None where a touch is not possible."""
    motion = motion_in(still, seed, codec)
    if motion is None:
        return None
    renderer = Renderer(motion.scene, motion, seed, (still.light, still.without_face))
    settings = session_settings(Trial("", VIDEO, motion), renderer)
    tables = sorted(settings.whisker, key=lambda each: int(each.name[1:]))  # along the face
    settings = settings.model_copy(update={"whisker": tuple(tables)})
    settings = wrong_settings.with_wrong_lengths(settings, np.random.default_rng([seed, 1]))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        frames = (renderer.frame(i) for i in range(len(renderer)))
        write_video(folder / f"{VIDEO}{video_suffix(codec)}", frames, codec)
        write_session(folder / "session.toml", settings)
        found = other_truth.process(folder).contacts
    return table_scoring.match_contacts(found, contact_table(motion, VIDEO))


def peak_errors(match):
    """Of every contact found: relative error of the peak, whether that is small, and covered."""
    true = match.pairs["true_peak_force_uN"].to_numpy(float)
    error = match.pairs["peak_force_uN"].to_numpy(float) - true
    limit = table_scoring.Z95 * match.pairs["peak_force_se_uN"].to_numpy(float)
    small = np.abs(error) <= np.maximum(WITHIN * true, LEAST_UN)
    return np.abs(error) / true, small, np.abs(error) <= limit


def row_of(still: Still, stored: str, matches) -> list[str]:
    """One row of the table."""
    together = {name: pd.concat([getattr(m, name) for m in matches]) for name in FIELDS}
    every = table_scoring.ContactMatch(**together)
    errors = zip(*map(peak_errors, matches), strict=True)
    return [
        still.name,
        stored,
        str(len(still.whiskers)),
        str(len(matches)),
        str(len(every.pairs) + len(every.missed)),
        str(len(every.missed)),
        str(len(every.invented) + len(every.surplus)),
        *(pages.cell("{:.1%}", table_scoring.edges_within(every, frames)) for frames in (0, 1)),
        *(
            pages.cell_and_ends(form, *over_videos.with_range(list(each), statistic))
            for each, form, statistic in zip(errors, FORMS, STATISTICS, strict=True)
        ),
    ]


FORMS, STATISTICS = ("{:.2%}", "{:.1%}", "{:.1%}"), (np.median, np.mean, np.mean)
FIELDS = "pairs", "missed", "invented", "surplus"
HEADER = [
    "still", "stored", "whiskers", "videos", "contacts", "missed", "invented or split",
    "edges exact", "≤ 1 frame", "peak force: median error", "within 4 % or 0.1 µN", "coverage",
]  # fmt: skip


def matches_in(still: Still, seed: int, videos: int, codec: Codec):
    """Yield the `ContactMatch` of so many videos."""
    for each in measuring.video_seeds(still.name, seed, 3 * videos):
        match = compared(still, each, codec) if videos else None
        if match is not None:
            videos -= 1
            yield match


def main(argv=None) -> int:
    """Render, process and compare."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("stills", nargs="+", type=Path)
    parser.add_argument("--labels", type=Path, required=True)
    parser.add_argument("--videos", type=int, default=10, help="of each still")
    parser.add_argument("--crf", type=int, help="stored as H.264, too")
    measuring.add_seed(parser, "of the motions and the noise")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    codecs = {"lossless": Codec()}
    if args.crf is not None:
        codecs[f"H.264, crf {args.crf}"] = Codec("h264", crf=args.crf)
    labels, rows = json.loads(args.labels.read_text("utf-8")), []
    for path in args.stills:
        still = read_still(path, labels)
        for stored, codec in codecs.items():
            matches = list(matches_in(still, args.seed, args.videos, codec))
            rows.append(row_of(still, stored, matches))
    text = (
        f"{FRAMES} frames per video, drawn from seed {args.seed}.\n\n{pages.table(HEADER, rows)}"
    )
    pages.publish(text, args.write, "real stills")
    return 0


if __name__ == "__main__":
    measuring.limit_threads()
    sys.exit(main())
