"""Whether the tests notice changes: one line of a copy is changed at a time, and tests are run.

    python workflows/mutants.py                  # the changes that once survived the suite
    python workflows/mutants.py --random 40      # and forty drawn at random, by a printed seed

A change is a sign, a comparison, a minimum for a maximum, or a number twice as large; messages of
errors are left alone. It is noticed when a test of its room fails; without it, all must pass.
Functions that take Numba minutes to compile are first tested as plain Python.
A change of the whisker model that no test notices may alter no number: it does not count where all
numbers of random inputs (`mutant_numbers`, with a seed of their own) stay within 1e-7. Otherwise
it has survived: look at it. Prints a table; the exit status is 1 where fewer than 95 % of the
changes that count were noticed.
"""

import argparse
import ast
import hashlib
import json
import multiprocessing
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

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("pipeline", "whiskermodel", "synthetic", "tests", "workflows", "docs")
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
SAME = 1e-7  # of the largest number of its kind: less is rounding, and where a search ends
NOTICED, SURVIVED, SAME_NUMBERS = "noticed", "SURVIVED", "alters no number"
TIMEOUT_S = 900
LONG_S = 0.5  # tests that take longer come last
SECONDS = "seconds.jsonl"
UNCOMPILED = {  # of files that take minutes to compile: tests that are quick as plain Python
    "rod_integration": "tests/pipeline/forces/test_rod_integration.py",
    **dict.fromkeys(
        ("normal_equations", "rod_fit", "rod_outputs"), "tests/pipeline/forces/test_rod_outputs.py"
    ),
}
LIBRARIES = ("numba", "pandas", "pytest", "scipy.optimize", "scipy.stats")  # imported once
NAMED = (  # file, line as it is, changed line
    (
        "pipeline/contacts/summary.py",
        '"modulus_uN_per_percent": 0.01 * known',
        '"modulus_uN_per_percent": 0.02 * known',
    ),
    (
        "pipeline/forces/rod_outputs.py",
        "gradient[2, q] = force * base[2, q]",
        "gradient[2, q] = -force * base[2, q]",
    ),
    (
        "pipeline/forces/rod_outputs.py",
        "gradient[3, q] = -force * base[2, q]",
        "gradient[3, q] = force * base[2, q]",
    ),
    ("pipeline/forces/rod_outputs.py", "-side * cov[0, size - 1]", "side * cov[0, size - 1]"),
    ("pipeline/forces/forces.py", "stiffer = 4 /", "stiffer = 2 /"),
    (
        "pipeline/forces/forces.py",
        'fit["gap_force_cov"] * noise**2',
        'fit["gap_force_cov"] * noise',
    ),
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
METHODS = multiprocessing.get_all_start_methods()
_PROCESSES = multiprocessing.get_context("forkserver" if "forkserver" in METHODS else "spawn")
_PROCESSES.set_forkserver_preload(list(LIBRARIES))
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


def random_mutants(count: int, rng, rooms=ROOMS) -> list[Mutant]:
    """Changes drawn from all that `changes_of` finds in the rooms, at most one per line."""
    every = [
        change
        for room in rooms
        for path in sorted((ROOT / room).glob("*.py"))
        for change in changes_of(path.relative_to(ROOT).as_posix(), path.read_text("utf-8"))
    ]
    return [every[k] for k in rng.permutation(len(every))[:count]]


def changes_of(path: str, text: str) -> list[Mutant]:
    """Every line's possible change (the last one found on it)."""
    lines, found, tree = text.splitlines(), {}, ast.parse(text)
    messages = {
        part for node in ast.walk(tree) if isinstance(node, ast.Raise) for part in ast.walk(node)
    }
    for node in ast.walk(tree):
        change = _change(node, lines)
        if change is not None and node not in messages:
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


class Copy:
    """A copy of the code, its compiled code, and how long each test takes there."""

    def __init__(self, folder: Path):
        self.root, self.compiled, self.seconds = folder / "code", folder / "compiled", {}
        self.seed = secrets.randbits(31)  # of the numbers
        for name in PACKAGES:
            shutil.copytree(ROOT / name, self.root / name)
        for name in ("pyproject.toml", "README.md"):
            shutil.copy2(ROOT / name, self.root)
        self._take_compiled()

    def _take_compiled(self):
        """Compiled code as it is beside the sources, or where NUMBA_CACHE_DIR says."""
        from pipeline.runtime import numba_cache

        numba_cache.prepare_cache()
        elsewhere = os.environ.get("NUMBA_CACHE_DIR")
        os.environ["NUMBA_CACHE_DIR"] = str(self.compiled)
        numba_cache.drop_stale(self.root)  # notes the sources' times
        for folder in {file.parent for file in self.root.rglob("*.py")}:
            own = ROOT / folder.relative_to(self.root)
            old = Path(elsewhere) / _cached(own) if elsewhere else own / "__pycache__"
            new = self.compiled / _cached(folder)
            for file in [*old.glob("*.nbi"), *old.glob("*.nbc")]:
                new.mkdir(exist_ok=True)
                shutil.copy2(file, new)

    def prepare(self, room: str) -> None:
        """Compile and time the tests of a room; ValueError where they fail as the code is."""
        files = tests_of(room, self.root)
        uncompiled = {self.root / test for test in UNCOMPILED.values()} & {*files}
        if not (self._pass(files, self.compiled) and self._pass(sorted(uncompiled), None)):
            said = (self.root / "said.txt").read_text("utf-8")
            raise ValueError(f"tests of {room} must pass as the code is, got\n{said}")
        lines = (self.root / SECONDS).read_text("utf-8").splitlines()
        self.seconds.update(json.loads(line) for line in lines)

    def verdict(self, mutant: Mutant) -> str:
        """Whether the tests of the changed file's room pass and, if so, numbers are as before."""
        path = self.root / mutant.path
        original, times = path.read_text("utf-8"), path.stat()
        lines = original.splitlines()
        lines[mutant.line] = mutant.after
        first = [self.root / UNCOMPILED[path.stem]] if path.stem in UNCOMPILED else []
        files = tests_of(mutant.path, self.root)
        with tempfile.TemporaryDirectory(dir=self.root) as folder:
            compiled = Path(folder) / "compiled"
            shutil.copytree(self.compiled, compiled, copy_function=os.link)
            path.write_text("\n".join(lines) + "\n", "utf-8")
            try:
                if not (self._pass(first, None) and self._pass(files, compiled)):
                    return NOTICED
                changed = self._numbers(mutant.path, compiled)
            finally:
                path.write_text(original, "utf-8")
                os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        return SAME_NUMBERS if same(changed, self._numbers(mutant.path, None)) else SURVIVED

    def _numbers(self, path, compiled) -> np.ndarray | None:
        """What `mutant_numbers` gives in the copy; None where that fails or knows no such file."""
        file = self.root / "numbers.npy"
        file.unlink(missing_ok=True)
        command = [sys.executable, "-B", str(self.root / "workflows" / "mutant_numbers.py")]
        environment = {
            "PYTHONPATH": str(self.root),
            "NUMBA_CACHE_DIR": str(compiled or self.compiled),
        }
        try:
            subprocess.run(
                [*command, path, str(self.seed), str(file)],
                cwd=self.root,
                env=os.environ | environment,
                capture_output=True,
                timeout=TIMEOUT_S,
            )
        except subprocess.TimeoutExpired:
            return None
        return np.load(file) if file.exists() else None

    def _pass(self, files, compiled) -> bool:
        """Whether tests pass; `compiled`: Numba's folder, None where nothing is compiled."""
        if not files:
            return True
        names = [str(file) for file in files]
        process = _PROCESSES.Process(target=_run, args=(self.root, compiled, names, self.seconds))
        process.start()
        process.join(TIMEOUT_S)
        if process.exitcode is None:  # it no longer ends
            process.kill()
            process.join()
        return process.exitcode == 0


def same(changed: np.ndarray | None, numbers: np.ndarray | None) -> bool:
    """Whether there are numbers, and none differs by SAME or more."""
    if changed is None or numbers is None or changed.shape != numbers.shape:
        return False
    return np.allclose(changed, numbers, rtol=0, atol=SAME, equal_nan=True)


def _cached(folder: Path) -> str:
    """Name of the folder in NUMBA_CACHE_DIR that Numba has for a folder of sources."""
    return f"{folder.name}_{hashlib.sha1(str(folder).encode()).hexdigest()}"


def _run(root, compiled, files, seconds):
    """Tests in a process of its own, which ends with pytest's exit status."""
    with open(root / "said.txt", "w") as said:
        for stream in (1, 2):
            os.dup2(said.fileno(), stream)
    os.chdir(root)
    sys.path.insert(0, str(root))
    sys.dont_write_bytecode = True  # Python knows a changed file by the second only
    os.environ["PYTHONPATH"] = str(root)
    import numba
    import pytest

    if compiled is None:
        numba.config.DISABLE_JIT = True
    else:
        os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = str(compiled)
    clock = _Clock(seconds, root / SECONDS, compiled is None)
    sys.exit(int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *files], plugins=[clock])))


