"""A first session.toml from a look at the videos, and a picture of what was found."""

import os
from collections import Counter, defaultdict
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline import run
from pipeline.app.preview import pole_in_words, preview_of, write_preview
from pipeline.detection.static_scene import StaticScene
from pipeline.errors import InputError, VideoError, counted, need_folder, why
from pipeline.numerics.runs import spread
from pipeline.run import Seen, find_whiskers
from pipeline.scene.dust import is_passed_over
from pipeline.scene.epochs import numbers_at, typical_epoch, without_pole
from pipeline.scene.estimate import OTHER_SIZES, find_scenes, still_states, survey
from pipeline.scene.pole_search import DUST, SURE
from pipeline.scene.preparation import prepare_video
from pipeline.scene.scale import FIELD_MM, scale_of, working_scale
from pipeline.session.input_settings import PREVIEW_NAME, SETTINGS_NAME, check_settings_name
from pipeline.session.inputs import find_inputs
from pipeline.session.recording import Recording
from pipeline.session.session_file import read_session, session_text, settings_from
from pipeline.tables import whole_files
from pipeline.tracking.snout import snout_of
from pipeline.tracking.two_sides import counted_names, names_by_side
from pipeline.tracking.whiskers import TEMPLATE_FRAMES, tracing_options
from pipeline.video.open import open_video

ENOUGH = 3  # videos that show whiskers, and one of them a pole …
MOST = 9  # … or so many videos, are looked at
FRAMES_PER_SECOND = 1000.0
POLE_DIAMETER_MM = 0.5


