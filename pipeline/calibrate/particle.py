"""A particle that sticks to a whisker, followed along it from frame to frame.

It shows as a thick place that stays on the whisker: first the path of thickest places is
found, then the particle's median profile is fitted about that path in each frame.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter

from pipeline.calibrate.thickness import ThicknessMap
from pipeline.errors import counted
from pipeline.numerics.robust import robust_sd

SIZES_PX = 1.5, 2.5, 4.0  # SDs of the bumps that are looked for
SMOOTH_MM = 2.5  # the whisker's own thickness changes over more
FARTHEST_STEP_PX = 3  # of the particle along the whisker, from frame to frame
LEAST_SIGNAL = 4.0  # mean thickness along the path, of its noise
LEAST_THICKER_PX = 0.2  # than the whisker: a still place without dust stays below 0.03
ROUNDS = 3  # of fitting
SEEN = (0.45, 1.8)  # share of the usual profile
FEWEST_SHARE, FEWEST_FRAMES = 0.5, 50  # of the traced frames, that must show it
GONE_FRAMES = 20  # in a row, at the end


class NoParticleError(ValueError):
    """A whisker on which no particle can be followed; the message says why."""


@dataclass(frozen=True)
class ParticlePath:
    """Where a particle is.

    Attributes
    ----------
    frame : int (rows,)
    place_px, se_px : (rows,) beyond the circle of the thickness map; NaN where it is not seen
    size : (rows,) of the particle, relative to its usual size
    profile : usual thickness about its middle, 1 px apart [px]
    """

    frame: np.ndarray
    place_px: np.ndarray
    se_px: np.ndarray
    size: np.ndarray
    profile: np.ndarray

    @property
    def seen(self) -> np.ndarray:
        """Rows in which it is seen."""
        return np.isfinite(self.place_px)


def follow_particle(seen: ThicknessMap, pixels_per_mm, near_mm=None) -> ParticlePath:
    """Find and follow the particle on a whisker.

    Parameters
    ----------
    seen : the whisker's thickness
    near_mm : rough distance of the particle from the circle; None: it is searched for

    Raises
    ------
    NoParticleError
        Where there is none, or it falls off.
    """
    if len(seen.frame) < FEWEST_FRAMES:
        raise NoParticleError(
            f"traced in {counted(len(seen.frame), 'frame')}; expected at least {FEWEST_FRAMES}"
        )
    above = _above_smooth(seen.thickness, SMOOTH_MM * pixels_per_mm)
    signal, size = max((_bumps(above, size) for size in SIZES_PX), key=_strength)
    if near_mm is not None:
        far = np.abs(np.arange(signal.shape[1]) / pixels_per_mm - near_mm) > 1.0
        signal = np.where(far, 0.0, signal)
    path = likeliest_places(signal)
    strength = np.median(signal[np.arange(len(path)), path])
    if strength < LEAST_SIGNAL:
        raise NoParticleError(
            "no particle on it: no place thicker than its surroundings that stays on the whisker "
            f"(signal {strength:.1f} of the noise, expected at least {LEAST_SIGNAL:g})"
        )
    found = _fitted(above, path, int(np.ceil(4 * size)), seen.frame)
    thicker = found.profile.max()
    if thicker < LEAST_THICKER_PX:
        raise NoParticleError(
            f"no particle on it: its thickest place is {thicker:.2f} px thicker than its "
            f"surroundings, expected at least {LEAST_THICKER_PX:g} px"
        )
    _check_seen(found)
    return found


def _above_smooth(thickness, width_px):
    """Thickness less the whisker's own, which changes slowly along it [px]; NaN stays."""
    width = 2 * int(width_px / 2) + 1
    seen = ~np.isnan(thickness).all(axis=0)
    usual = np.zeros(thickness.shape[1])
    usual[seen] = np.nanmedian(thickness[:, seen], axis=0)
    smooth = median_filter(usual, width, mode="nearest")
    return thickness - smooth


def _bumps(above, size):
    """How much thicker than its surroundings each place is, in standard deviations, and `size`."""
    filled = np.nan_to_num(above)
    bumps = gaussian_filter1d(filled, size, axis=1) - gaussian_filter1d(filled, 3 * size, axis=1)
    noise = np.array([robust_sd(column) for column in bumps.T])
    noise = median_filter(noise, 2 * int(12 * size) + 1, mode="nearest")
    known = np.mean(np.isfinite(above), axis=0) > FEWEST_SHARE
    signal = np.where(known, bumps / np.maximum(noise, 1e-6), 0.0)
    return signal, size


