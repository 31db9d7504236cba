"""How exact whiskerforce is: rendered videos, processed as `run` does, compared with the truth.

    python workflows/accuracy.py                                # every preset
    python workflows/accuracy.py --presets single,noisy --out accuracy --jobs 2
    python workflows/accuracy.py --full                         # four times the videos

Prints tables in Markdown (docs/accuracy.md holds a run's), then every target with the value
that was reached; the exit status is 1 where one was missed. With --out the videos and their
truth are kept, with `accuracy.csv` (all figures) and `worst.csv` (where to look).
"""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import measuring
import numpy as np
import pages
import pandas as pd
from accuracy_targets import checks, checks_text, coverage_checks

from synthetic.presets import PRESETS
from synthetic.scoring.line_scoring import (
    LineScores,
    line_figures,
    rms,
)
from synthetic.scoring.table_scoring import (
    ContactMatch,
    contact_agreement,
    coverage,
    edge_errors,
    edges_within,
    error_figures,
    match_contacts,
    peak_figures,
)
from synthetic.session import render_session

LONG_FALSE_MM = 3.0  # a false line longer than this is a long false whisker
DOUBTFUL = ("large_deflection", "contact_near_curvature_window", "doubtful")
WORST = 12  # rows of worst.csv per preset and kind of failure


# Figures -------------------------------------------------------------------------------------


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
    out |= prefixed("least", mean_bounds(videos))
    out["frames_per_s"] = frames / sum(sum(v.seconds.values()) for v in videos)
    return out


def prefixed(name, figures):
    return {f"{name}_{key}": value for key, value in figures.items()}


def pooled_scores(videos) -> LineScores:
    parts = [v.scores for v in videos]
    return LineScores(
        rows=pd.concat([p.rows.assign(video=v.video) for p, v in zip(parts, videos, strict=True)]),
        whiskers=pd.concat([p.whiskers for p in parts]),
        distance_px=np.concatenate([p.distance_px for p in parts]),
        node=np.concatenate([p.node for p in parts]),
    )


def follicle_error(joined) -> float:
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


def mean_bounds(videos) -> dict:
    """Bounds on the curvature's SD [1/m], by model, for the first whisker of the videos."""
    firsts = [next(iter(v.least_sd.values())) for v in videos if v.least_sd]
    return {model: np.mean([f[model] for f in firsts]) for model in (firsts[0] if firsts else ())}


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


# Where to look -------------------------------------------------------------------------------


def worst_of(videos: list[measuring.Measured]) -> pd.DataFrame:
    """The worst frames and contacts of one preset: video, whisker, frame, what, value."""
    parts = []
    for v in videos:
        rows, joined = v.scores.rows, v.shape.joined
        bad = rows[rows["nearest"] != ""].nlargest(WORST, "rms_px")
        parts.append(failures(v, bad, "centreline rms_px", bad["rms_px"]))
        bad = rows[(rows["nearest"] != "") & (rows["nearest"] != rows["whisker"])]
        parts.append(failures(v, bad, "wrong whisker", bad["on"]))
        bad = rows[rows["nearest"] == ""]
        parts.append(failures(v, bad, "false line, length_px", bad["length_px"]))
        bad = joined[~joined["tracked"]]
        parts.append(failures(v, bad, "lost", bad["time_s"]))
        bad = joined[joined["tracked"] & (joined["in_contact"] != joined["true_in_contact"])]
        parts.append(failures(v, bad, "contact disagrees", bad["true_contact_force_uN"]))
        error = (joined["curvature_per_m"] - joined["true_curvature_per_m"]).abs()
        bad = joined.assign(error=error).nlargest(WORST, "error")
        parts.append(failures(v, bad, "curvature error_per_m", bad["error"]))
        match = matched([v.shape])
        for table, what in ((match.missed, "missed"), (match.invented, "invented")):
            bad = table.rename(columns={"onset_frame": "frame"})
            parts.append(failures(v, bad, f"{what} contact, peak µN", bad["peak_force_uN"]))
        bad = match.pairs.rename(columns={"onset_frame": "frame"})
        error = bad["peak_force_uN"] / bad["true_peak_force_uN"] - 1
        parts.append(failures(v, bad, "peak force, relative error", error))
    return pd.concat(parts, ignore_index=True)


