"""Fig. 3 from rendered videos: the paper's contacts, the true ones, and what `run` recovers.

    python workflows/fig3.py --out fig3                              # some 300 contacts, minutes
    python workflows/fig3.py --out fig3 --sizes 10,30,90             # what a session costs by size
    python workflows/fig3.py --out fig3 --full --write docs/fig3.md  # all 12,417 contacts, hours

Renders a session of the `fig3` preset, processes it by `whiskerforce run` with figures and
report, and compares the tables. The same command resumes a run that was stopped: what is
rendered or processed is not made again, and its time is remembered. The exit status is 1 where
a target is missed or a video failed.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pages
import pandas as pd

from pipeline.reports.session_numbers import read_contacts
from pipeline.tables import files, whole_files
from pipeline.tables.columns import CONTACT_COLUMNS, VIDEO_COLUMNS
from synthetic.scoring.table_scoring import ContactMatch, match_contacts
from synthetic.session import STAGES, RenderError, render_session

TRIALS, FULL_TRIALS = 25, 1035  # 12 touches each; all of the paper's 12,417
PERCENTILES = ("5 %", "median", "95 %")
PERCENTILE_TARGET = 0.03  # of the truth's
R2_TARGET = 0.02
R2 = ("peak force and duration", "r²")
TIMES = "times.json"
CONTACT_QUANTILES = (0.5, 0.9, 0.95, 0.99)


@dataclass(frozen=True)
class Size:
    """A session of so many trials, rendered and processed.

    Attributes
    ----------
    trials, jobs : as on the command line
    frames : of all videos that were processed
    video_bytes, all_bytes : of the videos, and of all that lies in the folder
    rendering, processing : seconds by stage, summed over all videos
    wall : seconds of the steps "render" and "run", summed over all invocations
    numbers : table of fig3.csv: quantity, statistic, unit, recovered, truth, paper
    match : found beside true contacts
    faults : what failed, a line each
    """

    trials: int
    jobs: int
    frames: int
    video_bytes: int
    all_bytes: int
    rendering: dict
    processing: dict
    wall: dict
    numbers: pd.DataFrame
    match: ContactMatch
    faults: list[str]

    @property
    def true_contacts(self) -> int:
        """How many contacts there are."""
        return len(self.match.pairs) + len(self.match.missed)


# Making --------------------------------------------------------------------------------------


def make(folder, trials, seed, jobs) -> Size:
    """Render and process a session in `folder`, or what of it is not there yet."""
    folder = Path(folder)
    videos, results, faults = folder / "videos", folder / "results", []
    with wall_time(folder, "render", "videos/truth/*/scene.json"):
        try:
            render_session(videos, "fig3", seed, trials, jobs, _Rendered(trials))
        except RenderError as error:
            faults.append(str(error))
    with wall_time(folder, "run", "results/*/run.json"):
        run_command(videos, results, jobs)
    outcomes = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    failed = outcomes["status"] == "failed"
    faults += (outcomes["video"] + ": " + outcomes["message"])[failed].tolist()
    done = outcomes[~failed]
    return Size(
        trials=trials,
        jobs=jobs,
        frames=int(done["frames"].sum()),
        video_bytes=sum(path.stat().st_size for path in videos.glob("*/*.mp4")),
        all_bytes=sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()),
        rendering=rendering_seconds(videos),
        processing=processing_seconds(results, done),
        wall=whole_files.read_json(folder / TIMES),
        numbers=pd.read_csv(results / "figures" / "fig3.csv"),
        match=match_contacts(*found_and_true(results, videos)),
        faults=faults,
    )


@dataclass
class _Rendered:
    """Progress of rendering, every tenth video."""

    total: int
    done: int = 0

    def __call__(self, event):
        self.done += event.kind == "done"
        if event.kind == "done" and (self.done % 10 == 0 or self.done == self.total):
            print(f"{self.done}/{self.total} rendered", file=sys.stderr)


def run_command(videos, results, jobs) -> None:
    """`whiskerforce run`; RuntimeError where it fails."""
    command = ["run", str(videos), "--out", str(results), "--jobs", str(jobs)]
    program = [sys.executable, "-m", "pipeline.app.cli"]
    status = subprocess.run([*program, *command], stdout=2).returncode  # tables alone on stdout
    if status not in (0, 1):  # 1: some videos failed, the others are there
        raise RuntimeError(f"whiskerforce {shlex.join(command)} ended with status {status}")


@contextmanager
def wall_time(folder, step, made):
    """Add the wall time of what is inside to a step's in `folder`, also where it is stopped.

    It counts only if any of the files `made` (a pattern) in `folder` is new.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times, before = whole_files.read_json(folder / TIMES, {}), newest(folder, made)
    started = time.perf_counter()
    try:
        yield
    finally:
        if newest(folder, made) > before:
            times[step] = round(times.get(step, 0.0) + time.perf_counter() - started, 3)
            whole_files.write_json(folder / TIMES, times)


