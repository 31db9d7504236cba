"""How accurate whiskerforce is: rendered videos, processed as by `run`, compared with the truth.

    python workflows/accuracy.py                                # every preset, a few short videos
    python workflows/accuracy.py --presets noisy,h264 --videos 20 --frames 1000 --jobs 2
    python workflows/accuracy.py --full                         # all presets, 20 long videos each

Every video has a seed of its own, drawn from a seed that is printed: `--seed` makes the same
videos again, without it each run makes others. Every hidden length and length in
session.toml is wrong by its stated uncertainty. Each video is processed twice more, to show what
that costs: with all settings exact, and with dimensions, modulus and scale wrong by theirs, too.
Prints tables in Markdown (docs/accuracy_rendered.md holds a run's), then the targets that were
missed; the exit status is 1 where one was. With --out the videos and their truth are kept, with
`accuracy.csv` (all figures) and `worst.csv` (where to look).
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import accuracy_crowds
import measuring
import numpy as np
import pages
import pandas as pd
import wrong_settings
from accuracy_figures import covered, figures_of, matched, peak_errors, samples_of
from accuracy_tables import tables_text, worst_of
from accuracy_targets import checks, checks_text

from synthetic.presets import PRESETS
from synthetic.session import render_session

FRAMES, VIDEOS = 500, 4
FULL_FRAMES, FULL_VIDEOS = 1000, 20


class Task(NamedTuple):
    """One video to be rendered, processed and compared."""

    folder: Path
    preset: str
    number: int
    seed: int
    frames: int
    keep: bool
    dimensions: bool


def tasks_of(preset, folder, args) -> list[Task]:
    """The videos of one preset, each with a seed of its own."""
    return [
        Task(
            folder / f"{k:03d}", preset, k, seed, args.frames, bool(args.out),
            not args.exact_dimensions,
        )
        for k, seed in enumerate(measuring.video_seeds(preset, args.seed, args.videos))
    ]  # fmt: skip


def measure_task(task: Task) -> tuple[measuring.Measured, dict, dict]:
    """Render a video and measure it; what it adds to the figures over videos, and of crowds."""
    (path,) = render_session(
        task.folder, task.preset, task.seed, 1, frames=task.frames, first=task.number
    )
    rng = np.random.default_rng([task.seed, 1])
    exact = measuring.RenderedVideo.of(path, task.folder).settings
    settings = wrong_settings.with_wrong_lengths(exact, rng)
    found = measuring.measure(task.preset, path, task.folder, settings)
    samples, crowds = samples_of(found), {}
    if task.preset in accuracy_crowds.CROWDS:
        crowds = accuracy_crowds.both_samples(found, path, task.folder, exact)
    if task.dimensions and len(found.shape.true_contacts):
        samples |= exact_samples(measuring.measure(task.preset, path, task.folder, exact))
        wrong = wrong_settings.with_wrong_dimensions(settings, rng)
        samples |= wrong_samples(measuring.measure(task.preset, path, task.folder, wrong), wrong)
    if not task.keep:
        path.unlink()
    return found, samples, crowds


def exact_samples(video: measuring.Measured) -> dict[str, np.ndarray]:
    """Errors of peak forces where all settings are exact, and whether the intervals hold them."""
    pairs = matched([video.shape]).pairs
    error, share = peak_errors(pairs)
    return {"exact_peak": share, "exact_covered": covered(error, pairs["peak_force_se_uN"])}


def wrong_samples(video: measuring.Measured, settings) -> dict[str, np.ndarray]:
    """Errors of peak forces, and whether they lie within the report's error budget."""
    pairs = matched([video.shape]).pairs
    cones = {w.name: w.cone_length_mm for w in settings.whisker}
    return {
        "wrong_peak": peak_errors(pairs)[1],
        "wrong_covered": wrong_settings.budget_covers(pairs, cones).astype(float),
    }


def run_preset(preset, folder, args):
    """Render a preset's videos and measure them all: what `measure_task` returns, of each."""
    started, tasks = time.monotonic(), tasks_of(preset, folder, args)
    found = list(measuring.of_each(measure_task, args.jobs, tasks))
    seconds = time.monotonic() - started
    print(f"{preset}: {len(tasks)} videos in {seconds:.0f} s", file=sys.stderr)
    return [list(each) for each in zip(*found, strict=True)]


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--presets", help=f"of {','.join(PRESETS)}; by default all")
    parser.add_argument("--videos", type=int, help=f"per preset (default {VIDEOS})")
    parser.add_argument("--frames", type=int, help=f"of each video (default {FRAMES})")
    parser.add_argument(
        "--full", action="store_true", help=f"{FULL_VIDEOS} videos of {FULL_FRAMES} frames"
    )
    parser.add_argument(
        "--exact-dimensions", action="store_true", help="leave out the runs with other settings"
    )
    parser.add_argument("--out", type=Path, help="folder for videos, truth and tables")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the tables into")
    parser.add_argument("--section", default="accuracy", help="of that file (default accuracy)")
    measuring.add_seed(parser, "all videos are drawn from it")
    args = parser.parse_args(argv)
    args.presets = args.presets.split(",") if args.presets else list(PRESETS)
    unknown = [p for p in args.presets if p not in PRESETS]
    if unknown:
        parser.error(f"--presets: no preset {unknown[0]!r}; there are {', '.join(PRESETS)}")
    args.videos = args.videos or (FULL_VIDEOS if args.full else VIDEOS)
    args.frames = args.frames or (FULL_FRAMES if args.full else FRAMES)
    return args


def preamble(args) -> str:
    """What was measured, and how to measure the same again."""
    again = f"--seed {args.seed} --videos {args.videos} --frames {args.frames}"
    return (
        f"{args.videos} videos of {args.frames} frames per preset, drawn from seed {args.seed} "
        f"(`python workflows/accuracy.py {again}` makes the same). Hidden lengths and lengths in "
        "session.toml are wrong by their stated uncertainty; *wrong dimensions*: radius, cone "
        "length, modulus and scale are, too; *exact settings*: nothing is."
    )


def main(argv=None) -> int:
    """Measure the presets; 1 where a target was missed."""
    measuring.limit_threads()
    args = arguments(argv)
    print(f"seed {args.seed}", file=sys.stderr)
    results, rows, worst, samples, crowds = {}, [], [], {}, {}
    with tempfile.TemporaryDirectory() as temporary:
        for preset in args.presets:
            folder = (args.out or Path(temporary)) / preset
            videos, samples[preset], crowds[preset] = run_preset(preset, folder, args)
            scale = videos[0].pixels_per_mm
            results[preset] = figures_of(videos, scale)
            rows += checks(
                preset, results[preset], {v.video: figures_of([v], scale) for v in videos}
            )
            worst.append(worst_of(videos))
    tables = tables_text(results, samples) + accuracy_crowds.crowds_text(crowds)
    text = "\n\n".join([preamble(args), tables, checks_text(rows)])
    pages.publish(text, args.write, args.section)
    if args.out:
        pd.DataFrame(results).T.to_csv(args.out / "accuracy.csv", index_label="preset")
        pd.concat(worst).to_csv(args.out / "worst.csv", index=False)
    return int(not all(row["met"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
