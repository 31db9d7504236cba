"""A picture of what the settings in force find in a video, with the names that a run gives."""

from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from pipeline.detection.static_scene import StaticScene
from pipeline.errors import counted
from pipeline.messages import guessed_order, no_whiskers, pole_doubt, settings_doubt, value_doubts
from pipeline.reports.drawing import INK, PAPER, SHIFT, View, name_boxes
from pipeline.reports.lettering import line_height, put_text
from pipeline.reports.overlay import write_png
from pipeline.reports.whisker_styles import DARKEST, pieces, whisker_styles
from pipeline.run import Seen, find_whiskers, look_at, trace
from pipeline.scene.epochs import numbers_at, typical_epoch
from pipeline.scene.picture_part import part_of
from pipeline.session.schema import Settings
from pipeline.tables.known_names import KNOWN, in_short, nameless
from pipeline.tracking.whiskers import tracing_options
from pipeline.video.changed import Negative
from pipeline.video.open import open_video

STRETCH = 48  # frames that are traced for the picture
GREY = (130, 130, 130)  # BGR, as those that follow: a line whose name is not known
FACE, POLE, REGION = (0, 170, 230), (60, 180, 60), (160, 60, 160)
DARK = 80  # grey level, median: of a darker picture
GROUND = {False: PAPER, True: INK}  # about words
WIDTH = 900  # px, about that of the picture


@dataclass(frozen=True)
class Preview:
    """What the settings find in one video.

    Attributes
    ----------
    path, settings : of which video, with which settings
    scene : what stands still
    frame : uint8 (height, width), the frame in which most is found
    lines : name → points (n, 2) of a whisker in that frame [px]
    known : names that are sure
    names : all whiskers that are followed; other `lines` are never known to be a whisker's
    doubts : sentences on what should be looked at before anything else
    unseen : those of `names` that are on no line of the frames that were looked at
    """

    path: Path
    settings: Settings
    scene: StaticScene
    frame: np.ndarray
    lines: dict[str, np.ndarray]
    known: frozenset[str]
    names: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()

    def words(self) -> list[str]:
        """What was found, and what is doubtful, in a sentence each."""
        place = pole_in_words(self.scene.pole)
        seen = [name for name in self.names if name not in self.unseen]
        count = counted(len(seen), "whisker")
        found = f"found: face at the {self.scene.face_side}, {place}, {count}"
        if seen:
            found += f" ({in_short(seen)})"
        if self.unseen:
            found += f"; in none of the frames looked at: {in_short(self.unseen)}"
        if self.lines.keys() - self.known:
            found += "; grey in the picture: not sure which whisker"
        elsewhere = [name for name in seen if name not in self.lines]
        if elsewhere:
            found += f"; not in the picture's frame: {in_short(elsewhere)}"
        return [found, *self.doubts]


def pole_in_words(pole) -> str:
    """Where a `PoleTrack` is, if there is one."""
    return "no pole" if pole is None else f"a pole at ({pole.x_px[0]:.0f}, {pole.y_px[0]:.0f})"


def preview_of(path, settings: Settings, seen: Seen | None = None) -> Preview:
    """Look at a video as `run` does, and follow the whiskers through a stretch of it.

    `seen`: what is seen in the video with these settings, if that is known, and it is open.
    """
    settings = settings.without_bare_whiskers()
    with ExitStack() as opened:
        if seen is None:
            video = opened.enter_context(open_video(path))
            seen = find_whiskers(*look_at(video, settings), settings)
        video, whisker_set = seen.video, seen.whisker_set
        start, count, scene = _stretch(seen)
        stretch = list(islice(video.frames(start), count))
        options = tracing_options(settings, video.shape)
        chunks = []
        if whisker_set.templates:
            chunks = list(trace(iter(stretch), scene, whisker_set, options, STRETCH))
        part = part_of(settings.image, video)
    rows = {frame: lines for each in chunks for frame, lines in _lines_by_frame(each).items()}
    best = max(rows, key=lambda k: _known_and_all(rows[k]), default=0)
    lines, traced = rows.get(best, {}), set().union(*rows.values())
    frame = np.invert(stretch[best]) if isinstance(video, Negative) else stretch[best]
    frame = frame if part is None else part.shown(frame)
    return Preview(
        path=Path(path),
        settings=settings,
        scene=scene,
        frame=frame,
        lines={name: points for name, (points, _) in lines.items()},
        known=frozenset(name for name, (_, c) in lines.items() if c >= KNOWN),
        names=whisker_set.given or whiskers_in(chunks),
        doubts=_doubts(settings, seen, scene),
        unseen=tuple(name for name in whisker_set.given if name not in traced),
    )


