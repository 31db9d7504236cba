"""`run` against pictures and forces that neither `synthetic` nor `whiskermodel` has made."""

from types import SimpleNamespace

import numpy as np
import other_truth
import plain_video as plain
import pytest
from promises.stand_in import drawn_quickly

from pipeline.session.parameters import DEFAULTS

pytestmark = pytest.mark.e2e

SEEDS = (3, 8)  # a face on the left; no face, from above
PEAK = 0.015  # relative, of the peak force and moment
ARC_MM = 0.06  # of the place of touch
MEDIAN_PX = 0.02  # of a point's distance from the true centreline
MOST_PX = 0.08  # of 95 in 100 points


@pytest.fixture(scope="module", params=SEEDS)
def filmed(request, tmp_path_factory):
    """A scene, its truth, and what the command has found."""
    folder = tmp_path_factory.mktemp("plain")
    scene = other_truth.Scene.drawn(request.param)
    truth = scene.film(folder)
    with drawn_quickly():
        found = other_truth.process(folder)
    return SimpleNamespace(scene=scene, truth=truth, found=found)


def test_contacts_and_forces(filmed):
    true = filmed.truth.contacts()
    assert len(true) == len(filmed.found.contacts) >= 2
    for (onset, offset, peak), row in zip(true, filmed.found.contacts.itertuples(), strict=True):
        assert abs(row.onset_frame - onset) <= 1
        assert abs(row.offset_frame - offset) <= 1
        assert row.peak_force_uN == pytest.approx(1e6 * peak.force, rel=PEAK)
        assert abs(row.peak_base_moment_nN_m) == pytest.approx(1e9 * abs(peak.moment), rel=PEAK)
        assert row.contact_arc_length_mm == pytest.approx(1e3 * peak.arc, abs=ARC_MM)


def test_centrelines(filmed):
    assert len(filmed.found.lines) == other_truth.FRAMES
    off = np.abs(filmed.truth.distances(filmed.found.lines))
    assert np.median(off) < MEDIAN_PX
    assert np.quantile(off, 0.95) < MOST_PX


def test_a_lightly_bent_whisker_is_a_cantilever():
    """The truth itself: small deflections are those of a cone that is held at its base."""
    arc, turned = 10e-3, 1e-4  # m, rad
    whisker = plain.Whisker(curvature=1e-3, touching=0.0, arc=arc)
    _, (touch,) = whisker.sweep([-turned])
    s = np.linspace(0, arc, 20001)
    stiffness = plain.YOUNG * np.pi / 4 * plain.radius(s) ** 4
    lever = (arc - s) ** 2 / stiffness
    compliance = np.sum(0.5 * (lever[1:] + lever[:-1])) * (s[1] - s[0])  # m/N
    assert touch.force == pytest.approx(turned * arc / compliance, rel=2e-3)
    assert touch.moment == pytest.approx(touch.force * arc, rel=2e-3)


def test_lengths_are_wrong_by_what_is_assumed_and_nothing_is_hidden_where_there_is_no_face():
    scene, rng = other_truth.Scene.drawn(SEEDS[0]), np.random.default_rng(0)
    off = np.array([scene.told_mm(rng) for _ in range(400)]) - scene.told_mm()
    assumed = DEFAULTS.forces.hidden_length_sd_mm, DEFAULTS.forces.tip_sd_mm
    assert np.std(off, axis=0) == pytest.approx(assumed, rel=0.15)
    assert other_truth.Scene.drawn(SEEDS[1]).told_mm(rng)[0] == 0


@pytest.mark.usefixtures("nothing_is_drawn")
def test_the_table_alone_is_printed(capfd, monkeypatch):
    monkeypatch.setattr(other_truth, "FRAMES", 120)
    assert other_truth.main(["--scenes", "1", "--seed", "3"]) == 0
    table, _, counts = capfd.readouterr().out.strip().partition("\n\n")
    assert all(line.startswith("| ") for line in table.splitlines())
    assert " contacts, 0 missed, 0 invented" in counts
    assert not counts.startswith("0 contacts")