@dataclass(frozen=True)
class Look:
    """What was found in one video: what stands still, the scale, and names for the whiskers.

    `snout` is the picture's side that it is nearest to, None where both sides of a face are seen.
    `seen` is what `run` sees with the settings that follow from this video alone.
    """

    path: Path
    scene: StaticScene
    pixels_per_mm: float
    names: tuple[str, ...] = ()
    snout: str | None = None
    seen: Seen | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture [px]."""
        return self.scene.face_mask.shape[::-1]

    @property
    def view(self) -> str:
        """What all videos of one session.toml have in common."""
        return f"{self.size[0]}×{self.size[1]} px, face at the {self.scene.face_side}"

    @property
    def pole(self) -> tuple[float, float, float] | None:
        """(x, y, radius) [px]."""
        pole = self.scene.pole
        return None if pole is None else (pole.x_px[0], pole.y_px[0], pole.radius_px)


def init_folder(folder, overwrite=False, config=None, say=lambda line: None) -> list[str]:
    """Write session.toml and a preview PNG into a folder of videos; return lines to print.

    Where there is a session.toml already, or one is given (`config`), it is kept, and the preview
    shows what it finds; `overwrite` renames it and writes another. `say` is called with a line
    before each video that is looked at, and for each that cannot be read.

    Raises
    ------
    InputError
        Where there is no readable video, or a session.toml by another name, or nothing can be
        written.
    SettingsError
        Where the session.toml that is there cannot be used.
    """
    folder = Path(folder)
    need_folder(folder, "a folder of videos")
    try:
        whole_files.try_writing(folder)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot write {SETTINGS_NAME} and the preview there ({why(error)}); make a "
            "folder of your own with links to the videos, or copies, and `init` that"
        ) from None
    target = folder / SETTINGS_NAME
    if config is not None or (target.exists() and not overwrite):
        return _show(folder, Path(config or target), say)
    check_settings_name(folder)
    with ExitStack() as opened:
        looks, count = _look_at_some(folder, lambda path: look_at(path, opened), ENOUGH, say)
        alike = next(iter(by_view(looks).values()))
        document, notes = findings(alike, len(looks) == count)
        shown = _best(alike)
        look = looks[shown]
        seen = look.seen if _document(look) == document else None
        preview = preview_of(look.path, settings_from(document, target), seen)
    document["whisker"] = [{"name": name} for name in preview.names]
    settings = settings_from(document, target)
    old = whole_files.replace_text(target, session_text(settings, notes))
    kept = [f"the earlier settings are kept as {old}"] if old else []
    kept += write_preview(folder / PREVIEW_NAME, preview)
    return [*_seen_in_words(looks, count, shown, preview), *_next(looks, preview, target), *kept]


def _show(folder, session, say) -> list[str]:
    """Show what is found with a session.toml that a person may have corrected."""
    settings = read_session(session)
    with ExitStack() as opened:
        looks, count = _look_at_some(
            folder, lambda path: _look_with(settings, path, opened), 1, say
        )
        shown = _best(looks)
        preview = preview_of(looks[shown].path, settings, looks[shown].seen)
    kept = write_preview(folder / PREVIEW_NAME, preview)
    return [
        f"{session} is kept (--overwrite writes a new {folder / SETTINGS_NAME})",
        *_seen_in_words(looks, count, shown, preview),
        f"wrote {folder / PREVIEW_NAME}",
        *kept,
    ]


def _look_at_some(folder, look, enough, say) -> tuple[dict, int]:
    """What `look` finds in videos from all over the folder, by what they are called.

    In some trials the pole is out of reach, or no whisker is in view; so more videos are looked
    at until `enough` show whiskers, and one of them a pole. Second, how many videos there are.
    """
    found = find_inputs([folder])
    inputs = [each for each in found if not each.fault]
    looks, problems = {}, [] if inputs else [f"{each.path}: {each.fault}" for each in found]
    called, count = called_apart([each.path for each in inputs]), len(inputs)
    for i in spread(len(inputs)):
        showing = [each for each in looks.values() if each.names]
        if len(looks) == MOST or (len(showing) >= enough and any(each.pole for each in showing)):
            break
        say(f"looking at {called[i]} …")
        try:
            looks[i] = look(inputs[i].path)
        except VideoError as error:
            problems.append(str(error))
            count -= 1
    if not looks:
        raise InputError("; ".join(problems) or f"{folder}: no videos or images in it")
    for problem in problems:
        say(f"left out: {problem}")
    return {called[i]: looks[i] for i in sorted(looks)}, count


def by_view(looks) -> dict[str, dict[str, Look]]:
    """The looks that are alike, by their view; the view with most whiskers comes first.

    A video without whiskers tells nothing of the face; it counts where none shows any.
    """
    views = defaultdict(dict)
    for name, look in looks.items():
        if look.names or not any(each.names for each in looks.values()):
            views[look.view][name] = look
    whiskers = {view: sum(len(each.names) for each in of.values()) for view, of in views.items()}
    return {view: views[view] for view in sorted(views, key=whiskers.get, reverse=True)}


def _best(looks) -> str:
    """What the video is called that shows most whiskers, if possible with a pole."""
    return max(looks, key=lambda name: (len(looks[name].names), looks[name].pole is not None))


def called_apart(paths) -> list[str]:
    """What files are called: by their names, with folders where these differ."""
    base = os.path.commonpath([path.parent for path in paths]) if paths else ""
    return [path.relative_to(base).as_posix() for path in paths]


def look_at(path, opened: ExitStack) -> Look:
    """Find face, pole, scale and whiskers in one video, which stays open as long as `opened`."""
    video = opened.enter_context(open_video(path))
    prepared = prepare_video(video)
    scene, scale = _scene_and_scale(prepared)
    settings = settings_from(_document(Look(Path(path), scene, scale)))
    seen = find_whiskers(*run.look_at(video, settings, prepared), settings)
    likely, side = seen.whisker_set.templates, scene.face_side
    if not likely:
        return Look(Path(path), without_pole(scene), _usual_scale(video))
    names = counted_names(likely, side, tracing_options(settings, video.shape))
    snout = None if names_by_side(names, side) else snout_of(likely, side)
    return Look(Path(path), scene, scale, names, snout, seen)


def _look_with(settings, path, opened: ExitStack) -> Look:
    """What these settings find in one video, which stays open as long as `opened`."""
    video, settings = opened.enter_context(open_video(path)), settings.without_bare_whiskers()
    seen = find_whiskers(*run.look_at(video, settings), settings)
    scene = typical_epoch(seen.epochs, video.n_frames).scene
    scale = settings.recording.pixels_per_mm
    return Look(Path(path), scene, scale, seen.whisker_set.found, seen=seen)


def _document(look):
    """What was found in one video alone, in session.toml's shape."""
    return findings({look.path.name: look})[0]


def _usual_scale(video) -> float:
    """Pixels per mm where the picture shows as much as is usual."""
    return max(scale_of(video.shape, FIELD_MM), 1.0)  # the least that settings take


def _scene_and_scale(look):
    """The typical scene, and the scale [px/mm].

    The scale is from the pole's thickness, or else from the image's size. Of discs found at
    several scales, the one most similar to a pole's end is the pole; no more are tried once one
    surely is.
    """
    usual, first, best, known = _usual_scale(look.video), None, None, {}
    for factor in (1.0, *OTHER_SIZES):
        recording = Recording(FRAMES_PER_SECOND, usual * factor, None)
        scale = working_scale(look.video.shape, recording.pixels_per_mm)
        if scale not in known:
            known[scale] = still_states(survey(look, recording), recording)
        still, pole = known[scale], 1e-3 * POLE_DIAMETER_MM
        epochs = find_scenes(look.video, recording, pole, still=still)
        scene, frames = _typical_frames(look.video, still.survey, epochs)
        first = first or (replace(scene, pole=None), usual)
        if scene.pole is None or (scene.pole_likeness < DUST and _is_passed_over(scene, frames)):
            continue
        if best is None or scene.pole_likeness > best[0].pole_likeness:
            best = scene, 2 * scene.pole.radius_px / POLE_DIAMETER_MM
        if scene.pole_likeness > SURE:
            break
    return best or first


