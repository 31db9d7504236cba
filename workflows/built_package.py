"""Whether the built package works where nothing else is installed.

    python workflows/built_package.py

Needs only Python and a network connection. Builds sdist and wheel from a copy of the repository,
looks at what is in them, installs the wheel into a bare environment, runs the command there,
follows the tutorial word for word, and installs the sdist. Exit status 1 where a step fails.
"""

import shutil
import subprocess
import sys
import tempfile
import time
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = (".git", ".venv", "build", "dist", "__pycache__", "*.egg-info", ".hypothesis")
IN_WHEEL = (
    "pipeline/py.typed", "pipeline/__init__.pyi", "synthetic/py.typed", "whiskermodel/py.typed",
    "pipeline/curate/page.html", "pipeline/curate/page.js", "pipeline/app/cli.py",
)  # fmt: skip
NOT_IN_WHEEL = ("tests/", "workflows/", "docs/")


def python_of(folder) -> Path:
    """Make a bare environment; its Python."""
    venv.create(folder, with_pip=True)
    return Path(folder) / ("Scripts" if sys.platform == "win32" else "bin") / "python"


def run(*command, cwd=None) -> None:
    """Run a command; CalledProcessError where it fails, with its output."""
    done = subprocess.run(list(map(str, command)), cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout, done.stderr, file=sys.stderr)
        done.check_returncode()


def step(words, do) -> None:
    """Do one step and print how long it took."""
    started = time.monotonic()
    do()
    print(f"{words}: done in {time.monotonic() - started:.0f} s", flush=True)


def copy_source(folder) -> Path:
    """Copy the repository into a new folder, without what other programs left in it."""
    return Path(shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_OUT)))


def build(work) -> None:
    """Build sdist and wheel into work/dist."""
    source = copy_source(work / "source")
    python = python_of(work / "builder")
    run(python, "-m", "pip", "install", "--quiet", "build")
    run(python, "-m", "build", "--outdir", work / "dist", source)


def check_wheel(wheel) -> None:
    """The wheel holds what it should, and nothing else; SystemExit where not."""
    names = zipfile.ZipFile(wheel).namelist()
    missing = [name for name in IN_WHEEL if name not in names]
    odd = [name for name in names if name.startswith(NOT_IN_WHEEL)]
    templates = [name for name in names if name.startswith("pipeline/reports/templates/")]
    if missing or odd or not templates:
        sys.exit(f"{wheel.name}: missing {missing}, not wanted {odd}, templates {templates}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "reader").mkdir()
        step("sdist and wheel built", lambda: build(work))
        (wheel,), (sdist,) = (work / "dist").glob("*.whl"), (work / "dist").glob("*.tar.gz")
        step(f"{wheel.name} holds what it should", lambda: check_wheel(wheel))
        python = python_of(work / "bare")
        step("wheel installed", lambda: run(python, "-m", "pip", "install", "--quiet", wheel))
        command = python.parent / "whiskerforce"
        step("whiskerforce --version", lambda: run(command, "--version", cwd=work))
        step("python -m pipeline -h", lambda: run(python, "-m", "pipeline", "-h", cwd=work))
        follow = (python, ROOT / "workflows" / "tutorial.py", work / "reader")
        step("tutorial followed", lambda: run(*follow, cwd=work / "reader"))
        again = ("--force-reinstall", "--no-deps", "--quiet", sdist)
        step("sdist installed", lambda: run(python, "-m", "pip", "install", *again))
        step("whiskerforce --version", lambda: run(command, "--version", cwd=work))


if __name__ == "__main__":
    main()
