"""The whole way for one video: `analyse`, one call per step, top to bottom."""

import time
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd

from pipeline import contact, curvature, scene_finding, stations, tracing
from pipeline.face_doubt import face_message
from pipeline.records import (
    CONTACT_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
    PoleTrack,
    Recording,
    as_table,
    empty_table,
)
from pipeline.resting import without_resting_whiskers
from pipeline.settings import Settings, WhiskerSettings
from pipeline.station_store import StationStore
from pipeline.video import open_video
from whiskermodel.whisker import Whisker

ROSTER_FRAMES = 24
ENOUGH_FRAMES = 12  # to find a lone whisker, which is not to be told from others
SELDOM_TRACKED = 0.8  # a whisker seen in less than this part of the frames is worth a message
OTHER_THICKNESS = 0.12  # of the pole, relative: more is no error of measurement
SELDOM_ACROSS = 1  # frame may be a mistake; a whisker more often across the pole is worth one


@dataclass(frozen=True)
class Analysis:
    """All that `analyse` found in one video.

    Attributes
    ----------
    frames, contacts : tables of FRAME_COLUMNS and CONTACT_COLUMNS
    evidence : the measurements behind the contacts, aligned with `frames`, SI units
    pole : where the pole was; None if it was never seen
    n_frames : frames read
    messages : what a person should know of: missing whiskers, no pole, no forces and why
    seconds : time spent, by stage
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    evidence: pd.DataFrame
    pole: PoleTrack | None
    n_frames: int
    messages: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)


def analyse(
    path, settings: Settings, keep=None, progress=None, corrections=None, threads=1
) -> Analysis:
    """Frames → background, pole, face → centrelines → curvature → contacts, forces, base loads.

    Parameters
    ----------
    path : a video, TIFF stack or folder of images
    settings : the session's settings
    keep : called with the centrelines (`records.Centrelines`) of some hundred frames at a
        time, to store them: they are not held together in memory
    progress : called with (frames done, frames expected), often
    corrections : table of a person's corrections (`pipeline.curation`)
    threads : for decoding; 0: as the codec thinks best

    Raises
    ------
    VideoError
        If the video cannot be read to its end.
    """
    clock = Clock()
    with open_video(path, threads) as video:
        recording, pole = settings.recording.si(), settings.pole
        with clock("scene"):
            seen = scene_finding.survey(video, recording)
            epochs = scene_finding.find_scenes(
                video, recording, pole.diameter, pole.position_px, seen
            )
        with clock("roster"):
            cast = find_cast(*seen.sample(roster_frames(settings)), epochs, settings)
            epochs = behind_whiskers(epochs, cast.roster, recording.pixels_per_mm)
        followed = follow(video, epochs, cast, settings, clock, keep, progress)
    with clock("contacts"):
        touch = find_touches(followed, settings, corrections)
    return Analysis(
        frames=touch.frames,
        contacts=touch.contacts,
        evidence=touch.evidence,
        pole=followed.pole,
        n_frames=followed.n_frames,
        messages=tuple(_messages(settings, touch, video, epochs, followed)),
        seconds=clock.seconds,
    )


@dataclass(frozen=True)
class Followed:
    """What is known of a video's whiskers before touch is spoken of.

    Attributes
    ----------
    cast : the whiskers
    frames : table of FRAME_COLUMNS with the kinematics
    places : `Stations` of all traced rows, by whisker
    pole : where the pole was
    n_frames : frames read
    """

    cast: "Cast"
    frames: pd.DataFrame
    places: StationStore
    pole: PoleTrack | None
    n_frames: int


def follow(video, epochs, cast, settings, clock, keep=None, progress=None) -> Followed:
    """Trace the whiskers through all frames and measure angle, curvature, distance to the pole."""
    recording, pole = settings.recording.si(), pole_track(epochs)
    frames = Counted(clock.each("decoding", video.lent()), video.n_frames, progress)
    options, open_ended = tracing_options(settings), not settings.whisker
    chunks = tracing.trace(frames, epochs, list(cast.roster), options, open_ended=open_ended)
    kinematics, places = [], StationStore()
    for chunk in clock.each("centrelines", chunks):
        cast = cast.of(chunk.names)
        with clock("curvature"):
            at = settings.analysis.curvature_at
            hidden = cast.hidden_lengths
            measured = curvature.measure(chunk, recording, hidden, at, pole)
            kinematics.append(measured.assign(confidence=chunk.confidence))
        with clock("distances"):
            places.add(
                stations.measure_stations(
                    chunk, recording, cast.nominal, hidden, pole, video.interpolated
                )
            )
        with clock("storing"):
            if keep is not None:
                keep(chunk)
    clock.seconds["centrelines"] -= clock.seconds["decoding"]
    table = frame_table(kinematics, cast, frames.count, recording)
    return Followed(cast, table, places, pole, frames.count)


def find_touches(followed: Followed, settings, corrections=None) -> contact.Touch:
    """Contacts, forces, pulses and base loads of what was followed."""
    if not followed.places.names:
        return _nothing_traced(followed.frames)
    return contact.analyse_touch(
        followed.frames,
        followed.places,
        settings.recording.si(),
        followed.cast.whiskers,
        curvature_at=settings.analysis.curvature_at,
        friction=settings.analysis.friction,
        corrections=corrections,
    )


def _nothing_traced(frames) -> contact.Touch:
    """What there is to say of touches where no whisker was ever seen."""
    return contact.Touch(
        frames=frames,
        contacts=empty_table(CONTACT_COLUMNS),
        intervals=pd.DataFrame(columns=[*contact.INTERVAL_COLUMNS, "curated"]),
        evidence=as_table(frames[["frame", "whisker"]], EVIDENCE_COLUMNS),
    )


def pole_track(epochs) -> PoleTrack | None:
    """The pole from frame to frame, NaN where it is away or moving; None if never seen.

    What holds at the last entry holds to the video's end.
    """
    n_frames = epochs[-1].start + 1
    x, y = np.full((2, n_frames), np.nan)
    radii = []
    for epoch in epochs:
        pole = epoch.scene.pole if epoch.scene else None
        if pole is not None:
            part = slice(epoch.start, epoch.stop)
            x[part], y[part] = pole.x_px[0], pole.y_px[0]
            radii.append(pole.radius_px)
    return PoleTrack(x, y, float(np.median(radii))) if radii else None


def tracing_options(settings) -> tracing.TracingOptions:
    """The tracer's lengths; the whiskers' own ones only if those of all are known."""
    recording, whiskers = settings.recording.si(), settings.whisker
    if any(w.length_mm is None for w in whiskers):
        return tracing.options_for(recording)
    cones = [w.cone_length_mm for w in whiskers]
    return tracing.options_for(
        recording,
        [1e-3 * w.length_mm for w in whiskers],
        [w.hidden_length for w in whiskers],
        () if None in cones else [1e-3 * cone for cone in cones],
    )


@dataclass(frozen=True)
class Cast:
    """The whiskers of one video.

    Attributes
    ----------
    names : all that the tables speak of: those of the settings, or else those found
    roster : `tracing.Slot`s of those found in the video
    whiskers : name → `Whisker`, None where its dimensions are not given
    nominal, hidden_lengths : one per slot; a stand-in where the whisker is None, and follicle to
        first visible point [m]
    """

    names: tuple[str, ...]
    roster: tuple[tracing.Slot, ...]
    whiskers: dict[str, Whisker | None]
    nominal: tuple[Whisker, ...]
    hidden_lengths: tuple[float, ...]

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the whiskers found in the video, in the tracer's order."""
        return tuple(slot.name for slot in self.roster)

    def of(self, found) -> "Cast":
        """The cast of whiskers named when the whole video has been seen; these may be more."""
        if tuple(found) == self.found:
            return self
        typical, hidden = self.nominal[0], self.hidden_lengths[0]
        count = len(found)
        return Cast(
            names=tuple(found),
            roster=tuple(replace(self.roster[0], name=name) for name in found),
            whiskers=dict.fromkeys(found),
            nominal=tuple(replace(typical, name=name) for name in found),
            hidden_lengths=(hidden,) * count,
        )


