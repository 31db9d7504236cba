"""Whether a Snakemake run gives what `whiskerforce run` gives, also where jobs are killed.

    pip install -e ".[cluster]"
    python workflows/cluster.py                # prints
    python workflows/cluster.py --write        # into docs/cluster.md, too

Renders a small session; processes it with `whiskerforce run`; processes it with the Snakefile on
two cores, while the first job that starts is killed; compares all files byte by byte; starts
Snakemake again; and plans the same session for SLURM, without running it. Exit status 1 where
files differ.
"""

import argparse
import csv
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pages

from synthetic import render_session

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "cluster.md"
TIMES = {  # what states how long something took, or when or where: left out of the comparison
    "videos.csv": {"frames_per_s"},
    "run.json": {
        "frames_per_s", "stages", "seconds", "finished", "command", "jobs", "input", "platform",
        "pictures_of", "written",
    },
}  # fmt: skip
LOGS = {"run.log"}
REPORT = "report.html"  # states times and the command
JOB = "pipeline.app.one_video"
PATIENCE_S = 1800
SAID = 12  # last lines of Snakemake's log, where it fails
ENVIRONMENT = os.environ | {
    "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
}


def run_plain(videos, out) -> None:
    """Process with `whiskerforce run`, on two cores."""
    command = [sys.executable, "-m", "pipeline", "run", videos, "--out", out, "--jobs", "2"]
    subprocess.run(
        [*map(str, command), "--overwrite"], check=True, capture_output=True, env=ENVIRONMENT
    )


def snakemake(videos, out, profile, *options) -> list[str]:
    """The command line that processes `videos` into `out` with a profile."""
    folder = ROOT / "workflows"
    return [
        sys.executable, "-m", "snakemake", "-s", str(folder / "Snakefile"),
        "--workflow-profile", str(folder / "profiles" / profile), *options,
        "--config", f"videos={videos}", f"out={out}",
    ]  # fmt: skip


def run_and_kill(command, folder) -> tuple[int, int, str]:
    """Run Snakemake, killing its first job: (exit status, jobs killed, what it said)."""
    said = folder / "snakemake.log"
    with open(said, "w", encoding="utf-8") as file:
        child = subprocess.Popen(
            command, cwd=folder, stdout=file, stderr=subprocess.STDOUT, env=ENVIRONMENT
        )
        killed = kill_first_job(child)
        status = child.wait(PATIENCE_S)
    return status, killed, said.read_text("utf-8")


def kill_first_job(child) -> int:
    """Kill the first job of a running Snakemake as soon as it is there; how many were killed."""
    import psutil

    parent, end = psutil.Process(child.pid), time.monotonic() + PATIENCE_S
    while child.poll() is None and time.monotonic() < end:
        if any(kill_if_job(process) for process in parent.children(recursive=True)):
            return 1
        time.sleep(0.05)
    return 0


def kill_if_job(process) -> bool:
    """Kill a process (of psutil) if it is a job that still runs; whether it was killed."""
    import psutil

    try:
        line = process.cmdline()
        if JOB not in line or "-c" in line:
            return False
        time.sleep(1.0)  # it is at work
        process.send_signal(signal.SIGKILL)
    except psutil.NoSuchProcess:
        return False
    return True


def files_of(out) -> dict:
    """All results in a folder: name → path; hidden files are the program's own."""
    found = {p.relative_to(out).as_posix(): p for p in sorted(out.rglob("*")) if p.is_file()}
    return {n: p for n, p in found.items() if not any(s.startswith(".") for s in n.split("/"))}


def content(path):
    """What a file holds, without times."""
    left_out = TIMES.get(path.name)
    if path.name in LOGS:
        return None
    if path.name == REPORT:
        return re.findall(r'src="data:[^"]+"', path.read_text("utf-8"))
    if left_out is None:
        return path.read_bytes()
    if path.suffix == ".csv":
        with open(path, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return [{k: v for k, v in row.items() if k not in left_out} for row in rows]
    return _without(json.loads(path.read_text("utf-8")), left_out)


def _without(value, keys):
    """A JSON value without some keys, at any depth."""
    if not isinstance(value, dict):
        return value
    return {key: _without(each, keys) for key, each in value.items() if key not in keys}


def compare(one, other) -> tuple[list, list[str]]:
    """Rows of a table: kind of file, how many, how many equal; and the files that differ."""
    here, there = files_of(one), files_of(other)
    differ = sorted(here.keys() ^ there.keys())
    count = {}
    for name in sorted(here.keys() & there.keys()):
        kind = re.sub(r"^[^/]+/", "<video>/", name) if "/" in name else name
        kind = f"figures/*{Path(name).suffix}" if name.startswith("figures/") else kind
        equal = content(here[name]) == content(there[name])
        total, same = count.get(kind, (0, 0))
        count[kind] = total + 1, same + equal
        if not equal:
            differ.append(name)
    return [(kind, total, same) for kind, (total, same) in count.items()], differ


def note(kind) -> str:
    """How files of a kind are compared."""
    name = kind.rsplit("/", 1)[-1]
    if name in LOGS:
        return "is there"
    if name == REPORT:
        return "its plots"
    return "without times" if name in TIMES else "byte by byte"


def try_it(folder, trials, frames) -> tuple[str, bool]:
    """Do it all in a folder; what came of it in Markdown, and whether all is well."""
    videos, plain, made = folder / "videos", folder / "plain", folder / "made"
    render_session(videos, "single", seed=1, trials=trials, frames=frames)
    run_plain(videos, plain)  # compiles: code just compiled and code kept round differently
    run_plain(videos, plain)
    local = snakemake(videos, made, "local", "--cores", "2")
    status, killed, said = run_and_kill(local, folder)
    again = subprocess.run(local, cwd=folder, capture_output=True, text=True, env=ENVIRONMENT)
    dry = snakemake(videos, folder / "dry", "slurm", "--dry-run")
    planned = subprocess.run(dry, cwd=folder, capture_output=True, text=True, env=ENVIRONMENT)
    rows, differ = compare(plain, made)
    idle = "Nothing to be done" in again.stdout + again.stderr
    plan = re.findall(r"^rule (\w+):", planned.stdout + planned.stderr, re.MULTILINE)
    good = status == 0 and killed == 1 and not differ and idle and not planned.returncode
    good = good and plan.count("video") == trials and "Trying to restart job" in said
    table = pages.table(
        ["files", "compared", "number", "the same"],
        [[kind, note(kind), str(total), str(same)] for kind, total, same in rows],
    )
    lines = [
        f"{trials} videos of {frames} frames, `--cores 2`; {killed} job killed while it worked, "
        f"started again by Snakemake {said.count('Trying to restart job')} time(s); exit status "
        f"{status}.",
        "",
        table,
        "",
        f"Started once more: {'nothing to be done' if idle else 'jobs were run again'}. Dry run "
        f"with the SLURM profile: exit status {planned.returncode}, planned "
        f"{plan.count('video')} jobs `video` and {plan.count('gather')} `gather`.",
    ]
    if differ:
        lines += ["", f"Different: {', '.join(differ)}"]
    if status:
        lines += ["", "Snakemake said:", "", *said.splitlines()[-SAID:]]
    return "\n".join(lines), good


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=3)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--keep", type=Path, help="work in this folder, and leave it")
    parser.add_argument("--write", action="store_true", help="write into docs/cluster.md")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as passing:
        folder = args.keep or Path(passing)
        folder.mkdir(parents=True, exist_ok=True)
        text, good = try_it(folder, args.trials, args.frames)
    pages.publish(text, PAGE if args.write else None, "cluster")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