def newest(folder, pattern) -> int:
    """When the newest file of a pattern was written [ns]."""
    return max((path.stat().st_mtime_ns for path in folder.glob(pattern)), default=0)


def rendering_seconds(videos) -> dict:
    """Seconds by stage of rendering, summed over the videos of a session."""
    each = [whole_files.read_json(path) for path in (videos / "truth").glob("*/scene.json")]
    return {stage: sum(scene["seconds"][stage] for scene in each) for stage in STAGES}


def processing_seconds(results, outcomes) -> dict:
    """Seconds by stage of `run`, summed over videos; "tables" is what no stage holds."""
    record, seconds = whole_files.read_json(results / "run.json")["inputs"], {}
    for video in outcomes["video"]:
        for stage, spent in record[video]["stages"].items():
            seconds[stage] = seconds.get(stage, 0.0) + spent
    whole = float((outcomes["frames"] / outcomes["frames_per_s"]).sum())
    return {**seconds, "tables": whole - sum(seconds.values())}


def found_and_true(results, videos):
    """Contacts of the results and of the truth, also of videos that have no results."""
    truth = files.read_csv(videos / "truth" / "contacts.csv", CONTACT_COLUMNS)
    return read_contacts(results), truth


# Comparing -----------------------------------------------------------------------------------


def checks(size: Size) -> list[dict]:
    """Every target: `what`, its `deviation` from the truth, the largest `allowed`, `met`."""
    rows = []
    for row in size.numbers.itertuples():
        if row.statistic in PERCENTILES:
            off, limit, form = row.recovered / row.truth - 1, PERCENTILE_TARGET, "{:+.2%}"
        elif (row.quantity, row.statistic) == R2:
            off, limit, form = row.recovered - row.truth, R2_TARGET, "{:+.4f}"
        else:
            continue
        rows.append(
            {
                "what": f"{row.quantity}, {row.statistic}",
                "deviation": form.format(off),
                "allowed": form.format(limit).replace("+", "±"),
                "met": bool(abs(off) <= limit),
            }
        )
    return rows


def errors(match: ContactMatch) -> dict[str, np.ndarray]:
    """Errors of every contact that was found, by what is compared."""
    pairs = match.pairs

    def off(column):
        return (pairs[column] - pairs[f"true_{column}"]).to_numpy(float)

    def share(column):
        with np.errstate(divide="ignore", invalid="ignore"):
            return 100 * off(column) / np.abs(pairs[f"true_{column}"].to_numpy(float))

    return {
        "onset [frames]": off("onset_frame"),
        "offset [frames]": off("offset_frame"),
        "duration [ms]": off("duration_ms"),
        "peak force [µN]": off("peak_force_uN"),
        "peak force [%]": share("peak_force_uN"),
        "impulse [%]": share("impulse_uN_ms"),
        "peak base moment [%]": share("peak_base_moment_nN_m"),
        "contact's place [mm]": off("contact_arc_length_mm"),
        "steady peak moment [%]": share("steady_peak_nN_m"),
        "vibration over steady": off("vibration_ratio"),
    }


# Tables --------------------------------------------------------------------------------------


def numbers_text(size: Size) -> str:
    """Paper, truth and recovered, side by side."""
    rows = []
    for row in size.numbers.itertuples():
        as_number = row.statistic in ("number", "r²")
        off = row.recovered - row.truth if as_number else 100 * (row.recovered / row.truth - 1)
        off_form = {"number": "{:+.0f}", "r²": "{:+.4f}"}.get(row.statistic, "{:+.2f} %")
        form = {"number": "{:.0f}", "r²": "{:.4f}"}.get(row.statistic, "{:.2f}")
        unit = f" [{row.unit}]" if isinstance(row.unit, str) else ""
        values = (pages.cell(form, value) for value in (row.paper, row.truth, row.recovered))
        rows.append([f"{row.quantity}, {row.statistic}{unit}", *values, pages.cell(off_form, off)])
    return pages.table(["", "paper", "truth", "recovered", "recovered − truth"], rows)


def checks_text(size: Size) -> str:
    """Every target with what was reached."""
    rows = [
        [row["what"], row["deviation"], row["allowed"], "ok" if row["met"] else "MISSED"]
        for row in checks(size)
    ]
    return pages.table(["recovered against truth", "deviation", "allowed", ""], rows)


def contacts_text(size: Size) -> str:
    """How many contacts were found, and the errors of those."""
    match, rows = size.match, []
    short = (match.missed["duration_ms"] < 3) | (match.missed["peak_force_uN"] < 1)
    flagged = (match.pairs["flags"].fillna("") != "").mean()
    said = (
        f"{size.true_contacts} contacts: {len(match.pairs)} found, {len(match.missed)} missed "
        f"({int((~short).sum())} of them of at least 3 ms and 1 µN), {len(match.invented)} "
        f"invented, {len(match.surplus)} parts of one that was split; {flagged:.1%} of those "
        "found bear a flag."
    )
    for what, values in errors(match).items():
        known = values[np.isfinite(values)]
        middle = np.median(known) if len(known) else np.nan
        sizes = np.quantile(np.abs(known), CONTACT_QUANTILES) if len(known) else [np.nan] * 4
        rows.append(
            [what, f"{len(known)}", pages.cell("{:+.3g}", middle)]
            + [pages.cell("{:.3g}", value) for value in sizes]
        )
    header = ["error of", "contacts", "median"]
    header += [f"{q:.0%} within" for q in CONTACT_QUANTILES]
    return f"{said}\n\n{pages.table(header, rows)}"


