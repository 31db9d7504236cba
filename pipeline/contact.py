"""Contacts: when a whisker touches the pole, decided from distance and force together.

In every frame the fitted rod gives two numbers: the gap d between the surfaces and the force F
that the nearest point would feel. A free whisker has F = 0 and d > 0, a touching one d = 0 and
F > 0: an L in the plane (d, F), blurred by errors that are known from the fit or learnt from the
video. A hidden Markov model of two states turns the likelihoods of both arms into a probability
per frame.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd
from numba import njit
from scipy.ndimage import binary_dilation
from scipy.special import erfcx, log_ndtr

from pipeline import forces
from pipeline.contact_rows import PEAK_ERROR_COLUMNS, contact_table, peak_errors
from pipeline.records import EVIDENCE_COLUMNS, FRAME_COLUMNS, Recording, as_table
from pipeline.rest_curvature import FREE_DISTANCE_M
from pipeline.stations import N_STATIONS, Stations, nominal_whisker
from pipeline.stretches import stretches

GAP_SCALE_M = 1e-3  # typical gap of a free whisker
FORCE_SCALE_N = 8e-6  # typical force of a touch
CONTACT_STARTS, CONTACT_ENDS = 0.01, 0.03  # probabilities per frame
UNSEEN_LOG_ODDS = -0.5  # of a frame without a trace: some are bridged in a contact, many are not
# share of frames whose force, or gap, says nothing: the other one still tells
FORCE_OUTLIERS, GAP_OUTLIERS = 1e-4, 1e-5
LEAST_GAP_SD_PX = 0.04
SURE_PUSH_SD = 6.0  # a force of so many standard errors is no noise
STRONG_SHARE = 0.1  # of the largest: where faint pushes may be errors, the strong ones tell
FEWEST_SURE = 10
FARTHEST_OFFSET_PX = 4.0  # of the pole's surface from where it was measured
LEAST_EVIDENCE = 12.0  # summed log-likelihood ratio below which a contact is noise
SHORTEST_S = 1.5e-3  # what is over sooner is a slip of the tracer
LEAST_PEAK_SD = 3.5  # peak force in standard errors
CLEAR_PEAK_SCATTER = 8.0  # or, of both estimates, in what they scatter by in free frames
SURELY_FREE = 1e-3  # probability of contact below which a frame tells the rest shape
MUCH_MORE = 1.0  # near the pole than farther off, of free frames: worth another fit
BESIDE_FRAMES, FEWEST_HELD = 6, 3  # before and after a contact; as many as count, and as must
AT_PLACE_SD = 2.0  # as far from the place of other touches a touch may be
SLIP_LOOK_FRAMES = 4  # so many frames after the end in which the pole has changed sides
LARGE_DEFLECTION_RAD = 0.6
NEAR_CURVATURE_M = 1.0e-3
# a rod that fits so much worse (χ²) under its largest loads than free ones do is another whisker's
UNLIKE_ROD = 4.0
HIGH_LOAD = 0.5  # of a contact's largest

INTERVAL_COLUMNS = (
    "whisker",
    "onset_frame",
    "offset_frame",
    "probability",
    "side",
    "slip",
    "flags",
)


@dataclass(frozen=True)
class Touch:
    """All about the touches in one video.

    Attributes
    ----------
    frames, contacts : tables of records.FRAME_COLUMNS and CONTACT_COLUMNS
    intervals : contacts as INTERVAL_COLUMNS and `curated`
    evidence : the measurements behind, aligned with `frames`, SI units
    """

    frames: pd.DataFrame
    contacts: pd.DataFrame
    intervals: pd.DataFrame
    evidence: pd.DataFrame


def analyse_touch(
    frames: pd.DataFrame,
    places: Stations,
    recording: Recording,
    whiskers: dict,
    *,
    curvature_at: float = 5.5e-3,
    method: str = "shape",
    friction: float = 0.0,
    corrections=None,
    video: str = "",
) -> Touch:
    """Rest shape, contacts, forces, pulses and base loads of one video.

    Parameters
    ----------
    frames : records.FRAME_COLUMNS with the kinematics; a row per whisker and frame, any order
    places : `Stations` of all tracked rows, in any order
    whiskers : name → Whisker, or None: contacts are found all the same, forces are not
    curvature_at : arc length of the curvature in `frames` [m]
    method : "shape" or "point"
    friction : coefficient of friction between whisker and pole, >= 0
    corrections : table of a person's corrections (pipeline.curation), or None
    """
    frames, evidence = measure_touch(
        frames, places, whiskers, curvature_at, friction, recording.pixels_per_m
    )
    return retouch(
        frames, evidence, recording, whiskers,
        curvature_at=curvature_at, method=method, corrections=corrections, video=video,
    )  # fmt: skip


def retouch(
    frames: pd.DataFrame,
    evidence: pd.DataFrame,
    recording: Recording,
    whiskers: dict,
    *,
    curvature_at: float = 5.5e-3,
    method: str = "shape",
    corrections=None,
    video: str = "",
) -> Touch:
    """Everything behind the evidence: contacts, a person's corrections, forces, pulses, loads."""
    from pipeline import base_moments, pulses

    evidence = add_probability(evidence, recording)
    intervals = find_contacts(evidence, curvature_at)
    intervals["curated"] = False
    if corrections is not None:
        intervals = _correct(intervals, corrections, evidence)
    frames = frames.copy()
    frames["in_contact"] = in_contact(frames, intervals)
    frames["contact_probability"] = evidence["probability"].to_numpy()
    frames = forces.add_forces(frames, evidence, whiskers, method)
    contacts = contact_table(frames, intervals, recording, video)
    contacts = pulses.add_pulses(contacts, frames, recording)
    contacts = base_moments.add_base_moments(contacts, frames, whiskers, recording)
    contacts[list(PEAK_ERROR_COLUMNS)] = peak_errors(contacts, evidence, whiskers)
    return Touch(as_table(frames, FRAME_COLUMNS), contacts, intervals, evidence)


