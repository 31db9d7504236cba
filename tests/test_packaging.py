"""What is declared for pip, conda and type checkers agrees."""

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml
from built_package import check_wheel, copy_source

import pipeline
import synthetic
import whiskermodel

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
RECIPE = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text("utf-8"))
IN_CONDA = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base"}


BUILD = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"


def versions(requirements):
    """Name → least version."""
    return dict(re.fullmatch(r"([\w-]+) ?>=([\d.]+)", each).groups() for each in requirements)


PACKAGES = (pipeline, synthetic, whiskermodel)
IMPORTED_AS = {"opencv-python-headless": "cv2", "scikit-image": "skimage", "pillow": "PIL"}
IMPORTED_AS |= {"lazy-loader": "lazy_loader"}
PARTS = {"pydantic_core"}  # of pydantic, which wants the very version that suits it


def imported(package):
    """Names of the top-level packages that the files of a package import, wherever they do."""
    for path in Path(package.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                yield node.module.partition(".")[0]


def test_every_library_that_is_imported_is_declared():
    """Those that only some need are extras, imported by `convert.optional`, by name."""
    declared = {IMPORTED_AS.get(name, name) for name in versions(PROJECT["dependencies"])}
    own = {package.__name__ for package in PACKAGES}
    found = {name for package in PACKAGES for name in imported(package)}
    assert found - own - set(sys.stdlib_module_names) - declared == PARTS


def test_conda_wants_what_pip_wants():
    pip = {IN_CONDA.get(k, k): v for k, v in versions(PROJECT["dependencies"]).items()}
    conda = versions(RECIPE["requirements"]["run"])
    assert conda.pop("python") == PROJECT["requires-python"].removeprefix(">=")
    assert conda == pip


def test_conda_has_the_version_and_the_command():
    assert RECIPE["context"]["version"] == pipeline.__version__
    (entry,) = RECIPE["build"]["python"]["entry_points"]
    assert entry == f"whiskerforce = {PROJECT['scripts']['whiskerforce']}"


def test_packages_are_typed():
    for package in PACKAGES:
        assert (Path(package.__file__).parent / "py.typed").is_file()


def test_workflow_calls_what_is_run_here():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    commands = [step["run"] for step in steps if "run" in step]
    assert ".ci/run" in commands
    for command in commands:
        for path in re.findall(r"[\w.]+/[\w./]+", command):
            assert (ROOT / path).is_file(), path


def test_urls_are_given():
    assert PROJECT["urls"]["Paper"].startswith("https://doi.org/")


@pytest.mark.slow
def test_the_wheel_holds_all_that_the_command_needs(tmp_path):
    """`workflows/built_package.py` installs it into a bare environment, with all it depends on."""
    pytest.importorskip("setuptools", "77")  # as pyproject.toml wants it
    source, out = copy_source(tmp_path / "source"), tmp_path / "out"
    subprocess.run([sys.executable, "-c", BUILD, str(out)], cwd=source, check=True)
    (wheel,) = out.glob("*.whl")
    check_wheel(wheel)
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    command = [sys.executable, "-m", "pipeline", "--version"]
    child = subprocess.run(
        command, cwd=tmp_path / "installed", check=True, capture_output=True, text=True
    )
    assert pipeline.__version__ in child.stdout
