"""The whiskers of one video: those that the settings name, and those found in it."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.detection.tracing_options import TracingOptions
from pipeline.scene.epochs import numbers_at
from pipeline.scene.scale import scale_of
from pipeline.session.parameters import Parameters
from pipeline.session.schema import Settings, WhiskerSettings
from pipeline.tracking.given_lengths import GivenLengths
from pipeline.tracking.line_ends import tips_seen
from pipeline.tracking.options import options_for
from pipeline.tracking.registry import WhiskerTemplate, templates_and_others
from pipeline.tracking.two_sides import named_by_side, names_by_side
from pipeline.tracking.whisker_evidence import whisker_like
from whiskermodel.whisker import Whisker

TEMPLATE_FRAMES = 24  # of the whole video, that show which whiskers there are
BEYOND_TRACE = 1.03  # times the traced length, the thin tip reaches
ENOUGH_FRAMES = 12  # to find a lone whisker, which cannot be mistaken for another


@dataclass(frozen=True)
class WhiskerSet:
    """The whiskers of one video.

    Attributes
    ----------
    names : all that appear in the tables: those of the settings, or else those found
    templates : `WhiskerTemplate`s of those found in the video
    whiskers : name → `Whisker`, None where its dimensions are not given
    stand_ins : name → the `Whisker`, or one of usual proportions where that is None; none where
        no whisker was found
    hidden : name → follicle to first visible point [m]
    refused : `WhiskerTemplate`s of lines that are no whiskers' (`whisker_evidence`)
    other_side : `WhiskerTemplate`s of the side of the face that has no names, where one has
    given : the names in session.toml
    unnamed : how many more whiskers than these are seen in the first look
    """

    names: tuple[str, ...]
    templates: tuple[WhiskerTemplate, ...]
    whiskers: dict[str, Whisker | None]
    stand_ins: dict[str, Whisker]
    hidden: dict[str, float]
    refused: tuple[WhiskerTemplate, ...] = ()
    other_side: tuple[WhiskerTemplate, ...] = ()
    given: tuple[str, ...] = ()
    unnamed: int = 0

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the whiskers found in the video, in the tracker's order."""
        return tuple(template.name for template in self.templates)

    @property
    def nominal(self) -> tuple[Whisker, ...]:
        """The whiskers found, or stand-ins."""
        return tuple(self.stand_ins[name] for name in self.found)

    @property
    def hidden_lengths(self) -> tuple[float, ...]:
        """From follicle to first visible point of the whiskers found [m]."""
        return tuple(self.hidden[name] for name in self.found)

    def only(self, names) -> "WhiskerSet":
        """The set of some of the whiskers; None: of all."""
        if names is None:
            return self
        return replace(
            self,
            names=tuple(name for name in self.names if name in names),
            templates=tuple(template for template in self.templates if template.name in names),
            whiskers={name: w for name, w in self.whiskers.items() if name in names},
        )

    def of(self, found) -> "WhiskerSet":
        """The set of whiskers named when all of the video has been seen; these may be others."""
        if tuple(found) == self.found:
            return self
        if not found:
            return self.only(())
        if self.given:
            known = {template.name: template for template in self.templates}
            unseen = WhiskerTemplate("", np.full(2, np.nan), np.nan)
            templates = tuple(known.get(name) or replace(unseen, name=name) for name in found)
            return replace(self, templates=templates)
        return replace(
            self,
            names=tuple(found),
            templates=tuple(replace(self.templates[0], name=name) for name in found),
            whiskers=dict.fromkeys(found),
            stand_ins={name: replace(self.nominal[0], name=name) for name in found},
            hidden=dict.fromkeys(found, self.hidden_lengths[0]),
        )


def template_frames(settings) -> int:
    """How many frames to find the whiskers in."""
    return ENOUGH_FRAMES if len(settings.whisker) == 1 else TEMPLATE_FRAMES


