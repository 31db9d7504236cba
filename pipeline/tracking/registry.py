"""Which whiskers a video shows: the lines of some frames, grouped by whisker."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipeline.detection import detect, line_choice
from pipeline.detection.frame import Frame
from pipeline.detection.image_model import ImageModel
from pipeline.detection.line import Line, Workspace
from pipeline.detection.tracing_options import TracingOptions
from pipeline.numerics.robust import column_medians
from pipeline.scene.epochs import as_epochs, numbers_at
from pipeline.tables.centrelines import Centrelines
from pipeline.tracking import at_pole, hairs, line_ends, matching
from pipeline.tracking.given_lengths import (
    GivenLengths,
    numbers_in_order,
    posterior_first,
    runs_backwards,
)
from pipeline.tracking.matching import Ruler
from pipeline.tracking.snout import anterior_first
from pipeline.tracking.whisker_evidence import moves, still_hairs

SEEN_TOGETHER = 3.0  # frames: where chance gives so many, two whiskers are seen in one at least
FEWEST_WHOLE = 3  # lines needed for a whisker's length


@dataclass(frozen=True)
class WhiskerTemplate:
    """What the first look shows of one whisker: where it leaves the face, its visible length.

    `samples` are lines of it, of the sample frames with the numbers `frames`. `signature` is as in
    matching.Ruler, less the turn of all whiskers. No line of this whisker is longer than
    `longest_px`.
    """

    name: str
    base_xy: np.ndarray
    visible_px: float
    samples: tuple = ()  # detection.Line
    signature: np.ndarray | None = None
    longest_px: float = np.inf
    frames: tuple = ()


@dataclass
class _Group:
    """Lines of one whisker, with their frames and signatures less the shift of all angles."""

    frames: list = field(default_factory=list)
    lines: list = field(default_factory=list)
    signatures: list = field(default_factory=list)

    def add(self, frame, line, signature, shift):
        """Add a line of a frame in which all angles are larger by `shift` [rad]."""
        self.__dict__.pop("signature", None)  # of those before
        signature = signature.copy()
        signature[matching.ANGLE] -= shift
        self.frames.append(frame)
        self.lines.append(line)
        self.signatures.append(signature)

    def joined_with(self, other):
        """A group of the lines of both."""
        return _Group(
            self.frames + other.frames,
            self.lines + other.lines,
            self.signatures + other.signatures,
        )

    @cached_property
    def signature(self):
        """Median of its lines' signatures, NaN where none of them shows a part."""
        return column_medians(np.array(self.signatures))

    @property
    def base(self):
        """Where its lines begin, (x, y) [px], in the median."""
        return np.median([line.points[0] for line in self.lines], axis=0)

    @property
    def strength(self):
        """How clearly its lines are seen (`line_choice.usual_strength`)."""
        return line_choice.usual_strength(self.lines)


def templates_of(lines: Centrelines) -> tuple[WhiskerTemplate, ...]:
    """Templates of the whiskers in lines that have names already."""
    templates = []
    for k in np.unique(lines.whisker):
        rows = np.flatnonzero(lines.whisker == k)
        base = lines.offsets[rows]
        place = np.median(lines.x_px[base]), np.median(lines.y_px[base])
        length = np.median(np.diff(lines.offsets)[rows])
        templates.append(WhiskerTemplate(lines.names[k], np.array(place), float(length)))
    return tuple(templates)


def usual_absorbance(lines) -> float:
    """Share of the light that a typical line absorbs, in the median along it; inf: no lines."""
    return float(np.median([np.median(each.amplitude[: each.n]) for each in lines] or [np.inf]))


def find_templates(
    frames, scene, options: TracingOptions, names=None, indices=None
) -> list[WhiskerTemplate]:
    """Learn from some frames which whiskers there are, in order along the face.

    Parameters
    ----------
    frames : uint8 (k, height, width), taken from the whole video
    scene : StaticScene, or the video's epochs, which need `indices`
    names : names of the whiskers, anterior → posterior; None: those that are mostly seen,
        called w1, w2, …
    indices : frame numbers of `frames`; not needed where the scene never changes

    Returns
    -------
    One template per whisker, in the order of `names`; fewer where some are never seen.
    """
    return templates_and_others(frames, scene, options, names, indices)[0]


