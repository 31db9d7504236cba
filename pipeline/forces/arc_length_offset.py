"""Where along the whisker the trace begins: how long the part hidden in the fur really is.

The force goes with the fourth power of the radius, so a first traced point that is taken 0.1 mm
too near to the follicle costs 4 % in force. Beside the hidden length as it was given (on average
right to 0.1 mm or so) two things show where the trace begins: the tip, which lies at the
whisker's length, and the bending itself, whose distribution along the whisker depends on where
its stiff base is. All three are combined in one estimate, a smooth function of time: as a whisker
turns, the edge of the fur crosses it at another place, some 0.06 mm away even if the fur keeps
still. Touching frames are used together with the rest shape (`origin_and_rest.py`).

The trace ends up to a millimetre short of the tip, where the thin end drowns in noise or a codec
has erased it. How short, on average over the frames, the mean of what lies beyond the ends shows
(`kinematics/tip.py`); where that is not known (lines of other programs), the trace's end only
shows how the origin changes from frame to frame.

Frames that a codec interpolates between others (B frames of H.264) are not used. They show a
whisker at its turning point a hundredth of a pixel short of it. That is the same in all touches,
and would be taken for another origin.

The estimate from the bending is only as good as the model: a cone length that is 1 % off, or a
pole that is a pixel off, moves it by 0.2 mm. So it counts less where the whisker does not bend at
the pole. Where it contradicts session.toml and the tip, it is used all the same: forces are nearer
to the truth with it than without (docs/assumptions.md). Of a difference between them, what exceeds
EXPLAINED_SD standard errors becomes a standard error itself. With three in place of two, no
confidence interval would contain the forces of a whisker whose cone is 2 % shorter than given.

The whisker's length may be wrong, too, if it contradicts the hidden length: how likely that is
follows from Bayes' rule. So a whisker that has grown does not shift the base.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.special import expit

from pipeline.forces import rod_fit
from pipeline.forces.origin_and_rest import OriginAndRest, of_each_row, shown_by
from pipeline.forces.rest_shape import CORRELATED_FRAMES
from pipeline.forces.rod_fit import RestPrior
from pipeline.kinematics.stations import BLOCK_ROWS, Stations, may_touch
from pipeline.kinematics.tip import tip_beyond
from pipeline.numerics.robust import robust_sd
from pipeline.numerics.runs import evenly, parts
from pipeline.session.parameters import RodParams
from whiskermodel.whisker import Whisker

MOST_KNOTS = 400
ALIKE = 0.8  # correlation of the origin at neighbouring knots: 0 and 0.95 do worse, rendered
LENGTH_WRONG = 0.01  # share of lengths that have changed since they were measured; chosen
TIP_PART = 0.3  # of all frames: in so many the tip must be seen
SHARED_FRAMES = 2.0  # neighbouring frames have the errors of their ends in common
TIP_LAGS = 8  # the same where a codec made the picture, at most
FEWEST_ROWS = 5
MOST_ROWS = 240  # frames that may touch whose bending is used
ENOUGH_ROWS = 20  # of frames that were not interpolated; with fewer, all are used
CLEAN = 4.0  # times the usual χ²: above, something else lies on the whisker
EXPLAINED_SD = 2.0  # standard errors by which bending, tip and hidden length may differ
POLE_LEVER = 6.0  # shift of the estimate from the bending, over that of a misplaced pole


@dataclass(frozen=True)
class Origin:
    """The offset to be added to the arc lengths of each row, and its standard error [m], (rows,).

    `by_bending` and `bending_se` [m]: what the bending alone would add on average, and its
    standard error; NaN where it shows nothing. `per_tip`: how far the origin moves where the
    tip is misplaced, as a share of the tip's error.
    """

    per_row: np.ndarray
    se: np.ndarray
    per_tip: float = 0.0
    by_bending: float = np.nan
    bending_se: float = np.nan


@dataclass
class _Evidence:
    """Normal equations A w = b of the weights of the sparse `design`, with the priors in.

    `tip` is how b changes with the tip's place.
    """

    design: sparse.csr_matrix
    matrix: np.ndarray
    rhs: np.ndarray
    tip: np.ndarray
    params: RodParams

    def weights(self) -> np.ndarray:
        return np.linalg.solve(self.matrix, self.rhs)

    def solve(self) -> Origin:
        cov, n = np.linalg.inv(self.matrix), self.design.shape[0]
        root, se = np.linalg.cholesky(cov), np.empty(n)
        for rows in parts(n, BLOCK_ROWS):  # rows by terms would not fit into memory
            se[rows] = np.linalg.norm(self.design[rows] @ root, axis=1)
        return Origin(self.design @ self.weights(), se, self.per_tip(cov))

    def per_tip(self, cov) -> float:
        """`Origin.per_tip` where the weights have the covariance `cov`."""
        return float(np.mean(self.design @ (cov @ self.tip)))

    def mean(self, rows, weight):
        """Weighted mean of the `rows`' origins, and its variance [m, m²]."""
        part = weight @ self.design[rows] / weight.sum()
        return part @ self.weights(), part @ np.linalg.solve(self.matrix, part)

    def beside(self, design, bend, pull, sd) -> "_Evidence":
        """With that of rows of `design`, whose common error of `sd` [m] is eliminated.

        Each has the slope `pull` and the curvature `bend` of its log-likelihood at origin 0.
        """
        matrix = (design.T @ design.multiply(bend[:, None]).tocsr()).toarray()
        common, own = design.T @ bend, bend.sum() + sd**-2
        matrix = self.matrix + matrix - np.outer(common, common) / own
        rhs = self.rhs + design.T @ pull - common * pull.sum() / own
        return replace(self, matrix=matrix, rhs=rhs, tip=common * (1 - bend.sum() / own))


