"""A short rendered session, made once per test run, for all who need a real video."""

import gc
import os

import pytest
from hypothesis import HealthCheck, settings

from pipeline.runtime.garbage import search_seldom
from pipeline.runtime.numba_cache import prepare_cache
from pipeline.runtime.workers import THREADS

for name in THREADS:  # before NumPy is loaded: the matrices are small, threads only wait
    os.environ.setdefault(name, "1")
prepare_cache()
search_seldom()  # as the program does
# no test judges by the clock: the machine may be busy
settings.register_profile(
    "busy", deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("busy")

FRAMES = 260
# Tests of rooms whose functions take long to compile. With several processes they come first, each
# file in one: where all begin with whole videos, all compile everything in a fresh checkout.
COMPILED_FIRST = (
    "forces/test_rod_fit", "detection/test_detect", "identity/test_naming",
    "kinematics/test_curvature", "tracking/test_tracker",
    "kinematics", "detection", "forces", "identity", "tracking",
)  # fmt: skip


def pytest_configure(config):
    """Let pytest-xdist hand out files in the order in which they are collected."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(config, items):
    """Order files: what is to be compiled first, then those of whole videos, then all others."""
    if not hasattr(config, "workerinput"):
        return  # one process alone
    whole = {each.path for each in items if each.get_closest_marker("e2e")}
    items.sort(key=lambda item: (_place(item.path), item.path not in whole))


def pytest_collection_finish():
    """Never search what has been made until now: tests, and the packages that they import."""
    gc.freeze()


def _place(path) -> int:
    """Place of a test file in COMPILED_FIRST, behind them for all others."""
    place = path.as_posix()
    found = (k for k, part in enumerate(COMPILED_FIRST) if f"tests/pipeline/{part}" in place)
    return next(found, len(COMPILED_FIRST))


@pytest.fixture(autouse=True, scope="session")
def no_waiting_for_the_disk():
    """Files of tests need not outlive a power cut."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session")
def rendered(tmp_path_factory):
    """A folder with a video of 260 frames, its session.toml and its truth/<stem>/ tables."""
    from made_once import made_once
    from quick_codec import quick_to_read

    from synthetic.session import render_trial

    with made_once(tmp_path_factory, "rendered") as (folder, is_new), quick_to_read():
        if is_new:
            render_trial(folder, "single", seed=0, trial=0, frames=FRAMES)
    return folder


@pytest.fixture
def lossless_is_quick():
    """Videos without loss that a test renders are written in a code that is read quickly."""
    from quick_codec import quick_to_read

    with quick_to_read():
        yield


@pytest.fixture
def nothing_is_drawn():
    """Runs of a test that looks at tables alone draw no figures, and write a short report."""
    from promises.stand_in import drawn_quickly

    with drawn_quickly():
        yield


@pytest.fixture
def video(rendered):
    """The rendered video."""
    return next(rendered.glob("*.avi"))
