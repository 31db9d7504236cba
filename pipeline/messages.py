"""Messages about one video: what is missing or doubtful, and what to do."""

from collections import defaultdict
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.contacts.probability import bent_elsewhere
from pipeline.errors import counted
from pipeline.scene.face import thickening_towards
from pipeline.scene.picture_part import region_doubt
from pipeline.scene.what_was_seen import seen_instead_of_pole, seen_instead_of_whiskers
from pipeline.session.plausibility import MOST_NAMED, doubtful_values
from pipeline.session.schema import DIMENSIONS, SIDES, UPRIGHT
from pipeline.tables.columns import split_flags
from pipeline.tables.known_names import KNOWN, in_short, nameless_in
from pipeline.tables.video_messages import NO_POLE
from pipeline.tracking.given_lengths import posterior_first
from pipeline.tracking.snout import snout_of
from pipeline.video.changed import Negative
from pipeline.video.frame_faults import BLACK

SELDOM_TRACKED = 0.8  # a whisker seen in less than this part of the frames is worth a message
SELDOM_CURVED = 0.5  # so is one whose curvature is known in less than this part of its lines
OTHER_THICKNESS = 0.12  # of the pole, relative: more is no error of measurement
MOST_UNKNOWN = 0.2  # of what is tracked: more is worth the first message
CONTRADICTED, NEVER_FREE = "base_contradicted", "no_rest_curvature"  # flags of contacts
DARK = 64  # grey levels of 255, median: no light behind the whiskers
LIGHT = 128  # a picture of a lighter median is no dark ground for bright whiskers
ON_A_SIDE = tuple(f"{side}_" for side in (*SIDES, *UPRIGHT))
SELDOM_BENT = 0.05  # of the frames: where lines have left their whisker, they look bent, too
SELDOM_ACROSS = 1  # frame may be a mistake; a whisker more often across the pole is worth one


class Advice(NamedTuple):
    """What to do about a pole that is not found, and whiskers that are lost.

    no_pole : the whole message; lost : in every frame; seldom : in many frames
    """

    no_pole: str
    lost: str
    seldom: str


GIVEN_LINES = Advice(
    no_pole="no contacts: traced lines do not show where the pole is; give [pole] x_px, y_px in "
    "session.toml, and import again",
    lost="if they were traced, name their lines so in the program that traced them, and import "
    "again; if not, take their [[whisker]] tables out",
    seldom="where they are in view, trace them in the other program, and import again",
)


def messages(settings, tables, seen, followed):
    """Sentences on what is missing or doubtful in one video, the main doubt first.

    seen : `pipeline.run.Seen`, at first; followed : the `Kinematics` of all frames
    """
    whisker_set = followed.whisker_set
    doubt = settings_doubt(settings, seen)
    if doubt:
        yield doubt
    yield from value_doubts(settings, seen.video)
    yield from _too_few_frames(seen.video, followed.n_frames)
    yield from seen.video.problems()
    if not whisker_set.templates and not settings.analysis.follow:
        if seen.odd is not None:
            yield "no whiskers found"
        elif doubt is None:
            yield no_whiskers(settings, seen)
        return
    numbered, nameless = not settings.whisker, nameless_in(tables.frames)
    order = guessed_order(settings, whisker_set, nameless)
    yield from _unknown_names(tables.frames, nameless if numbered else ())
    yield from _unnamed_whiskers(settings, followed)
    if not numbered:
        yield from order
    yield from _assumed_place(settings, followed.pole)
    yield from _of_whiskers(settings, tables, followed, _advice(settings, seen))
    if numbered:
        yield from order
        yield from _not_whiskers(tables.frames, nameless)


def settings_doubt(settings, seen) -> str | None:
    """Message about settings that the lines of the first look contradict; None: none."""
    if seen.odd is not None:
        return _of_another_length(settings, seen.odd)
    whiskers, refused = seen.whisker_set.templates, seen.whisker_set.refused
    return face_message(_scenes(seen), whiskers, settings.recording.face, refused)


