"""The drawn video makes every step of `run` happen, so that all of them are compiled."""

import multiprocessing
import signal

import pytest

from pipeline import analyse
from pipeline.app import warm_up

pytestmark = pytest.mark.e2e


def test_whisker_pole_and_rod_are_found_in_the_drawn_video(monkeypatch):
    analyses = []

    def kept(folder, settings):
        analyses.append(analyse(folder, settings))

    monkeypatch.setattr("pipeline.run.analyse", kept)
    warm_up.warm_up()
    (analysis,) = analyses
    assert analysis.n_frames == warm_up.FRAMES
    assert analysis.frames["tracked"].all()
    assert analysis.pole is not None
    evidence = analysis.evidence
    for column in ("gap_m", "shape_force_N", "shape_force_se_N", "point_force_N", "log_odds"):
        assert evidence[column].notna().mean() > 0.9, column


def test_the_process_ends_by_itself():
    with warm_up.meanwhile() as process:
        pass
    assert process.exitcode == 0
    assert process not in multiprocessing.active_children()


def test_the_process_ends_where_what_goes_on_meanwhile_fails():
    with pytest.raises(ValueError, match="no videos"), warm_up.meanwhile() as process:
        raise ValueError("no videos")
    assert process.exitcode == -signal.SIGTERM