def _steadiness(knots):
    """Inverse of the correlations ALIKE^|j − k| of knots j and k."""
    diagonal = np.full(knots, 1 + ALIKE**2)
    diagonal[[0, -1]] = 1.0
    inverse = np.diag(diagonal) - ALIKE * (np.eye(knots, k=1) + np.eye(knots, k=-1))
    return inverse / (1 - ALIKE**2)


def origin_from_tip(
    places: Stations, whisker: Whisker, time, params: RodParams
) -> tuple[Origin, _Evidence]:
    """Origin of each row from the prior and, as far as the tip is seen, from its place.

    Parameters
    ----------
    places : rows of one whisker in the order of their frames
    time : (rows,) [s]
    """
    design = _design(time, params.hidden_length_knot_s)
    terms, session = design.shape[1], 1e-3 * params.hidden_length_sd_mm
    evidence = _Evidence(design, np.zeros((terms, terms)), *np.zeros((2, terms)), params)
    evidence.matrix[0, 0] = session**-2
    varies = 1e-3 * params.hidden_length_varies_mm
    evidence.matrix[1:, 1:] = _steadiness(terms - 1) / varies**2
    end, sd = trace_ends(places, params)
    good = np.isfinite(end)
    if good.any():
        tip, common = _expected_end(places.rows(good), whisker, params)
        away, part = tip - end[good], design[good]
        hidden, common = _errors_in_conflict(abs(np.mean(away)), session, common)
        evidence.matrix[0, 0] = hidden**-2
        weight, variance = np.ones(good.sum()), SHARED_FRAMES * sd**2
        for _ in range(4):
            bend = weight / variance
            found = evidence.beside(part, bend, bend * away, common)
            left = away - part @ found.weights()
            left -= np.average(left, weights=weight)
            weight = 1 / np.maximum(1, np.abs(left) / (2 * sd))
            lasting = _lasting_variance(np.clip(left, -3 * sd, 3 * sd))
            variance = max(SHARED_FRAMES * sd**2, lasting)
        evidence = found
    return evidence.solve(), evidence


def origin_from_bending(
    places: Stations,
    whisker: Whisker,
    curvature_at: float,
    prior: RestPrior,
    evidence: _Evidence,
    from_free,
    friction=0.0,
) -> tuple[Origin, RestPrior]:
    """Origin of each row from tip and bending together, and the rest shape in each row with it.

    `places.origin` is that of the `evidence`, and `prior` what free frames show with it; as
    `from_free(design)(rows)` would have it if free frames showed their rows of a sparse `design`
    instead. `friction` as in `fit_loaded`.
    """
    rows, shown, pole_sd = _shown(places, whisker, curvature_at, prior, evidence.params, friction)
    cov = np.linalg.inv(evidence.matrix)
    both = OriginAndRest.before(evidence.design, cov, prior, whisker, from_free, pole_sd)
    answer, answer_se, unexplained = np.nan, np.nan, 0.0
    if len(rows) >= FEWEST_ROWS:
        both, answer, answer_se, unexplained = _with_rows(both, evidence, rows, shown)
    change, se, prior = both.of_rows(prior)
    se, per_tip = np.hypot(se, unexplained), evidence.per_tip(both.cov[: len(cov), : len(cov)])
    return Origin(places.origin + change, se, per_tip, answer, answer_se), prior


def _with_rows(both, evidence, rows, shown):
    """`both` with the rows, their own estimate and its error, and what stays unexplained [m]."""
    other, variance = evidence.mean(rows, shown[0][:, 0, 0])
    try:
        away, se = both.by_rows_alone(rows, *shown)
        given = both.given(rows, *shown)
    except np.linalg.LinAlgError:
        return both, np.nan, np.nan, 0.0
    most = 1e-3 * evidence.params.bending_most_mm
    unexplained = abs(away) - EXPLAINED_SD * np.hypot(se, np.sqrt(variance))
    both = given if abs(other + away) <= most else both
    return both, other + away, se, np.clip(unexplained, 0.0, most)


