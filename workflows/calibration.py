"""How exact the `calibrate` commands are, on pictures of known truth.

    python workflows/calibration.py geometry --count 60
    python workflows/calibration.py ringdown --count 3
    python workflows/calibration.py dust --count 2
    python workflows/calibration.py ringdown --count 3 --write docs/calibrate_ringdown.md

`geometry` renders micrographs drawn at random and measures each. `ringdown` renders sessions of
two videos in which a whisker slips, each with a Young's modulus and a damping of its own, which
session.toml does not hold; `dust` sessions of two videos with a particle on the whisker, in the
second of which the follicle gives way. Both process them by the commands. Prints a table in
Markdown.
"""

import argparse
import re
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import pages
import pandas as pd

from pipeline.app import cli
from pipeline.calibrate.find_whisker import NoWhiskerError
from pipeline.calibrate.follicle_motion import contact_row, slope_of
from pipeline.calibrate.geometry import measure_geometry
from pipeline.tables.columns import (
    CONTACT_COLUMNS,
    DUST_COLUMNS,
    DUST_CONTACT_COLUMNS,
    DUST_VIDEO_COLUMNS,
    RINGDOWN_COLUMNS,
    as_table,
)
from pipeline.tables.files import read_csv, read_frames
from synthetic.micrograph import random_micrograph
from synthetic.presets import make_trial
from synthetic.session import render_session

QUANTITIES = {
    "length": ("length", 1e3),
    "base_radius": ("base radius", 1e6),
    "tip_radius": ("tip radius", 1e6),
    "cone_length": ("cone length", 1e3),
}
COLUMNS = {
    "youngs_modulus_GPa": ("Young's modulus [GPa]", 1e-9, "youngs_modulus"),
    "damping_per_s": ("damping [1/s]", 1.0, "damping_rate"),
}


def measured_against_truth(seed: int, folder: Path):
    """One random micrograph: {quantity: (error, standard error, truth)}; None if refused."""
    micrograph = random_micrograph(seed)
    path = folder / f"{seed}.png"
    cv2.imwrite(str(path), micrograph.picture())
    try:
        found = measure_geometry(path, micrograph.pixels_per_mm)
    except NoWhiskerError as error:
        print(error, file=sys.stderr)
        return None
    whisker = micrograph.whisker
    truth = {
        "length": whisker.length,
        "base_radius": whisker.base_radius,
        "tip_radius": float(whisker.radius(whisker.length)),
        "cone_length": whisker.cone_length,
    }
    return {
        name: (getattr(found, name).value - true, getattr(found, name).se, true)
        for (name, (_, unit)) in QUANTITIES.items()
        for true in [unit * truth[name]]
    } | {"rough": micrograph.roughness > 0}


def geometry_text(count: int, seed: int) -> str:
    """Errors of random micrographs, as Markdown."""
    with tempfile.TemporaryDirectory() as folder:
        cases = [measured_against_truth(seed + k, Path(folder)) for k in range(count)]
    kept = [case for case in cases if case]
    groups = {
        "smooth": [case for case in kept if not case["rough"]],
        "rough by 1–2 %": [case for case in kept if case["rough"]],
    }
    rows = [
        [kind, word, *_error_cells(np.array([case[name] for case in group]), name)]
        for kind, group in groups.items()
        for name, (word, _) in QUANTITIES.items()
    ]
    header = ["whiskers", "", "median error", "95 % of errors within", "within 1.96 SE"]
    return (
        f"{pages.table(header, rows)}\n\n{count} micrographs, {count - len(kept)} refused; "
        f"{len(groups['smooth'])} whiskers are smooth cones, of the others the radius varies."
    )


def _error_cells(values, name):
    error, se, truth = values.T
    share = name != "tip_radius"
    off = np.abs(100 * error / truth if share else error)
    unit = "%" if share else "µm"
    covered = np.mean(np.abs(error) < 1.96 * se)
    return [
        f"{np.median(off):.3f} {unit}",
        f"{np.quantile(off, 0.95):.2f} {unit}",
        f"{100 * covered:.0f} %",
    ]


def ringdown_of_session(seed: int, folder: Path) -> dict:
    """Render, process and fit one session; its pooled row beside the truth."""
    videos, results, out = folder / "videos", folder / "results", folder / "out"
    render_session(videos, "ringdown", seed, trials=2)
    _forget_truth(videos / "session.toml")
    command("run", videos, "--out", results, "--jobs", 1)
    command("calibrate", "ringdown", results, "--out", out)
    table = read_csv(out / "ringdown.csv", RINGDOWN_COLUMNS)
    whisker = make_trial("ringdown", seed, 0, 40).scene.hairs[0].whisker
    return {"seed": seed, "slips": table.iloc[:-1], "pooled": table.iloc[-1], "whisker": whisker}


def command(*arguments) -> None:
    """Run a command of whiskerforce as a user would; SystemExit where it fails."""
    try:
        cli.main([str(each) for each in arguments])
    except SystemExit as stopped:
        if stopped.code:
            raise