def _typical_frames(video, seen, epochs):
    """The scene that holds longest, if possible one with a pole, and frames `seen` of it."""
    scene = typical_epoch(epochs, video.n_frames).scene
    indices, frames = seen.sample(TEMPLATE_FRAMES)
    inside = [epochs[k].scene is scene for k in numbers_at(indices, epochs)]
    return scene, frames[inside] if any(inside) else frames


def _is_passed_over(scene, frames) -> bool:
    """Whether whiskers pass over what was taken for the pole: it may be dust on a window."""
    place = (float(v) for v in (scene.pole.x_px[0], scene.pole.y_px[0], scene.pole.radius_px))
    noise = scene.noise_floor, scene.noise_gain
    return is_passed_over(*place, scene.background, noise, frames)


def findings(looks, all_videos=True):
    """What was found, in session.toml's shape, and a note for every value that is a guess.

    looks : `Look` of each video, all of one view, by what it is called
    all_videos : there are no others that session.toml will be for
    """
    first, *_ = found = list(looks.values())
    names = max((look.names for look in found), key=len)
    poles = [look.pole for look in found if look.pole]
    scale = np.median([look.pixels_per_mm for look in found if look.pole or not poles])
    document = {
        "recording": {
            "frames_per_second": FRAMES_PER_SECOND,
            "pixels_per_mm": round(float(scale), 2),
            "face": first.scene.face_side,
        },
        "whisker": [{"name": name} for name in names],
        "pole": {"diameter_mm": POLE_DIAMETER_MM},
    }
    snout = _snout(found)
    if snout:
        document["recording"]["snout"] = snout
    everywhere = all_videos and len(poles) == len(found)
    if everywhere and np.ptp(np.array(poles)[:, :2], axis=0).max() < 2:
        x, y, _ = np.mean(poles, axis=0)
        document["pole"] |= {"x_px": round(float(x), 1), "y_px": round(float(y), 1)}
    return document, _notes(looks, snout, scale)


def _notes(looks, snout, scale) -> dict:
    """What the user should know of a value, by its key; a guess begins with GUESS."""
    first = next(iter(looks.values()))
    width, height = (size / scale for size in first.size)
    how = (
        f"GUESS from the pole, taken to be {POLE_DIAMETER_MM:g} mm thick"
        if any(look.pole for look in looks.values())
        else f"GUESS, as if the image showed {width:.3g} mm × {height:.3g} mm"
    )
    return {
        "recording.frames_per_second": "GUESS, it is set at the camera or its trigger",
        "recording.pixels_per_mm": f"{how}; measure it: forces depend on it",
        "recording.face": "found in the picture",
        "recording.snout": "GUESS, whiskers look thinner there" if snout else "",
        "whisker.name": "found in some frames, numbered from the snout on; `run` may know others: "
        "every whisker that it sees is followed until one here has a dimension or another name",
        "whisker.length_mm": "needed for forces, as cone_length_mm and base_radius_um are",
        "pole.diameter_mm": "GUESS",
        "pole.x_px": _pole_note(looks),
    }


def _snout(looks) -> str | None:
    """Side of the snout in most of the looks, weighted by how many whiskers each one shows."""
    votes = Counter()
    for look in looks:
        if look.snout:
            votes[look.snout] += len(look.names)
    return max(votes, key=votes.get, default=None)


def _pole_note(looks) -> str:
    seen = [f"{pole_in_words(look.scene.pole)} in {name}" for name, look in looks.items()]
    return f"here: {', '.join(seen)}"


def _seen_in_words(looks, count, shown, preview):
    """Lines on the videos that were looked at, of so many; `shown` is in the picture."""
    which = f" (of {count} videos)" if count > len(looks) else ""
    which += f"; {shown} is in the picture" if len(looks) > 1 else ""
    yield f"looked at {', '.join(looks)}{which}"
    yield from preview.words()
    others = [
        f"{name}: {pole_in_words(look.scene.pole)}, {counted(len(look.names), 'whisker')}"
        for name, look in looks.items()
        if name != shown
    ]
    if others:
        yield f"in the others: {'; '.join(others)}"


def _next(looks, preview, target):
    """Lines on what was written, and what to do with it."""
    yield from _unlike(looks)
    yield f"wrote {target} and {target.parent / PREVIEW_NAME}"
    advice = "next: check the lines marked GUESS"
    if preview.names:
        advice += (
            ", and add the whiskers' dimensions if you want forces, best after a first `run`, "
            "which looks at all frames and may know fewer whiskers, or more, as its messages say"
        )
    yield (
        f"{advice}; then run `init` again: it shows what is found with the corrected file, and "
        "which whisker has which name"
    )


def _unlike(looks):
    """A line where videos are of several cameras or views: one session.toml is for one of them."""
    views = by_view(looks)
    if len(views) > 1:
        found = "; ".join(f"{view} ({', '.join(names)})" for view, names in views.items())
        yield (
            f"these videos are not alike: {found}: this session.toml is for the first of these; "
            "give each camera's videos a folder and a session.toml of their own"
        )
