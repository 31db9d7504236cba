"""A whole rendered session on disk: videos, session.toml, truth tables."""

import dataclasses
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

import numpy as np
import pandas as pd

from pipeline.errors import InputError, with_advice
from pipeline.runtime.progress import Step
from pipeline.runtime.workers import run_tasks
from pipeline.session.session_file import read_session, settings_from, write_session
from pipeline.tables.own_files import check_own, new_files
from pipeline.tables.whole_files import read_json, write_json, write_text
from synthetic.encode import video_suffix, write_video
from synthetic.presets import Trial, find_preset, make_trial, trial_place
from synthetic.render import Renderer
from synthetic.truth import centreline_table, hidden_length, visibility_table, write_truth

STAGES = ("motion", "truth", "drawing", "noise", "encoding")
_CURVATURE_AT_MM = 5.5


class RenderError(RuntimeError):
    """Some videos of a session could not be rendered; the others are there."""


def render_session(
    out_dir, preset="single", seed=0, trials=None, jobs=1, progress=None, frames=1000, first=0
) -> list[Path]:
    """Render the trials of a preset, with session.toml and truth, into `out_dir`.

    Parameters
    ----------
    out_dir : folder, made where it is missing. Videos and session.toml lie in it, or in a
        sub-folder per animal or face side where these differ; truth tables in
        `out_dir`/truth/<video stem>/, all true contacts together in `out_dir`/truth/contacts.csv
    preset : name of a preset, see synthetic.presets.PRESETS
    seed : int
    trials : how many videos; None: as many as show all that the preset has
    jobs : processes; the result does not depend on it
    progress : called with each `Event` of `pipeline.runtime.workers`; its messages are `Step`
    frames : of each video (`fig3` takes what its touches need)
    first : number of the first trial: side of the pole, direction and kind follow the number

    Returns
    -------
    Paths of the videos. One that is there already, with its truth, is not made again.

    Raises
    ------
    RenderError
        Where videos could not be rendered, after all others are.
    ValueError
        Where there is no such preset, or trials, jobs or frames are below 1.
    """
    out_dir = Path(out_dir)
    found = find_preset(preset)
    trials = found.trials if trials is None else trials
    for argument, value in (("trials", trials), ("jobs", jobs), ("frames", frames)):
        if value < 1:
            raise ValueError(f"{argument} must be at least 1, got {value!r}")
    out_dir.mkdir(parents=True, exist_ok=True)
    numbers = range(first, first + trials)
    tasks = [(out_dir, preset, seed, trial, frames, first) for trial in numbers]
    paths, faults = _render_all(tasks, jobs, progress or (lambda event: None))
    _write_all_contacts(out_dir, sorted(p.stem for p in paths))
    for folder in {path.parent for path in paths}:
        stems = [path.stem for path in paths if path.parent == folder]
        if (folder / "session.toml").exists():  # else its first trial failed
            _settle_hidden_lengths(folder / "session.toml", [out_dir / "truth" / s for s in stems])
    if faults:
        fault = min(faults)
        raise RenderError(
            f"{len(faults)} of {trials} videos could not be rendered, first trial "
            f"{numbers[fault]}: {faults[fault]}; the same command tries only these again"
        )
    return paths


def _settle_hidden_lengths(path, truths) -> None:
    """Give session.toml the hidden lengths of all its videos, unless a person has edited it."""
    try:
        check_own(path.parent, {path.name: ""})
    except InputError:
        return
    settings = read_session(path)
    columns = ["whisker", "first_visible_mm"]
    tables = [pd.read_parquet(t / "visibility.parquet", columns=columns) for t in sorted(truths)]
    whiskers = tuple(
        w.model_copy(
            update={
                "hidden_length_mm": round(
                    float(np.mean([1e3 * hidden_length(table, w.name) for table in tables])), 3
                )
            }
        )
        for w in settings.whisker
    )
    if whiskers != settings.whisker:
        with new_files(path.parent) as new:
            write_session(new / path.name, settings.model_copy(update={"whisker": whiskers}))


def _render_all(tasks, jobs, progress):
    """Paths of the videos that could be rendered, and why each of the others could not."""
    paths, faults = [], {}

    def take(event):
        if event.kind == "done" and isinstance(event.value, Path):
            paths.append(event.value)
        elif event.kind == "done":
            faults[event.task] = event.value
        elif event.kind == "died":
            faults[event.task] = event.value.strip().splitlines()[-1]
        progress(event)

    run_tasks(_render_task, tasks, take, jobs)
    return sorted(paths), faults


def _render_task(task, report):
    """The path of a trial's video, or in words why the disk or a person's file forbids it."""
    try:
        return render_trial(*task, report)
    except OSError as error:
        return with_advice(error)
    except InputError as error:
        return str(error)


