"""Who is who over a whole video: looks learned from all frames, names decided in the end."""

from itertools import pairwise

import numpy as np
import pytest

from pipeline import naming
from pipeline.fan_model import FanModel, learn
from pipeline.identities import Ruler
from pipeline.line_features import ANGLE, line_features
from pipeline.records import Centrelines, Recording
from pipeline.tracing import options_for
from pipeline.whole_video import LEAST_SD, SURE, names, settled

OPTIONS = options_for(Recording(500.0, 8.0, "left"))
RULER = Ruler.of("left", OPTIONS)
#        place [px], angle [rad], logs of thickness and length, bends [rad]
FAN = np.array(
    [
        [100.0, -0.40, -1.8, 4.20, 0.02, 0.04],
        [104.0, -0.25, -1.6, 4.35, -0.02, -0.03],
        [106.0, -0.20, -1.5, 4.50, 0.01, 0.03],
        [113.0, 0.10, -1.2, 4.70, 0.00, 0.00],
        [119.0, 0.30, -1.0, 4.90, -0.01, -0.02],
    ]
)
NOISE = np.array([0.4, 0.015, 0.04, 0.03, 0.006, 0.006])
FRAMES = 300


def whisking(rng, fan=FAN, frames=FRAMES):
    """Features (frames, whiskers, 6) of a fan that whisks; angles go unlike with the phase."""
    phase = 0.4 * np.sin(np.arange(frames) / 6)
    seen = fan + NOISE * rng.normal(size=(frames, *fan.shape))
    seen[..., ANGLE] += phase[:, None] * np.linspace(0.9, 1.1, len(fan))
    return seen


def rows(seen, called):
    """Frame, the tracer's name, features, true name, ordered by frame and the tracer's name."""
    frame, true = np.divmod(np.arange(seen.shape[0] * seen.shape[1]), seen.shape[1])
    order = np.lexsort((called.ravel(), frame))
    return frame[order], called.ravel()[order], seen.reshape(-1, 6)[order], true[order]


def samples(rng, fan=FAN):
    """What a roster would know: features in 24 frames."""
    return [dict(enumerate(each)) for each in whisking(rng, fan, 24).transpose(1, 0, 2)]


def exchanged(changes):
    """Names (frames, whiskers), exchanged as of (one, other, first frame, last frame)."""
    called = np.tile(np.arange(len(FAN)), (FRAMES, 1))
    for one, other, first, last in changes:
        called[first:last, [one, other]] = called[first:last, [other, one]]
    return called


def test_looks_are_learned_though_names_are_wrong():
    rng = np.random.default_rng(1)
    called = exchanged([(1, 2, 0, 170)])  # more than half of all frames
    _, whisker, features, _ = rows(whisking(rng), called)
    least = np.append(0.6, LEAST_SD[1:])
    starts = np.arange(0, len(features) + 1, len(FAN))
    model = learn(FanModel.first(samples(rng), least), features, whisker, starts)
    apart = np.diff(model.middle, axis=0)
    assert apart[:, 0] == pytest.approx(np.diff(FAN[:, 0]), abs=0.3)  # px
    assert apart[:, ANGLE] == pytest.approx(np.diff(FAN[:, ANGLE]), abs=0.03)  # rad
    assert apart[:, 3:] == pytest.approx(np.diff(FAN[:, 3:], axis=0), abs=0.02)
    turn = model.slope[:, ANGLE] / model.slope[2, ANGLE]
    assert turn == pytest.approx(np.linspace(0.9, 1.1, 5), abs=0.03)


def test_exchanges_are_put_right_wherever_they_are():
    rng = np.random.default_rng(2)
    called = exchanged([(1, 2, 60, 180), (3, 4, 200, 230), (0, 1, 250, FRAMES)])
    frame, whisker, features, true = rows(whisking(rng), called)
    named, sure = names(frame, whisker, features, samples(rng), OPTIONS.pixels_per_m)
    assert np.array_equal(named, true)
    assert (sure > SURE).mean() > 0.98