def measure_touch(
    frames, places: Stations, whiskers: dict, curvature_at, friction=0.0, pixels_per_m=None
):
    """Rest curvature and evidence of touch for all whiskers of a video.

    Returns
    -------
    frames : the table with distance, rest curvature and curvature change filled; base angle,
        curvature and, where the scale is given, follicle as the fitted rods have them
    evidence : aligned with `frames`; NaN in frames without a trace
    """
    frames = frames.reset_index(drop=True).copy()
    parts = []
    for index, name in enumerate(places.names):
        own = places.of(name)
        if len(own) == 0:
            continue
        rows = frames.index[frames["whisker"] == name].to_numpy()
        by_frame = pd.Series(rows, index=frames.loc[rows, "frame"])
        rows = by_frame.loc[own.frame].to_numpy()
        given = whiskers.get(name)
        length = (N_STATIONS - 1) * places.spacing[index]
        whisker = given or nominal_whisker(name, length / 1.03, 0.0)
        evidence, measured = _measure(
            own, whisker, frames.loc[rows], curvature_at, friction, pixels_per_m
        )
        if given is None:
            evidence["chi2"] = np.nan  # what stands in for the whisker need not bend as it does
        follicle = measured.pop("follicle_x_m"), measured.pop("follicle_y_m")
        for column in measured:
            frames.loc[rows, column] = measured[column].to_numpy()
        if pixels_per_m is not None:
            x, y = pixels_per_m * follicle[0].to_numpy(), -pixels_per_m * follicle[1].to_numpy()
            known = np.isfinite(x)
            frames.loc[rows[known], "follicle_x_px"] = x[known]
            frames.loc[rows[known], "follicle_y_px"] = y[known]
        frames.loc[rows, "pole_distance_mm"] = 1e3 * evidence["distance_m"].to_numpy()
        parts.append(evidence.set_index(rows))
    evidence = pd.concat(parts) if parts else pd.DataFrame()
    evidence = evidence.reindex(frames.index)
    evidence["whisker"], evidence["frame"] = frames["whisker"], frames["frame"]
    for column in EVIDENCE_COLUMNS:
        if column.name in evidence and column.dtype in ("bool", "int64"):
            evidence[column.name] = evidence[column.name].astype(float).fillna(0)
    return frames, as_table(evidence, EVIDENCE_COLUMNS)


