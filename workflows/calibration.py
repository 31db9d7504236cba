"""How accurate the `calibrate` commands are, on pictures of known truth.

    python workflows/calibration.py geometry --count 60
    python workflows/calibration.py ringdown --count 3
    python workflows/calibration.py dust --count 2
    python workflows/calibration.py views --count 2
    python workflows/calibration.py all --count 1
    python workflows/calibration.py ringdown --count 3 --write docs/calibrate_ringdown.md

`geometry` renders micrographs drawn at random and measures each. `ringdown` renders sessions of
two videos in which a whisker slips, each with its own Young's modulus and damping, which
session.toml does not contain; `dust` sessions of two videos with a particle on the whisker, in the
second of which the follicle gives way; `views` sessions in two views, as two videos or in one
picture. All are processed by the commands. `all` sums up all four beside their aims. Prints tables
in Markdown.
"""

import argparse
import re
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pages
from calibration_motion import command, dust_text, views_text, work_folder

from pipeline.calibrate.find_whisker import NoWhiskerError
from pipeline.calibrate.geometry import measure_geometry
from pipeline.runtime.workers import end_with_parent
from pipeline.tables.calibration_columns import RINGDOWN_COLUMNS
from pipeline.tables.files import read_csv
from synthetic.micrograph import random_micrograph
from synthetic.presets import make_trial
from synthetic.session import render_session

QUANTITIES = {
    "length": ("length", 1e3),
    "base_radius": ("base radius", 1e6),
    "tip_radius": ("tip radius", 1e6),
    "cone_length": ("cone length", 1e3),
}
GEOMETRY_AIMS = (("length", "length", 0.2), ("base_radius", "base radius", 0.5))  # %
MODULUS_AIM = 2.0  # %, of eight slips
MICROGRAPHS = 20  # for each session of the other commands, where all are measured
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


def geometry_text(count: int, seed: int, keep=None):
    """Errors of random micrographs, as Markdown, and aims."""
    with work_folder(keep, "geometry") as folder:
        cases = [measured_against_truth(seed + k, folder) for k in range(count)]
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
    text = (
        f"{pages.table(header, rows)}\n\n{count} micrographs, {count - len(kept)} refused; "
        f"{len(groups['smooth'])} whiskers are smooth cones, of the others the radius varies."
    )
    return text, [_geometry_aim(kept, *aim) for aim in GEOMETRY_AIMS]


def _geometry_aim(cases, name, what, percent):
    """A row of the table of aims: what, aim, median and 95 % of errors, intervals that hold."""
    error, se, truth = np.array([case[name] for case in cases]).T
    off = 100 * np.abs(error / truth)
    cells = (f"{part:.2f} %" for part in (percent, np.median(off), np.quantile(off, 0.95)))
    return ["geometry", what, *cells, f"{100 * np.mean(np.abs(error) < 1.96 * se):.0f} %"]


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
    if not out.exists():
        render_session(videos, "ringdown", seed, trials=2)
        _forget_truth(videos / "session.toml")
        command("run", videos, "--out", results, "--jobs", 1)
        command("calibrate", "ringdown", results, "--out", out)
    table = read_csv(out / "ringdown.csv", RINGDOWN_COLUMNS)
    whisker = make_trial("ringdown", seed, 0, 40).scene.hairs[0].whisker
    return {"seed": seed, "slips": table.iloc[:-1], "pooled": table.iloc[-1], "whisker": whisker}


def _forget_truth(session: Path) -> None:
    """Put the paper's Young's modulus and damping in place of the true ones."""
    text = session.read_text("utf-8")
    text = re.sub(r"(youngs_modulus_GPa = )[\d.]+", r"\g<1>3.0", text)
    session.write_text(re.sub(r"(damping_per_s = )[\d.]+", r"\g<1>215.0", text), "utf-8")


def ringdown_text(count: int, seed: int, keep=None):
    """Sessions with their Young's modulus and damping beside the truth, as Markdown, and aims."""
    sessions = []
    for k in range(count):
        with work_folder(keep, f"ringdown_{seed + k}") as folder:
            sessions.append(ringdown_of_session(seed + k, folder))
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
    text = (
        f"{pages.table(header, rows)}\n\nOf the single slips' 95 % intervals, {covered:.0f} % "
        "hold the truth."
    )
    return text, [_ringdown_aim(sessions)]


def _ringdown_aim(sessions):
    """The row of the table of aims: Young's modulus of each session, all slips pooled."""
    off, held = [], []
    for each in sessions:
        true, pooled = 1e-9 * each["whisker"].youngs_modulus, each["pooled"]
        off.append(100 * abs(pooled["youngs_modulus_GPa"] / true - 1))
        low, high = (pooled[f"youngs_modulus_GPa_{end}"] for end in ("low", "high"))
        held.append(low < true < high)
    cells = (f"{part:.2f} %" for part in (MODULUS_AIM, np.median(off), max(off)))
    return ["ringdown", "Young's modulus, slips pooled", *cells, f"{sum(held)} of {len(held)}"]


TEXTS = {
    "geometry": geometry_text,
    "ringdown": ringdown_text,
    "views": views_text,
    "dust": dust_text,
}


def all_text(count: int, seed: int, keep=None, jobs=1):
    """All four measurements beside their aims, then each one's own table, as Markdown."""
    counts = {name: count * (MICROGRAPHS if name == "geometry" else 1) for name in TEXTS}
    with ProcessPoolExecutor(jobs, initializer=end_with_parent) as pool:
        ways = {name: pool.submit(TEXTS[name], counts[name], seed, keep) for name in TEXTS}
        parts = {name: way.result() for name, way in ways.items()}
    aims = [row for _, rows in parts.values() for row in rows]
    header = ["command", "", "aim", "median error", "95 % or largest", "intervals that hold"]
    tables = (f"### calibrate {name}\n\n{text}" for name, (text, _) in parts.items())
    return "\n\n".join([pages.table(header, aims), *tables])


def main(argv=None) -> None:
    """Measure, print, and write with --write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("what", choices=("all", *TEXTS))
    parser.add_argument("--count", type=int, default=3, help="micrographs, or sessions")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    parser.add_argument("--jobs", type=int, default=1, help="processes, for all")
    parser.add_argument("--keep", type=Path, help="a folder that keeps videos and results")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    args = parser.parse_args(argv)
    if args.what == "all":
        text = all_text(args.count, args.seed, args.keep, args.jobs)
    else:
        text, _ = TEXTS[args.what](args.count, args.seed, args.keep)
    pages.publish(text, args.write, args.what)


if __name__ == "__main__":
    main()
