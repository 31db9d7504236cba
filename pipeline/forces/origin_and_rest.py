"""Origin of the arc lengths and rest shape, estimated together from the touching frames.

An error of one causes an error of the other. Where free frames are few, an error of the rest shape
looks like another origin in touching frames. And the rest shape belongs to the whisker: a frame in
which the trace begins at another place than in free frames shows another part of it. Where the
curvature grows by 2 1/m per millimetre, 25 µm make 0.05 1/m, as much as a faint touch.

The unknowns are the weights of the origin (columns of its `design`), those of the rest shape, and
how far the pole is misplaced, which shifts the estimate from the bending. For each touching row,
the log-likelihood of origin and rest shape, with pose and force fitted again (`rod_fit`), is taken
as a parabola: so all unknowns, and each row's origin and rest shape, are normally distributed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag

from pipeline.forces.rest_shape import of_polynomials
from pipeline.forces.rod_fit import N_REST, RestPrior, ShapeFit
from pipeline.kinematics.stations import BLOCK_ROWS
from pipeline.numerics.runs import parts
from whiskermodel.whisker import Whisker

FLAT_M = 1.0  # standard error of an origin of which nothing is known


@dataclass(frozen=True)
class OriginAndRest:
    """Posterior of the parameters that all rows of a whisker share.

    Attributes
    ----------
    design : sparse (rows, terms), of the origin
    powers : (rows, degrees), of the rest shape
    slide : (N_REST,) how a rest shape changes with the part of the whisker that is seen [1/m²]
    from_free : function of rows: their design (rows, terms) as free frames have it from theirs, as
        the rest shape
    change : (unknowns,) by which origin's terms [m], rest shape's weights [1/m] and the pole's
        place [m] differ from what was taken for them
    cov : (unknowns, unknowns)
    """

    design: sparse.csr_matrix
    powers: np.ndarray
    slide: np.ndarray
    from_free: Callable
    change: np.ndarray
    cov: np.ndarray

    @classmethod
    def before(cls, design, origin_cov, prior: RestPrior, whisker: Whisker, from_free, pole_sd):
        """The prior, before any touching row is used.

        `origin_cov` (terms, terms) [m²]; `from_free`: of the design, gives the function; `pole_sd`
        [m]: error of the bending's answer by a misplaced pole.
        """
        weights = prior.weights.size
        cov = block_diag(origin_cov, prior.weights_cov.reshape(weights, weights), pole_sd**2)
        slide = _slide(prior.weights[0], whisker.length)
        return cls(design, prior.powers, slide, from_free(design), np.zeros(len(cov)), cov)

    def given(self, rows, information, pull) -> "OriginAndRest":
        """The posterior, given what touching `rows` show (`shown_by`)."""
        change, cov = _updated(self.cov, self._seen_by(rows), information, pull)
        return replace(self, change=change, cov=cov)

    def by_rows_alone(self, rows, information, pull):
        """Change of origin common to all `rows`, from them alone, and its standard error [m].

        The rest shape moves along, so that it is no evidence.
        """
        first = self.design.shape[1] - 1
        seen = self._seen_by(rows)[:, :, first:]  # of the origin, one unknown is left
        seen[:, :, 0] = np.eye(seen.shape[1])[0]
        cov = block_diag(FLAT_M**2, self.cov[first + 1 :, first + 1 :])
        change, cov = _updated(cov, seen, information, pull)
        return float(change[0]), float(np.sqrt(cov[0, 0]))

    def of_rows(self, prior: RestPrior):
        """Rows' change of origin, its standard error [m], and rest shape, moving along with it."""
        n = len(prior.drift)
        origin, variance, drift = np.empty(n), np.empty(n), prior.drift.copy()
        by_origin, shared = np.empty_like(drift), np.empty_like(prior.cov)
        for part in parts(n, BLOCK_ROWS):
            rows = np.arange(part.start, part.stop)
            own, rest, both = self._moments(rows)
            origin[rows], variance[rows] = own
            drift[rows] += rest[0]
            by_origin[rows] = rest[1] / own[1][:, None]
            shared[rows] = both - by_origin[rows][:, :, None] * rest[1][:, None, :]
        cov = of_each_row(prior) + shared
        moved = replace(prior, drift=drift, cov=cov, by_origin=by_origin, shared=shared)
        return origin, np.sqrt(variance), moved

    def _moments(self, rows):
        """Of `rows`: origin and its variance; rest shape, its covariance with that and its own."""
        terms, design, weights = self.design.shape[1], self.design[rows], self._weights(rows)
        by_origin = design @ self.cov[:terms]
        design = design.toarray()
        away = design - self.from_free(rows)
        by_away = away @ self.cov[:terms]
        variance, both, square = (
            (one * other[:, :terms]).sum(axis=1)
            for one, other in ((design, by_origin), (design, by_away), (away, by_away))
        )
        with_origin, with_away = (
            np.einsum("nvw,nw->nv", weights, each[:, terms:-1]) for each in (by_origin, by_away)
        )
        slid = with_away[:, :, None] * self.slide
        shared = weights @ self.cov[terms:-1, terms:-1] @ weights.transpose(0, 2, 1)
        shared += slid + slid.transpose(0, 2, 1)
        shared += square[:, None, None] * np.outer(self.slide, self.slide)
        origin, moved = self.change[:terms], weights @ self.change[terms:-1]
        return (
            (design @ origin, variance),
            (
                np.outer(away @ origin, self.slide) + moved,
                np.outer(both, self.slide) + with_origin,
            ),
            shared,
        )

    def _weights(self, rows):
        """How rest shapes of `rows` follow the weights: (rows, N_REST, weights)."""
        weights = np.einsum("nk,vw->nvkw", self.powers[rows], np.eye(N_REST))
        return weights.reshape(len(rows), N_REST, -1)

    def _seen_by(self, rows):
        """How origin and rest shape of touching `rows` follow: (rows, 1 + N_REST, unknowns)."""
        terms, design = self.design.shape[1], self.design[rows].toarray()
        seen = np.zeros((len(rows), 1 + N_REST, len(self.cov)))
        seen[:, 0, :terms], seen[:, 0, -1] = design, 1.0
        away = design - self.from_free(rows)
        seen[:, 1:, :terms] = self.slide[:, None] * away[:, None, :]
        seen[:, 1:, terms:-1] = self._weights(rows)
        return seen


