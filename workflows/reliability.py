"""Try to break what the program promises, and print the table of docs/reliability.md.

    python workflows/reliability.py --write docs/reliability.md
    python workflows/reliability.py --only steps kills --results results.json

Each promise is tried in a folder of its own, in memory where the system has such a place: what is
tried is the order of what happens on the disk, not its speed. Parts can be tried one by one:
`--results` keeps what came of them, and the table is made of all that is kept there. The exit
status is 1 where a promise was broken.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import measuring
import pages
from promises import PROMISES
from promises.trial import Effort, Promise, attempt

IN_MEMORY = Path("/dev/shm")
BROKEN_SHOWN = 20
NOT_TRIED = "Not tried this time"


def main(argv=None) -> int:
    """Try the promises; 1 where one is broken."""
    measuring.limit_threads()
    args = _arguments(argv)
    results = json.loads(args.results.read_text("utf-8") or "{}")
    for promise in PROMISES:
        if promise.name in args.only:
            results[promise.name] = tried(promise, args.folder, Effort(args.share, args.seed))
            args.results.write_text(json.dumps(results, indent=2), "utf-8")
    text = table_of(results)
    print(text)
    if args.write:
        pages.write_between(args.write, "reliability", text)
    return int(any(each["broken"] for each in results.values()))


def _arguments(argv):
    names = [promise.name for promise in PROMISES]
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME",
                        help=f"promises to try: {', '.join(names)}")  # fmt: skip
    parser.add_argument("--share", type=float, default=1.0, help="of the cases")
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
            header = ["promise", "test", "cases", "in CI", "result"]
            parts.append(f"## {group}\n\n{pages.table(header, rows)}")
    left = [promise.name for promise in promises if promise.name not in results]
    if left:
        parts.append(f"{NOT_TRIED}: {', '.join(left)}.")
    minutes = sum(each["cpu"] for each in results.values()) / 60
    parts.append(f"All of this takes {minutes:.0f} minutes of one core's time.")
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
        said,
    ]


if __name__ == "__main__":
    sys.exit(main())