def test_a_fan_that_has_moved_up_by_one_is_put_right():
    rng = np.random.default_rng(3)
    called = np.tile(np.arange(len(FAN)), (FRAMES, 1))
    called[100:150, :-1] += 1
    frame, whisker, features, true = rows(whisking(rng), called)
    kept = ~((frame >= 100) & (frame < 150) & (true == 4))  # its line is not seen meanwhile
    named, _ = names(
        frame[kept], whisker[kept], features[kept], samples(rng), OPTIONS.pixels_per_m
    )
    assert np.array_equal(named, true[kept])


def test_it_does_not_know_whiskers_that_look_the_same():
    rng = np.random.default_rng(4)
    fan = FAN.copy()
    fan[2] = fan[1]
    frame, whisker, features, true = rows(whisking(rng, fan), exchanged([]))
    alike = (true == 1) | (true == 2)
    _, sure = names(frame, whisker, features, samples(rng, fan), OPTIONS.pixels_per_m)
    assert (sure[alike] < SURE).mean() > 0.9
    assert (sure[~alike] > SURE).mean() > 0.98


def test_all_likely_assignments_are_found_and_the_best_first():
    cost = np.array([[0.0, 1.0, 9.0], [0.5, 0.0, 9.0]])
    found = naming.k_best(cost)
    assert found[0] == ((0, 1), 0.0)
    assert ((1, 0), 1.5) in found
    assert all(a <= b for (_, a), (_, b) in pairwise(found))


def straight(place, angle, length):
    """Nodes of a line from the left, that points to `place` behind the fur."""
    s = RULER.pivot_px + np.arange(length)
    return np.column_stack([10 + s * np.cos(angle), place + s * np.sin(angle)])


def centrelines(frame, whisker, lines):
    points = np.concatenate(lines).astype(np.float32)
    n = len(points)
    return Centrelines(
        names=("a", "b", "c"),
        frame=np.asarray(frame, np.int32),
        whisker=np.asarray(whisker, np.int32),
        offsets=np.append(0, np.cumsum([len(line) for line in lines])),
        x_px=points[:, 0],
        y_px=points[:, 1],
        se_px=np.full(n, 0.1, np.float32),
        confidence=np.full(len(frame), 0.9, np.float32),
        thickness_px=np.full(n, 0.3, np.float32),
    )


def test_features_of_straight_lines_and_arcs():
    t = np.arange(100) / 200.0  # an arc of 0.005 per px
    arc = 200 * np.column_stack([np.sin(t), 1 - np.cos(t)])
    lines = centrelines([0, 0], [0, 1], [straight(120.0, 0.3, 80), arc])
    place, angle, thickness, length, bend, far = line_features(lines, RULER).T
    assert place[0] == pytest.approx(120.0, abs=1e-3)
    assert angle[0] == pytest.approx(0.3, abs=1e-5)
    assert thickness[0] == pytest.approx(np.log(0.3))
    assert np.exp(length) == pytest.approx([80, 100])
    assert [bend[0], far[0]] == pytest.approx([0, 0], abs=1e-5)
    assert bend[1] == pytest.approx(0.005 * RULER.base_px / 2, abs=1e-4)
    assert far[1] == pytest.approx(0.005 * RULER.base_px, abs=1e-4)


class Slot:
    """A roster's whisker that was never seen in a sample."""

    def __init__(self):
        self.seen, self.samples = {}, ()


def test_lines_of_a_short_video_are_handed_on_as_they_are():
    lines = [straight(100.0 + 10 * k, 0.1 * k, 60 + 10 * k) for k in range(3)]
    chunks = [centrelines([f] * 3, range(3), lines) for f in range(4)]
    got = list(settled(iter(chunks), [Slot()] * 3, RULER, OPTIONS.pixels_per_m))
    assert len(got) == 4
    for before, after in zip(chunks, got, strict=True):
        assert after.names == before.names
        assert np.array_equal(after.frame, before.frame)
        assert np.array_equal(after.whisker, before.whisker)
        assert np.array_equal(after.y_px, before.y_px)
        assert after.information is None