def of_each_row(prior: RestPrior) -> np.ndarray:
    """Covariance (rows, N_REST, N_REST) of the rest shape that rows do not share."""
    return prior.cov - of_polynomials(prior.powers, prior.weights_cov)


def shown_by(fit: ShapeFit, rest: RestPrior):
    """Log-likelihood of fitted rows as a parabola in their origin and rest shape.

    Curvature (rows, 1 + N_REST, 1 + N_REST) and slope (rows, 1 + N_REST), for measurements with
    the stations' information; `rest` as the rows were fitted with. Zero where no rod was fitted.
    """
    u = (fit["angle"] - rest.centre) / rest.scale
    mean = u[:, None] ** np.arange(len(rest.weights)) @ rest.weights + rest.drift
    inflate = np.fmax(fit["chi2"], 1.0)[:, None, None]
    precision = np.linalg.inv(rest.cov) * inflate
    information = np.empty((len(u), 1 + N_REST, 1 + N_REST))
    information[:, 0, 0] = fit["origin_bend"]
    information[:, 0, 1:] = information[:, 1:, 0] = -fit.pull_by_rest
    information[:, 1:, 1:] = precision - precision @ (fit.rest_cov / inflate) @ precision
    towards = np.einsum("nvw,nw->nv", precision, fit.rest - mean)
    pull = np.column_stack([fit["origin_pull"], towards])
    lost = ~np.isfinite(pull).all(axis=1)
    information[lost], pull[lost] = 0.0, 0.0
    return information, pull


def _slide(rest, length):
    """How rest coefficients change per length by which the whisker is seen farther out [1/m²]."""
    return 2 / length * np.append(np.polynomial.legendre.legder(rest), 0.0)


def _updated(cov, seen, information, pull):
    """Change of unknowns of covariance `cov`, `seen` by rows, and their covariance then."""
    bend = np.einsum("nai,nab,nbj->ij", seen, information, seen, optimize=True)
    usual = np.sqrt(np.diag(cov))  # metres beside curvatures: solved in standard errors
    units = np.outer(usual, usual)
    alike = cov / np.where(units > 0, units, 1.0)
    left = np.linalg.solve(np.eye(len(cov)) + alike @ (bend * units), alike)
    if not (np.diag(left) <= 1 + 1e-6).all():
        raise np.linalg.LinAlgError("a parabola bends upwards")
    left = (left + left.T) / 2 * units
    return left @ np.einsum("nai,na->i", seen, pull), left