def find_whisker_set(indices, frames, epochs, settings: Settings) -> WhiskerSet:
    """Find the whiskers in some frames and bring them together with the settings' ones."""
    names = [w.name for w in settings.whisker] or None
    shape = frames.shape[1:]
    options = tracing_options(settings, shape)
    scenes = [epoch.scene for epoch in epochs if epoch.scene]
    face_side = scenes[0].face_side if scenes else "left"
    shown = [epochs[k].scene for k in numbers_at(indices, epochs)]  # by each of the frames
    unseen_face = float(np.median([scene.unseen_face for scene in shown if scene] or [0.0]))

    def seen(wanted, options):
        both = templates_and_others(frames, epochs, options, wanted, indices)
        given = names is not None
        return [whisker_like(each, len(frames), shape, given, unseen_face) for each in both]

    by_side, named, other_side = names_by_side(names, face_side), None, ()
    if by_side:
        (likely, refused), _ = seen(None, replace(options, visible_px=()))
        longest = dict(zip(names, options.visible_px, strict=False))
        given = GivenLengths(
            longest, tips_seen(epochs, options.params.detection) if longest else None
        )
        named, other_side = named_by_side(likely, by_side, face_side, options, given)
        row = [each for each in likely if not any(each is other for other in other_side)]
    if named is None:  # one row
        (named, refused), (others, _) = seen(names, options)
        row = *named, *others
    return replace(
        whisker_set_of(named, settings),
        refused=tuple(refused),
        other_side=tuple(other_side),
        unnamed=max(seen_at_a_time(row) - len(named), 0),
    )


def seen_at_a_time(templates) -> int:
    """How many of the templates' whiskers are seen in one frame, in the median over frames."""
    frames = [number for template in templates for number in template.frames]
    return int(np.median(np.unique(frames, return_counts=True)[1])) if frames else 0


def whisker_set_of(templates, settings: Settings) -> WhiskerSet:
    """Bring a video's whiskers, `WhiskerTemplate`s, together with the settings' ones."""
    own = {w.name: w for w in settings.whisker}
    names = tuple(own) or tuple(template.name for template in templates)
    every = {name: own.get(name) or WhiskerSettings(name=name) for name in names}
    whiskers = {name: each.si() for name, each in every.items()}
    hidden = {name: each.hidden_length for name, each in every.items()}
    scale = settings.recording.si().pixels_per_m
    seen = {template.name: template.visible_px / scale for template in templates}
    usual = float(np.median(list(seen.values()))) if seen else np.nan
    stand_ins = {
        name: whiskers[name] or nominal_whisker(name, seen.get(name, usual), hidden[name])
        for name in (names if seen else ())
    }
    return WhiskerSet(names, tuple(templates), whiskers, stand_ins, hidden, given=tuple(own))


def tracing_options(settings, shape) -> TracingOptions:
    """The tracker's lengths, from those of the whiskers if all are known.

    Otherwise they suit the picture, `shape` (height, width).
    """
    recording, whiskers = settings.recording.si(), settings.whisker
    if not whiskers or any(w.length_mm is None for w in whiskers):
        options = options_for_picture(recording, shape, settings.advanced)
    else:
        lengths = [1e-3 * w.length_mm for w in whiskers]
        hidden = [w.hidden_length for w in whiskers]
        options = options_for(recording, lengths, hidden, params=settings.advanced)
    return replace(options, ends=any(w.si() is not None for w in whiskers))


def options_for_picture(recording, shape, params: Parameters) -> TracingOptions:
    """The tracker's lengths for a picture (height, width) whose scale may be a guess.

    With them, tracing does not depend on the scale.
    """
    scale = scale_of(shape, params.tracking.field_mm)
    return options_for(replace(recording, pixels_per_mm=scale), params=params)


def nominal_whisker(name: str, visible_length: float, hidden_length: float) -> Whisker:
    """Return a stand-in of mouse-like proportions for a whisker whose dimensions are unknown.

    It is enough to find contacts, which do not depend on its stiffness, but not for forces.
    """
    length = BEYOND_TRACE * visible_length + hidden_length
    radius = 37e-6 * length / 18e-3
    return Whisker(length=length, cone_length=length / 0.95, base_radius=radius, name=name)