def templates_and_others(frames, scene, options, names=None, indices=None):
    """As `find_templates`, and `WhiskerTemplate`s of what else is mostly seen, without names."""
    at = frames, scene, options, names, indices
    found, poles, side = _lines_of(*at)
    absorbed = usual_absorbance([line for lines in found for line in lines])
    params = options.params.detection
    if params.faintest_share * absorbed < params.faintest:  # a picture of little contrast
        found, poles, side = _lines_of(*at, absorbed)
    poles = [pole for pole, lines in zip(poles, found, strict=True) if lines]
    found = [lines for lines in found if lines]
    if not found:
        return [], []
    ruler = Ruler.of(side, options)
    groups = gather(found, ruler)
    share = np.array([len(g.frames) / len(found) for g in groups])
    strength = np.array([g.strength for g in groups])
    often = mostly_seen(share, strength, options.params.tracking)
    chosen = often = often[~_are_hairs([groups[k] for k in often])]
    templates = [_template(group) for group in groups]
    if names:
        hair = still_hairs(templates, np.array([moves(g.lines) for g in groups]), len(found))
        merit = share * np.sqrt(strength)
        if len(names) == 1:
            merit *= _nearness_to_pole(groups, poles, options.pixels_per_m)
        chosen = np.lexsort((-merit, hair))[: len(names)]
    others = [templates[k] for k in np.setdiff1d(often, chosen)]
    templates = [templates[k] for k in chosen]
    templates.sort(key=lambda template: ruler.order_place(template.signature))
    templates = anterior_first(templates, options.snout)
    names = names or [f"w{i + 1}" for i in range(len(templates))]
    known = len(options.visible_px) == len(names)
    longest = options.visible_px if known else [np.inf] * len(names)
    given = dict(zip(names, longest, strict=True))
    tips_seen = line_ends.tips_seen(scene, options.params.detection) if known else None
    return named_as_given(templates, GivenLengths(given, tips_seen)), others


def _nearness_to_pole(groups, poles, pixels_per_m) -> np.ndarray:
    """`at_pole.nearness` of each group, (groups,); poles : in each of the frames."""
    return np.array(
        [
            at_pole.nearness(g.lines, [poles[k] for k in g.frames], len(poles), pixels_per_m)
            for g in groups
        ]
    )


def _are_hairs(groups) -> np.ndarray:
    """Which groups are hairs apart from the others, bool (groups,)."""
    bases = np.array([group.base for group in groups]).reshape(-1, 2)
    strength = [len(group.frames) * group.strength for group in groups]
    lengths = [line.n for group in groups for line in group.lines]
    return hairs.are_hairs(bases, strength, np.median(lengths or [0.0]))


def mostly_seen(share, strength, params) -> np.ndarray:
    """Numbers of the lines that are seen in enough frames, and are too strong to be fur.

    share : of the frames in which each line is seen, (lines,)
    strength : as in `line_choice.usual_strength`, (lines,) [px]
    params : `TrackerParams`
    """
    often = share >= params.seen_share
    least = params.fur_share * strength[often].max(initial=0.0)
    return np.flatnonzero(often & (strength >= least))


def named_as_given(templates, given: GivenLengths) -> list[WhiskerTemplate]:
    """The templates, anterior first, as whiskers of session.toml, in the order of these.

    Where lengths show the order, they are trusted more than the guess which end is anterior.

    Parameters
    ----------
    templates : no more than given
    given : infinite lengths: not known
    """
    names, longest = list(given.longest_px), list(given.longest_px.values())
    whole = [_whole_length(template.samples, given.tips_seen) for template in templates]
    reverse = runs_backwards(whole, longest)
    if reverse is None:
        reverse = posterior_first(names)
    if reverse:
        templates, whole = templates[::-1], whole[::-1]
    numbers = numbers_in_order(whole, longest)
    return [
        replace(template, name=names[k], longest_px=longest[k])
        for template, k in zip(templates, numbers, strict=True)
    ]


def _template(group: _Group) -> WhiskerTemplate:
    length = float(np.median([line.n for line in group.lines]))
    return WhiskerTemplate(
        "", group.base, length, tuple(group.lines), group.signature, frames=tuple(group.frames)
    )