def _forget_truth(session: Path) -> None:
    """Put the paper's Young's modulus and damping in place of the true ones."""
    text = session.read_text("utf-8")
    text = re.sub(r"(youngs_modulus_GPa = )[\d.]+", r"\g<1>3.0", text)
    session.write_text(re.sub(r"(damping_per_s = )[\d.]+", r"\g<1>215.0", text), "utf-8")


def ringdown_text(count: int, seed: int) -> str:
    """Sessions with their pooled Young's modulus and damping beside the truth, as Markdown."""
    sessions = []
    for k in range(count):
        with tempfile.TemporaryDirectory() as folder:
            sessions.append(ringdown_of_session(seed + k, Path(folder)))
    rows, inside = [], []
    for each in sessions:
        row = [str(each["seed"]), str(len(each["slips"]))]
        for column, (_, unit, attribute) in COLUMNS.items():
            true = unit * getattr(each["whisker"], attribute)
            low, value, high = (each["pooled"][column + end] for end in ("_low", "", "_high"))
            row += [f"{true:.4g}", f"{value:.4g} ({low:.4g} to {high:.4g})"]
            row += [f"{100 * (value / true - 1):+.1f} %"]
            slips = each["slips"]
            inside.append((slips[f"{column}_low"] < true) & (true < slips[f"{column}_high"]))
        rows.append(row)
    header = ["session", "slips"]
    for word, *_ in COLUMNS.values():
        header += [f"true {word}", "found (95 %)", "error"]
    covered = 100 * np.concatenate(inside).mean()
    return (
        f"{pages.table(header, rows)}\n\nOf the single slips' 95 % intervals, {covered:.0f} % "
        "hold the truth."
    )


def dust_text(count: int, seed: int) -> str:
    """Videos with a particle: the follicle's motion beside the truth, as Markdown."""
    rows = []
    for k in range(count):
        with tempfile.TemporaryDirectory() as folder:
            videos, results, out = (Path(folder) / name for name in ("videos", "results", "out"))
            render_session(videos, "dust", seed + k, trials=2)
            command("run", videos, "--out", results, "--jobs", 1)
            command("calibrate", "dust", results, "--out", out)
            rows += [[f"{seed + k}", *row] for row in dust_rows(videos / "truth", out)]
    header = ["session", "video", "range found", "true", "error of its course", "slope (95 %)"]
    held = sum(row[-1] == "yes" for row in rows)
    return (
        f"{pages.table([*header, 'true slope', 'held'], rows)}\n\nThe course's error is its SD. "
        "Slopes in µm per 1/m of curvature change; true slopes are those of the "
        f"rendered motion over the true contacts. {held} of {len(rows)} intervals hold them."
    )


def dust_rows(truth: Path, out: Path):
    """Cells of each video that `calibrate dust` wrote, beside the truth."""
    frames = read_csv(out / "dust.csv", DUST_COLUMNS)
    found = read_csv(out / "dust_videos.csv", DUST_VIDEO_COLUMNS)
    for row in found[found["video"] != "pooled"].itertuples():
        own = frames[frames["video"] == row.video]
        true = _true_course(truth / row.video, own)
        slope = slope_of(_true_contacts(truth / row.video, true))
        true_slope = 1e3 * slope.slope
        yield [
            row.video[-3:],
            f"{row.radial_range_mm:.3f} mm",
            f"{np.ptp(true['radial_mm']):.3f} mm",
            f"{1e3 * np.std(own['radial_mm'].to_numpy() - true['radial_mm'].to_numpy()):.1f} µm",
            f"{row.slope_um_m:.2f} ({row.slope_um_m_low:.2f} to {row.slope_um_m_high:.2f})",
            f"{true_slope:.2f}",
            "yes" if row.slope_um_m_low < true_slope < row.slope_um_m_high else "no",
        ]


def _true_course(truth, own):
    """The rows of dust.csv as they are in truth."""
    table = read_frames(truth / "frames.parquet").set_index("frame").loc[own["frame"]]
    scale = 1e-3 * make_trial("dust", 0, 0, 40).scene.camera.pixels_per_m
    axis = np.deg2rad(table["base_angle_deg"].median())
    x, y = (table[f"follicle_{c}_px"] - table[f"follicle_{c}_px"].median() for c in "xy")
    radial = (x * np.cos(axis) - y * np.sin(axis)) / scale
    return table.assign(radial_mm=radial).reset_index()


def _true_contacts(truth, course):
    """What the follicle truly does in the true contacts."""
    rows = read_csv(truth / "contacts.csv", CONTACT_COLUMNS)
    changes = [contact_row(course, each) for each in rows.itertuples()]
    return as_table(pd.DataFrame(changes), DUST_CONTACT_COLUMNS)


TEXTS = {"geometry": geometry_text, "ringdown": ringdown_text, "dust": dust_text}


def main(argv=None) -> None:
    """Measure, print, and write with --write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("what", choices=tuple(TEXTS))
    parser.add_argument("--count", type=int, default=3, help="micrographs, or sessions")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    text = TEXTS[args.what](args.count, args.seed)
    print(text)
    if args.write:
        pages.write_between(args.write, args.what, text)


if __name__ == "__main__":
    main()