def failures(video, rows, what, value):
    table = pd.DataFrame(
        {
            "preset": video.preset,
            "video": video.video,
            "whisker": rows["whisker"].to_numpy(),
            "frame": rows["frame"].to_numpy(),
            "what": what,
            "value": np.asarray(value, float),
        }
    )
    keep = table["value"].abs().nlargest(WORST).index
    return table.loc[keep]


# Tables --------------------------------------------------------------------------------------

TRACKING_TABLE = {
    "frames": ("frames", "{:.0f}"),
    "median [px]": ("median_px", "{:.4f}"),
    "RMS [px]": ("rms_px", "{:.4f}"),
    "95 % [px]": ("p95_px", "{:.4f}"),
    "beside pole": ("beside_pole_rms_px", "{:.3f}"),
    "frames with 80 % [%]": ("covered_80", "{:.2%}"),
    "wrong whisker": ("identity_errors", "{:.0f}"),
    "strayed": ("strayed", "{:.0f}"),
    "long false / frame": ("long_false_per_frame", "{:.4f}"),
    "κ bias [1/m]": ("curvature_bias", "{:+.3f}"),
    "κ SD [1/m]": ("curvature_sd", "{:.3f}"),
    "κ robust SD": ("curvature_robust_sd", "{:.3f}"),
    "SD / bound": ("bound_ratio", "{:.2f}"),
    "SD / bound, knots": ("knots_ratio", "{:.2f}"),
    "κ coverage": ("curvature_coverage", "{:.1%}"),
    "follicle RMS [px]": ("follicle_rms_px", "{:.2f}"),
    "base angle SD [°]": ("angle_sd", "{:.3f}"),
    "frames/s": ("frames_per_s", "{:.0f}"),
}
TOUCH_TABLE = {
    "contacts": ("contacts", "{:.0f}"),
    "missed": ("missed", "{:.0f}"),
    "missed ≥ 3 ms, 1 µN": ("missed_3ms_1uN", "{:.0f}"),
    "invented": ("invented", "{:.0f}"),
    "split": ("surplus", "{:.0f}"),
    "free frames": ("free_frames", "{:.0f}"),
    "frames agree": ("agreement", "{:.2%}"),
    "edges exact": ("edges_within_0", "{:.1%}"),
    "≤ 1 frame": ("edges_within_1", "{:.1%}"),
    "≤ 2 frames": ("edges_within_2", "{:.1%}"),
    "onset bias": ("onset_bias", "{:+.2f}"),
    "offset bias": ("offset_bias", "{:+.2f}"),
    "flagged": ("flagged", "{:.0f}"),
}
FORCE_TABLE = {
    "peak: median error": ("force_median", "{:.2%}"),
    "bias": ("force_bias", "{:+.2%}"),
    "95 % of them": ("force_p95", "{:.1%}"),
    "within 3 % or 0.1 µN": ("force_within", "{:.1%}"),
    "not flagged: within": ("plain_force_within", "{:.1%}"),
    "moment: median": ("moment_median", "{:.2%}"),
    "axial: median": ("axial_median", "{:.2%}"),
    "peak coverage": ("peak_coverage", "{:.1%}"),
    "force coverage": ("force_coverage", "{:.1%}"),
    "moment coverage": ("moment_coverage", "{:.1%}"),
    "axial coverage": ("axial_coverage", "{:.1%}"),
    "free frames SD [µN]": ("noise_uN", "{:.3f}"),
}


