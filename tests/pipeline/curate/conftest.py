"""A processed session to be curated."""

import shutil

import pytest
from curated import FRAMES, process
from made_once import made_once

from pipeline.video.open import open_video


@pytest.fixture(scope="session")
def session(tmp_path_factory):
    """A rendered session of two short videos, processed: (videos, results)."""
    from synthetic.session import render_session

    with made_once(tmp_path_factory, "session") as (folder, is_new):
        if is_new:
            render_session(folder / "videos", "h264", seed=3, trials=2, frames=FRAMES)
            process(folder / "videos", folder / "results")
    return folder / "videos", folder / "results"


@pytest.fixture
def results(session, tmp_path):
    """A copy of the results that a test may change."""
    shutil.copytree(session[1], tmp_path / "results")
    return tmp_path / "results"


@pytest.fixture(scope="session")
def video(session):
    """Path of a video and all its frames."""
    path = sorted(session[0].glob("*.mp4"))[0]
    return path, list(open_video(path))
