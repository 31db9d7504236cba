"""What accuracy.py must reach: targets by preset, and what was reached beside them."""

from dataclasses import dataclass

import numpy as np
import pages

FEWEST_VIDEOS = 10  # below, the part of truths in the intervals is not judged


@dataclass(frozen=True)
class Target:
    """A figure that must not exceed (`most`) or not fall below (`least`) a value."""

    what: str
    figure: str
    most: float = np.inf
    least: float = -np.inf
    unit: str = ""
    each_video: bool = False

    def met(self, value) -> bool:
        """Whether a value meets the target; a figure that is unknown does not."""
        return bool(self.least <= value <= self.most)

    @property
    def demand(self) -> str:
        """The target as text."""
        if np.isinf(self.most):
            return f">= {self.least:g}"
        return f"<= {self.most:g}" if np.isinf(self.least) else f"{self.least:g} to {self.most:g}"


FIRST = (
    Target("contacts of 5 ms and more missed", "missed_5ms", 0),
    Target("contacts invented", "invented", 0),
    Target("contacts with both edges within 2 frames", "edges_within_2", least=0.95),
    Target("peak force: median error / (5 % or 0.5 µN)", "shape_force_typical_small", 1),
    Target("centreline RMS error", "rms_px", 0.1, unit="px"),
)
LINES = tuple(
    Target(what, figure, most, unit=unit, each_video=True)
    for what, figure, most, unit in (
        ("centreline median error", "median_px", 0.01, "px"),
        ("centreline RMS error", "rms_px", 0.03, "px"),
        ("centreline 95th percentile", "p95_px", 0.06, "px"),
        ("curvature SD", "curvature_sd", 0.3, "1/m"),
        ("curvature |bias|", "curvature_abs_bias", 0.1, "1/m"),
        ("curvature SD / bound of a quadratic over ±2 mm", "bound_ratio", 1.5, ""),
    )
)
BESIDE_POLE = Target("RMS error beside the pole", "beside_pole_rms_px", 0.03, unit="px")
NO_LONG_FALSE = Target("long false whiskers per frame", "long_false_per_frame", 0)
ROWS = (
    Target("frames on the wrong whisker", "identity_errors", 0),
    Target("lines that leave their whisker", "strayed", 0),
)
COVERED = Target("frames with 80 % of the visible length", "covered_80", least=0.99)
TOUCH = (
    Target("frames that agree on contact", "agreement", least=0.995),
    Target("contacts of 3 ms and 1 µN missed", "missed_3ms_1uN", 0),
    Target("contacts invented", "invented", 0),
    Target("contacts with both edges within 1 frame", "edges_within_1", least=0.99),
)
FORCES = (
    Target("peak force: median error", "shape_force_median", 0.01),
    Target("peak force: within 3 % or 0.1 µN", "shape_force_within", least=0.95),
    Target("base moment: median error", "shape_moment_median", 0.02),
    Target("axial force: median error", "shape_axial_median", 0.02),
)
FLOOR = (
    Target("force SD in free frames, shape", "shape_noise_uN", 0.05, unit="µN"),
    Target("force SD in free frames, point", "point_noise_uN", 0.1, unit="µN"),
)
HARD_FORCES = (
    Target("peak force: median error", "shape_force_median", 0.01),
    Target("peak force: within 4 % or 0.1 µN", "shape_force_within_4", least=0.95),
)
COVERAGE = (  # of every preset on its own: mean over videos, whose errors have much in common
    Target("curvature: truths in the 95 % intervals", "curvature_coverage", 0.97, 0.93),
    Target("peak force: truths in the 95 % intervals", "shape_peak_coverage", 0.97, 0.93),
    Target("force: truths in the 95 % intervals", "shape_force_coverage", 0.97, 0.93),
    Target("base moment: truths in the 95 % intervals", "shape_moment_coverage", 0.97, 0.93),
    Target("axial force: truths in the 95 % intervals", "shape_axial_coverage", 0.97, 0.93),
)
NO_TOUCH = (Target("contacts invented", "invented", 0),)
TARGETS = {
    "single": (*FIRST, *TOUCH, *FORCES),
    "noisy": (*FIRST, *LINES, BESIDE_POLE, *TOUCH, *FORCES, *FLOOR),
    "low_contrast": (COVERED, *TOUCH, *HARD_FORCES, *FLOOR),
    "row": (*ROWS, COVERED, *TOUCH, *FORCES, *FLOOR),
    "crossing": ROWS,
    "moving_fur": (COVERED, *TOUCH, *HARD_FORCES, *FLOOR),
    "orientation": LINES,
    "faint_touch": (*TOUCH, *FORCES),
    "close_touches": (*TOUCH, *FORCES),
    "resting": (*TOUCH, *FORCES),
    "h264": (*TOUCH, *HARD_FORCES, *FLOOR),
    "mjpeg": (*TOUCH, *FORCES, *FLOOR),
    "slip_off": (*ROWS, *TOUCH, *FORCES),
    "large_deflection": (*TOUCH, *FORCES),
    "coarse": (*TOUCH, *FORCES),
    "moving_pole": (*TOUCH, *FORCES),
    "near_miss": NO_TOUCH,
    "free": (*NO_TOUCH, *FLOOR),
    "border": ROWS,
    "passing": (*NO_TOUCH, COVERED),
    "fig3": (*TOUCH, *FORCES, *FLOOR),
    "dense_row": ROWS,
    "mouse_face_on_top": ROWS,
    "rat_both_sides": ROWS,
    "varied": (*ROWS, *TOUCH, *HARD_FORCES),
}