def table_of(columns, results: dict[str, dict], prefix="", wanted="frames") -> str:
    rows = [
        [
            preset,
            *(
                pages.cell(form, figures.get(prefix + key, np.nan))
                for key, form in columns.values()
            ),
        ]
        for preset, figures in results.items()
        if figures[wanted]
    ]
    return pages.table(["preset", *columns], rows)


def bounds_table(results: dict[str, dict]) -> str:
    """Bounds by model beside what was reached."""
    keys = dict.fromkeys(key for figures in results.values() for key in figures)
    models = [key.removeprefix("least_") for key in keys if key.startswith("least_")]
    columns = {"reached, robust": ("curvature_robust_sd", "{:.3f}")}
    columns |= {model: (f"least_{model}", "{:.3f}") for model in models}
    return table_of(columns, results)


def tables_text(results: dict[str, dict]) -> str:
    """Every table of figures."""
    parts = ["### Tracking", table_of(TRACKING_TABLE, results)]
    parts += ["### Least SD of the curvature [1/m], first whisker", bounds_table(results)]
    parts += ["### Contacts", table_of(TOUCH_TABLE, results)]
    for method in ("shape", "point"):
        parts += [f"### Forces by `{method}`", table_of(FORCE_TABLE, results, f"{method}_")]
    return "\n\n".join(parts)


# The whole -----------------------------------------------------------------------------------


def run_preset(preset, folder, args) -> list[measuring.Measured]:
    """Render a preset's videos and measure them all."""
    started = time.monotonic()
    trials = args.trials or PRESETS[preset].trials * (4 if args.full else 1)
    paths = render_session(folder, preset, args.seed, trials, args.jobs)
    rendered = time.monotonic()
    if args.jobs == 1:
        videos = [measuring.measure(preset, path, folder) for path in paths]
    else:
        with ProcessPoolExecutor(args.jobs, mp_context=get_context("spawn")) as pool:
            waiting = [pool.submit(measuring.measure, preset, path, folder) for path in paths]
            videos = [future.result() for future in as_completed(waiting)]
    print(
        f"{preset}: {len(paths)} videos, rendered in {rendered - started:.0f} s, processed in "
        f"{time.monotonic() - rendered:.0f} s",
        file=sys.stderr,
    )
    if not args.out:
        for path in paths:
            path.unlink()
    return sorted(videos, key=lambda v: v.video)


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--presets", help=f"of {','.join(PRESETS)}; by default all")
    parser.add_argument("--trials", type=int, help="videos per preset")
    parser.add_argument("--full", action="store_true", help="four times the usual videos")
    parser.add_argument("--out", type=Path, help="folder for videos, truth and tables")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the tables into")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(argv)
    args.presets = args.presets.split(",") if args.presets else list(PRESETS)
    unknown = [p for p in args.presets if p not in PRESETS]
    if unknown:
        parser.error(f"--presets: no preset {unknown[0]!r}; there are {', '.join(PRESETS)}")
    return args


def main(argv=None) -> int:
    """Measure the presets asked for; 1 where a target was missed."""
    measuring.limit_threads()
    args = arguments(argv)
    results, rows, worst, singly = {}, [], [], []
    with tempfile.TemporaryDirectory() as temporary:
        for preset in args.presets:
            videos = run_preset(preset, (args.out or Path(temporary)) / preset, args)
            scale = videos[0].pixels_per_mm
            results[preset] = figures_of(videos, scale)
            each = {v.video: figures_of([v], scale) for v in videos}
            rows += checks(preset, results[preset], each)
            singly += each.values()
            worst.append(worst_of(videos))
    rows += coverage_checks(singly)
    text = f"{tables_text(results)}\n\n{checks_text(rows)}"
    print(text)
    if args.write:
        pages.write_between(args.write, "accuracy", text)
    if args.out:
        pd.DataFrame(results).T.to_csv(args.out / "accuracy.csv", index_label="preset")
        pd.concat(worst).to_csv(args.out / "worst.csv", index=False)
    return int(not all(row["met"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
