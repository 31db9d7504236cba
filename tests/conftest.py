"""A short rendered session, made once per test run, for all who need a real video."""

import os

import pytest
from hypothesis import HealthCheck, settings

from pipeline.runtime.numba_cache import prepare_cache
from pipeline.runtime.workers import THREADS

for name in THREADS:  # before NumPy is loaded: the matrices are small, threads only wait
    os.environ.setdefault(name, "1")
prepare_cache()
# no test judges by the clock: the machine may be busy
settings.register_profile(
    "busy", deadline=None, max_examples=40, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("busy")

FRAMES = 260


@pytest.fixture(autouse=True, scope="session")
def no_waiting_for_the_disk():
    """Files of tests need not outlive a power cut."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _: None)
        yield


@pytest.fixture(scope="session")
def rendered(tmp_path_factory):
    """A folder with a video of 260 frames, its session.toml and its truth/<stem>/ tables."""
    from synthetic.session import render_trial

    folder = tmp_path_factory.mktemp("rendered")
    render_trial(folder, "single", seed=0, trial=0, frames=FRAMES)
    return folder


@pytest.fixture
def video(rendered):
    """The rendered video."""
    return next(rendered.glob("*.avi"))
