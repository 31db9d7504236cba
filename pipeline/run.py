"""The whole way for one video: `analyse`, one call per step, top to bottom."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from pipeline.analysis import Analysis
from pipeline.contacts import (
    ContactOptions,
    ContactTables,
    corrections_given,
    find_contacts,
    left_out,
    no_contacts,
)
from pipeline.detection import PoleTrack
from pipeline.errors import InputError
from pipeline.forces import estimate_forces
from pipeline.identity import Unnamed, assign_identities
from pipeline.kinematics import (
    Kinematics,
    KinematicsMeter,
    StationStore,
    as_recorded,
    given_lines,
    locate_follicles,
)
from pipeline.messages import line_messages, messages
from pipeline.runtime import Clock, Counted, Step, prepare_cache
from pipeline.scene import (
    Pole,
    face_side_of,
    find_scenes,
    pole_of_another_size,
    pole_track,
    prepare_video,
    still_states,
    survey,
    without_poles,
    working_scale,
)
from pipeline.session import settings_given
from pipeline.tables import CONTACT_COLUMNS, FRAME_COLUMNS, Centrelines, with_units
from pipeline.tables.centrelines import lines_of_table
from pipeline.tracking import (
    CHUNK_FRAMES,
    GivenLengths,
    SeenLength,
    WhiskerSet,
    behind_whiskers,
    find_whisker_set,
    odd_length,
    options_for,
    sample_lines,
    template_frames,
    templates_of,
    tips_seen,
    tracing_options,
    track,
    whisker_set_of,
)  # fmt: skip
from pipeline.video import Video, open_video

prepare_cache()  # nothing compiled has been called yet


def analyse(
    video, settings=None, keep=None, progress=None, corrections=None, threads=1
) -> Analysis:
    """Frames → scene → tracks → identities → kinematics → forces → contacts → tables.

    Parameters
    ----------
    video : path of a video, TIFF stack or folder of images; an array of frames (n, height,
        width); or lines traced before: `Centrelines`, or a table as in centrelines.parquet
    settings : `Settings`, path of a session.toml, or a dictionary of its content; None: the
        session.toml beside the video
    keep : called with the centrelines (`tables.Centrelines`) of some hundred frames at a time,
        to store them; None: they are in the `Analysis`
    progress : called with a `runtime.Step` at the start of each stage, and with every frame
    corrections : table of a person's corrections, as `contacts.read_corrections` gives
    threads : for decoding; 0: as the codec thinks best

    Raises
    ------
    VideoError
        If the video cannot be read to its end.
    """
    given, corrections = settings_given(settings, video), corrections_given(corrections)
    if isinstance(video, (pd.DataFrame, Centrelines)):
        return analyse_lines(video, given, keep=keep, corrections=corrections)
    clock, say, stored = Clock(), progress or (lambda step: None), []
    settings = given.without_bare_whiskers()
    keep = keep or (lambda chunk: stored.append(chunk.points_only()))
    with StationStore() as places:
        with open_video(video, threads) as video:
            with clock("scene"):
                say(Step("scene"))
                what = look_at(video, settings)
            with clock("whiskers"):
                say(Step("whiskers"))
                seen = without_whiskers(find_whiskers(*what, settings), settings)
            kinematics = follow(seen, settings, clock, places, keep, say)
        with clock("forces"):
            say(Step("forces"))
            frames, evidence = forces_of(kinematics, settings)
    with clock("contacts"):
        say(Step("contacts"))
        tables = contacts_of(kinematics, frames, evidence, settings, corrections)
    notes = [*messages(settings, tables, seen, kinematics), *_unused(corrections, kinematics)]
    return _analysis(kinematics, tables, notes, clock, given, stored, seen.video.shifts)


def analyse_lines(lines, settings, pole=None, n_frames=0, keep=None, corrections=None) -> Analysis:
    """As `analyse`, from lines that another program traced: the video is not needed.

    Parameters
    ----------
    lines : `Centrelines`, or a table as in centrelines.parquet, of the whole video, follicle
        side → tip, with the settings' names; raw offsets and information follow from the points'
        scatter where the lines lack them
    settings, keep, corrections : as for `analyse`
    pole : `PoleTrack` of one place for all frames, or of one for each; None: the place that the
        settings give, if they do
    n_frames : of the video, where it goes on after the last line

    Raises
    ------
    InputError
        If a line has a name that no [[whisker]] table has, or `pole` is something else or ends
        before the lines do.
    """
    clock, settings, stored = Clock(), settings_given(settings), []
    corrections = corrections_given(corrections)
    keep = keep or (lambda chunk: stored.append(chunk.points_only()))
    lines = lines if isinstance(lines, Centrelines) else lines_of_table(lines)
    n_frames = max(int(n_frames), int(lines.frame.max(initial=-1)) + 1)
    _check_pole(pole, n_frames)
    pole = pole or _given_pole(settings)
    with StationStore() as places:
        kinematics = measure_lines(lines, settings, pole, n_frames, clock, places, keep)
        with clock("forces"):
            frames, evidence = forces_of(kinematics, settings)
    with clock("contacts"):
        tables = contacts_of(kinematics, frames, evidence, settings, corrections)
    notes = [*line_messages(settings, tables, kinematics), *_unused(corrections, kinematics)]
    return _analysis(kinematics, tables, notes, clock, settings, stored)


def _unused(corrections, kinematics):
    """Sentences on corrections that cannot be applied to a video."""
    if corrections is None:
        return ()
    return left_out(corrections, kinematics.frames["whisker"].unique(), kinematics.n_frames)


def _analysis(kinematics, tables, notes, clock, settings, stored, shifts=None) -> Analysis:
    """What was found, with the notes to a person.

    `shifts` of a shaking camera's frames: places are those in the frames as recorded.
    """
    frames, pole = tables.frames, kinematics.pole
    if shifts is not None:
        frames, pole = as_recorded(frames, shifts), pole and pole.moved(shifts)
    return Analysis(
        frames=with_units(frames, FRAME_COLUMNS),
        contacts=with_units(tables.contacts, CONTACT_COLUMNS),
        evidence=tables.evidence,
        pole=pole,
        n_frames=kinematics.n_frames,
        messages=tuple(notes),
        seconds=clock.seconds,
        settings=settings,
        lines=tuple(stored),
    )


@dataclass(frozen=True)
class Seen:
    """What is seen in some frames of a video, before the whiskers are followed through all.

    Attributes
    ----------
    video : `Video`, steadied or as its negative if need be
    epochs : what stands still, and until when
    whisker_set : `WhiskerSet`, whose templates are those of real lines
    odd : `SeenLength` that contradicts the settings, as in `tracking.odd_length`, or None
    frames : numbers of the frames that were looked at
    other_pole : `Pole` of another size than the settings say, where whiskers but no other are seen
    """

    video: Video
    epochs: list
    whisker_set: WhiskerSet
    odd: SeenLength | None
    frames: np.ndarray
    other_pole: Pole | None = None


def look_at(video, settings, prepared=None):
    """The video, steadied or as its negative if need be; its `Survey`, and its epochs.

    Epochs say what stands still, and until when. `prepared`: as `prepare_video` gives, if known.
    """
    recording, pole, params = settings.recording.si(), settings.pole, settings.advanced
    prepared = prepared or prepare_video(video, settings.image)
    seen, video = survey(prepared, recording, params.scene), prepared.video
    still = still_states(seen, recording, params)
    epochs = find_scenes(video, recording, pole.diameter, pole.position_px, still, params)
    return video, seen, epochs


def without_whiskers(seen: Seen, settings) -> Seen:
    """The same, with backgrounds as they are behind whiskers that hardly move."""
    scale = working_scale(seen.video.shape, settings.recording.pixels_per_mm)
    params = settings.advanced.tracking
    epochs = behind_whiskers(seen.epochs, seen.whisker_set.templates, scale, params)
    return replace(seen, epochs=epochs)


def find_whiskers(video, survey, epochs, settings) -> Seen:
    """The whiskers of a video, of which `look_at` tells the rest.

    Its epochs keep a pole only where a whisker may touch it, or a person has given its place.
    """
    sample = survey.sample(template_frames(settings))
    whisker_set = find_whisker_set(*sample, epochs, settings)
    if not whisker_set.templates and settings.pole.position_px is None:
        epochs = without_poles(epochs)
    odd = odd_length(*sample, epochs, whisker_set.templates, settings)
    other = _other_pole(sample[1], epochs, settings) if whisker_set.templates else None
    return Seen(video, epochs, whisker_set, odd, sample[0], other)


def _other_pole(frames, epochs, settings) -> Pole | None:
    """A pole of another size than expected, where none is found and its place is not given."""
    scenes = [epoch.scene for epoch in epochs if epoch.scene]
    given = settings.pole.position_px is not None
    if given or not scenes or any(scene.pole is not None for scene in scenes):
        return None
    scale = working_scale(frames.shape[1:], settings.recording.pixels_per_mm)
    radius_px = 0.5 * settings.pole.diameter * settings.recording.si().pixels_per_m
    return pole_of_another_size(frames, scenes[0], radius_px, scale, settings.advanced.scene)


def follow(
    seen: Seen, settings, clock, places: StationStore, keep=None, say=lambda step: None
) -> Kinematics:
    """Follow the whiskers through all frames, and measure angle, curvature, distance to the pole.

    Frames, lines and measurements pass through in chunks, so that memory does not grow with the
    length of the video. All whiskers are tracked; measured are those that `follow` in [analysis]
    names.
    """
    recording, params = settings.recording.si(), settings.advanced
    video, epochs, whisker_set = seen.video, seen.epochs, seen.whisker_set
    decoded = clock.each("decoding", video.watched())
    frames = Counted(decoded, video.n_frames, lambda *done: say(Step("following", *done)))
    options = tracing_options(settings, video.shape)
    unnamed = Unnamed(params.tracking.fur_share, whisker_set.unnamed)
    lines = trace(frames, epochs, whisker_set, options, unnamed=unnamed)
    at = settings.analysis.curvature_at
    names = settings.analysis.follow
    meter = KinematicsMeter(
        whisker_set.only(names), recording, at, pole_track(epochs), params.kinematics, places
    )
    for chunk in clock.each("centrelines", lines):
        chunk = chunk.of(names)
        with clock("kinematics"):
            meter.add(chunk, video.interpolated)
        with clock("storing"):
            if keep is not None:
                keep(chunk if video.shifts is None else chunk.moved(video.shifts))
    clock.seconds["centrelines"] -= clock.seconds["decoding"]
    return replace(meter.result(frames.count), unnamed=unnamed.count)


def measure_lines(
    lines, settings, pole, n_frames, clock, places: StationStore, keep
) -> Kinematics:
    """Follicle, angle, curvature and distance to the pole of given lines; see `analyse_lines`."""
    recording, params = settings.recording.si(), settings.advanced.kinematics
    _check_names(lines.names, settings)
    with clock("centrelines"):
        lines = given_lines.as_centrelines(lines)
        whisker_set = whisker_set_of(templates_of(lines), settings)
    hidden = tuple(length * recording.pixels_per_m for length in whisker_set.hidden_lengths)
    options = replace(options_for(recording, params=settings.advanced), hidden_px=hidden)
    chunks = given_lines.chunks_of(lines, CHUNK_FRAMES)
    chunks = locate_follicles(chunks, given_lines.sample_of(lines), options)
    at = settings.analysis.curvature_at
    meter = KinematicsMeter(whisker_set, recording, at, pole, params, places)
    for chunk in clock.each("centrelines", chunks):
        with clock("kinematics"):
            meter.add(chunk)
        with clock("storing"):
            if keep is not None:
                keep(chunk)
    return meter.result(n_frames)


def _check_pole(pole, n_frames):
    """Raise where `pole` does not say where the pole is in all frames."""
    if not isinstance(pole, PoleTrack | None):
        raise InputError(f"pole: expected a `PoleTrack` or None, got {type(pole).__name__}")
    if pole is None:
        return
    n_x, n_y = len(pole.x_px), len(pole.y_px)
    if n_x != n_y or 1 != n_x < n_frames:
        raise InputError(
            f"pole: expected one place in x_px, y_px, or one for each of {n_frames} frames (NaN "
            f"while the pole is away), got {n_x} in x_px and {n_y} in y_px; add what is missing"
        )


def _check_names(names, settings):
    """Raise where lines have names that the settings do not know."""
    known = [w.name for w in settings.whisker]
    unknown = [name for name in names if name not in known]
    if known and unknown:
        lacking = "whisker {} has" if len(unknown) == 1 else "whiskers {} have"
        raise InputError(
            f"{lacking.format(', '.join(unknown))} no [[whisker]] table in session.toml, which "
            f"names {', '.join(known)}: add one, or correct the names"
        )


def _given_pole(settings) -> PoleTrack | None:
    """The pole where the settings say that it stands; None where they do not."""
    if settings.pole.position_px is None:
        return None
    radius_px = 0.5 * settings.pole.diameter * settings.recording.si().pixels_per_m
    x, y = settings.pole.position_px
    return PoleTrack(np.array([x]), np.array([y]), radius_px)


def trace(
    frames, scene, whisker_set: WhiskerSet, options, chunk_frames=CHUNK_FRAMES, unnamed=None
):
    """Yield centrelines chunk by chunk: tracks → identities → follicles.

    Parameters
    ----------
    frames, scene, options, chunk_frames : as for `pipeline.tracking.track`
    whisker_set : the lengths in `options` belong to the names that session.toml gives; where it
        gives none and whiskers stand close together, all that are seen over the whole video are
        named: the templates are a first guess
    unnamed : `identity.Unnamed`, which counts whiskers that get no name
    """
    templates = list(whisker_set.templates)
    tracks = track(frames, scene, templates, options, chunk_frames)
    if not templates:  # then there are no lines to be named
        return tracks
    face = face_side_of(scene)
    lengths = dict.fromkeys(whisker_set.given, np.inf)
    lengths.update(zip(lengths, options.visible_px, strict=False))
    given = GivenLengths(lengths, tips_seen(scene, options.params.detection)) if lengths else None
    lines = assign_identities(
        tracks, templates, options, face, not lengths, whisker_set.other_side, given, unnamed,
    )  # fmt: skip
    return locate_follicles(lines, sample_lines(templates, options), options)


def forces_of(kinematics: Kinematics, settings):
    """Frames with rest curvature, and the evidence of contact, as in `forces.estimate_forces`."""
    recording, analysis, params = settings.recording.si(), settings.analysis, settings.advanced
    return estimate_forces(
        kinematics.frames,
        kinematics.places,
        kinematics.whisker_set.whiskers,
        analysis.curvature_at,
        analysis.friction,
        recording.pixels_per_m,
        params.forces,
    )


def contacts_of(
    kinematics: Kinematics, frames, evidence, settings, corrections=None
) -> ContactTables:
    """Contacts, forces, pulses and base loads, with a person's corrections on top."""
    if not kinematics.places.names:  # no whisker was ever seen
        return no_contacts(frames)
    return find_contacts(
        frames,
        evidence,
        settings.recording.si(),
        kinematics.whisker_set.whiskers,
        ContactOptions(settings.analysis.curvature_at, params=settings.advanced),
        corrections,
    )
