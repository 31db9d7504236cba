"""Figures of rendered videos beside their truth: lines, curvature, contacts, forces."""

import measuring
import numpy as np
import pandas as pd

from synthetic.scoring.line_scoring import LineScores, line_figures, rms
from synthetic.scoring.table_scoring import (
    Z95,
    ContactMatch,
    contact_agreement,
    coverage,
    edge_errors,
    edges_within,
    error_figures,
    match_contacts,
    peak_figures,
)

LONG_FALSE_MM = 3.0  # a false line longer than this is a long false whisker
DOUBTFUL = ("large_deflection", "contact_near_curvature_window", "doubtful")
LOOSE = 0.04, 0.1  # of the peak force, or µN


def figures_of(videos: list[measuring.Measured], pixels_per_mm: float) -> dict:
    """All figures of one preset's videos, pooled."""
    scores = pooled_scores(videos)
    frames = sum(v.n_frames for v in videos)
    out = {"videos": len(videos), "frames": frames}
    out |= line_figures(scores, frames, LONG_FALSE_MM * pixels_per_mm)
    beside = np.concatenate([v.beside_pole for v in videos])
    out["beside_pole_rms_px"] = rms(scores.distance_px[beside])
    joined = pd.concat([v.shape.joined for v in videos], ignore_index=True)
    out["tracked"] = joined["tracked"].mean()
    out |= prefixed("curvature", error_figures(joined, "curvature_per_m"))
    out |= prefixed("angle", error_figures(joined, "base_angle_deg"))
    out["follicle_rms_px"] = follicle_error(joined)
    out |= bound_ratios(joined)
    out |= contact_figures([v.shape for v in videos])
    for method in ("shape", "point"):
        out |= prefixed(method, force_figures([getattr(v, method) for v in videos]))
    out["frames_per_s"] = frames / sum(sum(v.seconds.values()) for v in videos)
    return out


def prefixed(name, figures):
    """The same figures under keys that begin with a name."""
    return {f"{name}_{key}": value for key, value in figures.items()}


def pooled_scores(videos) -> LineScores:
    """The scores of several videos as those of one."""
    parts = [v.scores for v in videos]
    return LineScores(
        rows=pd.concat([p.rows.assign(video=v.video) for p, v in zip(parts, videos, strict=True)]),
        whiskers=pd.concat([p.whiskers for p in parts]),
        distance_px=np.concatenate([p.distance_px for p in parts]),
        node=np.concatenate([p.node for p in parts]),
    )


def follicle_error(joined) -> float:
    """RMS distance of the follicle from the true one [px]; NaN where nothing is tracked."""
    dx = joined["follicle_x_px"] - joined["true_follicle_x_px"]
    dy = joined["follicle_y_px"] - joined["true_follicle_y_px"]
    return float(np.sqrt(np.nanmean(dx**2 + dy**2))) if joined["tracked"].any() else np.nan


def bound_ratios(joined) -> dict:
    """SD of the curvature's error over the least possible ones; robust, whiskers pooled."""
    out = {}
    for key, column in (("bound_ratio", "least_sd"), ("knots_ratio", "least_sd_knots")):
        error = joined["curvature_per_m"] - joined["true_curvature_per_m"]
        share = (error / joined[column]).to_numpy(float)
        share = share[np.isfinite(share)]
        out[key] = float(np.std(share)) if len(share) else np.nan
    return out


def contact_figures(forces: list[measuring.Forces]) -> dict:
    """How many touches were found, and where their edges are."""
    match = matched(forces)
    joined = pd.concat([f.joined for f in forces], ignore_index=True)
    true = joined["true_in_contact"].astype(bool)
    missed = match.missed
    onset, offset = edge_errors(match)
    return {
        "contacts": len(match.pairs) + len(missed),
        "missed_5ms": int((missed["duration_ms"] >= 5).sum()),
        "missed_3ms_1uN": int(
            ((missed["duration_ms"] >= 3) & (missed["peak_force_uN"] >= 1)).sum()
        ),
        "missed": len(missed),
        "invented": len(match.invented),
        "surplus": len(match.surplus),
        "free_frames": int((~true).sum()),
        "agreement": contact_agreement(joined),
        "edges_within_0": edges_within(match, 0),
        "edges_within_1": edges_within(match, 1),
        "edges_within_2": edges_within(match, 2),
        "onset_bias": onset.mean() if len(onset) else np.nan,
        "offset_bias": offset.mean() if len(offset) else np.nan,
        "flagged": int(is_doubtful(match.pairs).sum()),
    }


def matched(forces) -> ContactMatch:
    """Contacts of several videos' `Forces` beside the true ones."""
    return match_contacts(
        pd.concat([f.contacts for f in forces], ignore_index=True),
        pd.concat([f.true_contacts for f in forces], ignore_index=True),
    )


