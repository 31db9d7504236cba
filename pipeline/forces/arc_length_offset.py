"""Where along the whisker the trace begins: what is not known of the part hidden in the fur.

The force goes with the fourth power of the radius, so a first traced point that is taken 0.1 mm
too near to the follicle costs 4 % in force. Beside the hidden length as it was given (on average
right to 0.1 mm or so) two things show where the trace begins: the tip, from which the trace's
length counts back, frame by frame (relative only: how far the thin end is seen is not relied
on), and the bending itself, whose distribution along the whisker depends on where its stiff base
is. Both go into one estimate, a smooth function of base angle and time.

Frames that a codec made out of those before and after (B frames of H.264) show a whisker that
turns back where it is in the mean of these, short of its turning point: by a hundredth of a
pixel only, but in all touches alike, which the bending takes for another origin. So such frames
are not used.

The bending is right where the model is: a cone length that is 1 % off or a pole that is put a
pixel wrong move its answer by 0.2 mm. So it counts less where the pole is not where the whisker
bends. Where its answer contradicts the session, it is used all the same: forces are nearer to the
truth with it than without (docs/assumptions.md). Their standard error grows with the
contradiction.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from pipeline.forces import rest_shape, rod_fit
from pipeline.forces.rod_fit import N_REST, RestPrior
from pipeline.kinematics.resampled import N_STATIONS, Stations
from pipeline.numerics.robust import robust_sd
from pipeline.session.parameters import DEFAULTS, RodParams
from whiskermodel.whisker import Whisker

LOCAL_SD_M = 3e-6  # what a smooth function cannot follow
MOST_KNOTS = 400
ANGLE_TERMS = 3
TIP_PART = 0.3  # of the frames in which the tip must be seen at least
TIP_FRAMES = 2.0  # neighbouring frames whose ends err together, at least
TIP_LAGS = 8  # frames over which ends of a codec's pictures err together
LENGTH_MATCH = 0.05  # a tip farther from the whisker's length than this part is none
MOST_ROWS = 240  # loaded frames whose bending is used
ENOUGH_ROWS = 20  # of frames that were not interpolated; with fewer, all are used
LEAST_PUSH_SD = 15.0
CLEAN = 4.0  # times the usual misfit: something else lies upon the whisker
TOGETHER = 5.0  # rows that count as one: those of a contact err together
# error of a station in the mean of a whole video, in its noise: a touching whisker lies still
# upon the same pixels; and how far along the whisker such errors are alike
LASTING_SHARE = 0.1
LASTING_REACH_M = 1.5e-3
ROUNDS = 3  # of Gauss–Newton
BENDING_SD_M = 0.003e-3  # of the bending's answer, even where all is well
DOUBTED = 0.8  # of the largest answer that is taken: from here on it counts less
POLE_LEVER = 6.0  # how much farther a misplaced pole moves the answer


@dataclass(frozen=True)
class Origin:
    """What to add to the arc lengths of each row, and its standard error [m], both (rows,).

    `by_bending` [m] is what the bending alone would add on average; NaN where it shows nothing.
    """

    per_row: np.ndarray
    se: np.ndarray
    by_bending: float = np.nan


@dataclass
class _Evidence:
    """Normal equations A w = b of the weights of the sparse `design`, with the priors in."""

    design: sparse.csr_matrix
    matrix: np.ndarray
    rhs: np.ndarray
    params: RodParams

    def weights(self) -> np.ndarray:
        return np.linalg.solve(self.matrix, self.rhs)

    def solve(self) -> Origin:
        inverse = np.linalg.inv(self.matrix)
        n = self.design.shape[0]
        variance = np.empty(n)
        for first in range(0, n, 4096):  # rows by terms would not fit into memory
            part = self.design[first : first + 4096]
            variance[first : first + 4096] = np.asarray(part.multiply(part @ inverse).sum(1))[:, 0]
        se = np.sqrt(np.maximum(variance, 0.0) + LOCAL_SD_M**2)
        return Origin(self.design @ self.weights(), se)

    def loosely(self) -> "_Evidence":
        """Return the same with next to no prior on the constant."""
        matrix = self.matrix.copy()
        matrix[0, 0] += 1e-3**-2 - (1e-3 * self.params.hidden_length_sd_mm) ** -2
        return replace(self, matrix=matrix)


def origin_from_tip(
    places: Stations, whisker: Whisker, angle, time, params: RodParams = DEFAULTS.forces
) -> tuple[Origin, _Evidence]:
    """Origin of each row from the prior and, as far as the tip is seen, from the trace's end.

    Parameters
    ----------
    places : rows of one whisker in the order of their frames
    angle, time : (rows,) base angle [rad] and time [s]
    """
    design = _design(angle, time, params.hidden_length_knot_s)
    terms, varies = design.shape[1], 1e-3 * params.hidden_length_varies_mm
    prior = np.full(terms, varies**-2)
    prior[0] = (1e-3 * params.hidden_length_sd_mm) ** -2
    evidence = _Evidence(design, np.diag(prior), np.zeros(terms), params)
    tip, sd = _tip_places(places, whisker, params)
    good = np.isfinite(tip)
    if good.any():
        part = design[good]
        weight, variance = np.ones(good.sum()), TIP_FRAMES * sd**2
        for _ in range(4):
            # the tip's own place is unknown: a free constant, eliminated
            weighted = part.multiply(weight[:, None] / variance).tocsr()
            total = np.asarray(weighted.sum(0))[0]
            matrix = (weighted.T @ part).toarray()
            matrix -= np.outer(total, total) / (weight.sum() / variance)
            away = np.average(tip[good], weights=weight) - tip[good]
            rhs = weighted.T @ away
            found = replace(evidence, matrix=evidence.matrix + matrix, rhs=rhs)
            left = away - part @ found.weights()
            left -= np.average(left, weights=weight)
            weight = 1 / np.maximum(1, np.abs(left) / (2 * sd))
            variance = max(TIP_FRAMES * sd**2, _lasting_variance(np.clip(left, -3 * sd, 3 * sd)))
        # an end that wanders more than the fur's edge does is seen so by light and motion
        wander = np.average((away - left) ** 2, weights=weight) - varies**2
        matrix, rhs = _doubted(matrix, rhs, max(wander, 0.0))
        evidence = replace(evidence, matrix=evidence.matrix + matrix, rhs=rhs)
    return evidence.solve(), evidence


def origin_from_bending(
    places: Stations,
    whisker: Whisker,
    curvature_at: float,
    prior: RestPrior,
    evidence: _Evidence,
    friction=0.0,
) -> Origin:
    """Origin of each row from tip and bending together.

    The rest shape moves along with a row's origin, so that the stiffness along the whisker is
    what tells. `places.origin` is where the search starts; `friction` as in `fit_loaded`.
    """
    friction = np.broadcast_to(np.asarray(friction, float), len(places))
    near = _near_rows(places, evidence.params)
    rows = _loaded_rows(near, places, whisker, curvature_at, prior, friction)
    if len(rows) < 5:
        return evidence.solve()
    part = places.rows(rows).loaded()
    rest = replace(prior, drift=prior.drift[rows], cov=prior.cov[rows])
    here, design = part.origin, evidence.design[rows]
    apart = _apart_sd(evidence, rows, places)
    influence = np.zeros((len(rows), N_STATIONS + N_REST))
    for _ in range(ROUNDS):
        fit = rod_fit.fit_loaded(
            part, whisker, curvature_at, rest, friction[rows], here - part.origin, influence
        )
        bend, pull = (np.nan_to_num(fit[f"origin_{k}"]) for k in ("bend", "pull"))
        share = _trust(pull, bend) * (fit["chi2"] < CLEAN * float(np.nanmedian(fit["chi2"])))
        share /= _noise(share, pull, bend)
        common = _common_sd(share, bend, influence, part, fit, rest, whisker, apart)
        bending = design, share * bend, share * (pull + bend * here)
        try:
            alone = _with_bending(evidence.loosely(), *bending, common)
            doubt = _doubt(alone.weights()[0], fit["gap"], part.side, evidence.params)
            sd = np.hypot(common, doubt)
            found = _with_bending(evidence, *bending, sd).solve()
        except np.linalg.LinAlgError:
            return evidence.solve()
        here = found.per_row[rows]
    answer = float(alone.weights()[0])
    # a session so wrong may be wrong in other ways, which the bending takes for the origin, too
    beyond = max(abs(answer) - 1e-3 * evidence.params.bending_trusted_mm, 0.0)
    return replace(found, se=np.hypot(found.se, beyond), by_bending=answer)


def _noise(share, pull, bend):
    """Variance of the rows' pulls over the one expected from the stations' information.

    The pulls of neighbouring rows err together, most so a codec's: counted are independent ones.
    """
    good = (share > 0) & (bend > 0)
    if good.sum() < 2:
        return 1.0
    answer = (share * pull)[good].sum() / (share * bend)[good].sum()
    deviation = (pull - bend * answer)[good] / np.sqrt(bend[good])
    limit = 3 * robust_sd(deviation, about=0.0)
    return TOGETHER * max(0.5, float(np.mean(np.clip(deviation, -limit, limit) ** 2)))


def _common_sd(share, bend, influence, part, fit, rest, whisker, apart):
    """Standard error [m] of the bending's answer from what is common to all of its rows.

    Its parts are the stations' errors that do not average out, the errors of the rest shape's
    weights (`RestPrior`), and the rest shape's place along the whisker, which is that of the free
    frames and `apart` [m] off.
    """
    total = (share * bend).sum()
    rows = share[:, None] * np.nan_to_num(influence)
    known = (part.information / np.fmax(fit["chi2"], 1.0)[:, None]).sum(axis=0)
    known /= np.maximum((part.information > 0).sum(axis=0), 1)
    noise = np.where(known > 0, 1 / np.sqrt(np.maximum(known, 1e-30)), 0.0)
    lasting = LASTING_SHARE * noise * rows[:, :N_STATIONS].sum(axis=0)
    spacing = part.spacing[part.whisker[0]]
    away = np.subtract.outer(np.arange(N_STATIONS), np.arange(N_STATIONS))
    alike = np.exp(-0.5 * (away * spacing / LASTING_REACH_M) ** 2)
    variance = lasting @ alike @ lasting
    if rest.weights_cov is not None:
        u = np.nan_to_num(fit["angle"] - rest.centre) / rest.scale
        powers = u[:, None] ** np.arange(len(rest.weights))
        answers = powers.T @ rows[:, N_STATIONS:]
        variance += np.einsum("ka,kalb,lb->", answers, rest.weights_cov, answers)
    slope = 2 / whisker.length * np.polynomial.legendre.legder(np.nan_to_num(fit.rest), axis=1)
    variance += (apart * np.sum(rows[:, N_STATIONS:-1] * slope)) ** 2
    return float(np.sqrt(variance) / total) if total > 0 else np.inf


def _apart_sd(evidence, rows, places):
    """Standard error [m] of the mean origin of `rows` beside that of the free frames."""
    free = rest_shape.free_frames(places.distance, np.isfinite(places.pole_x), evidence.params)
    if not free.any():
        return 1e-3 * evidence.params.hidden_length_sd_mm
    gap = np.asarray(
        evidence.design[rows].mean(axis=0) - evidence.design[np.flatnonzero(free)].mean(axis=0)
    )
    return float(np.sqrt(gap[0] @ np.linalg.solve(evidence.matrix, gap[0])))


def _with_bending(evidence, design, bend, pull, sd):
    """Evidence with that of the bending, whose common error of `sd` [m] is eliminated."""
    matrix = (design.T @ design.multiply(bend[:, None]).tocsr()).toarray()
    common, own = design.T @ bend, bend.sum() + sd**-2
    matrix = evidence.matrix + matrix - np.outer(common, common) / own
    rhs = evidence.rhs + design.T @ pull - common * pull.sum() / own
    np.linalg.cholesky(matrix)  # fails where the parabola bends upwards
    return replace(evidence, matrix=matrix, rhs=rhs)


def _doubted(matrix, rhs, variance):
    """The evidence A w = b, where each of the answers w errs by a further `variance` [m²].

    A (A + A S A)⁻¹ A = (1 + A S)⁻¹ A with S = variance · 1, and the same of b.
    """
    total = np.eye(len(matrix)) + matrix * variance
    kept = np.linalg.solve(total, np.column_stack([matrix, rhs]))
    return (kept[:, :-1] + kept[:, :-1].T) / 2, kept[:, -1]


def _doubt(answer, gap, side, params):
    """Standard deviation [m] to give to the bending's answer."""
    sides = [np.nanmedian(gap[side == s]) for s in (-1, 1) if np.isfinite(gap[side == s]).any()]
    misplaced = max(map(abs, sides), default=0.0)
    limit = 1e-3 * params.bending_most_mm
    trust = np.interp(abs(answer), [DOUBTED * limit, limit], [1.0, 1e-6])
    beyond = 1e-3 * params.hidden_length_sd_mm * np.sqrt(1 / trust - 1)
    return float(np.sqrt(BENDING_SD_M**2 + (POLE_LEVER * misplaced) ** 2 + beyond**2))


