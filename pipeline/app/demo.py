"""`whiskerforce demo` and `synth`: rendered sessions, and results beside their truth."""

import contextlib
import difflib
import time
from pathlib import Path

import numpy as np

from pipeline.app import batch, warm_up
from pipeline.app.terminal import say_problems
from pipeline.errors import InputError, counted
from pipeline.reports.session_numbers import read_contacts, read_truth
from pipeline.runtime.progress import Progress, duration
from pipeline.tables.whole_files import read_json

DEMO_PRESET, DEMO_TRIALS, DEMO_SEED = "fig3", 4, 1
TRUTH = "truth"  # folder by which a rendered session is known
RENDERING = {"motion": 0.3, "drawing": 1.0}  # stages of a video, and the time that each takes
LEAST_MS = 5.0  # shorter contacts are shown, but not counted as missed


def preset_lines() -> list[str]:
    """Every preset and what it renders."""
    from synthetic.presets import PRESETS
    from synthetic.two_view_session import PRESETS as TWO_VIEWS

    meanings = {name: each.meaning for name, each in PRESETS.items()} | TWO_VIEWS
    return [f"  {name}: {meaning}" for name, meaning in meanings.items()]


def render(folder, preset, seed, trials, jobs, progress, say, frames=1000) -> list[Path]:
    """Render the videos of a preset into a folder; `progress` as in `batch.run`.

    Raises
    ------
    ValueError
        If the preset does not exist; the message lists those that do.
    """
    from synthetic.presets import PRESETS
    from synthetic.session import render_session
    from synthetic.two_view_session import PRESETS as TWO_VIEWS
    from synthetic.two_view_session import render_two_views

    _check_folder(Path(folder), preset)
    if preset not in (*PRESETS, *TWO_VIEWS):
        known = "\n".join(preset_lines())
        near = difflib.get_close_matches(preset, [*PRESETS, *TWO_VIEWS], 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        raise ValueError(f"--preset {preset}: no such preset{meant}; expected one of\n{known}")
    Path(folder).mkdir(parents=True, exist_ok=True)
    (Path(folder) / TRUTH).mkdir(exist_ok=True)  # if this is killed, the same command goes on
    if preset in TWO_VIEWS:
        say("rendering two views …")
        paths = render_two_views(folder, preset, seed, trials or 2, frames)
        say(f"videos, settings, points and truth tables: {Path(folder).resolve()}")
        return paths
    trials = trials or PRESETS[preset].trials
    names = [f"trial {trial}" for trial in range(trials)]
    say(f"rendering {counted(trials, 'video')} …")
    with (progress or Progress)(names, RENDERING, "drawing") as shown:
        options = {"jobs": jobs, "progress": shown.receive, "frames": frames}
        paths = render_session(folder, preset, seed, trials, **options)
    say(f"videos, session.toml and truth tables: {Path(folder).resolve()}")
    return paths


def _check_folder(folder, preset):
    """A person's files are not replaced, nor the session.toml of videos of another preset."""
    for scene in sorted((folder / TRUTH).glob("*/scene.json")):
        other = read_json(scene, {}).get("made_from", {}).get("preset", preset)
        if other != preset:
            raise InputError(
                f"{folder}: holds videos of the preset {other}, whose session.toml has no place "
                f"for those of {preset}; choose another folder"
            )
    if folder.is_dir() and not (folder / TRUTH).is_dir():
        there = sorted(p.name for p in folder.iterdir() if not p.name.startswith("."))
        if there:
            raise InputError(
                f"{folder}: holds files that were not rendered ({there[0]}); choose another "
                "folder, or an empty one"
            )


def run_demo(out, jobs, progress, say) -> bool:
    """Render a small session, process it and print its contacts beside the truth.

    Returns True if a video, or figures or report, failed. `progress` as in `batch.run`.
    """
    started = time.monotonic()
    videos, results = Path(out) / "videos", Path(out) / "results"
    say("rendering a small pole-localization session (the first time, some of it is compiling) …")
    with warm_up.meanwhile() if jobs > 1 else contextlib.nullcontext():
        render(videos, DEMO_PRESET, DEMO_SEED, DEMO_TRIALS, max(jobs - 1, 1), progress, say)
    say("processing it …")
    summary = batch.run([videos], results, jobs=jobs, overwrite=True, progress=progress)
    if summary.interrupted:
        raise KeyboardInterrupt
    contacts, truth = read_contacts(results), read_truth(results)
    for line in comparison(contacts, truth) if truth is not None else ():  # else all have failed
        say(line)
    say_problems(summary, say)
    say("")
    for what, path in (
        ("videos and truth", videos),
        ("tables", results / "contacts.csv"),
        ("figures", results / "figures" / "fig3.png"),
        ("report", results / "report.html"),
    ):
        if path.exists():
            say(f"{what:<17} {path.resolve()}")
    say(f"done in {duration(time.monotonic() - started)}; next: whiskerforce init YOUR_FOLDER")
    return bool(summary.of("failed") or summary.undrawn)


def comparison(contacts, truth):
    """Lines of a table: every true contact with the one found, then a summary."""
    from synthetic.scoring.table_scoring import match_contacts

    match = match_contacts(contacts, truth)
    pairs = match.pairs.sort_values(["video", "whisker", "true_onset_frame"])
    yield ""
    yield "contacts, found beside true (force: peak; moment: peak at the follicle)"
    yield (
        f"{'video':<14} {'onset':>6} {'true':>6}  {'ms':>5} {'true':>5}  "
        f"{'µN':>6} {'true':>6}  {'nN m':>7} {'true':>7}  {'ringing':>7}"
    )
    for row in pairs.to_dict("records"):
        yield (
            f"{row['video']:<14} {row['onset_frame']:>6.0f} {row['true_onset_frame']:>6.0f}  "
            f"{row['duration_ms']:>5.0f} {row['true_duration_ms']:>5.0f}  "
            f"{row['peak_force_uN']:>6.2f} {row['true_peak_force_uN']:>6.2f}  "
            f"{row['peak_base_moment_nN_m']:>7.1f} {row['true_peak_base_moment_nN_m']:>7.1f}  "
            f"{row['vibration_ratio']:>7.2f}"
        )
    yield ""
    yield from _summary(match, pairs)


def _summary(match, pairs):
    """A summary of the table."""
    missed = match.missed
    long = int((missed["duration_ms"] >= LEAST_MS).sum())
    yield (
        f"{len(pairs)} of {counted(len(pairs) + len(missed), 'contact')} found "
        f"({long} of {LEAST_MS:g} ms or longer missed), {len(match.invented)} invented"
    )
    if pairs.empty:
        return
    edges = [(pairs[f"{e}_frame"] - pairs[f"true_{e}_frame"]).abs() for e in ("onset", "offset")]
    exact = np.mean([edge <= 1 for edge in edges])
    force = (pairs["peak_force_uN"] / pairs["true_peak_force_uN"] - 1).abs()
    moment = (pairs["peak_base_moment_nN_m"] / pairs["true_peak_base_moment_nN_m"] - 1).abs()
    yield f"{100 * exact:.1f} % of onsets and offsets within one frame"
    yield f"median error of the peak force {100 * force.median():.1f} %"
    yield f"median error of the peak base moment {100 * moment.median():.1f} %"