def _doubts(settings, seen, scene) -> tuple[str, ...]:
    """The main doubts that a run would report, and what to do about them."""
    doubt = settings_doubt(settings, seen)
    if doubt is None and not seen.whisker_set.templates:
        doubt = no_whiskers(settings, seen)
    size = pole_doubt(settings, seen, scene.pole)
    order = guessed_order(settings, seen.whisker_set) if settings.whisker else ()
    main = filter(None, (doubt, size))
    return (*main, *value_doubts(settings, seen.video), *order)


def whiskers_in(chunks) -> tuple[str, ...]:
    """The names in `Centrelines`, without the numbers of lines that are no known whisker's."""
    names = [each.names[number] for each in chunks for number in each.whisker]
    without = nameless(names, [sure for each in chunks for sure in each.confidence])
    every = dict.fromkeys(name for each in chunks for name in each.names)
    return tuple(name for name in every if name not in without)


def _known_and_all(lines):
    """Number of lines whose names are sure, and of all lines."""
    return sum(confidence >= KNOWN for _, confidence in lines.values()), len(lines)


def _stretch(seen):
    """Frames in the middle of the video's typical epoch, the first and how many; its scene."""
    epoch = typical_epoch(seen.epochs, seen.video.n_frames)
    own = seen.frames[[seen.epochs[k] is epoch for k in numbers_at(seen.frames, seen.epochs)]]
    start = int(own[len(own) // 2]) if len(own) else epoch.start
    if epoch.stop is None:
        return start, STRETCH, epoch.scene
    start = max(min(start, epoch.stop - STRETCH), epoch.start)
    return start, min(STRETCH, epoch.stop - start), epoch.scene


def _lines_by_frame(chunk):
    """Frame → name → points (n, 2) and confidence, of centrelines."""
    out = {}
    for (frame, name, points), sure in zip(chunk.each(), chunk.confidence, strict=True):
        out.setdefault(frame, {})[name] = points, float(sure)
    return out


# ---- the picture --------------------------------------------------------------------------


def write_preview(path, preview: Preview) -> list[str]:
    """Draw the preview and write it as PNG; as `overlay.write_png`."""
    return write_png(path, draw(preview))


def draw(preview: Preview) -> np.ndarray:
    """The frame with face, pole and whiskers drawn in, uint8 (height, width, 3), BGR."""
    zoom = max(1, round(WIDTH / preview.frame.shape[1]))
    picture = cv2.cvtColor(preview.frame, cv2.COLOR_GRAY2BGR)
    picture = cv2.resize(picture, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)
    view = View(0, 0, *preview.frame.shape[::-1], zoom)
    _draw_scene(picture, preview, view)
    _draw_lines(picture, preview, view)
    recording = preview.settings.recording
    size = view.letters
    put_text(picture, preview.path.name, (8, 4), INK, size, PAPER)
    words = f"face {recording.face}, {recording.pixels_per_mm:g} px/mm"
    put_text(picture, words, (8, 4 + line_height(size)), INK, size, PAPER)
    return picture


def _draw_lines(picture, preview, view):
    """The whiskers, each in its style; those that are not known in grey, and without a number."""
    styles, is_dark = whisker_styles(preview.names), np.median(preview.frame) < DARK
    known = {name: styles[name] for name in preview.lines if name in preview.known & styles.keys()}
    places = {name: view.places(line) for name, line in preview.lines.items()}
    colours = dict.fromkeys(places, GREY)
    for name, style in known.items():
        colours[name] = PAPER if is_dark and style.colour == DARKEST else _bgr(style.colour)
    for name, line in places.items():
        drawn = pieces(line, [2 * part for part in known[name].dash] if name in known else ())
        drawn = [np.round(each * 2**SHIFT).astype(np.int32) for each in drawn]
        cv2.polylines(picture, drawn, False, colours[name], 2, cv2.LINE_AA, SHIFT)
    for name, (x, y, _, _) in name_boxes(places, view).items():
        shown = name if name in styles else "?"
        put_text(picture, shown, (x, y), colours[name], view.letters, GROUND[bool(is_dark)])


def _bgr(colour: str) -> tuple[int, ...]:
    return tuple(int(colour[k : k + 2], 16) for k in (5, 3, 1))


def _draw_scene(picture, preview, view):
    """Edge of the face, pole, region."""
    face = cv2.resize(preview.scene.face_mask.astype(np.uint8), picture.shape[1::-1])
    edges, _ = cv2.findContours(face, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, edges, -1, FACE, 2, cv2.LINE_AA)
    pole, region = preview.scene.pole, preview.settings.image.region_px
    if pole is not None:
        centre = view.pixels([pole.x_px[0], pole.y_px[0]])
        radius = round(pole.radius_px * view.zoom * 2**SHIFT)
        cv2.circle(picture, centre, radius, POLE, 2, cv2.LINE_AA, SHIFT)
    if region is not None:
        corners = view.pixels([region[:2], region[2:]])
        cv2.rectangle(picture, corners[0], corners[1], REGION, 1, cv2.LINE_AA, SHIFT)