def _trust(pull, bend):
    """Weight of each row: less where it wants to go much farther than its fellows."""
    with np.errstate(all="ignore"):
        wish = np.where(bend > 0, pull / bend, 0.0)
    spread = max(float(robust_sd(wish)), 1e-6)
    return 1 / np.maximum(1, np.abs(wish - np.median(wish)) / (3 * spread))


def _design(angle, time, knot_s):
    """Columns: 1, powers of the base angle, hats in time; sparse (rows, terms)."""
    known = np.isfinite(angle)
    low, high = np.percentile(angle[known], [2, 98]) if known.any() else (0.0, 1.0)
    u = np.clip((angle - (low + high) / 2) / max((high - low) / 2, 0.02), -1.5, 1.5)
    u = np.where(known, u, 0.0)
    span = float(np.ptp(time)) if len(time) else 0.0
    knots = int(np.clip(span / knot_s, 1, MOST_KNOTS)) + 1
    place = (time - time.min()) / max(span, 1e-9) * (knots - 1) if len(time) else time
    low = np.minimum(place.astype(int), knots - 2)
    part = place - low
    every = np.arange(len(u))
    hats = sparse.csr_matrix(
        (np.concatenate([1 - part, part]), (np.tile(every, 2), np.concatenate([low, low + 1]))),
        shape=(len(u), knots),
    )
    return sparse.hstack([u[:, None] ** np.arange(ANGLE_TERMS + 1), hats]).tocsr()


