"""Speed and accuracy of the tracker, compared with the Janelia Whisker Tracker and with decoding.

    python workflows/benchmark_tracking.py
    python workflows/benchmark_tracking.py --peer-python peer/bin/python
    python workflows/benchmark_tracking.py --scenes noisy --frames 20000 --memory 2000,100000

Everything sees the same rendered H.264 videos, on one core, in one run. Decoding alone takes the
luma plane; `trace` is decoding, finding the scene and tracing; `run` the whole command with its
tables, figures and report. The time that a command takes for a video of two frames is its
start-up: it is printed separately and subtracted in the rates of `run` and of the peer. Rates by
CPU time are valid on a busy machine, too. Without the peer (see workflows/peer_tracker.py) its
columns stay empty.
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import measuring
import numpy as np
import pages
from benchmark_clips import BRIEF, SCENES, Clip, decode, render_clip, repeat_video, trace
from benchmark_exactness import exactness
from peer_tracker import OPTIMISED, NoPeerError, find_peer, timed

from pipeline.tables.whole_files import read_json

START_UP_TARGET_S = 5.0
SPEED_TARGETS = {1: 30.0, 4: 15.0}  # times the peer's optimised rate, by number of whiskers
DECODING_TARGET = 0.5
REPEATS = 3


# Speed ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rate:
    """Frames per second by wall and by CPU time."""

    wall: float
    cpu: float

    @classmethod
    def best(cls, frames, times):
        """The fastest of several (wall, CPU) times [s]."""
        return cls(frames / min(w for w, _ in times), frames / min(c for _, c in times))


def clocked(work) -> tuple[float, float]:
    """Wall and CPU time [s] of a call."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - cpu


# The peak is the program's own: what the system reports of a child holds its parent's, too.
RUN = """
import re, resource, sys
from pathlib import Path
from pipeline.app.cli import main
try:
    main()
finally:
    status = Path("/proc/self/status")
    own = re.search(r"VmHWM:\\s*(\\d+)", status.read_text()) if status.exists() else None
    peak = own[1] if own else resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (Path(sys.argv[4]) / "peak_kB").write_text(str(peak))
"""


def run_command(path, out) -> list[str]:
    """The command `whiskerforce run` for one video; its peak memory goes to `out`/peak_kB."""
    return [sys.executable, "-c", RUN, "run", str(path), "--out", str(out), "--jobs", "1"]


@dataclass(frozen=True)
class RunCost:
    """One `whiskerforce run`: wall and CPU time [s], peak memory [MB], seconds by stage."""

    wall: float
    cpu: float
    megabytes: float
    stages: dict


def run_cost(path, folder) -> RunCost:
    """What `whiskerforce run` on one video takes."""
    out = Path(tempfile.mkdtemp(dir=folder))
    try:
        wall, cpu = timed(run_command(path, out))
        megabytes = int((out / "peak_kB").read_text()) / 1024
        record = read_json(out / "run.json")
        return RunCost(wall, cpu, megabytes, next(iter(record["inputs"].values()))["stages"])
    finally:
        shutil.rmtree(out)


def best_of(costs) -> tuple[float, float]:
    """Least wall and CPU time of several runs."""
    return min(c.wall for c in costs), min(c.cpu for c in costs)


def speeds(clip: Clip, folder, peer) -> dict:
    """Rates of decoding, tracing, the whole run and the peer; start-up [s] and stages."""
    for _ in trace(clip, clip.short):
        pass  # compiled code is loaded before the clock starts
    decoding = [clocked(lambda: decode(clip)) for _ in range(REPEATS)]
    tracing = [clocked(lambda: list(trace(clip))) for _ in range(REPEATS)]
    starting = best_of([run_cost(clip.brief, folder) for _ in range(REPEATS)])
    costs = [run_cost(clip.path, folder) for _ in range(REPEATS)]
    whole = np.subtract(best_of(costs), starting)
    rates = {
        "decode": Rate.best(clip.frames, decoding),
        "trace": Rate.best(clip.frames, tracing),
        "run": Rate.best(clip.frames - BRIEF, [whole]),
        "start": starting,
        "stages": min(costs, key=lambda c: c.cpu).stages,
        "peer": None,
    }
    if peer is not None:
        brief = np.min([peer.trace(clip.brief)[1:] for _ in range(REPEATS)], axis=0)
        work = np.subtract(peer.trace(clip.short)[1:], brief)
        rates["peer"] = Rate.best(clip.short_frames - BRIEF, [work])
    return rates