def render_trial(out_dir, preset, seed, trial, frames=1000, first=0, report=None) -> Path:
    """Render one trial with its truth unless both are there; returns the path of its video.

    The first trial of a sub-folder writes the session.toml; its hidden lengths are settled when
    all trials are there. scene.json says how many `seconds` each stage took. `report` is called
    with a `Step` at the start of the motion, and for every frame that is drawn.
    """
    out_dir = Path(out_dir)
    group, stem = trial_place(preset, seed, trial)
    folder, truth = out_dir / group, out_dir / "truth" / stem
    identity = {"preset": preset, "seed": seed, "trial": trial, "frames": frames}
    known = read_json(truth / "scene.json", {})
    opens = all(trial_place(preset, seed, t)[0] != group for t in range(first, trial))
    settings = folder / "session.toml"
    if (
        known.get("made_from") == identity
        and (settings.exists() or not opens)
        and (folder / known["video"]).exists()
    ):
        return folder / known["video"]
    seconds, say = dict.fromkeys(STAGES, 0.0), report or (lambda step: None)
    say(Step("motion"))
    with _timed(seconds, "motion"):
        made = make_trial(preset, seed, trial, frames)
    with _timed(seconds, "drawing"):
        renderer = Renderer(made.scene, made.motion, seed=1000 * seed + trial)
    folder.mkdir(parents=True, exist_ok=True)
    if opens:
        with new_files(folder) as new:
            write_session(new / settings.name, session_settings(made, renderer))
    with _timed(seconds, "truth"):
        write_truth(truth, made.motion, renderer, stem, 1e-3 * _CURVATURE_AT_MM)
    video = folder / f"{stem}{video_suffix(made.scene.codec)}"
    with _timed(seconds, "encoding"):
        write_video(video, _timed_frames(renderer, seconds, say), made.scene.codec)
    seconds["encoding"] -= seconds["drawing_frames"] + seconds["noise"]
    seconds["drawing"] += seconds.pop("drawing_frames")
    # written last: without it the trial does not count as done
    scene = {**dataclasses.asdict(made.scene), "frames": len(renderer), "seconds": seconds}
    write_json(truth / "scene.json", {"made_from": identity, "video": video.name, **scene})
    return video


@contextmanager
def _timed(seconds, stage):
    """Add the wall time of what is inside to a stage's `seconds`."""
    started = perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - started


def _timed_frames(renderer, seconds, say):
    """Yield the frames one after another, uint8 (height, width); drawing and noise are timed."""
    for i in range(len(renderer)):
        with _timed(seconds, "drawing_frames"):
            light = renderer.light(i)
        with _timed(seconds, "noise"):
            frame = renderer.expose(light, i)
        say(Step("drawing", i + 1, len(renderer)))
        yield frame


def session_settings(trial: Trial, renderer: Renderer):
    """Return the settings of a trial's session, with the hidden length as it is in the picture."""
    scene = trial.scene
    visibility = visibility_table(trial.motion, renderer, centreline_table(trial.motion))
    return settings_from(
        {
            "recording": {
                "frames_per_second": float(scene.camera.frames_per_second),
                "pixels_per_mm": float(scene.camera.pixels_per_mm),
                "face": scene.face.side,
            },
            "whisker": [_whisker_table(hair, visibility) for hair in scene.hairs],
            "pole": {"diameter_mm": 2e3 * scene.pole.radius} if scene.pole else {},
            "analysis": {"curvature_at_mm": _CURVATURE_AT_MM},
        },
        "rendered session",
    )


def _whisker_table(hair, visibility):
    whisker = hair.whisker
    return {
        "name": whisker.name,
        "length_mm": round(1e3 * whisker.length, 6),
        "cone_length_mm": round(1e3 * whisker.cone_length, 6),
        "base_radius_um": round(1e6 * whisker.base_radius, 6),
        "youngs_modulus_GPa": round(1e-9 * whisker.youngs_modulus, 9),
        "density_kg_per_m3": float(whisker.density),
        "damping_per_s": float(whisker.damping_rate),
        "hidden_length_mm": round(1e3 * hidden_length(visibility, whisker.name), 3),
    }


def _write_all_contacts(out_dir, stems):
    """Write the true contacts of all videos together, truth/contacts.csv."""
    if not stems:
        return
    texts = [(out_dir / "truth" / s / "contacts.csv").read_text("utf-8") for s in stems]
    header = texts[0].split("\n", 1)[0]
    rows = "".join(text.split("\n", 1)[1] for text in texts)
    write_text(out_dir / "truth" / "contacts.csv", f"{header}\n{rows}")