def value_doubts(settings, video):
    """Values of the settings that can hardly be true, or do not suit the picture."""
    region = region_doubt(settings.image, video)
    if region:
        yield region
    yield from doubtful_values(settings)


def _scenes(seen) -> list:
    return [epoch.scene for epoch in seen.epochs if epoch.scene]


def line_messages(settings, tables, followed):
    """Sentences on what is missing or doubtful in the lines that another program traced."""
    yield from doubtful_values(settings)
    if followed.whisker_set.templates:
        yield from _unknown_names(tables.frames)
        yield from _of_whiskers(settings, tables, followed, GIVEN_LINES)
    else:
        yield (
            "no line is a whisker's: all are too short, or have no name; name the whiskers in the "
            "program that traced them, and import again"
        )


def _of_whiskers(settings, tables, followed, advice):
    """What is missing or doubtful of the whiskers themselves, the pole and the forces."""
    whisker_set = followed.whisker_set
    if followed.pole is None:
        yield advice.no_pole
    yield from _never_tracked(settings.analysis.follow, whisker_set, advice.lost)
    yield from _seldom_tracked(tables.frames, whisker_set, advice.seldom)
    doubt = _size_doubt(settings, followed.pole)
    if doubt:
        yield doubt
    yield from _passes_over(settings, tables, followed.pole)
    yield from _bent_elsewhere(tables, followed.pole)
    yield from _contradicted(settings, tables.contacts)
    yield from _without_forces(settings, whisker_set)
    yield from _never_free(settings, tables.contacts)
    yield from _too_short(settings, tables.frames)


def _too_few_frames(video, count):
    """A video that is cut short, or is one picture."""
    if video.ended_by is None and video.exact_count and count < video.n_frames:
        yield (
            f"only {count} of {video.n_frames} frames could be read: is it cut short? then copy "
            "it again from the recording computer"
        )
    if count == 1:
        yield (
            "only one frame: without movement no contact can be found; give the whole video, or "
            "the folder of its images"
        )


def no_whiskers(settings, seen) -> str:
    """What was seen where no whisker is found, and what to look at.

    The scenes are of the negative where whiskers were taken to be brighter than the ground.
    """
    scenes, bright = _scenes(seen), isinstance(seen.video, Negative)
    if scenes:
        ground = max(_ground(scene.background) for scene in scenes)
        blank = _blank(scenes, bright)
        if blank:
            return f"no whiskers found: {blank}"
        if bright and 255 - ground > LIGHT:
            return _other_polarity("light", "brighter", "dark")
        if not bright and ground < DARK:
            return _other_polarity("dark", "darker", "bright")
    seen = seen_instead_of_whiskers(scenes, "bright" if bright else "dark")
    return (
        f"no whiskers found; what was seen is {seen}; if there are whiskers, check that "
        f'[recording] face = "{settings.recording.face}" is the side that they come from'
        f"{_whether_left_in(settings.image)}"
    )


def _blank(scenes, bright) -> str:
    """What to check where the picture shows nothing at all, "" where it shows something."""
    grey = [scene.background[scene.background > 0] for scene in scenes]
    low, high = (
        min(each.min(initial=255) for each in grey),
        max(each.max(initial=0) for each in grey),
    )
    darkest, brightest = (255 - high, 255 - low) if bright else (low, high)
    if brightest < BLACK:
        return (
            f"the picture is black throughout (no pixel is brighter than {BLACK} of 255); was the "
            "light on, and the lens open?"
        )
    if darkest > 255 - BLACK:
        return (
            f"the picture is white throughout (no pixel is darker than {255 - BLACK} of 255); is "
            "it overexposed?"
        )
    return ""