# Memory --------------------------------------------------------------------------------------


def memory(clip: Clip, folder, lengths) -> dict[int, float]:
    """Peak memory [MB] of `whiskerforce run` on videos of several lengths."""
    found = {}
    shutil.copy(clip.path.parent / "session.toml", folder / "session.toml")
    for n in lengths:
        path = folder / f"long_{n}{clip.path.suffix}"
        repeat_video(clip.path, path, n)
        found[n] = run_cost(path, folder).megabytes
        path.unlink()
    return found


# Tables --------------------------------------------------------------------------------------


def speeds_text(clips, rates) -> str:
    """Rates of all scenes."""
    header = ["scene", "whiskers", "by", "decode", "trace", "run", "run [Mpx/s]", "run / decode"]
    header += ["peer", f"peer × {OPTIMISED}", "run / peer", f"run / (peer × {OPTIMISED})"]
    rows = []
    for clip in clips:
        each = rates[clip.name]
        for by in ("wall", "cpu"):
            decoding, tracing, whole = (getattr(each[k], by) for k in ("decode", "trace", "run"))
            peer = getattr(each["peer"], by) if each["peer"] else np.nan
            numbers = [
                ("{:.0f}", decoding), ("{:.0f}", tracing), ("{:.0f}", whole),
                ("{:.0f}", whole * clip.pixels / 1e6), ("{:.2f}", whole / decoding),
                ("{:.1f}", peer), ("{:.1f}", peer * OPTIMISED), ("{:.0f}", whole / peer),
                ("{:.0f}", whole / peer / OPTIMISED),
            ]  # fmt: skip
            whiskers = str(len(clip.settings.whisker))
            rows.append([clip.name, whiskers, by, *(pages.cell(f, v) for f, v in numbers)])
    return f"### Frames per second, one core\n\n{pages.table(header, rows)}"


def stages_text(clips, rates) -> str:
    """Where the time of `run` goes, by its own clock."""
    stages = dict.fromkeys(stage for clip in clips for stage in rates[clip.name]["stages"])
    rows = [
        [
            clip.name,
            *(f"{1e3 * rates[clip.name]['stages'].get(s, 0) / clip.frames:.3f}" for s in stages),
            *(f"{t:.1f}" for t in rates[clip.name]["start"]),
        ]
        for clip in clips
    ]
    table = pages.table(["scene", *stages, "start-up", "its CPU time"], rows)
    return f"### Stages of `run` [ms per frame], start-up [s]\n\n{table}"


EXACTNESS = {
    "frames": ("frames", "{:.0f}"),
    "median [px]": ("median_px", "{:.4f}"),
    "RMS [px]": ("rms_px", "{:.4f}"),
    "95 % [px]": ("p95_px", "{:.4f}"),
    "covered": ("covered", "{:.1%}"),
    "κ bias [1/m]": ("curvature_bias", "{:+.2f}"),
    "κ SD [1/m]": ("curvature_sd", "{:.2f}"),
    "wrong whisker": ("identity_errors", "{:.0f}"),
    "strayed": ("strayed", "{:.0f}"),
    "false / frame": ("false_per_frame", "{:.3f}"),
    "long false / frame": ("long_false_per_frame", "{:.4f}"),
}