def _strength(bumps):
    """How clearly the best place of each frame stands out, over all frames."""
    return np.median(bumps[0].max(axis=1))


def likeliest_places(signal) -> np.ndarray:
    """The path of places (rows,) with the largest sum of `signal` (rows, places).

    From row to row it moves by FARTHEST_STEP_PX at most.
    """
    n, places = signal.shape
    shifts = np.arange(-FARTHEST_STEP_PX, FARTHEST_STEP_PX + 1)
    before = np.clip(np.arange(places) + shifts[:, None], 0, places - 1)
    capped = np.clip(signal, 0.0, 3 * LEAST_SIGNAL)
    total, came_from = capped[0], np.zeros((n, places), np.int32)
    for row in range(1, n):
        reached = total[before]
        best = reached.argmax(axis=0)
        came_from[row] = before[best, np.arange(places)]
        total = reached[best, np.arange(places)] + capped[row]
    path = np.empty(n, int)
    path[-1] = total.argmax()
    for row in range(n - 1, 0, -1):
        path[row - 1] = came_from[row, path[row]]
    return path


def _fitted(above, path, half, frame) -> ParticlePath:
    """Fit the particle's usual profile in each row about a path."""
    place = path.astype(float)
    at = np.arange(-half - 3, half + 4)
    for _ in range(ROUNDS):
        cuts = np.stack([_cut(row, p + at) for row, p in zip(above, place, strict=True)])
        profile = _profile(cuts)
        fits = np.array([_fit(row, p, at, profile) for row, p in zip(above, place, strict=True)])
        step, se, size = fits.T
        good = np.isfinite(step) & (size > SEEN[0]) & (size < SEEN[1])
        place = np.where(good, place + step, place)
    place = np.where(good, place + _middle(at, profile), np.nan)
    return ParticlePath(frame, place, np.where(good, se, np.nan), size, profile)


def _cut(row, at):
    """A row at places `at`, between pixels; NaN beyond its ends."""
    return np.interp(at, np.arange(len(row)), row, left=np.nan, right=np.nan)


def _profile(cuts):
    """The usual profile: the median of all rows, 0 at its ends."""
    with np.errstate(all="ignore"):
        profile = np.nan_to_num(np.nanmedian(cuts, axis=0))
    return profile - np.linspace(profile[:3].mean(), profile[-3:].mean(), len(profile))


def _middle(at, profile):
    """Where the thick part of a profile has its middle [px]."""
    thick = np.clip(profile - 0.2 * profile.max(), 0.0, None)
    return at @ thick / max(thick.sum(), 1e-9)


def _fit(row, place, at, profile):
    """Step to the particle's place, its standard error [px], and its size, of the usual."""
    step, se, size = 0.0, np.nan, 0.0
    for _ in range(4):
        data = _cut(row, place + step + at)
        slope = np.gradient(profile)
        known = np.isfinite(data)
        if known.sum() < len(at) // 2:
            return np.nan, np.nan, 0.0
        basis = np.column_stack([profile, -slope, np.ones(len(at)), at])[known]
        inverse = np.linalg.pinv(basis.T @ basis)
        answer = inverse @ (basis.T @ data[known])
        left = data[known] - basis @ answer
        size = answer[0]
        if size < SEEN[0]:
            return np.nan, np.nan, size
        se = np.sqrt(inverse[1, 1] * left @ left / max(known.sum() - 4, 1)) / size
        move = np.clip(answer[1] / size, -2.0, 2.0)
        step += move
        if abs(move) < 1e-3:
            break
    return step if abs(step) < 4 else np.nan, se, size


def _check_seen(found: ParticlePath) -> None:
    """NoParticleError where a particle falls off or is seen in too few frames."""
    last = int(np.flatnonzero(found.seen).max(initial=-1))
    gone = len(found.frame) - 1 - last
    if last >= 0 and gone >= GONE_FRAMES:
        raise NoParticleError(
            f"the particle is gone from frame {found.frame[last] + 1} on: it fell off or is "
            f"hidden; cut the video there and run it again"
        )
    if found.seen.mean() < FEWEST_SHARE:
        raise NoParticleError(
            f"the particle is seen in {found.seen.sum()} of {len(found.frame)} traced frames; "
            "expected at least half of them"
        )