def is_doubtful(pairs) -> np.ndarray:
    """Contacts whose flags say that the force may be off, bool (pairs,)."""
    flags = pairs["flags"].fillna("").str.split(";")
    return np.array([bool(set(each) & set(DOUBTFUL)) for each in flags], bool)


def force_figures(forces: list[measuring.Forces]) -> dict:
    """Peaks, noise floor and interval coverage of one force estimate."""
    match = matched(forces)
    joined = pd.concat([f.joined for f in forces], ignore_index=True)
    plain = ContactMatch(match.pairs[~is_doubtful(match.pairs)], *[match.missed] * 3)
    both = joined["in_contact"] & joined["true_in_contact"].astype(bool)
    free = np.concatenate([f.free_force for f in forces])
    out = prefixed("force", peak_figures(match, "peak_force_uN", 0.03, 0.1))
    out["force_typical_small"] = peak_figures(match, "peak_force_uN", 0.05, 0.5)["typical"]
    out["force_within_4"] = peak_figures(match, "peak_force_uN", *LOOSE)["within"]
    out |= prefixed("plain_force", peak_figures(plain, "peak_force_uN", 0.03, 0.1))
    out |= prefixed("moment", peak_figures(match, "peak_base_moment_nN_m", 0.03, 0.6))
    out |= prefixed("axial", peak_figures(match, "peak_axial_force_uN", 0.03, 0.1))
    for name, column in (
        ("force", "contact_force_uN"),
        ("moment", "base_moment_nN_m"),
        ("axial", "axial_force_uN"),
    ):
        out[f"{name}_coverage"] = error_figures(joined, column, both)["coverage"]
    error = match.pairs["peak_force_uN"] - match.pairs["true_peak_force_uN"]
    out["peak_coverage"] = coverage(error, match.pairs["peak_force_se_uN"])
    out["noise_uN"] = float(np.std(free)) if len(free) > 100 else np.nan
    return out


# Video by video ------------------------------------------------------------------------------

SPREADS = {  # figure: name of its samples, statistic, format
    "peak force: median error": ("peak", np.median, "{:.2%}"),
    "peak force: 95 % of them": ("peak", lambda each: np.quantile(each, 0.95), "{:.1%}"),
    "peak force: within 4 % or 0.1 µN": ("within_4", np.mean, "{:.1%}"),
    "peak force: coverage": ("peak_covered", np.mean, "{:.1%}"),
    "force per frame: coverage": ("frames_covered", np.mean, "{:.1%}"),
    "point: peak coverage": ("point_covered", np.mean, "{:.1%}"),
    "exact settings: median error": ("exact_peak", np.median, "{:.2%}"),
    "exact settings: coverage": ("exact_covered", np.mean, "{:.1%}"),
    "wrong dimensions: median error": ("wrong_peak", np.median, "{:.2%}"),
    "wrong dimensions: coverage by the budget": ("wrong_covered", np.mean, "{:.1%}"),
    "curvature: coverage": ("curvature_covered", np.mean, "{:.1%}"),
}


def samples_of(video: measuring.Measured) -> dict[str, np.ndarray]:
    """What one video adds to the SPREADS: errors, or 0 and 1, per contact or frame."""
    pairs, joined = matched([video.shape]).pairs, video.shape.joined
    touching = joined["in_contact"] & joined["true_in_contact"].astype(bool)
    error, share = peak_errors(pairs)
    close = np.abs(error) <= np.maximum(LOOSE[0] * pairs["true_peak_force_uN"], LOOSE[1])
    point = matched([video.point]).pairs
    return {
        "peak": share,
        "within_4": close.to_numpy(float),
        "peak_covered": covered(error, pairs["peak_force_se_uN"]),
        "point_covered": covered(peak_errors(point)[0], point["peak_force_se_uN"]),
        "frames_covered": covered_column(joined[touching], "contact_force_uN"),
        "curvature_covered": covered_column(joined, "curvature_per_m"),
    }


def peak_errors(pairs):
    """Errors of the peak forces [µN], and their magnitudes over the truth, both (contacts,)."""
    error = pairs["peak_force_uN"] - pairs["true_peak_force_uN"]
    return error, np.abs(error / pairs["true_peak_force_uN"]).to_numpy(float)


def covered(error, se) -> np.ndarray:
    """1 where the truth lies in the 95 % interval, 0 where not, NaN where there is none."""
    error, se = np.asarray(error, float), np.asarray(se, float)
    known = np.isfinite(error) & np.isfinite(se) & (se > 0)
    return np.where(known, np.abs(error) <= Z95 * se, np.nan)


def covered_column(joined, column) -> np.ndarray:
    """`covered` for a column of the frames."""
    return covered(joined[column] - joined[f"true_{column}"], joined[f"{column}_se"])
