"""Frames of a rendered row whose whiskers stand closer than they move, and the truth in them."""

from functools import cache
from typing import NamedTuple

import numpy as np
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.detection.static_scene import StaticScene
from pipeline.detection.tracing_options import TracingOptions
from pipeline.session.recording import Recording
from pipeline.tracking.registry import WhiskerTemplate, find_templates
from synthetic.presets import Trial, make_trial
from synthetic.render import Renderer

ON = 1.5  # px from a true centreline


class Row(NamedTuple):
    """A trial, what a tracker needs, and the images of some frames."""

    trial: Trial
    scene: StaticScene
    templates: list[WhiskerTemplate]
    options: TracingOptions
    images: list[np.ndarray]


def dense_row(frames) -> Row:
    """Some frames of a trial of the preset `dense_row`."""
    renderer, row = _without_images()
    return row._replace(images=[renderer.frame(i) for i in frames])


@cache
def _without_images() -> tuple[Renderer, Row]:
    """The trial's renderer, and what a tracker needs, made once for all tests of a process."""
    trial = make_trial("dense_row", 0, 0)
    renderer, camera = Renderer(trial.scene, trial.motion), trial.scene.camera
    recording = Recording(camera.frames_per_second, camera.pixels_per_mm, trial.scene.face.side)
    wide = np.array([renderer.frame(i) for i in range(0, len(trial.motion), 25)])
    scene = scene_from_frames(wide, recording, 0.5e-3, None, len(trial.motion))
    options = options_for(recording)
    templates = find_templates(wide[::2], scene, options)
    return renderer, Row(trial, scene, templates, options, [])


def whisker_at(trial, frame, line):
    """True whisker that most of a line's middle lies on, −1 for none."""
    points, best, found = line.points[10 : line.n // 2 + 10], 0.5, -1
    for hair in range(len(trial.scene.hairs)):
        x, y = trial.motion.centrelines(hair=hair, frames=slice(frame, frame + 1))
        off = np.hypot(points[:, :1] - x, points[:, 1:] - y).min(axis=1)
        if (off < ON).mean() > best:
            best, found = (off < ON).mean(), hair
    return found