def _whether_left_in(image) -> str:
    """What to check of the part of the picture that the settings select, if they do."""
    part = " and ".join(key for key in ("region_px", "mask") if getattr(image, key))
    return f", and that [image] {part} leaves their bases in the picture" if part else ""


def _ground(background) -> float:
    """Usual grey level of what is looked at, which is more than 0."""
    return float(np.median(background[background > 0])) if background.any() else 0.0


def _other_polarity(picture, taken, write) -> str:
    return (
        f"no whiskers found; the picture is mostly {picture}, and whiskers were taken to be "
        f"{taken} than what is behind them: if they are {write}, write [image] polarity = "
        f'"{write}"'
    )


def _advice(settings, seen) -> Advice:
    """What to do where the lines were traced here."""
    return Advice(
        no_pole=_no_pole(settings, seen),
        lost="if they are in the picture, check that nothing hides their bases"
        f"{_whether_left_in(settings.image)}; if they are not, take their [[whisker]] tables out, "
        "or others may get their names",
        seldom="see in the overlay where they are lost (`run --overlay` draws it): if they are "
        "in view there, leave out what they are taken for with [image] region_px or mask",
    )


def _no_pole(settings, seen) -> str:
    """What was seen where no pole is found, and what to do."""
    size = settings.pole.diameter_mm * settings.recording.pixels_per_mm
    scenes, shade = _scenes(seen), "bright" if isinstance(seen.video, Negative) else "dark"
    there = f"what was seen is {seen_instead_of_pole(scenes, shade)}; " if scenes else ""
    missing = f"{NO_POLE}{settings.pole.diameter_mm:g} mm ({size:.0f} px) found"
    if seen.other_pole is not None:
        other = _of_another_size("what may be one", settings, seen.other_pole)
        return f"{missing}, so no contacts; {other}"
    if settings.pole.position_px is not None:
        x, y = settings.pole.position_px
        return (
            f"{missing} at [pole] x_px, y_px = {x:g}, {y:g}, so no contacts; {there}correct them, "
            "or leave them out: then the pole is searched for"
        )
    return (
        f"{missing}, so no contacts; {there}if there is one, check [recording] pixels_per_mm and "
        "give [pole] x_px, y_px"
    )


def _unknown_names(frames, apart=()):
    """In many frames it is not known which whisker is which: then all results are in doubt.

    Names that are kept `apart`, as of `_not_whiskers`, do not count.
    """
    tracked = frames[frames["tracked"] & ~frames["whisker"].isin(apart)]
    unknown = (tracked["confidence"] < KNOWN).groupby(tracked["whisker"], sort=False)
    if not len(tracked) or unknown.sum().sum() <= MOST_UNKNOWN * len(tracked):
        return
    share = unknown.sum().sum() / len(tracked)
    worst = ", ".join(
        f"{name} {100 * part:.0f} %"
        for name, part in unknown.mean().nlargest(MOST_NAMED).items()
        if part
    )
    yield (
        f"for {100 * share:.0f} % of the traced lines it is not known which whisker they are "
        f"(confidence below {KNOWN:g}; most of all {worst}): use only rows of frames.parquet with "
        f"confidence of {KNOWN:g} or more"
    )


def _not_whiskers(frames, nameless):
    """Numbers of lines that belong to no known whisker; they mean nothing else."""
    if nameless:
        tracked = frames.loc[frames["tracked"], "whisker"]
        names = in_short(name for name in dict.fromkeys(tracked) if name in nameless)
        yield (
            f"{names}: not whiskers, but lines that could not be identified (confidence below "
            f'{KNOWN:g}); leave them out with frames[frames["confidence"] >= {KNOWN:g}]'
        )