def roster_frames(settings) -> int:
    """How many frames to find the whiskers in."""
    return ENOUGH_FRAMES if len(settings.whisker) == 1 else ROSTER_FRAMES


def find_cast(indices, frames, epochs, settings: Settings) -> Cast:
    """Find the whiskers in some frames and bring them together with the settings' ones."""
    options = tracing_options(settings)
    given = {w.name: w for w in settings.whisker}
    roster = tracing.find_roster(frames, epochs, options, list(given) or None, indices)
    names = tuple(given) or tuple(slot.name for slot in roster)
    given = {name: given.get(name) or WhiskerSettings(name=name) for name in names}
    whiskers = {name: each.si() for name, each in given.items()}
    hidden = tuple(given[slot.name].hidden_length for slot in roster)
    scale = settings.recording.si().pixels_per_m
    nominal = [
        whiskers[slot.name] or stations.nominal_whisker(slot.name, slot.visible_px / scale, each)
        for slot, each in zip(roster, hidden, strict=True)
    ]
    return Cast(names, tuple(roster), whiskers, tuple(nominal), hidden)


def behind_whiskers(epochs, roster, pixels_per_mm):
    """The epochs with backgrounds in which no resting whisker is left."""
    scenes = {id(e.scene): e.scene for e in epochs if e.scene is not None}
    cleared = {
        key: without_resting_whiskers(scene, roster, pixels_per_mm)
        for key, scene in scenes.items()
    }
    return tuple(replace(e, scene=cleared.get(id(e.scene))) for e in epochs)


def typical_frames(video, seen, epochs, n: int):
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


