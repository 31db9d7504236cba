"""Free motion of one mode, whatever its damping, against its differential equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from whiskermodel.modal_filter import free_motion

DAMPING = 215.0  # 1/s
TIME = np.linspace(0, 20e-3, 41)


@pytest.mark.parametrize("frequency", [5000.0, 938.0, 216.0, 215.0, 214.0, 60.0])
@pytest.mark.parametrize("start", [(1.0, 0.0), (0.0, 1.0)])
def test_free_motion_obeys_its_equation(frequency, start):
    solved = solve_ivp(
        lambda t, q: [q[1], -(frequency**2) * q[0] - 2 * DAMPING * q[1]],
        TIME[[0, -1]], start, t_eval=TIME, rtol=1e-10, atol=1e-14, method="DOP853",
    )  # fmt: skip
    (g,), (h,) = free_motion([frequency], DAMPING, TIME)
    scale = np.abs(solved.y[0]).max()
    np.testing.assert_allclose(start[0] * g + start[1] * h, solved.y[0], atol=1e-7 * scale)