def _lasting_variance(errors):
    """Variance that independent errors would have to have so that means scatter as these do's."""
    lags = range(1, min(TIP_LAGS, len(errors) - 1) + 1)
    return float(np.mean(errors**2) + 2 * sum(np.mean(errors[k:] * errors[:-k]) for k in lags))


def _tip_places(places, whisker, params):
    """Arc length [m] of the trace's end where that is the tip (NaN elsewhere), and its scatter."""
    nothing = np.full(len(places), np.nan), np.nan
    window, noise = 1e-3 * params.tip_window_mm, 1e-3 * params.tip_noise_mm
    end = places.last
    known = np.isfinite(end)
    if known.sum() < 30:
        return nothing
    usual = np.percentile(end[known], 90)
    usual = np.median(end[known & (np.abs(end - usual) < window)])
    good = known & (np.abs(end - usual) < window)
    steps = np.diff(end[good])
    scatter = float(robust_sd(steps)) / np.sqrt(2)
    scatter = max(scatter, float(np.std(steps[np.abs(steps) < noise * 3])) / np.sqrt(2))
    if (
        good.mean() < TIP_PART
        or abs(usual / whisker.length - 1) > LENGTH_MATCH
        or not scatter < noise
    ):
        return nothing
    return np.where(good, end, np.nan), max(scatter, 10e-6)


def _near_rows(places, params):
    """Rows that may touch, rather of frames that no codec made up."""
    with np.errstate(invalid="ignore"):
        touching = places.distance < 1e-3 * params.loaded_distance_mm
    near = np.flatnonzero((places.side != 0) & touching & ~places.extended)
    return places.rather_shown(near, ENOUGH_ROWS)


def _loaded_rows(near, places, whisker, curvature_at, prior, friction):
    """Rows of `near` that are surely and strongly bent by the pole, spread over the video."""
    if len(near) == 0:
        return near
    near = near[:: max(1, len(near) // (2 * MOST_ROWS))]
    rest = replace(prior, drift=prior.drift[near], cov=prior.cov[near])
    fit = rod_fit.fit_loaded(places.rows(near), whisker, curvature_at, rest, friction[near])
    with np.errstate(invalid="ignore"):
        push = np.nan_to_num(fit["force"] / np.sqrt(fit["force_var"]))
    near = near[push > LEAST_PUSH_SD]
    return (
        near[np.unique(np.linspace(0, len(near) - 1, MOST_ROWS).astype(int))]
        if len(near)
        else near
    )
