"""Promises of docs/reliability.md: some cases of each, and the form of the page."""

import ast
import re
import sys
from pathlib import Path

import pytest

if sys.platform != "linux":
    pytest.skip("the trials use Linux's processes", allow_module_level=True)

import reliability
from promises import PROMISES
from promises.trial import Promise, Tried, attempt, for_ci

PAGE = Path(__file__).parents[1] / "docs" / "reliability.md"
IN_CI = [promise for promise in PROMISES if promise.in_ci]


@pytest.mark.e2e
@pytest.mark.usefixtures("lossless_is_quick")
@pytest.mark.parametrize("promise", IN_CI, ids=lambda promise: promise.name)
def test_promise_is_kept(promise, tmp_path):
    folder = tmp_path / "promise"
    folder.mkdir()
    tried = attempt(promise, folder, for_ci(promise)).tried
    assert tried.cases > 0
    assert tried.broken == []


def test_every_promise_of_the_page_is_kept_or_named_as_not_tried():
    table = PAGE.read_text("utf-8").partition("reliability: begin")[2]
    not_tried = table.partition(reliability.NOT_TRIED)[2].partition(".\n")[0]
    for promise in PROMISES:
        rows = [line for line in table.splitlines() if f"| {promise.name}, " in line]
        if not rows:
            assert promise.name in not_tried
            continue
        sentence, _, cases, _, _, result = map(str.strip, rows[0].strip("|").split(" | "))
        assert sentence == promise.sentence
        assert int(cases) > 0
        assert result.startswith("kept")


def test_the_time_of_all_promises_is_the_sum_of_their_times():
    table = PAGE.read_text("utf-8").partition("reliability: begin")[2]
    seconds = sum(map(int, re.findall(r"\| (\d+) s +\|", table)))
    assert f"all of this takes {seconds / 60:.0f} minutes" in table


def test_every_dependency_is_explained():
    project = (PAGE.parents[1] / "pyproject.toml").read_text("utf-8")
    listed = project.partition("dependencies = [")[2].partition("]")[0]
    explained = PAGE.read_text("utf-8").rpartition("| package |")[2]
    assert set(re.findall(r'"([\w-]+)', listed)) == set(
        re.findall(r"[\w-]+", " ".join(line.split("|")[1] for line in explained.splitlines()[2:]))
    )


def test_a_broken_promise_is_said(capsys):
    def try_it(folder, effort):
        return Tried(cases=3, broken=["the sky fell", "again"], said="3 looks")

    promise = Promise("sky", "Heaven", "The sky does not fall", try_it)
    results = {"sky": reliability.tried(promise, None, for_ci(promise))}
    assert "**broken in 2**: the sky fell; 3 looks" in reliability.table_of(results, [promise])
    assert "sky: the sky fell" in capsys.readouterr().err


READS_CODE = {"pickle", "marshal", "shelve", "dill", "joblib"}
RUNS_CODE = {"eval", "exec", "read_pickle", "unsafe_load"}


def _faults(tree):
    """Yield what reads objects or runs code that may come out of a file."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = {alias.name for alias in node.names} | {getattr(node, "module", None)}
            yield from names & READS_CODE
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            yield from {name} & RUNS_CODE
            given = {k.arg: getattr(k.value, "value", True) for k in node.keywords}
            yield from ["allow_pickle"] if given.get("allow_pickle") else []


@pytest.mark.parametrize("package", ["pipeline", "synthetic", "whiskermodel"])
def test_no_file_is_read_by_pickle_or_run_as_code(package):
    files = list((PAGE.parents[1] / package).rglob("*.py"))
    assert files
    found = {f.name: fault for f in files for fault in _faults(ast.parse(f.read_text("utf-8")))}
    assert found == {}


def test_pickles_and_code_are_found_where_there_are_some():
    code = "import pickle\nfrom shelve import open\nnp.load(f, allow_pickle=True)\neval('1')"
    assert set(_faults(ast.parse(code))) == {"pickle", "shelve", "allow_pickle", "eval"}