def _unnamed_whiskers(settings, followed):
    """More whiskers are seen than have names: it is guessed which ones the names belong to."""
    names = [whisker.name for whisker in settings.whisker]
    if not names or not followed.unnamed:
        return
    seen = len(followed.whisker_set.found) + followed.unnamed
    wanted = [f'"{name}"' for name in settings.analysis.follow or names]
    follow = ", ".join(wanted[:MOST_NAMED] + ["…"] * (len(wanted) > MOST_NAMED))
    tables = (
        f"only {len(names)} have a [[whisker]] table: which ones are {names[0]} to {names[-1]} "
        "is a guess and may be wrong"
    )
    if len(names) == 1:
        tables = (
            f"only one has a [[whisker]] table: which one is {names[0]} is a guess, from "
            f"{_chosen_by(followed.pole)}"
        )
    yield (
        f"about {seen} whiskers are seen at a time, but {tables}; "
        "give every whisker a table, in order along the face (a name is enough), and write "
        f"[analysis] follow = [{follow}] to get only those"
    )


def _chosen_by(pole) -> str:
    """How the only whisker in session.toml is chosen among several, and what comes of it."""
    if pole is None:
        return "how well each is seen, and may be wrong, or another one than where a pole is seen"
    return "how near each comes to the pole and how well it is seen, and may be wrong"


def guessed_order(settings, whisker_set, unknown=()):
    """Names that depend on which end of the row is at the snout, where that is not sure.

    It is sure where both sides of a face are seen, and may follow from lengths. `unknown` names
    are those of lines that belong to no whisker.
    """
    found = [name for name in whisker_set.found if name not in unknown]
    snout = settings.recording.snout
    if len(found) < 2 or all(name.startswith(ON_A_SIDE) for name in found):
        return
    row = f"{found[0]} to {found[-1]}"
    if not settings.whisker:
        first = "the snout" if snout else "the end of the row where whiskers look thinner"
        yield (
            f"{row} are numbered anew in each video, from {first} on: in another video, the same "
            "name may stand for another whisker"
        )
    elif snout:
        yield from _other_end(whisker_set, settings.recording)
    elif any(whisker.length_mm is None for whisker in settings.whisker):
        yield (
            f"the order of {row} along the face is guessed anew in each video, from how thick "
            "they look: write [recording] snout, the side of the picture nearest to the snout, "
            "and run again"
        )


def _other_end(whisker_set, recording):
    """Names that begin at the other end than the snout's, because of the lengths."""
    templates = [each for each in whisker_set.templates if np.isfinite(each.base_xy).all()]
    if posterior_first(whisker_set.given):
        templates = templates[::-1]
    seen = snout_of(templates, recording.face)
    if seen not in (None, recording.snout):
        yield (
            f'[recording] snout = "{recording.snout}", but by their lengths the whiskers follow '
            f"each other from the {seen}, and have their names from that: correct snout or the "
            "lengths, and run again"
        )


def _never_tracked(follow, whisker_set, advice):
    """Whiskers that are wanted, and lost in all frames."""
    wanted = follow or whisker_set.names
    lost = [name for name in wanted if name not in whisker_set.found]
    if lost:
        yield (
            f"not found in any frame: {in_short(lost)} (expected: "
            f"{counted(len(wanted), 'whisker')}, found: {len(wanted) - len(lost)}); {advice}"
        )


def _seldom_tracked(frames, whisker_set, advice):
    """Whiskers that are lost in many frames."""
    found = set(whisker_set.found) - nameless_in(frames)
    share = frames.groupby("whisker", sort=False)["tracked"].mean()
    seldom = share[share.index.isin(found) & (share < SELDOM_TRACKED)]
    if len(seldom):
        least = seldom.nsmallest(MOST_NAMED)
        named = ", ".join(f"{name} in {100 * part:.0f} %" for name, part in least.items())
        more = f"{len(seldom)} whiskers, least " if len(seldom) > MOST_NAMED else ""
        yield (
            f"tracked in only part of the frames: {more}{named} (expected: at least "
            f"{100 * SELDOM_TRACKED:.0f} %); {advice}"
        )