def frame_table(kinematics, cast: Cast, n_frames: int, recording: Recording) -> pd.DataFrame:
    """Table of FRAME_COLUMNS with a row per frame and whisker, kinematics where it is tracked.

    `kinematics` are tables as of `curvature.measure`, whose `whisker` indexes `cast.found`.
    """
    every = pd.MultiIndex.from_product([range(n_frames), cast.names], names=["frame", "whisker"])
    nothing = pd.DataFrame({"frame": [], "whisker": []}, dtype=int)
    found = pd.concat(kinematics or [nothing], ignore_index=True)
    found["whisker"] = np.asarray(cast.found, object)[found["whisker"].to_numpy(int)]
    found["tracked"] = True
    table = found.set_index(["frame", "whisker"]).reindex(every).reset_index()
    table["tracked"] = table["tracked"].notna()
    table["time_s"] = table["frame"] / recording.frames_per_second
    return as_table(table, FRAME_COLUMNS)


def _messages(settings, touch, video, epochs, followed):
    """Sentences on what is missing or doubtful in one video."""
    cast = followed.cast
    scenes = [epoch.scene for epoch in epochs if epoch.scene]
    doubt = face_message(scenes, cast.roster, settings.recording.face)
    if doubt:
        yield doubt
    count = followed.n_frames
    if video.exact_count and count < video.n_frames:
        yield f"only {count} of {video.n_frames} frames could be read: is it cut short?"
    if count == 1:
        yield "one frame only: no movement to learn from, no contacts"
    if not cast.roster:
        yield "no whisker found in any frame" + ("" if doubt else _look_at_the_face(settings))
        return
    lost = [name for name in cast.names if name not in cast.found]
    if lost:
        yield f"not found in any frame: {', '.join(lost)}"
    if followed.pole is None:
        yield (
            f"no pole of {settings.pole.diameter_mm:g} mm found, so no contacts; if there is "
            "one, check [recording] pixels_per_mm and give [pole] x_px, y_px"
        )
    yield from _of_another_size(settings, followed.pole)
    yield from _passes_over(settings, touch, followed.pole)
    for name, tracked in touch.frames.groupby("whisker", sort=False)["tracked"].mean().items():
        if name in cast.found and tracked < SELDOM_TRACKED:
            yield f"{name} is tracked in {100 * tracked:.0f} % of the frames only"
    yield from _without_forces(settings, cast)


def _look_at_the_face(settings):
    return f'; is [recording] face = "{settings.recording.face}" where they come from?'


def _of_another_size(settings, pole):
    """A pole that is not as thick as scale and diameter make it: one of them must be wrong."""
    if pole is None:
        return
    thickness_mm = 2 * pole.radius_px / settings.recording.pixels_per_mm
    if abs(thickness_mm / settings.pole.diameter_mm - 1) > OTHER_THICKNESS:
        yield (
            f"the pole looks {thickness_mm:.2g} mm thick, but [pole] diameter_mm = "
            f"{settings.pole.diameter_mm:g}: correct it or [recording] pixels_per_mm = "
            f"{settings.recording.pixels_per_mm:g}, on which lengths and forces depend"
        )


def _passes_over(settings, touch, pole):
    """Whiskers that pass over what was taken for the pole, where no person says that it is."""
    if pole is None or settings.pole.position_px is not None:
        return
    across = touch.evidence[touch.evidence["across"]].groupby("whisker", sort=False).size()
    x, y = np.nanmedian(pole.x_px), np.nanmedian(pole.y_px)
    for name, frames in across.items():
        if frames > SELDOM_ACROSS and name not in set(touch.contacts["whisker"]):
            yield (
                f"{name} passes over the pole at ({x:.0f}, {y:.0f}) px in {frames} frames without "
                "touching it; if that is dust, give [pole] x_px, y_px"
            )


def _without_forces(settings, cast):
    """Why force columns are empty."""
    if not settings.whisker:
        yield "no forces: there is no [[whisker]] table with dimensions in session.toml"
    lacking = defaultdict(list)
    for whisker in settings.whisker:
        if whisker.missing_dimensions and whisker.name in cast.found:
            lacking[whisker.missing_dimensions].append(whisker.name)
    for keys, names in lacking.items():
        yield f"no forces for {', '.join(names)}: no {', '.join(keys)} in session.toml"


class Counted:
    """Frames handed on one by one and counted; `progress(done, expected)` is told."""

    def __init__(self, frames, expected: int | None, progress=None):
        self.frames = frames
        self.expected = expected
        self.progress = progress
        self.count = 0

    def __iter__(self):
        for frame in self.frames:
            yield frame
            self.count += 1
            if self.progress is not None:
                self.progress((self.count, max(self.expected or 0, self.count)))


class Clock:
    """Time spent by stage [s], in `seconds`."""

    def __init__(self):
        self.seconds = defaultdict(float)

    @contextmanager
    def __call__(self, stage):
        """Count the time of a with block to `stage`."""
        started = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[stage] += time.perf_counter() - started

    def each(self, stage, items):
        """Hand on `items`, counting the time it takes to make them to `stage`."""
        items, none = iter(items), object()
        while True:
            started = time.perf_counter()
            item = next(items, none)
            self.seconds[stage] += time.perf_counter() - started
            if item is none:
                return
            yield item