class _Clock:
    """Plugin of pytest: notes how long tests take, and puts those last that took long."""

    def __init__(self, seconds, path, plain):
        self.seconds, self.path, self.plain, self.spent = seconds, path, plain, {}
        if not plain:
            path.write_text("", "utf-8")

    def pytest_collection_modifyitems(self, items):
        items.sort(key=lambda item: self.seconds.get(item.nodeid, 0.0) > LONG_S)

    def pytest_runtest_logreport(self, report):
        if self.plain:
            if report.failed and "ZeroDivisionError" in report.longreprtext:
                os._exit(0)  # what Python refuses, compiled code may do
            return
        self.spent[report.nodeid] = self.spent.get(report.nodeid, 0.0) + report.duration
        if report.passed and report.when == "teardown":
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps([report.nodeid, self.spent[report.nodeid]]) + "\n")


def room_of(path: str) -> str:
    """The room of TESTS that a file (or the room itself) belongs to."""
    return next(room for room in TESTS if f"{path}/".startswith(f"{room}/"))


def tests_of(path: str, root: Path) -> list[Path]:
    """Test files of a file's room, those first that name it most: there changes are noticed."""
    room = room_of(path)
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


def main(argv=None) -> int:
    """Change, test and count; 1 where too many changes survive."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--random", type=int, default=0, help="changes drawn at random")
    parser.add_argument("--seed", type=int, help="of these (default: a new one)")
    parser.add_argument("--room", choices=ROOMS, action="append", help="of these only")
    args = parser.parse_args(argv)
    seed = secrets.randbits(31) if args.seed is None else args.seed
    rooms = tuple(args.room or ROOMS)
    named = [m for m in named_mutants() if not args.room or m.path.startswith(rooms)]
    mutants = named + random_mutants(args.random, np.random.default_rng(seed), rooms)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for room in dict.fromkeys(room_of(mutant.path) for mutant in mutants):
            copy.prepare(room)
        for mutant in mutants:
            place = f"{mutant.path}:{mutant.line + 1}"
            rows.append([place, f"`{mutant.after.strip()}`", copy.verdict(mutant)])
            print(*rows[-1], file=sys.stderr)
    import pages  # not in the processes that test: they take all packages from the copy

    print(pages.table(["where", "changed line", ""], rows))
    results = [row[-1] for row in rows]
    noticed, survived = results.count(NOTICED), results.count(SURVIVED)
    print(
        f"\n{noticed} of {noticed + survived} changes noticed, {results.count(SAME_NUMBERS)} more "
        f"alter no number; random ones of seed {seed}, numbers of seed {copy.seed}"
    )
    return int(noticed < WANTED * (noticed + survived))


if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    sys.exit(main())
