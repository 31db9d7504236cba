"""Try to break what the program promises, and print the table of docs/reliability.md.

    python workflows/reliability.py --write docs/reliability.md
    python workflows/reliability.py --only steps kills --results results.json

Each promise is tried in a folder of its own, in memory where the system allows it: what matters is
the order of events on the disk, not its speed. Two are tried at a time where there are two cores
(`--jobs`). Promises can be tried one by one: `--results` stores their outcomes, and the table is
made from all outcomes stored there. The exit status is 1 where a promise was broken.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

import measuring
import pages
from promises import PROMISES
from promises.trial import Effort, Promise, attempt

from pipeline.runtime.workers import end_with_parent

IN_MEMORY = Path("/dev/shm")
BROKEN_SHOWN = 20
NOT_TRIED = "Not tried this time"
LONGEST = ("long video", "bounds", "kills", "steps", "many videos")  # begun first


def main(argv=None) -> int:
    """Try the promises; 1 where one is broken."""
    measuring.limit_threads()
    args = _arguments(argv)
    results, started = json.loads(args.results.read_text("utf-8") or "{}"), time.monotonic()
    for name, result in _each_tried(args):
        results[name] = result
        args.results.write_text(json.dumps(results, indent=2), "utf-8")
    text = table_of(results)
    print(text)
    minutes = (time.monotonic() - started) / 60
    print(f"{minutes:.0f} minutes by the clock, {args.jobs} at a time", file=sys.stderr)
    if args.write:
        pages.write_between(args.write, "reliability", text)
    return int(any(each["broken"] for each in results.values()))


def _each_tried(args):
    """Yield the name of each promise that is to be tried, and what came of it."""
    effort = Effort(args.share, args.seed)
    wanted = [promise for promise in PROMISES if promise.name in args.only]
    wanted.sort(key=lambda promise: promise.name not in LONGEST)
    context = multiprocessing.get_context("fork")  # all is loaded here; promises are functions
    with ProcessPoolExecutor(args.jobs, context, end_with_parent) as pool:
        waiting = {pool.submit(_tried, p.name, args.folder, effort): p.name for p in wanted}
        for each in as_completed(waiting):
            yield waiting[each], each.result()


def _tried(name, place, effort) -> dict:
    return tried(next(p for p in PROMISES if p.name == name), place, effort)


def _arguments(argv):
    names = [promise.name for promise in PROMISES]
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME",
                        help=f"promises to try: {', '.join(names)}")  # fmt: skip
    parser.add_argument("--share", type=float, default=1.0, help="of the cases")
    parser.add_argument("--jobs", type=int, default=_cores(), help="promises tried at a time")
    parser.add_argument("--seed", type=int, default=0, help="of what is drawn")
    parser.add_argument("--folder", type=Path, help="for the files of the trials",
                        default=IN_MEMORY if IN_MEMORY.is_dir() else None)  # fmt: skip
    parser.add_argument("--results", type=Path, help="JSON file that keeps the results",
                        default=Path(os.devnull))  # fmt: skip
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    if not args.results.exists():
        args.results.touch()
    return args


def _cores() -> int:
    """Cores that this process may use, at most two: the trials want memory, too."""
    return min(len(os.sched_getaffinity(0)), 2)


def tried(promise: Promise, place, effort) -> dict:
    """What came of a promise, as it is kept; failures go to the terminal as well."""
    with tempfile.TemporaryDirectory(dir=place, prefix="reliability-") as folder:
        own = Path(folder) / "promise"
        own.mkdir()
        result = attempt(promise, own, effort)
    what = result.tried
    for sentence in what.broken[:BROKEN_SHOWN]:
        print(f"{promise.name}: {sentence}", file=sys.stderr)
    print(f"{promise.name}: {what.cases} cases in {result.seconds:.0f} s", file=sys.stderr)
    return {
        "cases": what.cases,
        "broken": what.broken,
        "said": what.said,
        "seconds": round(result.seconds, 1),
        "cpu": round(result.cpu, 1),
    }


def table_of(results, promises=PROMISES) -> str:
    """All promises that were tried, by group, as Markdown."""
    parts = []
    for group in dict.fromkeys(promise.group for promise in promises):
        rows = [
            _row(promise, results[promise.name])
            for promise in promises
            if promise.group == group and promise.name in results
        ]
        if rows:
            header = ["promise", "test", "cases", "in CI", "time", "result"]
            parts.append(f"## {group}\n\n{pages.table(header, rows)}")
    left = [promise.name for promise in promises if promise.name not in results]
    if left:
        parts.append(f"{NOT_TRIED}: {', '.join(left)}.")
    minutes = sum(each["cpu"] for each in results.values()) / 60
    parts.append(f"Times are those of one core; all of this takes {minutes:.0f} minutes of it.")
    return "\n\n".join(parts)


def _row(promise, result) -> list[str]:
    count = len(result["broken"])
    kept = f"**broken in {count}**: {result['broken'][0]}" if count else "kept"
    said = "; ".join(filter(None, (kept, result["said"])))
    in_ci = f"{100 * promise.in_ci:g} %" if promise.in_ci else "–"
    return [
        promise.sentence,
        f"{promise.name}, {promise.place}",
        str(result["cases"]),
        in_ci,
        f"{result['cpu']:.0f} s",
        said,
    ]


if __name__ == "__main__":
    sys.exit(main())
