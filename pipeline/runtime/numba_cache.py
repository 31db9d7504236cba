"""Compiled code that Numba keeps beside its source, dropped where it no longer is what is written.

Numba compiles a function again when its own file has changed. That a function which it calls from
another file has changed, Numba does not see: after an update of the program, old and new would
be mixed.
"""

import json
import os
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("pipeline", "synthetic", "whiskermodel")
STAMPS = "compiled_from.json"  # beside the compiled code of the first package
_IMPORT = re.compile(r"^(?:from|import) ([\w.]+)(?: import (\([^)]*\)|.*))?", re.MULTILINE)


def drop_stale(root=ROOT, packages=PACKAGES) -> list[Path]:
    """Remove the compiled code of files that import compiled functions from changed files.

    `root`: the folder of the `packages`. Returns the files that were removed; none where nothing
    has changed since the last call. Where nothing can be written, all stays as it is.
    """
    root = Path(root)
    files = [file for package in packages for file in (root / package).rglob("*.py")]
    sources = {_module(file.relative_to(root)): file for file in files}
    stamps = root / packages[0] / "__pycache__" / STAMPS
    now = {name: file.stat().st_mtime_ns for name, file in sorted(sources.items())}
    before = _read(stamps)
    if now == before:
        return []
    changed = {name for name in now if before.get(name) != now[name]}
    removed = []
    try:
        for name in _callers(sources, changed):
            file = sources[name]
            for index in (file.parent / "__pycache__").glob(f"{file.stem}.*.nbi"):
                index.unlink(missing_ok=True)
                removed.append(index)
        stamps.parent.mkdir(exist_ok=True)
        part = stamps.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(now))
        part.replace(stamps)  # another process never reads a half
    except OSError:
        pass
    return removed


def _module(path) -> str:
    """Dotted name of the module in a file at `path` below the root."""
    return ".".join(path.with_suffix("").parts)


def _read(stamps) -> dict:
    try:
        return json.loads(stamps.read_text())
    except (OSError, ValueError):
        return {}


def _callers(sources, changed) -> set:
    """Files of compiled functions that import from changed ones, at first or second hand."""
    texts = {name: file.read_text(encoding="utf-8") for name, file in sources.items()}
    compiled = {name: _imports(text) for name, text in texts.items() if "njit" in text}
    stale = changed & compiled.keys()
    callers = set()
    while stale:
        stale = {name for name in compiled if compiled[name] & stale} - callers
        callers |= stale
    return callers


def _imports(text) -> set:
    """All that a file may import: modules, and what is taken from them."""
    found = set()
    for module, names in _IMPORT.findall(text):
        found.add(module)
        found.update(f"{module}.{name}" for name in re.findall(r"\w+", names))
    return found
