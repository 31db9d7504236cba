"""A first session.toml from a look at the videos, and a picture of what was found."""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from pipeline.detection.static_scene import StaticScene
from pipeline.errors import InputError, VideoError
from pipeline.run import trace
from pipeline.scene.dust import is_passed_over
from pipeline.scene.estimate import find_scenes, survey
from pipeline.session.inputs import PREVIEW_NAME, find_inputs
from pipeline.session.recording import Recording
from pipeline.session.session_file import settings_from, write_session
from pipeline.tables import files
from pipeline.tracking.registry import find_roster
from pipeline.tracking.tracker import options_for
from pipeline.video.open import open_video

LOOKED_AT = 3  # videos
ROSTER_FRAMES = 16
FRAMES_PER_SECOND = 1000.0
FIELD_OF_VIEW_MM = 25.0  # a usual width of the image, where no pole gives the scale
POLE_DIAMETER_MM = 0.5
SCALES = (1.0, 0.6, 1.6, 0.4, 2.5)  # of the usual one, tried in this order for the pole
COLOURS = [(200, 90, 0), (40, 40, 220), (0, 140, 60), (170, 0, 150), (0, 130, 200)]  # BGR


@dataclass(frozen=True)
class Look:
    """What was found in one video; `lines` are whiskers in `frame`, name → (n, 2) [px]."""

    path: Path
    scene: StaticScene
    pixels_per_mm: float
    frame: np.ndarray
    lines: dict[str, np.ndarray]

    @property
    def pole(self) -> tuple[float, float, float] | None:
        """(x, y, radius) [px]."""
        pole = self.scene.pole
        return None if pole is None else (pole.x_px[0], pole.y_px[0], pole.radius_px)


def init_folder(folder, overwrite: bool = False, say=lambda line: None) -> list[str]:
    """Write session.toml and a preview PNG into a folder of videos; return what to tell.

    `say` is called with a line before each video that is looked at.

    Raises
    ------
    InputError
        Where there is no readable video, or a session.toml already.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give a folder of videos")
    target = folder / "session.toml"
    if target.exists() and not overwrite:
        raise InputError(f"{target} is there already; --overwrite replaces it")
    looks = _look_at_some(folder, say)
    document, notes = findings(looks)
    write_session(target, settings_from(document, target), notes)
    with files.whole_file(folder / PREVIEW_NAME) as temporary:
        temporary.write_bytes(cv2.imencode(".png", preview(looks[0], document))[1])
    return _words(looks, document, target)


def _look_at_some(folder, say) -> list[Look]:
    """Look at the first, middle and last readable videos."""
    inputs = [each for each in find_inputs([folder]) if not each.fault]
    looks = []
    problems = [] if inputs else [f"{each.path}: {each.fault}" for each in find_inputs([folder])]
    places = np.unique(np.linspace(0, len(inputs) - 1, LOOKED_AT).astype(int)) if inputs else []
    rest = [i for i in range(len(inputs)) if i not in places]
    for i in (*places, *rest):
        if len(looks) == LOOKED_AT or (looks and i in rest):
            break
        say(f"looking at {inputs[i].path.name} …")
        try:
            looks.append(look_at(inputs[i].path))
        except VideoError as error:
            problems.append(str(error))
    if not looks:
        raise InputError("; ".join(problems) or f"{folder}: no videos or images in it")
    return looks


def look_at(path) -> Look:
    """Find face, pole, scale and whiskers in one video."""
    with open_video(path) as video:
        scene, sample, scale = _scene_and_scale(video)
        options = options_for(Recording(FRAMES_PER_SECOND, scale, scene.face_side))
    roster = find_roster(sample, scene, options)
    best, lines = sample[0], {}
    for frame in sample:
        found = _lines(frame, scene, roster, options) if roster else {}
        if len(found) > len(lines):
            best, lines = frame, found
    return Look(Path(path), scene, scale, best, lines)


def _scene_and_scale(video):
    """The typical scene, frames of it, and the scale [px/mm].

    The scale is from the pole's thickness, or else from the image's width.
    """
    usual = max(video.width, video.height) / FIELD_OF_VIEW_MM
    first = None
    for factor in SCALES:
        recording = Recording(FRAMES_PER_SECOND, usual * factor, None)
        seen = survey(video, recording)
        epochs = find_scenes(video, recording, 1e-3 * POLE_DIAMETER_MM, seen=seen)
        scene, frames = _typical_frames(video, seen, epochs, ROSTER_FRAMES)
        if scene.pole is not None and not _is_passed_over(scene, frames):
            return scene, frames, 2 * scene.pole.radius_px / POLE_DIAMETER_MM
        first = first or (replace(scene, pole=None), frames, usual)
    return first


def _typical_frames(video, seen, epochs, n: int):
    """The scene that holds for most of the video, and up to `n` of the frames `seen` of it."""
    held = defaultdict(int)
    for epoch in epochs:
        end = epoch.stop or max(video.n_frames or 0, epoch.start + 1)
        held[id(epoch.scene)] += end - epoch.start
    scene = max((e.scene for e in epochs if e.scene), key=lambda each: held[id(each)])
    indices, frames = seen.sample(n)
    own = [(e.start, e.stop or np.inf) for e in epochs if e.scene is scene]
    inside = [any(start <= i < stop for start, stop in own) for i in indices]
    return scene, frames[inside] if any(inside) else frames


def _is_passed_over(scene, frames) -> bool:
    """Whether whiskers pass over what was taken for the pole: it may be dust on a window."""
    place = (float(v) for v in (scene.pole.x_px[0], scene.pole.y_px[0], scene.pole.radius_px))
    noise = scene.noise_floor, scene.noise_gain
    return is_passed_over(*place, scene.background, noise, frames)


def _lines(frame, scene, roster, options):
    chunks = trace([frame], scene, roster, options)
    return {
        chunk.names[chunk.whisker[i]]: chunk.row(i) for chunk in chunks for i in range(len(chunk))
    }


def findings(looks):
    """What was found, in session.toml's shape, and a note for every value that is a guess."""
    first = looks[0]
    count = max(len(look.lines) for look in looks)
    poles = [look.pole for look in looks if look.pole]
    scale = np.median([look.pixels_per_mm for look in looks if look.pole or not poles])
    document = {
        "recording": {
            "frames_per_second": FRAMES_PER_SECOND,
            "pixels_per_mm": round(float(scale), 2),
            "face": first.scene.face_side,
        },
        "whisker": [{"name": f"w{i + 1}"} for i in range(count)],
        "pole": {"diameter_mm": POLE_DIAMETER_MM},
    }
    how = (
        f"GUESS from the pole, taken to be {POLE_DIAMETER_MM:g} mm thick"
        if poles
        else f"GUESS from the image's width, taken to be {FIELD_OF_VIEW_MM:g} mm"
    )
    notes = {
        "recording.frames_per_second": "GUESS, the files do not say",
        "recording.pixels_per_mm": f"{how}; measure it: forces depend on it",
        "recording.face": "found in the picture",
        "whisker.name": "found in the picture, anterior to posterior",
        "whisker.length_mm": "needed for forces, as the next two",
        "pole.diameter_mm": "GUESS",
        "pole.x_px": _pole_note(looks),
    }
    same = len(poles) == len(looks) and np.ptp(np.array(poles)[:, :2], axis=0).max() < 2
    if same:
        x, y, _ = np.mean(poles, axis=0)
        document["pole"] |= {"x_px": round(float(x), 1), "y_px": round(float(y), 1)}
    return document, notes


