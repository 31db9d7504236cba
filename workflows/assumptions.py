"""What the forces assume, and the errors where an assumption is wrong.

    python workflows/assumptions.py --scenes 12 --write docs/assumptions.md

Whiskers bend as an elastic rod that other code has computed (`plain_video`), one assumption
broken at a time, and are traced with white noise; no picture is drawn. Contacts and forces are
then found as `run` finds them. Prints a table in Markdown.
"""

import argparse
import sys
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import numpy as np
import pages
import plain_video as plain
from other_truth import FRAMES, Scene
from scipy.ndimage import gaussian_filter1d

from pipeline.contacts import find_contacts
from pipeline.detection.static_scene import PoleTrack
from pipeline.forces import estimate_forces
from pipeline.kinematics import curvature, resampled
from pipeline.kinematics.follicle import follicles
from pipeline.numerics.runs import runs_of_true
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.columns import FRAME_COLUMNS, as_table, split_flags
from whiskermodel.whisker import Whisker

PIXELS_PER_MM, CURVATURE_AT_M = 25.0, 5.5e-3
NOISE_PX = 0.03  # of a point, points 1 px apart
HIDDEN_M, TIP_UNSEEN_M = 1.4e-3, 0.3e-3
HARMLESS = ("starts_before", "ends_after", "slip", "not_half_gaussian")  # say nothing of forces


@dataclass(frozen=True)
class Case:
    """One assumption broken.

    Attributes
    ----------
    name : what is so
    shorter : whole pictures are shorter along x by this factor: the whisker's plane is tilted
    stiffness : true rigidity over the assumed one, function of arc length over length
    dimensions : what the session says over what is true, by field of `Whisker`
    hidden : what it says too much of the hidden length [m]
    """

    name: str
    shorter: float = 1.0
    stiffness: object = None
    dimensions: dict = field(default_factory=dict)
    hidden: float = 0.0


def tilted(degrees):
    """A whisker whose plane is tilted out of the picture's."""
    name = f"elevation of {degrees}°"
    return Case(name, shorter=float(np.cos(np.deg2rad(degrees))))


def softer(share):
    """Young's modulus falls from base to tip by this share of its mean, at equal mean."""
    return Case(
        f"modulus {100 * share:.0f} % lower at the tip than at the base",
        stiffness=lambda u: 1 + share * (0.5 - u),
    )


def bellied(share):
    """Thicker than a cone halfway along, by this share of the radius."""
    return Case(
        f"{100 * share:.0f} % thicker than a cone halfway along",
        stiffness=lambda u: (1 + 4 * share * u * (1 - u)) ** 4,
    )


CASES = (
    Case("all as assumed"),
    *map(tilted, (5, 8, 14)),
    *map(softer, (0.2, 0.4)),
    *map(bellied, (0.02, 0.05)),
    *(Case(f"hidden length {h:g} mm too long", hidden=1e-3 * h) for h in (0.12, 0.3, 0.6)),
    Case("base radius 1 % too large", dimensions={"base_radius": 1.01}),
    Case("cone 2 % too long", dimensions={"cone_length": 1.02}),
    Case("cone 5 % too long", dimensions={"cone_length": 1.05}),
    Case("Young's modulus 5 % too large", dimensions={"youngs_modulus": 1.05}),
)


class UnlikeCone(plain.Whisker):
    """A whisker of another stiffness than a cone's."""

    def stiffness(self, s):
        """E I(s) [N m²]."""
        return self.share(np.asarray(s) / plain.LENGTH) * super().stiffness(s)


@cache
def truth_of(seed, stiffness):
    """Points (frames, arc lengths, 2) [m], touches, and pole [m] of a scene; None if it slips."""
    scene = Scene.drawn(seed)
    whisker = scene.whisker
    if stiffness is not None:
        kind = type("Unlike", (UnlikeCone,), {"share": staticmethod(stiffness)})
        whisker = kind(whisker.curvature, whisker.touching, whisker.arc)
    try:
        return *whisker.sweep(scene.angles), whisker.pole
    except RuntimeError:
        return None


def traced(points, rng) -> Centrelines:
    """Centrelines of true points [px], with white noise across the whisker."""
    step = plain.LENGTH * 1e3 * PIXELS_PER_MM
    s = np.linspace(0, plain.LENGTH, round(step) + 1)
    s = s[(s >= HIDDEN_M) & (s <= plain.LENGTH - TIP_UNSEEN_M)]
    n, m = len(points), len(s)
    x, y = (np.array([np.interp(s, plain.ARC, each[:, k]) for each in points]) for k in (0, 1))
    raw = rng.normal(0, NOISE_PX, (n, m))
    smooth = gaussian_filter1d(raw, 6.0, axis=1)
    tx, ty = np.gradient(x, axis=1), np.gradient(y, axis=1)
    norm = np.hypot(tx, ty)
    return Centrelines(
        names=("C2",),
        frame=np.arange(n, dtype=np.int32),
        whisker=np.zeros(n, np.int32),
        offsets=m * np.arange(n + 1),
        x_px=(x + smooth * ty / norm).ravel().astype(np.float32),
        y_px=(y - smooth * tx / norm).ravel().astype(np.float32),
        se_px=np.full(n * m, NOISE_PX, np.float32),
        confidence=np.ones(n, np.float32),
        offset_px=(raw - smooth).ravel().astype(np.float32),
        information=np.full(n * m, NOISE_PX**-2, np.float32),
    )


