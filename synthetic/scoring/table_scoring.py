"""How near the tables of results come to the truth's: curvature, touches, forces."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

Z95 = 1.959964  # half-width of a normal distribution's 95 % interval / SD


# Per-frame quantities ------------------------------------------------------------------------


def join_frames(result: pd.DataFrame, truth: pd.DataFrame) -> pd.DataFrame:
    """Put result and truth frame tables side by side; the truth's columns get `true_` before.

    One row per true whisker and frame; a row that the result lacks has `tracked` False.
    """
    keys = ["frame", "whisker"]
    right = truth.rename(columns={c: f"true_{c}" for c in truth.columns if c not in keys})
    joined = right.merge(result, on=keys, how="left", validate="one_to_one")
    joined["tracked"] = joined["tracked"].astype("boolean").fillna(False).astype(bool)
    if "in_contact" in joined:
        joined["in_contact"] = joined["in_contact"].astype("boolean").fillna(False).astype(bool)
    return joined


def error_figures(joined: pd.DataFrame, column: str, where=None) -> dict:
    """Bias, SD, robust SD and interval coverage of a measured column of `join_frames`' table.

    Returns
    -------
    dict of `count`, `bias`, `sd`, `robust_sd` (from the quartiles), `outliers` (errors beyond
    six robust SDs of the median), `coverage` (part of the truths within ±1.96 of the column's
    standard errors; NaN where there are none)
    """
    part = joined if where is None else joined[where]
    error = (part[column] - part[f"true_{column}"]).to_numpy(float)
    if column.endswith("_deg"):
        error = np.mod(error + 180, 360) - 180  # full turns are no error
    valid = np.isfinite(error) & part["tracked"].to_numpy(bool)
    error = error[valid]
    if not len(error):
        return dict.fromkeys(("bias", "sd", "robust_sd", "coverage"), np.nan) | {
            "count": 0,
            "outliers": 0,
        }
    robust = (np.percentile(error, 75) - np.percentile(error, 25)) / 1.349
    stem = column.removesuffix("_deg")
    se = part.get(f"{column}_se" if stem == column else f"{stem}_se_deg")
    return {
        "count": len(error),
        "bias": float(error.mean()),
        "sd": float(error.std()),
        "robust_sd": float(robust),
        "outliers": int((np.abs(error - np.median(error)) > 6 * robust).sum()),
        "coverage": np.nan if se is None else coverage(error, se.to_numpy(float)[valid]),
    }


def coverage(error, se) -> float:
    """Part of the truths that lie in the estimates' 95 % intervals; NaN without any."""
    error, se = np.asarray(error, float), np.asarray(se, float)
    known = np.isfinite(error) & np.isfinite(se) & (se > 0)
    return float((np.abs(error[known]) <= Z95 * se[known]).mean()) if known.any() else np.nan


def contact_agreement(joined: pd.DataFrame) -> float:
    """Part of frames in which result and truth agree on contact; untracked frames say "free"."""
    return float((joined["in_contact"] == joined["true_in_contact"].astype(bool)).mean())


# Contacts ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ContactMatch:
    """True and found contacts, one to one.

    Attributes
    ----------
    pairs : table, a row per pair: all columns of both contact tables (the truth's with `true_`
        before) and `overlap`, frames in common over frames of either
    missed : rows of the truth that no found contact stands for
    invented : found contacts that share no frame with any true one
    surplus : found contacts that share frames with a true one which another stands for
    """

    pairs: pd.DataFrame
    missed: pd.DataFrame
    invented: pd.DataFrame
    surplus: pd.DataFrame