def checks(preset, pooled: dict, each: dict[str, dict]) -> list[dict]:
    """Every target of a preset with what was reached; of `each_video` ones the worst video's."""
    rows = []
    for target in (*TARGETS.get(preset, ()), NO_LONG_FALSE):
        value, where = reached(target, pooled), "all"
        if target.each_video:
            where = max(each, key=lambda v: _nan_last(reached(target, each[v])))
            value = reached(target, each[where])
        rows.append(
            {
                "preset": preset,
                "what": target.what,
                "value": value,
                "unit": target.unit,
                "target": target.demand,
                "met": target.met(value),
                "video": where,
            }
        )
    return rows + coverage_checks(preset, list(each.values()))


def coverage_checks(preset, each: list[dict]) -> list[dict]:
    """The targets for a preset's standard errors: means over videos, with their own error."""
    rows = []
    for target in COVERAGE:
        shares = np.array([figures[target.figure] for figures in each])
        shares = shares[np.isfinite(shares)]
        if len(shares) < FEWEST_VIDEOS:
            continue
        error = shares.std(ddof=1) / np.sqrt(len(shares))
        rows.append(
            {
                "preset": preset,
                "what": f"{target.what} (± {error:.3f}, {len(shares)} videos)",
                "value": shares.mean(),
                "unit": "",
                "target": target.demand,
                "met": target.met(shares.mean()),
                "video": "all",
            }
        )
    return rows


def reached(target, figures):
    """The figure that a target is about."""
    if target.figure == "curvature_abs_bias":
        return abs(figures["curvature_bias"])
    return figures[target.figure]


def _nan_last(value):
    return np.inf if np.isnan(value) else value


def checks_text(rows: list[dict]) -> str:
    """How many targets are met, and those that are missed with what was reached."""
    missed = [
        [
            row["preset"],
            row["what"],
            f"{row['value']:.4g} {row['unit']}".strip(),
            row["target"],
            f"MISSED ({row['video']})",
        ]
        for row in rows
        if not row["met"]
    ]
    said = f"{len(rows) - len(missed)} of {len(rows)} targets met"
    header = ["preset", "what", "reached", "target", ""]
    parts = ["### Targets", said, *([pages.table(header, missed)] if missed else [])]
    return "\n\n".join(parts)