def exactness_text(found) -> str:
    """Lines and curvature of both programs."""
    rows = [
        [scene, who, *(pages.cell(form, figures[key]) for key, form in EXACTNESS.values())]
        for scene, both in found.items()
        for who, figures in both.items()
    ]
    return f"### Exactness\n\n{pages.table(['scene', 'program', *EXACTNESS], rows)}"


def targets(clips, rates) -> list[list]:
    """Speed targets (by CPU time): what, reached, target, whether it is met."""
    started = max(rates[clip.name]["start"][1] for clip in clips)
    met = started <= START_UP_TARGET_S
    rows = [["start-up [s]", f"{started:.1f}", f"<= {START_UP_TARGET_S:g}", met]]
    for clip in clips:
        each, count = rates[clip.name], len(clip.settings.whisker)
        share = each["run"].cpu / each["decode"].cpu
        if count == 1:
            what = f"{clip.name}: run / decode"
            rows.append(
                [what, f"{share:.2f}", f">= {DECODING_TARGET:g}", share >= DECODING_TARGET]
            )
        if each["peer"] and count in SPEED_TARGETS:
            times = each["run"].cpu / each["peer"].cpu / OPTIMISED
            what = f"{clip.name}: run / (peer × {OPTIMISED})"
            target = SPEED_TARGETS[count]
            rows.append([what, f"{times:.1f}", f">= {target:g}", times >= target])
    return rows


def targets_text(rows) -> str:
    """The targets as a table."""
    said = [[*row[:3], "ok" if row[3] else "MISSED"] for row in rows]
    return f"### Speed targets\n\n{pages.table(['what', 'reached', 'target', ''], said)}"


# The whole -----------------------------------------------------------------------------------


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", help=f"of {','.join(SCENES)}; by default all")
    parser.add_argument("--frames", type=int, default=10000, help="frames that are timed")
    parser.add_argument("--peer-frames", type=int, default=100, help="frames for the slow peer")
    parser.add_argument("--peer-python", help="python of the environment with the peer")
    parser.add_argument("--no-peer", action="store_true")
    parser.add_argument("--memory", default="2000,20000", help="lengths whose memory is measured")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the tables into")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(argv)
    args.scenes = args.scenes.split(",") if args.scenes else list(SCENES)
    args.memory = [int(n) for n in args.memory.split(",") if n]
    unknown = [s for s in args.scenes if s not in SCENES]
    if unknown:
        parser.error(f"--scenes: no scene {unknown[0]!r}; there are {', '.join(SCENES)}")
    return args


def one_core() -> str:
    """Bind this process and its children to one core; what was possible, as text."""
    measuring.limit_threads()
    if not hasattr(os, "sched_setaffinity"):
        return "one thread each; this system cannot bind them to one core"
    core = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {core})
    return "bound to one core"


def the_peer(args, banks_video):
    """The peer, or None with a word on why."""
    if args.no_peer:
        return None
    try:
        return find_peer(args.peer_python, banks_video)
    except NoPeerError as error:
        print(f"Without the peer: {error}")
        return None


def main(argv=None) -> int:
    """Run the benchmark; 1 where a speed target was missed."""
    args = arguments(argv)
    print(f"{one_core()}; rates are the best of {REPEATS} runs")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        clips = [
            render_clip(name, folder, args.frames, args.peer_frames, args.seed)
            for name in args.scenes
        ]
        peer = the_peer(args, clips[0].short)
        rates = {clip.name: speeds(clip, folder, peer) for clip in clips}
        found = {clip.name: exactness(clip, peer) for clip in clips}
        peaks = memory(clips[0], folder, args.memory)
        if peer is not None:
            shutil.rmtree(peer.folder)
    rows = targets(clips, rates)
    parts = [speeds_text(clips, rates), stages_text(clips, rates), exactness_text(found)]
    parts += [f"Peak memory of `run` on {n} frames: {mb:.0f} MB." for n, mb in peaks.items()]
    text = "\n\n".join([*parts, targets_text(rows)])
    pages.publish(text, args.write, "benchmark")
    return int(not all(row[3] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