def _shown(places, whisker, curvature_at, prior, params, friction):
    """Rows whose bending is used, their `shown_by`, and the error by a misplaced pole [m]."""
    rows = _bent_rows(places, params)
    if len(rows) < FEWEST_ROWS:
        return rows, None, 0.0
    part, powers = places.rows(rows).loaded(), prior.powers[rows]
    rest = replace(prior, drift=prior.drift[rows], cov=of_each_row(prior)[rows], powers=powers)
    friction = np.broadcast_to(np.asarray(friction, float), len(places))[rows]
    fit = rod_fit.fit_loaded(part, whisker, curvature_at, rest, friction, fine=True)
    clean = (fit["chi2"] < CLEAN * np.nanmedian(fit["chi2"])) & (fit["origin_bend"] > 0)
    noise = _noise(fit["origin_pull"][clean], fit["origin_bend"][clean])
    shown = [each[clean] / noise for each in shown_by(fit, rest)]
    return rows[clean], shown, _misplaced_sd(fit["gap"], part.side)


def _noise(pull, bend):
    """Variance of the rows' pulls over the one expected from the stations' information.

    Rows share errors, since a still whisker lies on the same pixels and all rows have their rest
    shape from the same free frames. So CORRELATED_FRAMES of them count as one, as in rest shapes.
    """
    good = bend > 0
    if good.sum() < 2:
        return 1.0
    pull, bend = pull[good], bend[good]
    deviation = (pull - bend * pull.sum() / bend.sum()) / np.sqrt(bend)
    limit = 3 * robust_sd(deviation, about=0.0)
    return CORRELATED_FRAMES * max(0.5, float(np.mean(np.clip(deviation, -limit, limit) ** 2)))


def _misplaced_sd(gap, side):
    """Standard error [m] of the estimate from the bending, by a misplaced pole."""
    sides = [np.nanmedian(gap[side == s]) for s in (-1, 1) if np.isfinite(gap[side == s]).any()]
    return POLE_LEVER * max(map(abs, sides), default=0.0)


def _design(time, knot_s):
    """Basis in time, sparse (rows, terms): a constant, and a triangle about every knot."""
    span = float(np.ptp(time)) if len(time) else 0.0
    knots = int(np.clip(span / knot_s, 1, MOST_KNOTS)) + 1
    place = (time - time.min()) / max(span, 1e-9) * (knots - 1) if len(time) else time
    low = np.minimum(place.astype(int), knots - 2)
    part = place - low
    every = np.arange(len(time))
    hats = sparse.csr_matrix(
        (np.concatenate([1 - part, part]), (np.tile(every, 2), np.concatenate([low, low + 1]))),
        shape=(len(time), knots),
    )
    return sparse.hstack([np.ones((len(time), 1)), hats]).tocsr()


def _errors_in_conflict(away, hidden, tip):
    """Standard errors [m] for hidden length and tip's place that contradict each other by `away`.

    Either both are right within their errors `hidden` and `tip`, or the whisker's length is wrong
    by what these do not explain. The two cases are averaged by their posterior probabilities: with
    the errors returned, the two sources together give that average and its variance.
    """
    expected = np.hypot(hidden, tip)
    if not expected < away < np.inf:
        return hidden, tip
    surprise = away / expected
    right = expit(np.log(surprise / LENGTH_WRONG) - 0.5 * (surprise**2 - 1))
    follows = (hidden / np.array([expected, away])) ** 2  # the tip, if all is right or else
    variances = follows * np.array([tip**2, away**2 - hidden**2])
    each = np.array([right, 1 - right])
    variance = each @ variances + right * (1 - right) * (np.diff(follows)[0] * away) ** 2
    return np.sqrt(variance / (1 - each @ follows)), np.sqrt(variance / (each @ follows))


def _lasting_variance(errors):
    """Variance of independent errors whose mean would scatter as much as the mean of these."""
    lags = range(1, min(TIP_LAGS, len(errors) - 1) + 1)
    return float(np.mean(errors**2) + 2 * sum(np.mean(errors[k:] * errors[:-k]) for k in lags))


def _expected_end(places: Stations, whisker: Whisker, params: RodParams):
    """Arc length [m] at which the traces of `places` should end, and its standard error.

    Where the tip beyond is not seen, it is their mean end, with an infinite error.
    """
    tip = tip_beyond(places, whisker)
    if tip is None:
        return places.last.mean(), np.inf
    return whisker.length - tip.beyond, np.hypot(1e-3 * params.tip_sd_mm, tip.se)


def trace_ends(places: Stations, params: RodParams):
    """Arc length [m] of the trace's end where that is the tip (NaN elsewhere), and its scatter."""
    end, window = places.last, 1e-3 * params.tip_window_mm
    known = end[np.isfinite(end)]
    usual = np.percentile(known, 90) if len(known) else np.nan
    near = known[np.abs(known - usual) < window]
    with np.errstate(invalid="ignore"):
        good = np.abs(end - np.median(near)) < window if len(near) else near
    if np.sum(good) < max(FEWEST_ROWS, TIP_PART * len(end)):
        return np.full(len(end), np.nan), np.nan
    scatter = float(np.std(np.diff(end[good]))) / np.sqrt(2)
    return np.where(good, end, np.nan), max(scatter, 10e-6)


def _bent_rows(places, params):
    """Rows that may touch, rather of frames that no codec made up, spread over the video."""
    near = np.flatnonzero(may_touch(places, 1e-3 * params.loaded_distance_mm))
    near = places.not_interpolated(near, ENOUGH_ROWS)
    return near[evenly(len(near), MOST_ROWS)]
