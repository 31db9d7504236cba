"""`run` against pictures and forces that neither `synthetic` nor `whiskermodel` has made.

    python workflows/other_truth.py --scenes 20

Scenes are drawn at random: side of the face or none, scale, light, blur, noise, the whisker's
curvature, how it sweeps and where it meets the pole (`plain_video`). The whisker's length and, in
fur, its hidden length are off in session.toml by what the standard errors assume. Every video is
processed by the command. Prints a table in Markdown.
"""

import argparse
import contextlib
import sys
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pages
import pandas as pd
import plain_video as plain
import tifffile
import wrong_settings

from pipeline.app import cli
from pipeline.numerics.runs import runs_of_true
from pipeline.tables import centrelines, files
from pipeline.tables.columns import CONTACT_COLUMNS

SIDES = ("left", "top", "right", "bottom")
SHAPE = 440, 660  # px
FRAMES = 240
CLEAR_UN = 0.3  # peak force of a contact that must be found
SESSION = """[recording]
frames_per_second = 1000.0
pixels_per_mm = {scale}
face = "{side}"

[[whisker]]
name = "C2"
length_mm = {length}
cone_length_mm = {cone}
base_radius_um = {radius}
youngs_modulus_GPa = {young}
density_kg_per_m3 = 1000.0
damping_per_s = 215.0
hidden_length_mm = {hidden}

[pole]
diameter_mm = 0.5
"""


@dataclass(frozen=True)
class Scene:
    """One video: lengths in mm where not said otherwise, angles in rad, light in grey levels."""

    seed: int
    side: str
    pixels_per_mm: float
    depth: float  # of the follicle behind the face's edge; 0: there is no face
    edge_px: float  # width of the face's edge
    light: float
    dark: float
    noise: float
    blur_px: float
    whisker: plain.Whisker
    angles: np.ndarray

    @classmethod
    def drawn(cls, seed: int) -> "Scene":
        """One at random."""
        rng = np.random.default_rng(seed)
        curvature = rng.choice([-1, 1]) * rng.uniform(1, 25)
        middle = -0.5 * curvature * plain.LENGTH  # the whisker's ends are level
        amplitude, phase = rng.uniform(0.1, 0.25), rng.uniform(0, 2 * np.pi)
        time = np.arange(FRAMES) / 1000
        angles = middle + amplitude * np.sin(2 * np.pi * rng.uniform(6, 14) * time + phase)
        touching = middle - amplitude + min(rng.uniform(0.3, 1.2) * amplitude, 0.15)
        return cls(
            seed=seed,
            side=str(rng.choice(SIDES)),
            pixels_per_mm=round(rng.uniform(18, 32), 2),
            depth=float(rng.choice([0.0, rng.uniform(0.8, 1.8)], p=[0.25, 0.75])),
            edge_px=rng.uniform(0.3, 4),
            light=rng.uniform(140, 225),
            dark=rng.uniform(0.5, 1.0),
            noise=rng.uniform(0.5, 4.0),
            blur_px=rng.uniform(0.6, 1.3),
            whisker=plain.Whisker(curvature, touching, rng.uniform(0.45, 0.75) * plain.LENGTH),
            angles=angles,
        )

    @cached_property
    def swept(self):
        """Points and touches, as of `plain.Whisker.sweep`."""
        return self.whisker.sweep(self.angles)

    def hidden_mm(self) -> float:
        """Arc length from the follicle to the face's edge, halfway through the whisk [mm]."""
        line = self.whisker.free(np.mean([self.angles.min(), self.angles.max()]))
        return float(np.interp(1e-3 * self.depth, line[:, 0], 1e3 * plain.ARC))

    def told_mm(self, rng=None) -> tuple[float, float]:
        """Hidden length and length of the session [mm]: exact, or wrong by a random generator."""
        hidden, length = self.hidden_mm(), 1e3 * plain.LENGTH
        if rng is None:
            return hidden, length
        wrong = wrong_settings.wrong_lengths_mm(hidden, length, 1e3 * plain.CONE, rng)
        return wrong if self.depth else (hidden, wrong[1])

    def film(self, folder: Path, rng=None) -> "Truth":
        """Write whisker.tif and session.toml into a folder, with the lengths of `told_mm`."""
        points, touches = self.swept
        follicle = np.array([35.0, SHAPE[0] / 2])
        scale = 1e3 * self.pixels_per_mm  # px/m
        light = np.full(SHAPE, self.light)
        if self.depth:
            off = np.indices(SHAPE)[1] - follicle[0] - self.depth * self.pixels_per_mm
            light *= 0.1 + 0.9 / (1 + np.exp(-off / self.edge_px))
        pole_px = follicle + scale * self.whisker.pole
        points_px = follicle + scale * points
        video = np.array(list(plain.pictures(
            points_px, pole_px, self.pixels_per_mm, light, self.dark, self.noise, self.blur_px,
            self.seed,
        )))  # fmt: skip
        turns = SIDES.index(self.side)
        tifffile.imwrite(folder / "whisker.tif", np.rot90(video, -turns, axes=(1, 2)))
        for k in range(turns):  # by a quarter to the right
            height = SHAPE[k % 2]
            points_px = np.stack([height - 1 - points_px[..., 1], points_px[..., 0]], axis=-1)
        hidden, length = self.told_mm(rng)
        (folder / "session.toml").write_text(
            SESSION.format(
                scale=self.pixels_per_mm, side=self.side, hidden=hidden, length=length,
                cone=1e3 * plain.CONE, radius=1e6 * plain.BASE_RADIUS, young=1e-9 * plain.YOUNG,
            )
        )  # fmt: skip
        return Truth(points_px, touches)


