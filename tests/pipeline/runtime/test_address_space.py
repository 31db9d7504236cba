"""A limit on the address space is said before a library ends the program."""

import os
import subprocess
import sys

import pytest

from pipeline.runtime.address_space import ENOUGH, shortage

resource = pytest.importorskip("resource")
TOO_LITTLE = "lets a program address 2.0 GB of memory only: expected 3 GB or more"


@pytest.mark.parametrize("limit", [resource.RLIM_INFINITY, int(ENOUGH)])
def test_of_enough_nothing_is_said(monkeypatch, limit):
    monkeypatch.setattr(resource, "getrlimit", lambda which: (limit, limit))
    assert shortage() is None


@pytest.mark.parametrize("module", ["pipeline", "pipeline.app.one_video"])
def test_too_little_is_said_before_anything_else(module, tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (2 * 10**9, resource.RLIM_INFINITY))

    command = [sys.executable, "-m", module, "--help"]
    done = subprocess.run(
        command, preexec_fn=limit, capture_output=True, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )  # fmt: skip
    assert done.returncode == 0
    assert TOO_LITTLE in done.stderr
