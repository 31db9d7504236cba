"""Compiled code that Numba keeps on disk: where it is kept, and when it is dropped.

Numba compiles a function again when its own file has changed. It does not see that a function or
a constant of another file, which the first one uses, has changed: after an update of the program,
old and new code would be mixed.

Compiled code lies beside its source. Where nothing can be written there (an installation for all
users of a machine) it lies in the user's cache folder, and where there is none, in a temporary
folder. `NUMBA_CACHE_DIR`, if set, comes first.
"""

import atexit
import contextlib
import hashlib
import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("pipeline", "synthetic", "whiskermodel")
VARIABLE = "NUMBA_CACHE_DIR"
_IMPORT = re.compile(r"^(?:from|import) ([\w.]+)(?: import (\([^)]*\)|.*))?", re.MULTILINE)


def prepare_cache(root=ROOT, packages=PACKAGES) -> list[Path]:
    """Choose the folder for compiled code, and `drop_stale` in it; call it before work begins."""
    root = Path(root)
    beside = root / packages[0] / "__pycache__"
    if not os.environ.get(VARIABLE) and not _is_writable(beside):
        os.environ[VARIABLE] = str(_folder_elsewhere())  # workers inherit it
        if "numba" in sys.modules:  # it has read the environment already
            sys.modules["numba"].config.CACHE_DIR = os.environ[VARIABLE]
    return drop_stale(root, packages)


def drop_stale(root=ROOT, packages=PACKAGES) -> list[Path]:
    """Remove the compiled code of files that import from changed files.

    `root`: the folder of the `packages`. Returns the files that were removed; none where nothing
    has changed since the last call. Where nothing can be written, all stays as it is.
    """
    root = Path(root)
    files = [file for package in packages for file in (root / package).rglob("*.py")]
    sources = {_module(file.relative_to(root)): file for file in files}
    stamps = _stamps(root, packages[0])
    now = {name: file.stat().st_mtime_ns for name, file in sorted(sources.items())}
    before = _read(stamps)
    if now == before:
        return []
    changed = {name for name in now if before.get(name) != now[name]}
    removed = []
    try:
        for name in _callers(sources, changed):
            for index in _indexes(sources[name]):
                index.unlink(missing_ok=True)
                removed.append(index)
        stamps.parent.mkdir(parents=True, exist_ok=True)
        part = stamps.with_suffix(f".{os.getpid()}.part")
        part.write_text(json.dumps(now))
        part.replace(stamps)  # another process never reads a half
    except OSError:
        pass
    return removed


def is_compiled(file="pipeline/forces/rod_fit.py") -> bool:
    """Whether the functions in a file, by default the slowest to compile, were compiled before."""
    return any(_indexes(ROOT / file))


def _stamps(root, package) -> Path:
    """File with the modification times of all sources at the last check."""
    if VARIABLE not in os.environ:
        return root / package / "__pycache__" / "compiled_from.json"
    installation = hashlib.sha256(str(root).encode()).hexdigest()[:12]
    return Path(os.environ[VARIABLE]) / f"compiled_from_{installation}.json"


def _indexes(file):
    """Numba's index files of the functions in a source file; without them it compiles again."""
    if VARIABLE in os.environ:
        return Path(os.environ[VARIABLE]).glob(f"{file.parent.name}_*/{file.stem}.*.nbi")
    return (file.parent / "__pycache__").glob(f"{file.stem}.*.nbi")


def _is_writable(folder) -> bool:
    """Whether files can be created in the folder, which is created if it is missing."""
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _folder_elsewhere() -> Path:
    """The user's folder for compiled code; if there is none, a temporary one."""
    user = _user_caches() / "whiskerforce"
    with contextlib.suppress(OSError):
        user.mkdir(parents=True, exist_ok=True)
    if _is_writable(user):
        return user
    passing = Path(tempfile.mkdtemp(prefix="whiskerforce-"))
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    return passing


def _user_caches() -> Path:
    """The user's cache folder."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _module(path) -> str:
    """Dotted name of the module in a file at `path` below the root."""
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def _read(stamps) -> dict:
    try:
        return json.loads(stamps.read_text())
    except (OSError, ValueError):
        return {}


def _callers(sources, changed) -> set:
    """Files of compiled functions that import from changed ones, directly or through each other.

    What is imported from a package may come from any of its files.
    """
    texts = {name: file.read_text(encoding="utf-8") for name, file in sources.items()}
    packages = {name for name, file in sources.items() if file.stem == "__init__"}
    compiled = {name: _imports(text) for name, text in texts.items() if "njit" in text}
    stale, callers = set(changed), set()
    while stale:
        rooms = {name.rpartition(".")[0] for name in stale} & packages
        stale = {n for n in compiled if compiled[n] & (stale | rooms)} - callers
        callers |= stale
    return callers


def _imports(text) -> set:
    """All that a file may import: modules, and what is taken from them."""
    found = set()
    for module, names in _IMPORT.findall(text):
        found.add(module)
        found.update(f"{module}.{name}" for name in re.findall(r"\w+", names))
    return found
