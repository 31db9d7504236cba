"""A whole rendered session on disk: videos, session.toml, truth tables."""

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from pipeline.settings import settings_from, write_session
from pipeline.tables import write_text
from synthetic.encode import video_suffix, write_video
from synthetic.presets import Trial, find_preset, make_trial
from synthetic.render import Renderer
from synthetic.truth import (
    centreline_table,
    hidden_length,
    visibility_table,
    write_truth,
)

_CURVATURE_AT_MM = 5.5


def render_session(
    out_dir, preset="single", seed=0, trials=None, jobs=1, progress=None
) -> list[Path]:
    """Render the trials of a preset, with session.toml and truth, into `out_dir`.

    Parameters
    ----------
    out_dir : folder, made where it is missing. Videos lie in it, or in a sub-folder per animal
        or camera where these differ; truth tables in `out_dir`/truth/<video stem>/
    preset : name of a preset, see synthetic.presets.PRESETS
    seed : int
    trials : how many videos; None: as many as show all that the preset has
    jobs : processes; the result does not depend on it
    progress : called with (done, total, path of the video) after each video

    Returns
    -------
    Paths of the videos. A video that is already there with its truth is not made again.
    """
    out_dir = Path(out_dir)
    trials = find_preset(preset).trials if trials is None else trials
    if trials < 1:
        raise ValueError(f"trials must be at least 1, got {trials!r}")
    out_dir.mkdir(parents=True, exist_ok=True)
    paths = []
    for done, path in enumerate(_render_all(out_dir, preset, seed, trials, jobs), 1):
        paths.append(path)
        if progress is not None:
            progress(done, trials, path)
    _write_all_contacts(out_dir, sorted(p.stem for p in paths))
    return sorted(paths)


def _render_all(out_dir, preset, seed, trials, jobs):
    """Yield the path of every video once it is there."""
    if jobs == 1:
        for trial in range(trials):
            yield render_trial(out_dir, preset, seed, trial)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = [pool.submit(render_trial, out_dir, preset, seed, t) for t in range(trials)]
        for future in as_completed(waiting):
            yield future.result()


def render_trial(out_dir, preset, seed, trial) -> Path:
    """Render one trial with truth and session.toml unless all are there; returns its video."""
    made = make_trial(preset, seed, trial)
    folder, truth = Path(out_dir) / made.group, Path(out_dir) / "truth" / made.stem
    video = folder / f"{made.stem}{video_suffix(made.scene.codec)}"
    if video.exists() and (truth / "contacts.csv").exists() and (folder / "session.toml").exists():
        return video
    folder.mkdir(parents=True, exist_ok=True)
    renderer = Renderer(made.scene, made.motion, seed=1000 * seed + trial)
    write_truth(truth, made.motion, renderer, made.stem, 1e-3 * _CURVATURE_AT_MM)
    if not (folder / "session.toml").exists():
        write_session(folder / "session.toml", session_settings(made, renderer))
    frames = (renderer.frame(i) for i in range(len(renderer)))
    write_video(video, frames, made.scene.codec)
    return video


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
    texts = [(out_dir / "truth" / s / "contacts.csv").read_text("utf-8") for s in stems]
    header = texts[0].split("\n", 1)[0]
    rows = "".join(text.split("\n", 1)[1] for text in texts)
    write_text(out_dir / "truth" / "contacts.csv", f"{header}\n{rows}")
