"""Promises of docs/reliability.md: some cases of each, and the form of the page."""

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
        sentence, _, cases, _, result = map(str.strip, rows[0].strip("|").split(" | "))
        assert sentence == promise.sentence
        assert int(cases) > 0
        assert result.startswith("kept")


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
