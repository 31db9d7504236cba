"""Which line is which whisker, by its signature."""

import numpy as np
import pytest
from usual_parameters import options_for

from pipeline.session.recording import Recording
from pipeline.tracking import matching
from pipeline.tracking.matching import Ruler, match

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
