"""The whole way for one video: `analyse`, one call per step, top to bottom."""

from dataclasses import dataclass, field

import pandas as pd

from pipeline.contacts import Touch, find_touches, no_touches, surely_free
from pipeline.detection import PoleTrack
from pipeline.forces import estimate_forces
from pipeline.identity import assign_identities
from pipeline.kinematics import Kinematics, KinematicsMeter, locate_follicles
from pipeline.messages import messages
from pipeline.runtime import Clock, Counted
from pipeline.scene import face_side_of, find_scenes, pole_track, survey
from pipeline.session import DEFAULTS, Settings
from pipeline.tracking import (
    CHUNK_FRAMES,
    behind_whiskers,
    find_cast,
    roster_frames,
    sample_lines,
    tracing_options,
    track,
)  # fmt: skip
from pipeline.video import open_video


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
    """Frames → scene → tracks → identities → kinematics → forces → contacts → tables.

    Parameters
    ----------
    path : a video, TIFF stack or folder of images
    settings : the session's settings
    keep : called with the centrelines (`tables.Centrelines`) of some hundred frames at a time,
        to store them: they are not held together in memory
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
        with clock("scene"):
            seen, epochs = look_at(video, settings)
        with clock("roster"):
            cast = find_cast(*seen.sample(roster_frames(settings)), epochs, settings)
            epochs = behind_whiskers(epochs, cast.roster, settings.recording.pixels_per_mm)
        kinematics = follow(video, epochs, cast, settings, clock, keep, progress)
    with clock("forces"):
        frames, evidence = forces_of(kinematics, settings)
    with clock("contacts"):
        touch = touches_of(kinematics, frames, evidence, settings, corrections)
    return Analysis(
        frames=touch.frames,
        contacts=touch.contacts,
        evidence=touch.evidence,
        pole=kinematics.pole,
        n_frames=kinematics.n_frames,
        messages=tuple(messages(settings, touch, video, epochs, kinematics)),
        seconds=clock.seconds,
    )


def look_at(video, settings):
    """The video's `Survey`, and its epochs: what stands still, and until when."""
    recording, pole, params = settings.recording.si(), settings.pole, settings.advanced.scene
    seen = survey(video, recording, params)
    return seen, find_scenes(video, recording, pole.diameter, pole.position_px, seen, params)


def follow(video, epochs, cast, settings, clock, keep=None, progress=None) -> Kinematics:
    """Follow the whiskers through all frames, and measure angle, curvature, distance to the pole.

    Frames, lines and measurements pass through in chunks, so that memory does not grow with the
    length of the video.
    """
    recording, params = settings.recording.si(), settings.advanced.kinematics
    frames = Counted(clock.each("decoding", video.lent()), video.n_frames, progress)
    options, open_ended = tracing_options(settings), not settings.whisker
    lines = trace(frames, epochs, list(cast.roster), options, CHUNK_FRAMES, open_ended, params)
    at = settings.analysis.curvature_at
    meter = KinematicsMeter(cast, recording, at, pole_track(epochs), params)
    for chunk in clock.each("centrelines", lines):
        with clock("kinematics"):
            meter.add(chunk, video.interpolated)
        with clock("storing"):
            if keep is not None:
                keep(chunk)
    clock.seconds["centrelines"] -= clock.seconds["decoding"]
    return meter.result(frames.count)


def trace(
    frames,
    scene,
    roster,
    options,
    chunk_frames=CHUNK_FRAMES,
    open_ended=False,
    params=DEFAULTS.kinematics,
):
    """Yield centrelines chunk by chunk: tracks → identities → follicles.

    Parameters
    ----------
    frames, scene, roster, options, chunk_frames : as for `pipeline.tracking.track`
    open_ended : no whiskers are given: where they stand close together, all that are seen over
        the whole video are named, else as many as the roster has; the roster is a first guess
    params : `KinematicsParams`
    """
    tracks = track(frames, scene, roster, options, chunk_frames)
    lines = assign_identities(tracks, roster, options, face_side_of(scene), open_ended)
    return locate_follicles(lines, sample_lines(roster, options), options, params)


def forces_of(kinematics: Kinematics, settings):
    """Frames with rest curvature, and the evidence of touch, as of `forces.estimate_forces`."""
    scale, analysis = settings.recording.si().pixels_per_m, settings.analysis
    return estimate_forces(
        kinematics.frames,
        kinematics.places,
        kinematics.cast.whiskers,
        analysis.curvature_at,
        analysis.friction,
        scale,
        lambda evidence: surely_free(evidence, scale),
    )


def touches_of(kinematics: Kinematics, frames, evidence, settings, corrections=None) -> Touch:
    """Contacts, forces, pulses and base loads, with a person's corrections on top."""
    if not kinematics.places.names:  # no whisker was ever seen
        return no_touches(frames)
    return find_touches(
        frames,
        evidence,
        settings.recording.si(),
        kinematics.cast.whiskers,
        curvature_at=settings.analysis.curvature_at,
        corrections=corrections,
    )
