"""Tables of accuracy.py: figures by preset, their spread over videos, and where to look."""

import measuring
import numpy as np
import pages
import pandas as pd
from accuracy_figures import SPREADS, matched
from over_videos import with_range

WORST = 12  # rows of worst.csv per preset and kind of failure

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


def table_of(columns, results: dict[str, dict], prefix="") -> str:
    """A row for each preset with frames; `columns` (header: key, format), keys after `prefix`."""
    rows = [
        [
            preset,
            *(
                pages.cell(form, figures.get(prefix + key, np.nan))
                for key, form in columns.values()
            ),
        ]
        for preset, figures in results.items()
        if figures["frames"]
    ]
    return pages.table(["preset", *columns], rows)


def spread_table(samples: dict[str, list[dict]]) -> str:
    """Figures over videos; `samples` by preset: of each video what `samples_of` gives."""
    rows, shown = [], set()
    for preset, videos in samples.items():
        row = {"preset": preset, "videos": str(len(videos))}
        for what, (name, statistic, form) in SPREADS.items():
            found = with_range([each[name] for each in videos if name in each], statistic)
            row[what] = pages.cell_and_ends(form, *found)
            shown |= {what} if np.isfinite(found[0]) else set()
        rows.append(row)
    header = ["preset", "videos", *(what for what in SPREADS if what in shown)]
    return pages.table(header, [[row[name] for name in header] for row in rows])


def tables_text(results: dict[str, dict], samples) -> str:
    """Every table of figures."""
    parts = ["### Tracking", table_of(TRACKING_TABLE, results)]
    if any(figures["frames"] and figures["contacts"] for figures in results.values()):
        parts += ["### Contacts", table_of(TOUCH_TABLE, results)]
        for method in ("shape", "point"):
            parts += [f"### Forces by `{method}`", table_of(FORCE_TABLE, results, f"{method}_")]
    parts += ["### Over videos, in brackets the range of single ones", spread_table(samples)]
    return "\n\n".join(parts)


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
    """The WORST of some rows of a video by the size of `value` (rows,), as a table."""
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