def _of_another_length(settings, odd) -> str:
    """A whisker that is not as long as the settings say: its length or the scale must be wrong."""
    scale = settings.recording.pixels_per_mm
    given = {w.name: w.length_mm for w in settings.whisker if w.length_mm is not None}
    lengths = sorted({given[odd.name]} if odd.name in given else {*given.values()})
    listed = " to ".join(f"{length:g}" for length in dict.fromkeys(lengths[:1] + lengths[-1:]))
    given_as = f", but [[whisker]] length_mm = {listed}" if lengths else ""
    return (
        f"{odd.name or 'the longest whisker'} looks {float(f'{odd.px / scale:.2g}'):g} mm long "
        f"({odd.px:.0f} px){given_as}: correct {'it or ' if lengths else ''}[recording] "
        f"pixels_per_mm = {scale:g}, on which lengths and forces depend"
    )


def pole_doubt(settings, seen, pole) -> str | None:
    """Message about a pole that is not as thick as expected, found as such or only without."""
    if pole is None and seen.other_pole is not None:
        return _no_pole(settings, seen)
    return _size_doubt(settings, pole)


def _size_doubt(settings, pole) -> str | None:
    """A pole that is not as thick as scale and diameter make it: one of them must be wrong."""
    if pole is None:
        return None
    if abs(_thickness_mm(settings, pole) / settings.pole.diameter_mm - 1) <= OTHER_THICKNESS:
        return None
    return _of_another_size("the pole", settings, pole)


def _of_another_size(what, settings, pole) -> str:
    """How thick `what` looks, and what to correct if that is the pole."""
    x, y = _usual_place(pole)
    return (
        f"{what} looks {_thickness_mm(settings, pole):.2g} mm thick "
        f"({2 * pole.radius_px:.0f} px, at {x:.0f}, {y:.0f} px), but [pole] diameter_mm = "
        f"{settings.pole.diameter_mm:g}: correct it or [recording] pixels_per_mm = "
        f"{settings.recording.pixels_per_mm:g}, on which lengths and "
        "forces depend"
    )


def _usual_place(pole) -> tuple[float, float]:
    """Where a pole mostly is, x and y [px]."""
    return np.nanmedian(pole.x_px), np.nanmedian(pole.y_px)


def _thickness_mm(settings, pole) -> float:
    return 2 * pole.radius_px / settings.recording.pixels_per_mm


def _assumed_place(settings, pole):
    """A pole that could not be measured where session.toml has it."""
    given = settings.pole.position_px
    if pole is None or given is None:
        return
    if set(zip(pole.x_px, pole.y_px, strict=True)) != {given}:  # a measured one is beside it
        return
    yield (
        f"no disc is seen at [pole] x_px, y_px = {given[0]:g}, {given[1]:g}: the pole is taken to "
        "be exactly there, and contacts and forces depend on it; check the place in the picture "
        "that `whiskerforce init` draws, and correct it, or leave x_px and y_px out: then the "
        "pole is searched for"
    )


def _passes_over(settings, tables, pole):
    """Whiskers that pass over what was taken for the pole, unless session.toml has it there.

    What another whisker touches is no dust.
    """
    if pole is None or settings.pole.position_px is not None or len(tables.contacts):
        return
    across = tables.evidence[tables.evidence["across"]].groupby("whisker", sort=False).size()
    for name, frames in across.items():
        if frames > SELDOM_ACROSS:
            x, y = _usual_place(pole)
            yield (
                f"{name} passes over the pole at ({x:.0f}, {y:.0f}) px in "
                f"{counted(frames, 'frame')} without touching it; if that is dust, give [pole] "
                "x_px, y_px"
            )


