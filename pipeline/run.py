"""The whole way for one video: `analyse`, one call per step, top to bottom."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipeline.contacts import analysis, intervals
from pipeline.detection.static_scene import PoleTrack, StaticScene
from pipeline.identity.assign import assign_identities
from pipeline.kinematics import curvature, resampled
from pipeline.kinematics.fur_noise import locate_follicles
from pipeline.kinematics.resampled_store import StationStore
from pipeline.messages import messages
from pipeline.runtime.timing import Clock, Counted
from pipeline.scene import estimate
from pipeline.session.recording import Recording
from pipeline.session.session_file import Settings
from pipeline.tables.columns import (
    CONTACT_COLUMNS,
    EVIDENCE_COLUMNS,
    FRAME_COLUMNS,
    as_table,
    empty_table,
)
from pipeline.tracking.stationary_whiskers import behind_whiskers
from pipeline.tracking.track_video import CHUNK_FRAMES, sample_lines, track
from pipeline.tracking.whiskers import Cast, find_cast, roster_frames, tracing_options
from pipeline.video.open import open_video


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
    corrections : table of a person's corrections (`pipeline.contacts.corrections`)
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
            seen = estimate.survey(video, recording)
            epochs = estimate.find_scenes(video, recording, pole.diameter, pole.position_px, seen)
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
        messages=tuple(messages(settings, touch, video, epochs, followed)),
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

    cast: Cast
    frames: pd.DataFrame
    places: StationStore
    pole: PoleTrack | None
    n_frames: int


def follow(video, epochs, cast, settings, clock, keep=None, progress=None) -> Followed:
    """Trace the whiskers through all frames and measure angle, curvature, distance to the pole."""
    recording, pole = settings.recording.si(), pole_track(epochs)
    frames = Counted(clock.each("decoding", video.lent()), video.n_frames, progress)
    options, open_ended = tracing_options(settings), not settings.whisker
    chunks = trace(frames, epochs, list(cast.roster), options, open_ended=open_ended)
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
                resampled.measure_stations(
                    chunk, recording, cast.nominal, hidden, pole, video.interpolated
                )
            )
        with clock("storing"):
            if keep is not None:
                keep(chunk)
    clock.seconds["centrelines"] -= clock.seconds["decoding"]
    table = frame_table(kinematics, cast, frames.count, recording)
    return Followed(cast, table, places, pole, frames.count)


def trace(frames, scene, roster, options, chunk_frames=CHUNK_FRAMES, open_ended=False):
    """Yield centrelines chunk by chunk: lines, then names, then follicles.

    Parameters
    ----------
    frames, scene, roster, options, chunk_frames : as for `pipeline.tracking.track`
    open_ended : no names are given: of a crowd, all whiskers that are seen over the whole video
        are named, else as many as the roster has; the roster is a first guess
    """
    side = face_side_of(scene)
    lines = track(frames, scene, roster, options, chunk_frames)
    lines = assign_identities(lines, roster, options, side, open_ended)
    return locate_follicles(lines, sample_lines(roster, options), options)


def face_side_of(scene) -> str:
    """Side of the picture with the face, of a StaticScene or of a video's epochs."""
    scenes = [scene] if isinstance(scene, StaticScene) else [e.scene for e in scene if e.scene]
    return scenes[0].face_side


def find_touches(followed: Followed, settings, corrections=None) -> analysis.Touch:
    """Contacts, forces, pulses and base loads of what was followed."""
    if not followed.places.names:
        return _nothing_traced(followed.frames)
    return analysis.analyse_touch(
        followed.frames,
        followed.places,
        settings.recording.si(),
        followed.cast.whiskers,
        curvature_at=settings.analysis.curvature_at,
        friction=settings.analysis.friction,
        corrections=corrections,
    )


def _nothing_traced(frames) -> analysis.Touch:
    """What there is to say of touches where no whisker was ever seen."""
    return analysis.Touch(
        frames=frames,
        contacts=empty_table(CONTACT_COLUMNS),
        intervals=pd.DataFrame(columns=[*intervals.INTERVAL_COLUMNS, "curated"]),
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
