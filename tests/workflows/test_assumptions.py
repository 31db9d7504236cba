"""What a broken assumption costs, in scenes whose forces are those of other code."""

import assumptions
import numpy as np
import pytest

pytestmark = pytest.mark.e2e


def test_a_cone_2_percent_too_long_is_flagged_and_its_forces_lie_in_the_intervals():
    case = assumptions.Case("cone", dimensions={"cone_length": 1.02})
    got = assumptions.figures(case, range(2))
    found, true = got["of"]
    assert found == true > 3
    assert np.abs(got["errors"]).min() > 0.03  # the tip is too stiff in the session
    assert all(got["covered"])
    assert all("base_contradicted" in flags for flags in got["flags"])