def _measure(own, whisker, kinematics, curvature_at, friction, pixels_per_m):
    """Forces of one whisker; again, where frames near the pole tell more of its rest shape."""
    rod = own, whisker, kinematics, curvature_at, friction
    evidence, measured = forces.measure_forces(*rod)
    if pixels_per_m is None or not np.isfinite(own.pole_x).any():
        return evidence, measured
    far = forces.far_from_pole(own)
    free = np.isfinite(own.last) & _surely_free(evidence, pixels_per_m)
    if np.count_nonzero(free & ~far) < MUCH_MORE * np.count_nonzero(far):
        return evidence, measured
    return forces.measure_forces(*rod, free | far)


def _surely_free(evidence, pixels_per_m):
    """Frames free of touch, as first measured, and with them their neighbours."""
    log_odds = _frame_log_odds(evidence, pixels_per_m)
    touching = _posterior(log_odds, CONTACT_STARTS, CONTACT_ENDS) > SURELY_FREE
    return ~binary_dilation(touching)


# Probability per frame ---------------------------------------------------------------------


def add_probability(evidence: pd.DataFrame, recording: Recording) -> pd.DataFrame:
    """Fill `probability` of contact and its `log_odds` (of the frame alone) in every frame."""
    evidence = evidence.copy()
    evidence["probability"] = 0.0
    evidence["log_odds"] = 0.0
    for name in evidence["whisker"].unique():
        rows = evidence.index[evidence["whisker"] == name]
        part = evidence.loc[rows].sort_values("frame")
        if not part["pole_known"].any():
            continue
        log_odds = _frame_log_odds(part, recording.pixels_per_m)
        evidence.loc[part.index, "log_odds"] = log_odds
        probability = _posterior(log_odds, CONTACT_STARTS, CONTACT_ENDS)
        shortest = SHORTEST_S * recording.frames_per_second
        for start, stop in stretches(probability > 0.5):
            if stop - start < shortest:
                probability[start:stop] = 0.5
        if _passes_over(part, probability):
            probability[:] = 0.0
        evidence.loc[part.index, "probability"] = probability
    return evidence


def _passes_over(part, probability):
    """Whether a whisker rather passes over the pole than touches it: another plane, or dust."""
    return np.count_nonzero(part["across"]) > np.count_nonzero(probability > 0.5)


def _frame_log_odds(part, pixels_per_m):
    """Log-likelihood ratio of contact to no contact of every frame on its own.

    The gap's offset (radius of the pole, blur) and scatter in contact are learnt from the
    video, for both sides, together with the frames that touch.
    """
    gap, gap_sd, force, force_sd, cov = _observations(part, pixels_per_m)
    # an untraced frame says nothing, one without a pole that there is no touch
    side = part["side"].to_numpy()
    absent = ~part["pole_known"].to_numpy(bool) & part["nearest_m"].isna().to_numpy()
    absent &= part["base_angle_rad"].notna().to_numpy()
    least = LEAST_GAP_SD_PX / pixels_per_m
    with np.errstate(invalid="ignore"):
        pushed = force > SURE_PUSH_SD * force_sd
        near = pushed & (np.abs(gap) < FARTHEST_OFFSET_PX / pixels_per_m)
    # before anything is known: what is strongly pushed, and not far, touches
    sure = np.zeros(len(part), bool)
    for s in (-1, 1):
        own = near & (side == s)
        sure |= own & (force > STRONG_SHARE * np.max(force[own], initial=0))
    offset, extra = np.zeros(len(part)), np.full(len(part), 4 * least)
    for _ in range(4):
        for s in (-1, 1):
            own = sure & (side == s)
            if own.sum() < FEWEST_SURE:
                continue
            middle = np.median(gap[own])
            spread = 1.4826 * np.median(np.abs(gap[own] - middle))
            offset[side == s] = middle
            extra[side == s] = np.sqrt(max(spread**2 - np.median(gap_sd[own]) ** 2, least**2))
        sd = np.hypot(gap_sd, extra)
        odds = _log_odds(gap - offset, sd, force, force_sd, cov)
        odds = np.where(np.isfinite(odds), odds, UNSEEN_LOG_ODDS)
        odds = np.where(absent, -50.0, odds)
        sure = pushed & (_posterior(odds, CONTACT_STARTS, CONTACT_ENDS) > 0.9)
    return odds


