"""Imports run down the list of rooms, and the map of the code is true."""

import ast
import functools
import importlib
import re
from pathlib import Path

import pytest
from draw_house import ORDER as ROOMS

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "code.md").read_text(encoding="utf-8")
ANYWHERE = {"pipeline.errors"}
WHOLE_WAY = {"pipeline", "pipeline.run", "pipeline.messages"}  # for the command line alone


def modules(package):
    """Dotted name → file of every module of a package."""
    files = (ROOT / package).rglob("*.py")
    return {".".join(file.relative_to(ROOT).with_suffix("").parts): file for file in files}


@functools.cache
def parsed(file):
    """A file's syntax tree."""
    return ast.parse(file.read_text(encoding="utf-8"))


def imported(file, known):
    """Modules among `known` that a file imports, also inside functions."""
    for node in ast.walk(parsed(file)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                deeper = f"{node.module}.{alias.name}"
                yield deeper if deeper in known else node.module


def room_of(module):
    """The room that a module of `pipeline` lies in, None for what stands beside the rooms."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in ROOMS else None


def test_every_folder_is_a_room_on_the_list():
    folders = {file.parent.name for file in (ROOT / "pipeline").glob("*/__init__.py")}
    assert folders == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_imports_run_down_the_list_of_rooms(room):
    known = modules("pipeline")
    below = set(ROOMS[ROOMS.index(room) :])
    for module, file in known.items():
        if room_of(module) != room:
            continue
        for other in imported(file, known):
            if other.split(".")[0] != "pipeline" or other in ANYWHERE:
                continue
            allowed = room_of(other) in below or (room == "app" and other in WHOLE_WAY)
            assert allowed, f"{module} imports {other}"


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_hands_on_names_that_are_there_and_hide_no_file(room):
    module = importlib.import_module(f"pipeline.{room}")
    files = {file.stem for file in (ROOT / "pipeline" / room).glob("*.py")}
    names = [name for name in dir(module) if not name.startswith("_")]
    for name in names:
        getattr(module, name)
    assert not set(module.__all__ if hasattr(module, "__all__") else ()) & files


def test_an_analysis_does_without_scipy_stats():
    """It takes as long to load as some hundred frames to follow."""
    known = modules("pipeline") | modules("whiskermodel")
    loading = [name for name, file in known.items() if "scipy.stats" in imported(file, known)]
    assert {room_of(name) for name in loading} <= {"calibrate"}, loading


@pytest.mark.parametrize(
    ("package", "others"),
    [("whiskermodel", {"pipeline", "synthetic"}), ("synthetic", {"pipeline.forces"})],
)
def test_packages_import_only_what_they_may(package, others):
    """The model stands alone; the truth is not made by what it judges."""
    known = modules("pipeline") | modules("synthetic")
    for module, file in modules(package).items():
        for other in imported(file, known):
            prefixes = {".".join(other.split(".")[:k]) for k in (1, 2)}
            assert not prefixes & others, f"{module} imports {other}"


@pytest.mark.parametrize("package", ["pipeline", "whiskermodel", "synthetic"])
def test_files_on_the_map_are_there(package):
    sections = re.split(r"^## ", PAGE, flags=re.MULTILINE)
    (section,) = [each for each in sections if each.startswith(f"`{package}`")]
    named = re.findall(r"`(\w+/[\w/]+)`", section)
    assert named or package != "pipeline"
    for name in named:
        assert (ROOT / package / f"{name}.py").is_file(), name


def test_every_file_of_the_rooms_is_on_the_map():
    named = re.findall(r"`(\w+/[\w/]+)`", PAGE)
    files = {f.relative_to(ROOT / "pipeline") for f in (ROOT / "pipeline").glob("*/**/*.py")}
    there = {file.with_suffix("").as_posix() for file in files if not file.stem.startswith("__")}
    assert there <= set(named), there - set(named)


@pytest.mark.parametrize("package", ["pipeline", "whiskermodel", "synthetic", "workflows"])
def test_no_file_imports_what_another_keeps_to_itself(package):
    for file in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(parsed(file)):
            if isinstance(node, ast.ImportFrom):
                private = [each.name for each in node.names if re.match("_[^_]", each.name)]
                assert not private, f"{file.relative_to(ROOT)} imports {private}"
