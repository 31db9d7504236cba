"""The videos of `benchmark_tracking`: rendered, encoded, decoded and traced."""

from dataclasses import dataclass
from pathlib import Path

import measuring
import numpy as np
import pandas as pd

from pipeline.run import trace as trace_frames
from pipeline.scene import estimate, prepare_video
from pipeline.session.session_file import write_session
from pipeline.tracking.stationary_whiskers import behind_whiskers
from pipeline.tracking.whiskers import find_whisker_set, template_frames, tracing_options
from pipeline.video.open import open_video
from synthetic.encode import video_suffix, write_video
from synthetic.presets import make_trial
from synthetic.render import Renderer
from synthetic.scene import Codec
from synthetic.scoring import line_scoring
from synthetic.session import session_settings
from synthetic.truth import centreline_table, frame_table, visibility_table

SCENES = {  # name: preset, trial
    "clean": ("single", 0),
    "noisy": ("noisy", 0),
    "four whiskers": ("row", 0),
    "crossing": ("crossing", 0),
    "moving fur": ("moving_fur", 0),
    "faint touch": ("faint_touch", 0),
    "along an axis": ("orientation", 6),
    "at 45°": ("orientation", 9),
}
CURVATURE_AT = 5.5e-3
CRF = 21
BRIEF = 2  # frames of the video that measures the start-up


@dataclass(frozen=True)
class Clip:
    """A rendered video for timing; its first `scored` frames have a truth.

    Attributes
    ----------
    path, short, brief : the video, its first frames only, for the slow peer, and two frames
    frames, short_frames : numbers of frames of the first two
    """

    name: str
    path: Path
    short: Path
    brief: Path
    frames: int
    short_frames: int
    scored: int
    trial: object
    settings: object
    truth: line_scoring.Truth
    true_frames: pd.DataFrame

    @property
    def pixels(self) -> int:
        """Pixels of a frame."""
        camera = self.trial.scene.camera
        return camera.width * camera.height


def render_clip(name, folder, frames, short_frames, seed) -> Clip:
    """Render a scene to H.264; where it is shorter than `frames`, forwards and back again."""
    preset, number = SCENES[name]
    trial = make_trial(preset, seed, number)
    codec = Codec("h264", crf=CRF)
    renderer = Renderer(trial.scene, trial.motion, seed=seed)
    n = len(renderer)
    folder = folder / name.replace(" ", "_")
    folder.mkdir(parents=True)
    suffix = video_suffix(codec)
    path, short, brief = (folder / f"{part}{suffix}" for part in ("clip", "short", "brief"))
    order = np.resize(np.concatenate([np.arange(n), np.arange(n - 1, -1, -1)]), frames)
    write_video(path, (renderer.frame(int(i)) for i in order), codec)
    short_frames = min(short_frames, n)
    write_video(short, (renderer.frame(i) for i in range(short_frames)), codec)
    write_video(brief, (renderer.frame(i) for i in range(BRIEF)), codec)
    settings = session_settings(trial, renderer)
    write_session(folder / "session.toml", settings)
    lines = centreline_table(trial.motion)
    camera = trial.scene.camera
    noise = np.sqrt(camera.read_noise**2 + camera.noise_gain * measuring.LIGHT)
    visibility = visibility_table(trial.motion, renderer, lines)
    truth = line_scoring.visible_truth(lines, visibility, camera.pixels_per_mm, noise)
    return Clip(
        name=name,
        path=path,
        short=short,
        brief=brief,
        frames=frames,
        short_frames=short_frames,
        scored=min(n, frames),
        trial=trial,
        settings=settings,
        truth=truth,
        true_frames=frame_table(trial.motion, CURVATURE_AT),
    )


def repeat_video(source, target, frames) -> None:
    """Make a longer video by writing the packets of `source` again and again."""
    import av

    with av.open(str(target), "w") as out, av.open(str(source)) as template:
        stream, written = out.add_stream_from_template(template.streams.video[0]), 0
        while written < frames:
            with av.open(str(source)) as container:
                packets = [p for p in container.demux(video=0) if p.size]
                _append(packets[: frames - written], out, stream, written)
                written += len(packets)


def _append(packets, out, stream, written):
    """Write packets of a video's beginning behind the `written` frames that `out` has."""
    step = packets[0].duration or 1
    for packet in packets:
        packet.pts += written * step
        packet.dts += written * step
        packet.stream = stream
        out.mux(packet)


def decode(clip: Clip) -> None:
    """Read every frame and do nothing with it."""
    with open_video(clip.path) as video:
        for _ in video.lent():
            pass


def trace(clip: Clip, path=None):
    """Decode, find the scene and trace as `analyse` does; yield centrelines chunk by chunk."""
    settings = clip.settings
    recording = settings.recording.si()
    with open_video(path or clip.path) as video:
        diameter = settings.pole.diameter if clip.trial.scene.pole else None
        look = prepare_video(video)
        seen = estimate.survey(look, recording)
        epochs = estimate.find_scenes(
            video, recording, diameter, still=estimate.still_states(seen, recording)
        )
        whisker_set = find_whisker_set(*seen.sample(template_frames(settings)), epochs, settings)
        scale, params = recording.pixels_per_mm, settings.advanced.tracking
        epochs = behind_whiskers(epochs, whisker_set.templates, scale, params)
        options = tracing_options(settings, video.shape)
        yield from trace_frames(video.lent(), epochs, whisker_set, options)