def _observations(part, pixels_per_m):
    """Gap and force with standard deviations and covariance, in metres and newtons.

    Where no rod could be fitted the traced distance stands in, and no force.
    """
    column = {c: part[c].to_numpy(float) for c in part if c != "whisker"}
    traced_sd = 0.4 / pixels_per_m
    fitted = np.isfinite(column["gap_m"]) & np.isfinite(column["shape_force_se_N"])
    fitted &= column["rest_known"] == 1
    gap = np.where(fitted, column["gap_m"], column["distance_m"])
    gap_sd = np.where(fitted, column["gap_se_m"], traced_sd)
    force = np.where(fitted, column["shape_force_N"], np.nan)
    cov = np.where(fitted, column["gap_force_cov"], 0.0)
    return gap, gap_sd, force, column["shape_force_se_N"], cov


def _log_odds(gap, gap_sd, force, force_sd, cov):
    """log p(d, F | contact) − log p(d, F | free), bivariate normal errors and outliers."""
    any_gap = np.log(GAP_OUTLIERS / (2 * GAP_SCALE_M))
    any_force = np.log(FORCE_OUTLIERS / (2 * 5 * FORCE_SCALE_N))
    with np.errstate(all="ignore"):
        free_gap = gap - cov / force_sd**2 * force
        free_gap_sd = np.sqrt(np.maximum(gap_sd**2 - (cov / force_sd) ** 2, (0.1 * gap_sd) ** 2))
        free = _either(
            _log_normal(force, force_sd), _log_skewed(free_gap, free_gap_sd, GAP_SCALE_M),
            any_force, _log_skewed(gap, gap_sd, GAP_SCALE_M), any_gap,
        )  # fmt: skip
        pushed = force - cov / gap_sd**2 * gap
        pushed_sd = np.sqrt(np.maximum(force_sd**2 - (cov / gap_sd) ** 2, (0.1 * force_sd) ** 2))
        contact = _either(
            _log_normal(gap, gap_sd), _log_skewed(pushed, pushed_sd, FORCE_SCALE_N),
            any_gap, _log_skewed(force, force_sd, FORCE_SCALE_N), any_force,
        )  # fmt: skip
        odds = contact - free
        # without a force the gap alone has to tell
        alone = _log_normal(gap, gap_sd) - _log_skewed(gap, gap_sd, GAP_SCALE_M)
        alone = np.clip(alone, -12.0, 6.0)
    return np.where(np.isfinite(force), odds, alone)


def _either(narrow, broad_given, any_narrow, broad, any_broad):
    """Log density of two quantities, either of which may be an outlier."""
    return np.logaddexp(
        narrow + np.logaddexp(broad_given, any_broad),
        any_narrow + np.logaddexp(broad, any_broad),
    )


def _log_normal(x, sd):
    return -0.5 * (x / sd) ** 2 - np.log(sd) - 0.5 * np.log(2 * np.pi)


def _log_skewed(x, sd, scale):
    """Log density of an exponential of mean `scale` blurred by a normal of `sd`."""
    z = sd / scale - x / sd
    # erfcx keeps its digits where exp and erfc would under- and overflow
    tail = np.log(erfcx(np.maximum(z, 0.0) / np.sqrt(2)) / 2) - 0.5 * (x / sd) ** 2
    body = 0.5 * (sd / scale) ** 2 - x / scale + log_ndtr(-np.minimum(z, 0.0))
    return np.where(z > 0, tail, body) - np.log(scale)


