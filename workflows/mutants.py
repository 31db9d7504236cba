"""Whether the tests notice changes: one line of a copy is changed at a time, and tests are run.

    python workflows/mutants.py                  # the changes that once survived the suite
    python workflows/mutants.py --random 40      # and forty drawn at random, by a printed seed

A change is a sign, a comparison, a minimum for a maximum, or a number twice as large. It is
noticed when a test of its room fails. Prints a table; the exit status is 1 where fewer than 95 %
were noticed. A change that alters no number (an equivalent mutant) counts as survived: check it
by eye.
"""

import argparse
import ast
import os
import re
import secrets
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pages

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("pipeline", "whiskermodel", "synthetic", "tests", "workflows")
TESTS = {  # folder of the changed file: where its tests are
    "whiskermodel": ("tests/whiskermodel",),
    "pipeline/forces": ("tests/pipeline/forces",),
    "pipeline/contacts": ("tests/pipeline/contacts", "tests/pipeline/forces/test_forces.py"),
    "synthetic": ("tests/synthetic",),
}
INSIDE = {  # of which file's tests theirs are a part
    **dict.fromkeys(
        ("rod_integration", "rod_outputs", "rod_types", "normal_equations"), "rod_fit"
    ),
    **dict.fromkeys(("intervals", "probability"), "analysis"),
}
ROOMS = ("whiskermodel", "pipeline/forces", "pipeline/contacts")  # of random changes
WANTED = 0.95
TIMEOUT_S = 1800
NAMED = (  # file, line as it is, changed line
    (
        "pipeline/contacts/summary.py",
        '"modulus_uN_per_percent": 0.01 * force',
        '"modulus_uN_per_percent": 0.02 * force',
    ),
    (
        "pipeline/forces/rod_outputs.py",
        "gradient[1, q] = force * base[2, q]",
        "gradient[1, q] = -force * base[2, q]",
    ),
    (
        "pipeline/forces/rod_outputs.py",
        "gradient[2, q] = -force * base[2, q]",
        "gradient[2, q] = force * base[2, q]",
    ),
    ("pipeline/forces/rod_outputs.py", "-side * cov[0, size - 1]", "side * cov[0, size - 1]"),
    ("pipeline/forces/forces.py", "stiffer = 4 /", "stiffer = 2 /"),
    ("pipeline/forces/forces.py", '["gap_force_cov"] *= noise**2', '["gap_force_cov"] *= noise'),
    ("pipeline/contacts/peaks.py", "course - FIRM_SD * error", "course + FIRM_SD * error"),
    (
        "pipeline/forces/rest_shape.py",
        "drift_cov = CORRELATED_FRAMES / frames",
        "drift_cov = 1 / frames",
    ),
    ("whiskermodel/supported.py", "int(touching[-1]) + 1", "int(touching[-1]) + 2"),
    ("synthetic/motion.py", "way = np.minimum(", "way = np.maximum("),
)
SWAPS = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.Lt: ">=",
    ast.Gt: "<=",
    ast.LtE: ">",
    ast.GtE: "<",
}
WORDS = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}


@dataclass(frozen=True)
class Mutant:
    """One changed line of a file (path from the root)."""

    path: str
    line: int
    before: str
    after: str


def named_mutants() -> list[Mutant]:
    """The changes of NAMED; ValueError where the code no longer has such a line."""
    found = []
    for path, old, new in NAMED:
        lines = (ROOT / path).read_text("utf-8").splitlines()
        places = [k for k, line in enumerate(lines) if old in line]
        if len(places) != 1:
            raise ValueError(f"{path} must have one line with {old!r}, got {len(places)}")
        line = lines[places[0]]
        found.append(Mutant(path, places[0], line, line.replace(old, new)))
    return found


def random_mutants(count: int, rng) -> list[Mutant]:
    """Changes drawn from all that `changes_of` finds in the ROOMS, at most one per line."""
    every = [
        change
        for room in ROOMS
        for path in sorted((ROOT / room).glob("*.py"))
        for change in changes_of(path.relative_to(ROOT).as_posix(), path.read_text("utf-8"))
    ]
    return [every[k] for k in rng.permutation(len(every))[:count]]


def changes_of(path: str, text: str) -> list[Mutant]:
    """Every line's possible change (the last one found on it)."""
    lines, found = text.splitlines(), {}
    for node in ast.walk(ast.parse(text)):
        change = _change(node, lines)
        if change is not None:
            line, first, last, new = change
            old = lines[line]
            found[line] = Mutant(path, line, old, old[:first] + new + old[last:])
    return [found[line] for line in sorted(found)]


