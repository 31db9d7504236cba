"""Ringing is the beam model's: it starts from the shape at the release and dies away."""

from dataclasses import replace

import numpy as np
import pytest

from synthetic.presets import make_trial
from synthetic.render import Renderer
from whiskermodel.modes import modes

FRAMES = 240


@pytest.fixture(scope="module")
def motion():
    return make_trial("ringdown", 3, 0, FRAMES).motion


@pytest.fixture(scope="module")
def ringing(motion):
    return motion.ringings[0][0]


def test_bending_goes_on_from_that_at_the_release(motion, ringing):
    """Twenty modes hold the shape at the release to some percent, but for its kink."""
    whisker, contact = motion.scene.hairs[0].whisker, motion.hairs[0].contact
    s = np.linspace(0, 0.5 * contact.contact_arc_length[ringing.first - 1], 8)
    before = motion.curvature(0, s)[ringing.first - 1]
    rest = np.polynomial.polynomial.polyval(s, motion.scene.hairs[0].intrinsic_curvature)
    just_after = rest + motion._added(0, ringing, ringing.release, s)[1]
    assert np.abs(just_after - before).max() < 0.08 * np.abs(before - rest).max()
    assert whisker.length > s[-1]


def test_swings_at_the_models_frequency_and_damping(motion, ringing):
    whisker = motion.scene.hairs[0].whisker
    shapes = modes(whisker.taper, "fixed", 1)
    slowest = replace(ringing, amplitudes=np.eye(len(ringing.amplitudes))[0])
    rate = motion.scene.camera.frames_per_second
    p = np.sqrt(shapes.angular_frequency(whisker)[0] ** 2 - whisker.damping_rate**2)
    period = 2 * np.pi / p * rate  # in frames
    s = np.array([5e-3])
    first, later = (
        motion._added(0, slowest, ringing.release + k * period, s)[1][0] for k in (0, 1)
    )
    decay = np.exp(-whisker.damping_rate * period / rate)
    assert later / first == pytest.approx(decay, rel=1e-6)


def test_whisker_keeps_its_length_while_it_rings(motion, ringing):
    x, y = motion.centrelines(0)
    whisker, camera = motion.scene.hairs[0].whisker, motion.scene.camera
    for frame in range(ringing.first, ringing.first + 10):
        length = np.hypot(np.diff(x[frame]), np.diff(y[frame])).sum()
        assert length == pytest.approx(whisker.length * camera.pixels_per_m, rel=1e-3)


@pytest.mark.slow
def test_exposure_blurs_what_moves_and_leaves_the_base(motion, ringing):
    """Light of the frame after the slip is spread over many more pixels than later on."""
    renderer = Renderer(motion.scene, motion)

    def faint_pixels(frame):
        dark = 1 - renderer.light(frame) / renderer.without_whiskers(frame)
        return np.count_nonzero((dark > 0.02) & (dark < 0.3))

    assert faint_pixels(ringing.first + 1) > 2 * faint_pixels(ringing.end - 5)


def test_true_curvature_is_in_the_truth(motion, ringing):
    from synthetic.truth import frame_table

    table = frame_table(motion, 5.5e-3)
    change = table["curvature_change_per_m"].to_numpy()[ringing.first : ringing.end]
    assert np.abs(change[:5]).max() > 5  # 1/m
    assert np.abs(change[-5:]).max() < 0.2