def costs_text(sizes: list[Size]) -> str:
    """Time by stage and size."""
    header = ["", *(f"{size.trials} videos" for size in sizes)]
    rows = [
        ["contacts", *(f"{size.true_contacts}" for size in sizes)],
        ["frames", *(f"{size.frames}" for size in sizes)],
        ["videos [kB/frame]", *(_kilobytes(size, size.video_bytes) for size in sizes)],
        ["all files [kB/frame]", *(_kilobytes(size, size.all_bytes) for size in sizes)],
        ["processes", *(f"{size.jobs}" for size in sizes)],
    ]
    for group in ("rendering", "processing"):
        for stage in dict.fromkeys(stage for size in sizes for stage in getattr(size, group)):
            rows.append(
                [f"{group}: {stage}", *(_cost(s, getattr(s, group), stage) for s in sizes)]
            )
        whole = (per_thousand(size, sum(getattr(size, group).values())) for size in sizes)
        rows.append([f"**{group}**, of a process", *(f"**{value:.3f}**" for value in whole)])
    for step in ("render", "run"):
        rows.append([f"wall time: {step}", *(_cost(s, s.wall, step) for s in sizes)])
    wall = [sum(size.wall.values()) for size in sizes]
    each = (per_thousand(size, spent) for size, spent in zip(sizes, wall, strict=True))
    rows.append(["**wall time**", *(f"**{value:.3f}**" for value in each)])
    rows.append(["wall time of all [min]", *(f"{spent / 60:.1f}" for spent in wall)])
    said = (
        "Seconds per 1000 frames; stages are summed over all processes, `run` draws figures and "
        "report, too."
    )
    return f"{said}\n\n{pages.table(header, rows)}"


def _kilobytes(size, n_bytes):
    return f"{1e-3 * n_bytes / max(size.frames, 1):.1f}"


def _cost(size, seconds, stage):
    return pages.cell("{:.3f}", per_thousand(size, seconds.get(stage, np.nan)))


def per_thousand(size: Size, seconds) -> float:
    """Seconds per 1000 frames."""
    return 1e3 * seconds / max(size.frames, 1)


def text_of(main: Size, sizes: list[Size], command: str) -> str:
    """All that is printed."""
    parts = [
        f"    {command}",
        "### Paper, truth, recovered",
        numbers_text(main),
        checks_text(main),
        "### Contact by contact",
        contacts_text(main),
        "### What it costs",
        costs_text(sizes),
    ]
    parts += [f"- {fault}" for fault in main.faults]
    return "\n\n".join(parts)


# The whole -----------------------------------------------------------------------------------


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, default=Path("fig3"), help="folder for all of it")
    parser.add_argument("--trials", type=int, default=TRIALS, help="videos, 12 contacts each")
    parser.add_argument("--full", action="store_true", help=f"{FULL_TRIALS} videos")
    parser.add_argument("--sizes", default="", help="further numbers of videos, e.g. 10,30,90")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", type=Path, help="a Markdown file to put the tables into")
    args = parser.parse_args(argv)
    try:
        args.sizes = [int(size) for size in args.sizes.split(",") if size]
    except ValueError:
        parser.error(f"--sizes: expected numbers with commas between, got {args.sizes!r}")
    args.trials = FULL_TRIALS if args.full else args.trials
    sizes = (("--sizes", size) for size in args.sizes)
    for name, value in (("--trials", args.trials), ("--jobs", args.jobs), *sizes):
        if value < 1:
            parser.error(f"{name}: expected at least 1, got {value}")
    return args


def main(argv=None) -> int:
    """Make all sizes and compare; 1 where a target was missed or a video failed."""
    args = arguments(argv)
    sizes = {
        trials: make(args.out / f"trials_{trials:04d}", trials, args.seed, args.jobs)
        for trials in sorted({*args.sizes, args.trials})
    }
    main_size = sizes[args.trials]
    words = sys.argv[1:] if argv is None else argv
    command = shlex.join(["python", "workflows/fig3.py", *map(str, words)])
    text = text_of(main_size, list(sizes.values()), command)
    pages.publish(text, args.write, "fig3")
    if args.write:
        picture = args.out / f"trials_{args.trials:04d}" / "results" / "figures" / "fig3.png"
        (args.write.parent / "images").mkdir(exist_ok=True)
        shutil.copyfile(picture, args.write.parent / "images" / "fig3.png")
    good = all(row["met"] for row in checks(main_size))
    return int(not good or any(size.faults for size in sizes.values()))


if __name__ == "__main__":
    sys.exit(main())