def _change(node, lines):
    """Line, columns and new text of one node's change; None where it has none on one line."""
    if isinstance(node, ast.BinOp | ast.Compare):
        left = node.left
        right = node.right if isinstance(node, ast.BinOp) else node.comparators[0]
        sign = node.op if isinstance(node, ast.BinOp) else node.ops[0]
        new = SWAPS.get(type(sign))
        if new and left.end_lineno == right.lineno and lines[left.end_lineno - 1].isascii():
            between = lines[left.end_lineno - 1][left.end_col_offset : right.col_offset]
            if between.strip() in ("+", "-", "*", "/", "<", ">", "<=", ">="):
                return left.end_lineno - 1, left.end_col_offset, right.col_offset, f" {new} "
    if isinstance(node, ast.Name | ast.Attribute):
        word = node.id if isinstance(node, ast.Name) else node.attr
        if word in WORDS and lines[node.end_lineno - 1].isascii():
            end = node.end_col_offset
            return node.end_lineno - 1, end - len(word), end, WORDS[word]
    is_number = isinstance(node, ast.Constant) and type(node.value) is float
    if is_number and lines[node.lineno - 1].isascii():
        return node.lineno - 1, node.col_offset, node.end_col_offset, repr(2 * node.value or 1.0)
    return None


def survives(mutant: Mutant, copy: Path) -> bool:
    """Whether the tests of the changed file's room pass in the `copy` of the code."""
    path = copy / mutant.path
    original, times = path.read_text("utf-8"), path.stat()
    lines = original.splitlines()
    lines[mutant.line] = mutant.after
    path.write_text("\n".join(lines) + "\n", "utf-8")
    try:
        return _tests_pass(mutant.path, copy)
    finally:
        path.write_text(original, "utf-8")
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def tests_of(path: str, root: Path) -> list[Path]:
    """Test files of a file's room, those first that name it most: there changes are noticed."""
    room = next(room for room in TESTS if path.startswith(f"{room}/"))
    name = re.compile(rf"\b(test_)?{INSIDE.get(Path(path).stem, Path(path).stem)}\b")
    files = []
    for place in TESTS[room]:
        files += (
            [root / place] if place.endswith(".py") else sorted((root / place).glob("**/*.py"))
        )
    files = [file for file in dict.fromkeys(files) if file.name.startswith("test_")]

    def mentions(file):
        return len(name.findall(f"{file.stem} {file.read_text('utf-8')}"))

    return sorted(
        files, key=lambda file: (f"test_{Path(path).stem}" != file.stem, -mentions(file))
    )


def _tests_pass(path, copy) -> bool:
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    command += [str(file) for file in tests_of(path, copy)]
    environment = {**os.environ, "PYTHONPATH": str(copy), "OMP_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        return False  # it no longer ends
    return done.returncode == 0


def copied(folder: Path) -> Path:
    """The code and its tests in a folder, with compiled code and times as they are."""
    for name in PACKAGES:
        shutil.copytree(ROOT / name, folder / name)
    for name in ("pyproject.toml", "README.md"):
        shutil.copy2(ROOT / name, folder)
    return folder


def main(argv=None) -> int:
    """Change, test and count; 1 where too many changes survive."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--random", type=int, default=0, help="changes drawn at random")
    parser.add_argument("--seed", type=int, help="of these (default: a new one)")
    args = parser.parse_args(argv)
    seed = secrets.randbits(31) if args.seed is None else args.seed
    mutants = named_mutants() + random_mutants(args.random, np.random.default_rng(seed))
    rows, survived = [], 0
    with tempfile.TemporaryDirectory() as folder:
        copy = copied(Path(folder))
        for mutant in mutants:
            left = survives(mutant, copy)
            survived += left
            place = f"{mutant.path}:{mutant.line + 1}"
            rows.append([place, f"`{mutant.after.strip()}`", "SURVIVED" if left else "noticed"])
            print(*rows[-1], file=sys.stderr)
    print(pages.table(["where", "changed line", ""], rows))
    print(f"\n{len(rows) - survived} of {len(rows)} changes noticed; random ones of seed {seed}")
    return int(survived > (1 - WANTED) * len(rows))


if __name__ == "__main__":
    sys.exit(main())
