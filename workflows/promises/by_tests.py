"""Promises that tests of the rooms hold: the tests are run and counted."""

import functools
import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

from promises.real_session import ROOT
from promises.trial import Effort, Tried

LONGEST_S = 3600


def try_tests(paths, folder, effort: Effort, **environment) -> Tried:
    """Run tests; a failed one breaks the promise, a skipped one does not count."""
    report = folder / "report.xml"
    command = [sys.executable, "-m", "pytest", "-n", "0", "-p", "no:cacheprovider", "-q"]
    subprocess.run(
        [*command, f"--junitxml={report}", *paths],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        timeout=LONGEST_S,
        capture_output=True,
    )
    cases = list(ElementTree.parse(report).getroot().iter("testcase"))
    skipped = [case for case in cases if case.find("skipped") is not None]
    failed = [c for c in cases if any(c.find(what) is not None for what in ("failure", "error"))]
    return Tried(
        cases=len(cases) - len(skipped),
        broken=[f"{case.get('classname')}.{case.get('name')} fails" for case in failed],
        said=f"tests in {', '.join(paths)}" + (f"; {len(skipped)} skipped" if skipped else ""),
    )


def try_bounds(paths, folder, effort: Effort) -> Tried:
    """Run tests of compiled code that is compiled anew, with every index checked."""
    cache = folder / "compiled"
    cache.mkdir()
    return try_tests(paths, folder, effort, NUMBA_BOUNDSCHECK="1", NUMBA_CACHE_DIR=str(cache))


page = functools.partial(
    try_tests, ["tests/pipeline/curate/test_page.py", "tests/pipeline/curate/test_results.py"]
)
escaped = functools.partial(
    try_tests,
    ["tests/pipeline/reports/test_report.py", "tests/pipeline/session/test_session_file.py"],
)
bounds = functools.partial(
    try_bounds, [f"tests/pipeline/{room}" for room in ("numerics", "forces", "contacts")]
)