def analysed(seed, case: Case):
    """Contacts as found, true touches, and the evidence, of one scene with one thing broken."""
    points, touches, pole = truth_of(seed, case.stiffness)
    rng = np.random.default_rng([seed, 3])
    scale = 1e3 * PIXELS_PER_MM
    # y up in the truth, down in pictures; a tilt shortens what lies along x
    to_px = np.array([case.shorter, -1.0]) * scale
    px, py = pole * to_px
    pole = PoleTrack(np.full(FRAMES, px), np.full(FRAMES, py), plain.POLE_RADIUS * scale)
    recording = Recording(1000.0, PIXELS_PER_MM, "left")
    lines, hidden = traced(points * to_px, rng), [HIDDEN_M + case.hidden]
    whisker = Whisker(plain.LENGTH, plain.CONE, plain.BASE_RADIUS, plain.YOUNG, name="C2")
    wrong = {key: value * getattr(whisker, key) for key, value in case.dimensions.items()}
    whisker = replace(whisker, **wrong)
    table = curvature.measure(lines, recording, hidden, CURVATURE_AT_M, DEFAULTS.kinematics, pole)
    turn = follicles(lines, np.full(len(lines), hidden[0] * scale), scale, DEFAULTS.kinematics)[
        :, 2
    ]
    table = table.assign(base_angle_deg=np.degrees(turn), whisker="C2", tracked=True,
                         time_s=table["frame"] / 1000.0)  # fmt: skip
    places = resampled.measure_stations(
        lines, recording, [whisker], hidden, pole, params=DEFAULTS.kinematics
    )
    frames = as_table(table, FRAME_COLUMNS)
    whiskers = {"C2": whisker}
    frames, evidence = estimate_forces(
        frames, places, whiskers, CURVATURE_AT_M, pixels_per_m=recording.pixels_per_m
    )
    found = find_contacts(frames, evidence, recording, whiskers)
    return found.contacts, touches, found.evidence


def figures(case: Case, seeds) -> dict:
    """Errors, coverage and flags over all contacts of the scenes."""
    errors, covered, flags, correction, found, true = [], [], [], [], 0, 0
    for seed in seeds:
        if truth_of(seed, case.stiffness) is None:
            continue
        contacts, touches, evidence = analysed(seed, case)
        for a, b in runs_of_true([touch is not None for touch in touches]):
            true += 1
            own = contacts[(contacts["onset_frame"] < b) & (contacts["offset_frame"] > a)]
            if own.empty:
                continue
            found += 1
            got = own.iloc[0]
            peak = 1e6 * max(touch.force for touch in touches[a:b])
            errors.append(got["peak_force_uN"] / peak - 1)
            covered.append(abs(got["peak_force_uN"] - peak) < 1.96 * got["peak_force_se_uN"])
            correction.append(1e3 * np.nanmedian(evidence["bending_origin_m"]))
            flags.append([f for f in split_flags(got["flags"]) if f not in HARMLESS])
    return {
        "errors": np.array(errors),
        "covered": covered,
        "flags": flags,
        "correction": correction,
        "of": (found, true),
    }


def row_of(case: Case, seeds) -> list[str]:
    """One row of the table."""
    got = figures(case, seeds)
    flagged = [bool(each) for each in got["flags"]]
    names = sorted({flag for each in got["flags"] for flag in each})
    low, middle, high = np.percentile(got["errors"], [5, 50, 95])
    return [
        case.name, "{} of {}".format(*got["of"]), f"{100 * middle:+.1f} %",
        f"{100 * low:+.1f} to {100 * high:+.1f} %", f"{100 * np.mean(got['covered']):.0f} %",
        f"{np.median(got['correction']):+.2f}", f"{100 * np.mean(flagged):.0f} %",
        ", ".join(f"`{name}`" for name in names),
    ]  # fmt: skip


def main(argv=None) -> int:
    """Break one assumption after another."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--seed", type=int, default=100, help="of the first scene")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    seeds = range(args.seed, args.seed + args.scenes)
    rows = []
    for case in CASES:
        rows.append(row_of(case, seeds))
        print(*rows[-1], sep=" | ", file=sys.stderr)
    header = [
        "what is so", "contacts found", "peak force: median error", "90 % of them",
        "truth in the 95 % interval", "bending adds to hidden length [mm]", "flagged", "flags",
    ]  # fmt: skip
    text = pages.table(header, rows)
    pages.publish(text, args.write, "assumptions")
    return 0


if __name__ == "__main__":
    sys.exit(main())
