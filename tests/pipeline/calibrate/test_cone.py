import numpy as np
import pytest

from pipeline.calibrate.cone import fit_cone

BASE, SLOPE = 8.0, 0.004  # px, and px per px
S = np.arange(5.0, 1800, 10)
SE = np.full(len(S), 0.01)
NONE = np.zeros(len(S))


def half_widths(rng, share=0.0, smooth=1):
    """A cone with measuring noise and, of a share of the radius, bumps `smooth` sections long."""
    cone = BASE - SLOPE * S
    rough = np.convolve(rng.normal(size=len(S) + smooth - 1), np.ones(smooth), "valid")
    return cone * (1 + share * rough / np.sqrt(smooth)) + rng.normal(scale=SE)


def test_dust_and_root_do_not_count():
    widths = half_widths(np.random.default_rng(0))
    widths[40:44] += 3.0
    widths[:4] *= 0.5
    fit = fit_cone(S, widths, SE, NONE)
    assert fit.base == pytest.approx(BASE, abs=0.01)  # px
    assert fit.slope == pytest.approx(SLOPE, rel=2e-3)
    assert not fit.used[40:44].any()
    assert not fit.used[:4].any()
    assert fit.used.mean() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize(("share", "smooth"), [(0.0, 1), (0.01, 1), (0.01, 8)])
def test_standard_errors_cover(share, smooth):
    """Of 200 cones, some in bumps: 95 % intervals hold the base in at least 90 %."""
    rng = np.random.default_rng(1)
    fits = [fit_cone(S, half_widths(rng, share, smooth), SE, NONE) for _ in range(200)]
    covered = np.mean([abs(fit.base - BASE) < 1.96 * fit.se_at(0.0) for fit in fits])
    assert covered > 0.9
    errors = np.std([fit.base for fit in fits])
    assert np.median([fit.se_at(0.0) for fit in fits]) < 1.5 * errors


def test_bumps_are_worth_less_than_as_many_sections():
    rng = np.random.default_rng(2)
    assert fit_cone(S, half_widths(rng, 0.02, 10), SE, NONE).independent < len(S) / 4
    assert fit_cone(S, half_widths(rng), SE, NONE).independent > len(S) / 2


def test_too_few_sections_are_refused():
    with pytest.raises(ValueError, match="at least 12, got 5"):
        fit_cone(S[:5], S[:5], SE[:5], NONE[:5])


def test_what_all_half_widths_share_is_as_uncertain_as_it_is():
    widths = half_widths(np.random.default_rng(0))
    alone, doubted = (fit_cone(S, widths, SE, doubt) for doubt in (NONE, NONE + 0.5))
    assert (doubted.base, doubted.slope) == (alone.base, alone.slope)
    for s in (0.0, 900.0):
        assert doubted.se_at(s) == pytest.approx(np.hypot(alone.se_at(s), 0.5))
