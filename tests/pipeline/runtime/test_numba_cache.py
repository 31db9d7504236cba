"""Compiled code is made again when a function that it calls has changed, in whatever file."""

import os
import subprocess
import sys

import pytest

from pipeline.runtime.numba_cache import ROOT, drop_stale

pytestmark = pytest.mark.slow

COMPILED = (
    "from numba import njit\n{imports}\n\n@njit(cache=True)\ndef {name}():\n    return {value}\n"
)


def write(root, name, value, imports=""):
    text = COMPILED.format(name=name, value=value, imports=imports)
    (root / "some" / f"{name}.py").write_text(text)


@pytest.fixture
def root(tmp_path):
    """A package in which `top` calls `middle`, which calls `bottom`; `other` calls nothing."""
    (tmp_path / "some" / "__pycache__").mkdir(parents=True)
    write(tmp_path, "bottom", "1")
    write(tmp_path, "middle", "bottom() + 10", "from some.bottom import bottom")
    write(tmp_path, "top", "middle.middle() + 100", "from some import (\n    middle,\n)")
    write(tmp_path, "other", "5")
    (tmp_path / "some" / "plain.py").write_text("from some.bottom import bottom\n")
    return tmp_path


def run(root, code="from some.top import top; print(top())", **variables):
    """What `top` returns in a process of its own."""
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | variables
    out = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, check=True
    )
    return int(out.stdout)


def test_a_changed_callee_is_compiled_into_its_callers(root):
    drop_stale(root, ["some"])
    assert run(root) == 111
    write(root, "bottom", "2 + 0")
    assert drop_stale(root, ["some"])
    assert run(root) == 112


def test_a_changed_constant_is_compiled_into_what_uses_it(root):
    (root / "some" / "sizes.py").write_text("SIZE = 3\n")
    write(root, "top", "SIZE", "from some.sizes import SIZE")
    drop_stale(root, ["some"])
    assert run(root) == 3
    (root / "some" / "sizes.py").write_text("SIZE = 2 + 2\n")
    assert drop_stale(root, ["some"])
    assert run(root) == 4


def test_whoever_imports_analyse_drops_stale_code(tmp_path):
    code = "from pipeline.run import analyse; print(0)"
    assert run(ROOT, code, NUMBA_CACHE_DIR=str(tmp_path)) == 0
    assert list(tmp_path.glob("compiled_from_*.json"))


def test_code_beside_the_sources_stays_where_compiled_code_lies_elsewhere(root, monkeypatch):
    drop_stale(root, ["some"])
    assert run(root) == 111
    beside = sorted((root / "some" / "__pycache__").glob("*.nbi"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(root / "elsewhere"))
    assert not drop_stale(root, ["some"])
    assert sorted((root / "some" / "__pycache__").glob("*.nbi")) == beside != []


def test_only_callers_of_what_changed_are_dropped(root):
    drop_stale(root, ["some"])
    cache = root / "some" / "__pycache__"
    kept = [cache / f"{name}.f-1.py311.nbi" for name in ("bottom", "other", "plain")]
    callers = [cache / f"{name}.f-1.py311.nbi" for name in ("middle", "top")]
    for index in kept + callers:
        index.touch()
    assert drop_stale(root, ["some"]) == []
    (root / "some" / "plain.py").write_text("# not compiled\n")
    assert drop_stale(root, ["some"]) == []
    write(root, "bottom", "2 + 0")
    assert sorted(drop_stale(root, ["some"])) == callers
    assert [index.exists() for index in kept + callers] == [True] * 3 + [False] * 2
    assert drop_stale(root, ["some"]) == []


def test_functions_taken_from_a_package_count_as_from_any_of_its_files(root):
    (root / "some" / "room").mkdir()
    (root / "some" / "room" / "__init__.py").write_text("from some.room.inner import inner\n")
    text = COMPILED.format(name="inner", value="1", imports="")
    (root / "some" / "room" / "inner.py").write_text(text)
    write(root, "top", "inner()", "from some.room import inner")
    drop_stale(root, ["some"])
    assert run(root) == 1
    (root / "some" / "room" / "inner.py").write_text(text.replace("1", "2 + 0"))
    assert drop_stale(root, ["some"])
    assert run(root) == 2


@pytest.fixture
def installed(root):
    """The package where nobody may write beside the sources, not even who may do all else."""
    (root / "some" / "__pycache__").rmdir()
    (root / "some" / "__pycache__").write_text("")
    return root


PREPARED = (
    "from pathlib import Path\n"
    "from pipeline.runtime.numba_cache import prepare_cache\n"
    "prepare_cache(Path.cwd(), ['some'])\n"
    "from some.top import top\n"
    "print(top())"
)


def test_code_of_an_installation_for_all_lies_in_the_users_folder(installed, tmp_path):
    caches = {"XDG_CACHE_HOME": str(tmp_path / "mine"), "LOCALAPPDATA": str(tmp_path / "mine")}
    caches["HOME"] = str(tmp_path / "mine")
    assert run(installed, PREPARED, **caches) == 111
    kept = {file.name.split(".")[0] for file in (tmp_path / "mine").rglob("*.nbi")}
    assert kept == {"bottom", "middle", "top"}
    write(installed, "bottom", "2 + 0")
    assert run(installed, PREPARED, **caches) == 112


def test_without_any_folder_code_is_compiled_anew_each_time(installed, tmp_path):
    (tmp_path / "nobodys").write_text("")
    nowhere = str(tmp_path / "nobodys")
    assert run(installed, PREPARED, XDG_CACHE_HOME=nowhere, LOCALAPPDATA=nowhere) == 111