def match_contacts(result: pd.DataFrame, truth: pd.DataFrame) -> ContactMatch:
    """Match found to true contacts of the same video and whisker so that overlaps sum highest."""
    result, truth = result.reset_index(drop=True), truth.reset_index(drop=True)
    left, right, overlap, touched = [], [], [], np.zeros(len(result), bool)
    groups = result.groupby(["video", "whisker"]).indices
    for key, i in truth.groupby(["video", "whisker"]).indices.items():
        j = groups.get(key, np.empty(0, int))
        share = overlaps(truth.iloc[i], result.iloc[j])
        touched[j] |= (share > 0).any(0)
        for a, b in zip(*linear_sum_assignment(-share), strict=True):
            if share[a, b] > 0:
                left.append(i[a])
                right.append(j[b])
                overlap.append(share[a, b])
    pairs = pd.concat(
        [
            truth.iloc[left].add_prefix("true_").reset_index(drop=True),
            result.iloc[right].reset_index(drop=True),
            pd.Series(overlap, name="overlap", dtype=float),
        ],
        axis=1,
    )
    unmatched = ~np.isin(np.arange(len(result)), right)
    return ContactMatch(
        pairs=pairs,
        missed=truth.drop(index=left),
        invented=result[unmatched & ~touched],
        surplus=result[unmatched & touched],
    )


def overlaps(truth: pd.DataFrame, result: pd.DataFrame) -> np.ndarray:
    """Frames in common over frames of either, for every pair of contacts, (truth, result)."""
    a0, a1 = (truth[c].to_numpy()[:, None] for c in ("onset_frame", "offset_frame"))
    b0, b1 = (result[c].to_numpy()[None, :] for c in ("onset_frame", "offset_frame"))
    common = np.maximum(np.minimum(a1, b1) - np.maximum(a0, b0), 0)
    return common / (np.maximum(a1, b1) - np.minimum(a0, b0))


def edge_errors(match: ContactMatch) -> tuple[np.ndarray, np.ndarray]:
    """Onset and offset errors of all pairs [frames], found − true; cut edges are left out."""
    pairs = match.pairs
    onset = (pairs["onset_frame"] - pairs["true_onset_frame"]).to_numpy(float)
    offset = (pairs["offset_frame"] - pairs["true_offset_frame"]).to_numpy(float)
    flags = pairs["true_flags"].fillna("").str
    starts, ends = flags.contains("starts_before"), flags.contains("ends_after")
    return onset[~starts.to_numpy(bool)], offset[~ends.to_numpy(bool)]


def edges_within(match: ContactMatch, frames: int) -> float:
    """Part of the pairs of which both edges are at most `frames` frames off."""
    pairs = match.pairs
    onset = (pairs["onset_frame"] - pairs["true_onset_frame"]).abs()
    offset = (pairs["offset_frame"] - pairs["true_offset_frame"]).abs()
    return float(((onset <= frames) & (offset <= frames)).mean()) if len(pairs) else np.nan


def peak_figures(match: ContactMatch, column: str, relative: float, absolute: float) -> dict:
    """Errors of a peak column over all pairs.

    Returns
    -------
    dict of `count`, `bias` and `median` (of the relative error and of its magnitude), `p95` (of
    the magnitude), `within` (part that is off by at most `relative` of the truth or `absolute`
    of the column's unit), `typical` (median of the error over the larger of the two bounds)
    """
    pairs = match.pairs
    true = pairs[f"true_{column}"].to_numpy(float)
    error = pairs[column].to_numpy(float) - true
    known = np.isfinite(true) & (true != 0)
    true, error = true[known], error[known]
    if not len(error):
        return dict.fromkeys(("bias", "median", "p95", "within", "typical"), np.nan) | {"count": 0}
    missing = ~np.isfinite(error)
    share = np.where(missing, np.inf, np.abs(error / true))
    bound = np.maximum(relative * np.abs(true), absolute)
    size = np.where(missing, np.inf, np.abs(error))
    return {
        "count": len(error),
        "bias": float(np.median((error / true)[~missing])) if (~missing).any() else np.nan,
        "median": float(np.median(share)),
        "p95": float(np.quantile(share, 0.95, method="higher")),
        "within": float((size <= bound).mean()),
        "typical": float(np.median(size / bound)),
    }