@njit(cache=True)
def _posterior(log_odds, starts, ends):
    """Forward–backward probability of contact in a chain of two states."""
    n = len(log_odds)
    forward = np.empty(n)
    probability = np.empty(n)
    last = starts / (starts + ends)
    for i in range(n):
        ahead = last * (1 - ends) + (1 - last) * starts if i else last
        odds = np.exp(min(max(log_odds[i], -600.0), 600.0)) * ahead / (1 - ahead)
        last = min(max(odds / (1 + odds), 1e-15), 1 - 1e-15)
        forward[i] = last
    back = 1.0  # likelihood of what follows in contact over that when free
    for i in range(n - 1, -1, -1):
        odds = forward[i] / (1 - forward[i]) * back
        probability[i] = odds / (1 + odds) if odds < 1e300 else 1.0
        ratio = np.exp(min(max(log_odds[i], -600.0), 600.0)) * back
        ratio = min(max(ratio, 1e-250), 1e250)
        back = ((1 - ends) * ratio + ends) / (starts * ratio + 1 - starts)
    return probability


# Intervals -----------------------------------------------------------------------------------


def find_contacts(evidence: pd.DataFrame, curvature_at: float = 5.5e-3) -> pd.DataFrame:
    """Contact intervals from evidence with `probability`: INTERVAL_COLUMNS, half-open frames."""
    rows = []
    for name in evidence["whisker"].unique():
        part = _columns(evidence[evidence["whisker"] == name].sort_values("frame"))
        usual = _usual_misfit(part)
        for start, stop in _real_runs(part):
            rows.append(_interval(part, name, start, stop, curvature_at, usual))
    table = pd.DataFrame(rows, columns=list(INTERVAL_COLUMNS))
    return table.astype({"onset_frame": int, "offset_frame": int, "side": int, "slip": bool})


def _columns(part) -> dict[str, np.ndarray]:
    """A table's columns as arrays: looking one up in a table takes longer than what is done."""
    return {name: part[name].to_numpy() for name in part.columns if name != "whisker"}


def _runs(part):
    """Stretches of rows more likely in contact than not, cut where the pole changes sides."""
    side = part["side"]
    for start, stop in stretches(part["probability"] > 0.5):
        first = start
        known = np.flatnonzero(side[start:stop]) + start
        for before, after in pairwise(known):
            if side[before] != side[after]:
                yield first, after
                first = after
        yield first, stop


def _real_runs(part):
    """Runs with enough evidence, and a push at their peak; or held at a place of such ones."""
    odds = part["log_odds"]
    runs = [
        run
        for run in _runs(part)
        if odds[slice(*run)].sum() >= LEAST_EVIDENCE and _is_near(part["distance_m"][slice(*run)])
    ]
    sides = [np.sign(part["side"][slice(*run)].sum()) for run in runs]
    firm = [_is_pushed(part, *run) for run in runs]
    touching = [(run, own) for run, own, yes in zip(runs, sides, firm, strict=True) if yes]
    places = {
        side: _touching_place(part, [run for run, own in touching if own == side])
        for side in set(sides)
    }
    return [
        run
        for run, own, yes in zip(runs, sides, firm, strict=True)
        if yes or (places[own] is not None and _is_held(part, *run, *places[own]))
    ]


def _is_near(distance):
    """Whether a whisker is by the pole in half of the frames; one that is not touches nothing."""
    known = distance[np.isfinite(distance)]
    return len(known) == 0 or np.median(known) < FREE_DISTANCE_M


def _touching_place(part, runs):
    """Gap [m] in touches, and how far it scatters; None where too few frames tell."""
    gap = np.concatenate([part["gap_m"][slice(*run)] for run in runs]) if runs else np.empty(0)
    gap = gap[np.isfinite(gap)]
    if len(gap) < FEWEST_SURE:
        return None
    place = np.median(gap)
    return place, 1.4826 * np.median(np.abs(gap - place))