@dataclass(frozen=True)
class Truth:
    """Points (frames, arc lengths, 2) [px] of the whisker, and its `plain.Touch`es."""

    points_px: np.ndarray
    touches: list

    def contacts(self):
        """First frame, one after the last, and strongest touch of every contact."""
        return [
            (a, b, max(self.touches[a:b], key=lambda touch: touch.force))
            for a, b in runs_of_true([touch is not None for touch in self.touches])
        ]

    def distances(self, lines) -> np.ndarray:
        """Of all traced points from the true centreline [px], positive on its left."""
        off = [np.empty(0)]
        for row, frame in enumerate(lines.frame):
            true, points = self.points_px[frame], lines.row(row)
            away = points[:, None] - true[None]
            k = np.clip(np.hypot(away[..., 0], away[..., 1]).argmin(axis=1), 1, len(true) - 2)
            along, away = true[k + 1] - true[k - 1], points - true[k]
            off.append((away[:, 1] * along[:, 0] - away[:, 0] * along[:, 1]) / np.hypot(*along.T))
        return np.concatenate(off)


@dataclass(frozen=True)
class Found:
    """What the command has made of a scene: `Centrelines`, contacts and frames."""

    lines: object
    contacts: pd.DataFrame
    frames: pd.DataFrame


def process(folder: Path) -> Found:
    """Run the command on a folder."""
    try:
        with contextlib.redirect_stdout(sys.stderr):  # the table alone on stdout
            cli.main(["run", str(folder), "--out", str(folder / "out"), "--jobs", "1"])
    except SystemExit as stopped:
        if stopped.code:
            raise
    out = folder / "out" / "whisker"
    return Found(
        centrelines.read_centrelines(out / "centrelines.parquet"),
        files.read_csv(out / "contacts.csv", CONTACT_COLUMNS),
        files.read_frames(out / "frames.parquet"),
    )


