"""One whisker in all frames in which it was tracked, and the rest shape that free ones show."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from pipeline.forces import rest_shape, rod_fit
from pipeline.forces.rest_shape import RestModel
from pipeline.forces.rod_fit import RestPrior
from pipeline.kinematics.stations import Stations
from whiskermodel.whisker import Whisker

REST_SD_PER_M = 1e-3  # added to each rest coefficient, so that its covariance can be inverted


@dataclass(frozen=True)
class WhiskerRows:
    """What rods are fitted to: a row per tracked frame of one whisker, in their order.

    Attributes
    ----------
    places : the whisker's `Stations`
    whisker : its dimensions (or stand-ins)
    curvature_at : arc length of the curvature [m]
    angle, time : (rows,) base angle [rad], NaN where it is not known, and time [s]
    free : bool (rows,), frames in which nothing touches the whisker
    """

    places: Stations
    whisker: Whisker
    curvature_at: float
    angle: np.ndarray
    time: np.ndarray
    free: np.ndarray

    def rows(self, rows) -> "WhiskerRows":
        """Return the given rows (indices, slice or mask), their places in memory."""
        return replace(
            self,
            places=self.places.rows(rows).loaded(),
            angle=self.angle[rows],
            time=self.time[rows],
            free=self.free[rows],
        )

    def rest_shape(self) -> RestModel | None:
        """Rest shape, by the angle of the follicle, from the free frames."""
        free = np.flatnonzero(self.free)
        rows = rest_shape.enough(self.places.not_interpolated(free, rest_shape.PLENTY))
        if len(rows) < rest_shape.FEWEST_FRAMES:
            return None
        places = self.places.rows(rows)
        fit = rod_fit.fit_free(places, self.whisker, self.curvature_at)
        lean = _lean(places, self.whisker)
        angle, everywhere = fit["angle"] + fit.rest @ lean, np.ones(len(rows), dtype=bool)
        model = rest_shape.fit_rest(fit.rest, fit.rest_cov, angle, self.time[rows], everywhere)
        if model is None:
            return None
        return replace(rest_shape.by_leaning_angle(model, -lean), rows=rows[model.rows])

    def rest_prior(self, model: RestModel) -> RestPrior:
        """The rest shape as prior for the loaded fit of all rows."""
        angle = self.filled_angle(model)
        powers, (values, cov) = model.powers(angle), model.predict(angle, self.time)
        drift = values - powers @ model.weights
        cov = cov + np.eye(cov.shape[1]) * REST_SD_PER_M**2
        shape = model.weights, model.centre, model.scale, drift, cov
        return RestPrior(*shape, model.weights_cov, powers)

    def filled_angle(self, model: RestModel) -> np.ndarray:
        """The angles; the model's centre where there is none, good enough for an error."""
        return np.where(np.isfinite(self.angle), self.angle, model.centre)


def _lean(places, whisker):
    """Angle between the straight line through the visible part and the follicle's axis.

    (N_REST,) [rad m], per rest coefficient. An error of the fitted shape is also one of the
    follicle's angle, but hardly one of this line's direction.
    """
    s = np.linspace(0, whisker.length, 200)
    turned = cumulative_trapezoid(rod_fit.rest_basis(whisker, s), s, axis=0, initial=0)
    first, last = np.nanmedian(places.first), np.nanmedian(places.last)
    # the slope of a least-squares line is the curve's direction weighted by a parabola
    weight = np.maximum((s - first) * (last - s), 0.0)
    return weight @ turned / weight.sum()