def _is_held(part, start, stop, place, spread):
    """Whether a whisker is held at the `place` of other touches, gaps of ± `spread` [m].

    It is pushed more there than in the free frames beside, or stops as no free whisker would.
    """
    sd = np.maximum(spread, part["gap_se_m"][start:stop])
    at_place = np.abs(part["gap_m"][start:stop] - place) < AT_PLACE_SD * sd
    if np.count_nonzero(at_place) < FEWEST_HELD:
        return False
    return _is_pushed_more_than_beside(part, start, stop) or _is_stopped(part, start, stop, spread)


def _is_stopped(part, start, stop, spread):
    """Whether the gap is no smooth function of time: a cubic, from some frames before to after."""
    first = max(start - BESIDE_FRAMES, 0)
    gap, gap_sd = (part[name][first : stop + BESIDE_FRAMES] for name in ("gap_m", "gap_se_m"))
    time, known = np.arange(len(gap)), np.isfinite(gap) & np.isfinite(gap_sd)
    outside = np.count_nonzero(known) - np.count_nonzero(known[start - first : stop - first])
    if outside < FEWEST_HELD:
        return False
    path = np.polynomial.Polynomial.fit(time[known], gap[known], 3)
    misfit = np.sum((gap[known] - path(time[known])) ** 2) / max(known.sum() - 4, 1)
    return misfit > (LEAST_PEAK_SD * max(spread, np.median(gap_sd[known]))) ** 2


def _is_pushed(part, start, stop):
    """Whether a force stands out at its peak, by its error or among those of free frames."""
    rows = slice(start, stop)
    return _pushes(part, rows) or all(
        _stands_out(part, rows, f"{method}_force_N") for method in forces.METHODS
    )


def _pushes(part, rows):
    """Whether a force is above its standard error at its peak; True where none is known."""
    with np.errstate(invalid="ignore"):
        push = part["shape_force_N"][rows] / part["shape_force_se_N"][rows]
    return not np.isfinite(push).any() or np.nanmax(push) > LEAST_PEAK_SD


def _is_pushed_more_than_beside(part, start, stop):
    """Whether the force is clearly larger than just before and after.

    Where the rest shape is not well known, neither is the force; but its errors are those of the
    free frames beside, too.
    """
    force = part["shape_force_N"]
    free = np.where(part["probability"] < 0.5, force, np.nan)
    before, after = free[max(start - BESIDE_FRAMES, 0) : start], free[stop : stop + BESIDE_FRAMES]
    beside, inside = (
        each[np.isfinite(each)] for each in (np.append(before, after), force[start:stop])
    )
    if min(len(beside), len(inside)) < FEWEST_HELD:
        return False
    noise = 1.4826 * np.nanmedian(np.abs(np.diff(free))) / np.sqrt(2)
    shares = sum(1 / min(len(some), BESIDE_FRAMES) for some in (beside, inside))
    return inside.mean() - beside.mean() > LEAST_PEAK_SD * noise * np.sqrt(shares)


def _stands_out(part, rows, column):
    """Whether a force is far above that of free frames, however wrong the rest shape may be."""
    force, free = part[column], part["probability"] < 0.5
    free = free & np.isfinite(force)
    if free.sum() < FEWEST_SURE or not np.isfinite(force[rows]).any():
        return False
    middle = np.median(force[free])
    scatter = 1.4826 * np.median(np.abs(force[free] - middle))
    return np.nanmax(force[rows]) - middle > CLEAR_PEAK_SCATTER * scatter


def _usual_misfit(part):
    """Median χ² of free frames' rods, at least 1; infinite where few are free."""
    free = part["chi2"][part["probability"] < 0.5]
    free = free[np.isfinite(free)]
    return max(float(np.median(free)), 1.0) if len(free) >= FEWEST_SURE else np.inf


