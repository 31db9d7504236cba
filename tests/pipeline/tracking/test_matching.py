"""Who is who among whiskers: matching by signature, and whiskers that have changed places."""

import numpy as np
import pytest

from pipeline.session.recording import Recording
from pipeline.tracking import matching
from pipeline.tracking.matching import PairEvidence, Ruler, match
from pipeline.tracking.tracker import options_for

OPTIONS = options_for(Recording(500.0, 8.0, "left"))
RULER = Ruler.of("left", OPTIONS)
#              place [px], angle [rad], log thickness, log length
FAN = np.array(
    [
        [100.0, -0.40, -1.5, 4.2],
        [104.0, -0.25, -1.4, 4.3],
        [109.0, -0.05, -1.3, 4.5],
        [113.0, 0.10, -1.1, 4.7],
        [119.0, 0.30, -1.0, 4.9],
    ]
)
NOISE = np.array([1.0, 0.05, 0.15, 0.1])


@pytest.mark.parametrize("degrees", [-35, 0, 20])
def test_lines_are_matched_whatever_the_phase_of_the_whisk(degrees):
    rng = np.random.default_rng(3)
    order = rng.permutation(len(FAN))[:4]  # one is not seen
    seen = FAN[order] + 0.5 * NOISE * rng.normal(size=(4, 4))
    seen[:, matching.ANGLE] += np.radians(degrees)
    got = match(seen, FAN, RULER.sd)
    assert sorted(got.pairs) == [(k, order[k]) for k in range(4)]
    assert np.degrees(got.shift) == pytest.approx(degrees, abs=4)


def test_a_line_like_no_whisker_is_given_to_none():
    seen = np.vstack([FAN, [150.0, -0.9, -3.5, 3.6]])
    assert {line for line, _ in match(seen, FAN, RULER.sd).pairs} == set(range(5))


def whisked(rng, frames):
    """Signatures (frames, whiskers, 4) of a fan that whisks, with errors that last."""
    turn = 0.4 * np.sin(np.arange(frames) / 6)
    errors = NOISE * rng.normal(size=(frames, *FAN.shape))
    seen = FAN + errors
    seen[..., matching.ANGLE] += turn[:, None]
    return seen


def evidence(rng):
    samples = whisked(rng, 24)
    each = [dict(enumerate(samples[:, k])) for k in range(len(FAN))]
    return PairEvidence(each, RULER, OPTIONS)


def test_an_exchange_is_noticed_and_told_from_when_on():
    rng = np.random.default_rng(5)
    known, swaps = evidence(rng), []
    for frame, seen in enumerate(whisked(rng, 400)):
        if frame >= 200:
            seen[[1, 2]] = seen[[2, 1]]
        swaps = known.look(frame, seen)
        if swaps:
            break
    assert [set(pair[:2]) for pair in swaps] == [{1, 2}]
    assert swaps[0][2] == pytest.approx(200, abs=8)
    assert frame < 300


def test_whiskers_in_their_places_are_left_there():
    rng = np.random.default_rng(6)
    known = evidence(rng)
    for frame, seen in enumerate(whisked(rng, 1000)):
        assert known.look(frame, seen) == []
    assert not known.doubtful().any()


def test_a_whisker_on_the_line_of_an_absent_one_is_noticed():
    rng = np.random.default_rng(7)
    known, swaps = evidence(rng), []
    for frame, seen in enumerate(whisked(rng, 600)):
        if frame >= 100:
            seen[1], seen[2] = seen[2].copy(), np.nan
        swaps = known.look(frame, seen)
        if swaps:
            break
    assert [set(pair[:2]) for pair in swaps] == [{1, 2}]


def test_one_found_again_beside_its_like_is_doubtful():
    known = evidence(np.random.default_rng(8))
    seen = FAN.copy()
    seen[2] = seen[1]  # where it was found, it looks just as the other
    known.look(0, seen, found=[2])
    assert known.doubtful()[[1, 2]].all()