def gather(found: list[list[Line]], ruler: Ruler) -> list[_Group]:
    """Group the lines of several frames by whisker.

    The frame with the strongest lines comes first; every other one is matched to the groups of
    those before. Then all frames are matched again to the final groups.
    """
    seen = [ruler.signatures(lines) for lines in found]
    strength = [sum(line_choice.contrast_length(line) for line in lines) for lines in found]
    groups: list[_Group] = []
    for frame in np.argsort(strength)[::-1]:
        _share_out(groups, frame, found[frame], seen[frame], ruler, new=True)
    known = [g for g in groups if len(g.frames) > 1 or len(found) < 3]
    for _ in range(2):
        signatures = [g.signature for g in known]
        again = [_Group() for _ in known]
        for frame, lines in enumerate(found):
            _share_out(again, frame, lines, seen[frame], ruler, signatures)
        known = [g for g in again if g.frames]
    return _joined(known, len(found), ruler)


def _joined(groups: list[_Group], n_frames: int, ruler: Ruler) -> list[_Group]:
    """Join groups that are one whisker: alike except for the angle, and never seen together."""
    for k, one in enumerate(groups):
        for other in groups[k + 1 :]:
            by_chance = len(one.frames) * len(other.frames) / n_frames
            apart = np.delete(one.signature - other.signature, matching.ANGLE)
            alike = np.all(np.abs(apart) < np.delete(ruler.sd, matching.ANGLE))
            if alike and by_chance > SEEN_TOGETHER and not set(one.frames) & set(other.frames):
                rest = [g for g in groups if g is not one and g is not other]
                return _joined([*rest, one.joined_with(other)], n_frames, ruler)
    return groups


def _share_out(groups, frame, lines, seen, ruler, known=None, new=False):
    """Add a frame's lines to the groups that they fit; the others begin new groups if `new`."""
    if known is None:
        known = [g.signature for g in groups]
    got = matching.match(seen, np.array(known).reshape(-1, 4), ruler.sd)
    for line, group in got.pairs:
        groups[group].add(frame, lines[line], seen[line], got.shift)
    if new:
        taken = {line for line, _ in got.pairs}
        for k in set(range(len(lines))) - taken:
            groups.append(_Group())
            groups[-1].add(frame, lines[k], seen[k], got.shift)


def _lines_of(frames, scene, options, names, indices, absorbed=np.inf):
    """Lines and pole of every frame, and the face's side; `absorbed` as in `ImageModel`."""
    several = names is None or len(names) > 1
    wanted = detect.Wanted(enough=len(names) if names else np.inf)
    found, poles, side = [], [], "left"
    for present, chosen in _by_scene(frames, scene, indices):
        model = ImageModel.from_scene(present, options.params.detection, absorbed=absorbed)
        workspace = Workspace.for_picture(present.background.shape, options.spacing_px)
        for image in chosen:
            frame = Frame(image, model, model.gain(image), options, workspace)
            found.append(
                detect.detect_crowded(frame, wanted=wanted) if several else detect.detect(frame)
            )
        poles += [present.pole] * len(chosen)
        side = present.face_side
    return found, poles, side


def _by_scene(frames, scene, indices):
    """Pairs of a scene and its frames, without those in which the scene changes."""
    epochs = as_epochs(scene)
    if len(epochs) == 1:
        return [(epochs[0].scene, frames)]
    if indices is None:
        raise ValueError("indices of the frames are needed where the scene changes, got None")
    owner = numbers_at(indices, epochs)
    pairs = [(e.scene, frames[owner == k]) for k, e in enumerate(epochs) if e.scene is not None]
    return [(s, f) for s, f in pairs if len(f)]


def _whole_length(lines, tips_seen) -> float:
    """Median length [px] of lines that show their tips, NaN where fewer than FEWEST_WHOLE do."""
    ends = np.array([line.points[-1] for line in lines])
    lengths = np.array([line.n for line in lines])[line_ends.whole(*ends.T, tips_seen)]
    return float(np.median(lengths)) if len(lengths) >= FEWEST_WHOLE else np.nan