def compare(scene: Scene, truth: Truth, found: Found) -> dict:
    """One scene's errors."""
    off = np.abs(truth.distances(found.lines))
    row = {
        "scene": scene.seed, "face": scene.side if scene.depth else f"none ({scene.side})",
        "px/mm": scene.pixels_per_mm, "frames traced": len(found.lines) / len(truth.touches),
        "median": np.median(off) if len(off) else np.nan,
        "95 %": np.quantile(off, 0.95) if len(off) else np.nan,
        "contacts": 0, "edges exact": 0, "missed": [], "invented": len(found.contacts),
        "peak": [], "moment": [],
    }  # fmt: skip
    for onset, offset, peak in truth.contacts():
        own = found.contacts
        own = own[(own["onset_frame"] < offset) & (own["offset_frame"] > onset)]
        row["contacts"] += 1
        row["invented"] -= len(own) > 0
        if not len(own):
            row["missed"].append(1e6 * peak.force)
            continue
        got = own.iloc[0]
        row["edges exact"] += (got["onset_frame"] == onset) & (got["offset_frame"] == offset)
        row["peak"].append(1e-6 * got["peak_force_uN"] / peak.force - 1)
        row["moment"].append(1e-9 * abs(got["peak_base_moment_nN_m"] / peak.moment) - 1)
    force = np.array([touch.force if touch else np.nan for touch in truth.touches])
    off = found.frames["contact_force_uN"].to_numpy() - 1e6 * force
    row["coverage"] = np.abs(off / found.frames["contact_force_uN_se"].to_numpy()) < 1.96
    row["coverage"] = row["coverage"][np.isfinite(off)]
    return row


def table_of(rows: list[dict]) -> str:
    """All scenes and all of them together, as Markdown."""
    lines = [
        [
            str(row["scene"]), row["face"], f"{row['px/mm']:.1f}",
            f"{100 * row['frames traced']:.1f} %", f"{row['median']:.4f}", f"{row['95 %']:.3f}",
            f"{row['contacts'] - len(row['missed'])} of {row['contacts']}",
            str(row["invented"]), str(row["edges exact"]),
            *(_percent(row[name]) for name in ("peak", "moment")),
            f"{100 * np.mean(row['coverage']):.0f} %" if len(row["coverage"]) else "–",
        ]
        for row in rows
    ]  # fmt: skip
    header = [
        "scene", "face", "px/mm", "traced", "median [px]", "95 % [px]", "contacts found",
        "invented", "edges exact", "peak force: largest error", "moment: largest error",
        "forces within 1.96 SE",
    ]  # fmt: skip
    peaks = np.abs(np.concatenate([row["peak"] for row in rows]))
    cover = np.concatenate([row["coverage"] for row in rows])
    contacts, exact, invented = (
        sum(row[name] for row in rows) for name in ("contacts", "edges exact", "invented")
    )
    missed = np.concatenate([row["missed"] for row in rows])
    strongest = f", the strongest of {missed.max():.2f} µN" if len(missed) else ""
    said = (
        f"{contacts} contacts, {len(missed)} missed{strongest}, {invented} invented, {exact} with "
        f"both edges exact; peak force: median error {100 * np.median(peaks):.2f} %, 95 % of them "
        f"within {100 * np.quantile(peaks, 0.95):.1f} %; {100 * cover.mean():.1f} % of all forces "
        "within 1.96 of their standard errors."
    )
    return f"{pages.table(header, lines)}\n\n{said}"


def _percent(errors) -> str:
    return f"{100 * max(errors, key=abs):+.1f} %" if errors else "–"


def scenes(count: int, seed: int):
    """Yield scenes in which the whisker does not slip off the pole, with their first seeds on."""
    while count:
        scene = Scene.drawn(seed)
        seed += 1
        try:
            _ = scene.swept
        except RuntimeError:
            continue
        count -= 1
        yield scene


def main(argv=None) -> int:
    """Film, process and compare; 1 where a clear contact is missed, or one is invented."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first scene")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    rows = []
    for scene in scenes(args.scenes, args.seed):
        with tempfile.TemporaryDirectory() as folder:
            truth = scene.film(Path(folder), np.random.default_rng([scene.seed, 1]))
            rows.append(compare(scene, truth, process(Path(folder))))
        print({k: v for k, v in rows[-1].items() if k != "coverage"}, file=sys.stderr)
    text = table_of(rows)
    pages.publish(text, args.write, "other truth")
    return int(any(row["invented"] or max(row["missed"], default=0) > CLEAR_UN for row in rows))


if __name__ == "__main__":
    sys.exit(main())