def _bent_elsewhere(tables, pole):
    """Whiskers that something bends, but mostly not the pole."""
    if pole is None:
        return
    count = tables.evidence.groupby("whisker", sort=False).size()
    for name, away, at in bent_elsewhere(tables.evidence).itertuples():
        if away > max(at, SELDOM_BENT * count[name]):
            x, y = _usual_place(pole)
            yield (
                f"{name} is bent in {counted(away, 'frame')} as if it touched something, but "
                f"not the pole at ({x:.0f}, {y:.0f}) px: look at the overlay, and if the pole "
                "stands elsewhere, give [pole] x_px, y_px"
            )


def _contradicted(settings, contacts):
    """Whiskers that bend as if their hidden length were wrong, in most of their contacts."""
    hidden = {whisker.name: whisker.hidden_length_mm for whisker in settings.whisker}
    most_mm = settings.advanced.contacts.contradicted_mm
    for name, own in _by_whisker(contacts, CONTRADICTED):
        if name in hidden and 2 * own.sum() > len(own):
            yield (
                f"in {own.sum()} of {counted(len(own), 'contact')} {name} bends as if "
                f"hidden_length_mm = {hidden[name]:g} were wrong by over {most_mm:g} mm: correct "
                "it or the dimensions, unless the whisker is out of the picture's plane"
            )


def _by_whisker(contacts, flag):
    """Each whisker's name, and which of its contacts have the flag."""
    flagged = [flag in split_flags(flags or "") for flags in contacts["flags"]]
    return pd.Series(flagged, dtype=bool).groupby(contacts["whisker"].to_numpy(), sort=False)


def _too_short(settings, frames):
    """Whiskers that are rarely traced as far as where curvature is taken."""
    sure = frames[frames["tracked"] & (frames["confidence"] >= KNOWN)]
    known = sure["curvature_per_m"].notna().groupby(sure["whisker"], sort=False).mean()
    names = known.index[known < SELDOM_CURVED]
    if len(names):
        yield (
            f"curvature_per_m is mostly empty for {in_short(names)}: traced lines end before "
            f"[analysis] curvature_at_mm = {settings.analysis.curvature_at_mm:g}; if the scale is "
            "right, write a smaller value, beyond the fur"
        )


def _never_free(settings, contacts):
    """Whiskers with dimensions that have no forces all the same."""
    measured = {whisker.name for whisker in settings.whisker if not whisker.missing_dimensions}
    names = [name for name, own in _by_whisker(contacts, NEVER_FREE) if own.all()]
    names = [name for name in names if name in measured]
    if names:
        yield (
            f"no forces for {in_short(names)}: too few frames without a touch to know the shape "
            "at rest; let the video begin before the touch"
        )


def _without_forces(settings, whisker_set):
    """Why force columns are empty."""
    if not settings.whisker:
        yield (
            "no forces: there is no [[whisker]] table with dimensions in session.toml; measure "
            f"{', '.join(DIMENSIONS)} and add them"
        )
    lacking = defaultdict(list)
    for whisker in settings.whisker:
        if whisker.missing_dimensions and whisker.name in whisker_set.found:
            lacking[whisker.missing_dimensions].append(whisker.name)
    for keys, names in lacking.items():
        yield (
            f"no forces for {in_short(names)}: no {', '.join(keys)} in session.toml; measure what "
            "is missing"
        )


def face_message(scenes, templates, side: str, refused=()) -> str | None:
    """Message about the face's given `side` where video and lines contradict it, or None.

    Parameters
    ----------
    scenes : the video's `StaticScene`s
    templates : `WhiskerTemplate`s of its whiskers; refused : of lines that are no whiskers'
    """
    other = thickening_towards((*templates, *refused)) or next(
        (scene.likelier_side for scene in scenes if scene.likelier_side), None
    )
    if other in (None, side):
        return None
    thicker = (
        f"lines are thicker towards the {other}, as whiskers are towards the face: if the face is "
        f'there, write face = "{other}" and run again'
    )
    given = f'[recording] face = "{side}", but {thicker}'
    return f"{given}; until then forces are wrong" if templates else f"no whiskers found; {given}"