def _bends_otherwise(part, rows, usual):
    """Whether the whisker bends as the rod does not, where it is loaded most."""
    force, misfit = part["shape_force_N"][rows], part["chi2"][rows]
    known = np.isfinite(force) & np.isfinite(misfit)
    high = known & (force >= HIGH_LOAD * np.max(force[known], initial=0.0))
    return bool(high.any()) and np.median(misfit[high]) > UNLIKE_ROD * usual


def _interval(part, name, start, stop, curvature_at, usual_misfit):
    rows = slice(start, stop)
    frame = part["frame"]
    sides = part["side"]
    side = int(np.sign(sides[rows].sum())) or 1
    after = sides[stop : stop + SLIP_LOOK_FRAMES]
    slip = len(after) > 0 and np.any(after == -side)
    probability = part["probability"][rows]
    flags = _flags(part, start, stop, curvature_at, slip, usual_misfit)
    return (
        name, frame[start], frame[stop - 1] + 1, probability.mean(), side, slip, ";".join(flags)
    )  # fmt: skip


def _flags(part, start, stop, curvature_at, slip, usual_misfit):
    """What to be careful about in one contact."""
    rows = slice(start, stop)
    frame = part["frame"]
    contact = part["contact_m"][rows]
    lateral = part["lateral_per_force"][rows]
    with np.errstate(invalid="ignore"):
        tilted = np.nanmin(np.abs(lateral), initial=1.0) < np.cos(LARGE_DEFLECTION_RAD)
        near = np.nanmin(contact, initial=np.inf) < curvature_at + NEAR_CURVATURE_M
    probability = part["probability"][rows]
    rest_known = part["rest_known"][rows].astype(bool)
    # without a rest shape no rod is loaded, so that none has a contact
    lost = np.isnan(part["base_angle_rad"][rows]) | (rest_known & np.isnan(contact))
    applies = {
        "starts_before": frame[start] == part["frame"].min(),
        "ends_after": frame[stop - 1] == part["frame"].max(),
        "slip": slip,
        "no_rest_curvature": not rest_known.any(),
        "large_deflection": tilted,
        "contact_near_curvature_window": near,
        "bends_unlike_rod": _bends_otherwise(part, rows, usual_misfit),
        "gaps_in_trace": lost.any(),
        "faint_force": not _pushes(part, rows),
        "doubtful": probability.max() < 0.99,
    }
    return [flag for flag, is_so in applies.items() if is_so]


def in_contact(frames: pd.DataFrame, intervals: pd.DataFrame) -> np.ndarray:
    """Bool (rows,): the frames of `frames` that lie in one of the half-open intervals."""
    frame, whisker = frames["frame"].to_numpy(), frames["whisker"].to_numpy(object)
    out = np.zeros(len(frames), dtype=bool)
    for name, own in intervals.groupby("whisker"):
        rows = np.flatnonzero(whisker == name)
        onsets, offsets = (np.sort(own[c].to_numpy()) for c in ("onset_frame", "offset_frame"))
        begun = np.searchsorted(onsets, frame[rows], side="right")
        out[rows] = begun > np.searchsorted(offsets, frame[rows], side="right")
    return out


def _correct(intervals, corrections, evidence):
    """Apply a person's corrections; fill what an added contact does not know of itself."""
    from pipeline import curation

    intervals = curation.apply(intervals, corrections).reset_index(drop=True)
    for i in intervals.index[intervals["curated"]]:
        row = intervals.loc[i]
        part = evidence[evidence["whisker"] == row["whisker"]].sort_values("frame")
        inside = part["frame"].between(row["onset_frame"], row["offset_frame"] - 1)
        sides = part.loc[inside, "side"].sum()
        intervals.loc[i, "side"] = int(np.sign(sides)) or 1
        intervals.loc[i, "probability"] = 1.0
    intervals["slip"] = intervals["slip"].eq(True)
    intervals["flags"] = intervals["flags"].fillna("")
    return intervals
