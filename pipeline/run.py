"""The whole way for one video: `analyse`, one call per step, top to bottom."""

import time
from collections import defaultdict
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipeline import contact, curvature, scene_finding, stations, tracing
from pipeline.records import FRAME_COLUMNS, Recording, StaticScene, as_table
from pipeline.settings import Settings, WhiskerSettings
from pipeline.video import open_video
from whiskermodel.whisker import Whisker

ROSTER_FRAMES = 24
SELDOM_TRACKED = 0.8  # a whisker seen in less than this part of the frames is worth a message


@dataclass(frozen=True)
class Analysis:
    """All that `analyse` found in one video.

    Attributes
    ----------
    frames, contacts : tables of FRAME_COLUMNS and CONTACT_COLUMNS
    scene : what does not move in the video
    n_frames : frames read
    messages : what a person should know of: missing whiskers, no pole, no forces and why
    seconds : time spent, by stage
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    scene: StaticScene
    n_frames: int
    messages: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)


def analyse(path, settings: Settings, keep=None, progress=None, corrections=None) -> Analysis:
    """Frames → background, pole, face → centrelines → curvature → contacts, forces, base loads.

    Parameters
    ----------
    path : a video, TIFF stack or folder of images
    settings : the session's settings
    keep : called with the centrelines (`records.Centrelines`) of some hundred frames at a
        time, to store them: they are not held together in memory
    progress : called with (frames done, frames expected), often
    corrections : a person's contact intervals (see `pipeline.contact`)

    Raises
    ------
    VideoError
        If the video cannot be read to its end.
    """
    clock = Clock()
    recording, at = settings.recording.si(), settings.analysis.curvature_at
    with open_video(path) as video:
        with clock("scene"):
            scene = scene_finding.find_scene(
                video, recording, settings.pole.diameter, settings.pole.position_px
            )
        with clock("roster"):
            options = tracing.options_for(recording, *_known_lengths(settings))
            names = [w.name for w in settings.whisker] or None
            roster = tracing.find_roster(video.sample(ROSTER_FRAMES)[1], scene, options, names)
        cast = Cast.of(settings, roster, recording)
        frames = Counted(clock.each("decoding", video), video.n_frames, progress)
        kinematics, places = [], []
        for chunk in clock.each("centrelines", tracing.trace(frames, scene, roster, options)):
            with clock("curvature"):
                kinematics.append(
                    curvature.measure(chunk, recording, cast.hidden_lengths, at, scene.pole)
                )
            with clock("distances"):
                places.append(
                    stations.measure_stations(
                        chunk, recording, cast.nominal, cast.hidden_lengths, scene.pole
                    )
                )
            with clock("storing"):
                if keep is not None:
                    keep(chunk)
    clock.seconds["centrelines"] -= clock.seconds["decoding"]
    with clock("contacts"):
        table = frame_table(kinematics, cast, frames.count, recording)
        touch = contact.analyse_touch(
            table,
            stations.join(places),
            recording,
            cast.whiskers,
            curvature_at=at,
            corrections=corrections,
        )
    messages = tuple(_messages(settings, scene, cast, table, frames))
    return Analysis(touch.frames, touch.contacts, scene, frames.count, messages, clock.seconds)


def _known_lengths(settings):
    """Whole and hidden lengths [m] of all whiskers, empty unless every one is known."""
    whiskers = settings.whisker
    if any(w.length_mm is None for w in whiskers):
        return (), ()
    return [1e-3 * w.length_mm for w in whiskers], [w.hidden_length for w in whiskers]


@dataclass(frozen=True)
class Cast:
    """The whiskers of one video.

    Attributes
    ----------
    names : all that the tables speak of: those of the settings, or else those found
    found : names of those found in the video, in the tracer's order
    whiskers : name → `Whisker`, None where its dimensions are not given
    nominal, hidden_lengths : one per name in `found`; a stand-in where the whisker is None,
        and follicle to first visible point [m]
    """

    names: tuple[str, ...]
    found: tuple[str, ...]
    whiskers: dict[str, Whisker | None]
    nominal: tuple[Whisker, ...]
    hidden_lengths: tuple[float, ...]

    @classmethod
    def of(cls, settings: Settings, roster, recording: Recording):
        """Bring the settings' whiskers together with those found in the video."""
        given = {w.name: w for w in settings.whisker}
        names = tuple(given) or tuple(slot.name for slot in roster)
        table = {name: given.get(name) or WhiskerSettings(name=name) for name in names}
        whiskers = {name: each.si() for name, each in table.items()}
        nominal = [
            whiskers[slot.name]
            or stations.nominal_whisker(
                slot.name,
                slot.visible_px / recording.pixels_per_m,
                table[slot.name].hidden_length,
            )
            for slot in roster
        ]
        return cls(
            names,
            tuple(slot.name for slot in roster),
            whiskers,
            tuple(nominal),
            tuple(table[slot.name].hidden_length for slot in roster),
        )


def frame_table(kinematics, cast: Cast, n_frames: int, recording: Recording) -> pd.DataFrame:
    """Table of FRAME_COLUMNS with a row per frame and whisker, kinematics where it is tracked.

    `kinematics` are tables as of `curvature.measure`, whose `whisker` indexes `cast.found`.
    """
    every = pd.MultiIndex.from_product([range(n_frames), cast.names], names=["frame", "whisker"])
    found = pd.concat(kinematics, ignore_index=True)
    found["whisker"] = np.asarray(cast.found, object)[found["whisker"].to_numpy()]
    found["tracked"] = True
    table = found.set_index(["frame", "whisker"]).reindex(every).reset_index()
    table["tracked"] = table["tracked"].notna()
    table["time_s"] = table["frame"] / recording.frames_per_second
    return as_table(table, FRAME_COLUMNS)


def _messages(settings, scene, cast, table, frames):
    """Sentences on what is missing or doubtful in one video."""
    if frames.expected and frames.count < 0.98 * frames.expected:
        yield f"only {frames.count} of {frames.expected} frames could be read: is it cut short?"
    if frames.count == 1:
        yield "one frame only: no movement to learn from, no contacts"
    if not cast.found:
        yield "no whisker found in any frame"
        return
    lost = [name for name in cast.names if name not in cast.found]
    if lost:
        yield f"not found in any frame: {', '.join(lost)}"
    if scene.pole is None:
        yield (
            f"no pole of {settings.pole.diameter_mm:g} mm found, so no contacts; if there is "
            "one, give [pole] x_px, y_px"
        )
    for name, tracked in table.groupby("whisker", sort=False)["tracked"].mean().items():
        if name in cast.found and tracked < SELDOM_TRACKED:
            yield f"{name} is tracked in {100 * tracked:.0f} % of the frames only"
    yield from _without_forces(settings, cast)


def _without_forces(settings, cast):
    """Why force columns are empty."""
    if not settings.whisker:
        yield "no forces: there is no [[whisker]] table with dimensions in session.toml"
    for whisker in settings.whisker:
        if whisker.missing_dimensions and whisker.name in cast.found:
            keys = ", ".join(whisker.missing_dimensions)
            yield f"no forces for {whisker.name}: {keys} not given in session.toml"


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
        items = iter(items)
        while True:
            with self(stage):
                try:
                    item = next(items)
                except StopIteration:
                    return
            yield item