def _pole_note(looks) -> str:
    found = [
        f"({look.pole[0]:.0f}, {look.pole[1]:.0f}) in {look.path.name}" if look.pole else
        f"none in {look.path.name}"
        for look in looks
    ]  # fmt: skip
    return f"here: {', '.join(found)}"


def preview(look: Look, document) -> np.ndarray:
    """The video's frame with face, pole and whiskers drawn in, uint8 (height, width, 3), BGR."""
    zoom = max(1, round(900 / look.frame.shape[1]))
    picture = cv2.cvtColor(look.frame, cv2.COLOR_GRAY2BGR)
    picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)

    def pixels(points):
        return np.round(((np.asarray(points) + 0.5) * zoom - 0.5) * 16).astype(np.int32)

    face = cv2.resize(look.scene.face_mask.astype(np.uint8), picture.shape[1::-1])
    edges, _ = cv2.findContours(face, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, edges, -1, (0, 170, 230), 2, cv2.LINE_AA)
    if look.pole is not None:
        x, y, radius = look.pole
        centre = pixels([[x, y]])[0]
        cv2.circle(picture, centre, round(radius * zoom * 16), (60, 180, 60), 2, cv2.LINE_AA, 4)
    for i, (name, line) in enumerate(look.lines.items()):
        colour = COLOURS[i % len(COLOURS)]
        cv2.polylines(picture, [pixels(line)], False, colour, 2, cv2.LINE_AA, 4)
        place = pixels(line[len(line) // 2 : len(line) // 2 + 1])[0] // 16 + (4, -8)
        _write(picture, name, place, colour)
    recording = document["recording"]
    _write(picture, look.path.name, (8, 22), (30, 30, 30))
    words = f"face {recording['face']}, {recording['pixels_per_mm']:g} px/mm (guess)"
    _write(picture, words, (8, 44), (30, 30, 30))
    return picture


def _write(picture, words, place, colour):
    """Put words on a light ground into a picture."""
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.6
    (width, height), _ = cv2.getTextSize(words, font, size, 1)
    x, y = (int(v) for v in place)
    ground = picture[max(y - height - 3, 0) : y + 5, max(x - 3, 0) : x + width + 3]
    ground[:] = (0.3 * ground + 0.7 * 255).astype(np.uint8)
    cv2.putText(picture, words, (x, y), font, size, colour, 1, cv2.LINE_AA)


def _words(looks, document, target) -> list[str]:
    """Lines to print for the user."""
    pole = "a pole" if looks[0].pole else "no pole"
    names = ", ".join(look.path.name for look in looks)
    count = len(document["whisker"])
    return [
        f"looked at {names}",
        f"found: face at the {document['recording']['face']}, {pole}, "
        f"{count} {'whisker' if count == 1 else 'whiskers'}",
        f"wrote {target} and {target.parent / PREVIEW_NAME}",
        "now check the lines marked GUESS, and give the whiskers' dimensions to get forces",
    ]
