"""Damaged settings, corrections, records and tables: named in a line, never a crash."""

import functools
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.app.earlier_results import PARQUETS, kept_outcome
from pipeline.contacts.corrections import (
    CORRECTIONS_FILE,
    applicable,
    apply,
    left_out,
    read_corrections,
)
from pipeline.errors import CorrectionsError
from pipeline.session.session_file import SettingsError, read_session
from pipeline.tables import centrelines, files
from pipeline.tables.run_record import read_pole, read_run, read_state, recorded_path
from promises import bad_video, fuzz, stand_in, whole
from promises.children import each_in_child, in_child, last_line
from promises.trial import Effort, Tried

CONTENTS = 1500  # of every kind that is read by our own code
TABLES, FOLDERS = 600, 90
BATCHES = 10  # processes that share the contents
LONGEST_S = 300


def _results(folder) -> Path:
    """A folder `work` with `videos`, and with curated `results` that are due again."""
    work = folder / "work"
    stand_in.make_videos(work / "videos", count=2)
    in_child(stand_in.curated, work / "videos", work / "results", seconds=LONGEST_S)
    return work


# Read by our own code -------------------------------------------------------------------------


def read_settings(path) -> str:
    """Read session.toml; 'refused', or 'read' where all its numbers are finite."""
    try:
        settings = read_session(path)
    except SettingsError:
        return "refused"
    return "read" if "Infinity" not in settings.model_dump_json() else "not finite"


def read_verdicts(path) -> str:
    """Read corrections.csv and apply it."""
    try:
        corrections = read_corrections(path.parent)
    except CorrectionsError:
        return "refused"
    found = pd.DataFrame({"whisker": ["C2"], "onset_frame": [3], "offset_frame": [9]})
    contacts = apply(found, applicable(corrections, ("C2",), 40))
    list(left_out(corrections, ("C2",), 40))
    within = (contacts["onset_frame"] >= 0) & (contacts["offset_frame"] <= 40)
    return "read" if within.all() else f"contacts beyond the video: {contacts}"


def read_record(path) -> str:
    """Read run.json, of a video and of a session."""
    state, pole, run = read_state(path.parent), read_pole(path.parent), read_run(path.parent)
    recorded_path(path.parent)
    kept_outcome(path.parent)
    return "read" if state or pole["pole"] or len(run) > 1 else "refused"


def read_sequence(path) -> str:
    """Decode a StreamPix sequence."""
    _, error, _ = bad_video.look(path)
    return "refused" if error else "read"


def try_own(folder, effort: Effort) -> Tried:
    """Read changed contents, led by the lines of our own code that they reach."""
    tried, work = Tried(), _results(folder)
    video = work / "results" / "video0"
    bad_video.write_seq(folder / "video.seq")
    kinds = (
        (video / "session.toml", read_settings, ("pipeline/session",)),
        (video / CORRECTIONS_FILE, read_verdicts, ("pipeline/contacts", "pipeline/tables")),
        (video / "run.json", read_record, ("pipeline/tables", "pipeline/app")),
        (folder / "video.seq", read_sequence, ("pipeline/video",)),
    )
    refused = 0
    for path, read, code in kinds:
        count = -(-effort.cases(CONTENTS) // BATCHES)
        batch = functools.partial(_batch, path, path.read_bytes(), read, count, code)
        for ending in each_in_child(batch, range(BATCHES), LONGEST_S):
            tried.check(not ending.fault, f"{path.name}: {last_line(ending.fault)}")
            answers, faults = ending.value or ((), ())
            tried.cases += len(answers)
            refused += answers.count("refused")
            tried.broken += [f"{path.name}: {fault}" for fault in faults]
    tried.said = f"{refused} refused, the others read"
    return tried


def _batch(path, content, read, count, code, seed):
    """Answers to some changed contents, and what was no answer."""
    rng = np.random.default_rng([seed, 5])
    answers, faults = [], []

    def look(new):
        path.write_bytes(new)
        try:
            return read(path)
        except Exception as error:
            return f"{type(error).__name__}: {error}"

    for new, answer in fuzz.led_by_coverage(content, look, count, rng, code):
        answers.append(answer)
        if answer not in ("read", "refused"):
            faults.append(f"{answer[:200]} at {new[:80]!r}…")
    path.write_bytes(content)
    return answers, faults


# Tables ---------------------------------------------------------------------------------------


def try_tables(folder, effort: Effort) -> Tried:
    """Read damaged parquet files: a change of any byte is found, or changes nothing."""
    tried, work = Tried(), _results(folder)
    video = work / "results" / "video0"
    cases = [(name, seed) for seed in range(effort.cases(TABLES) // 3) for name in PARQUETS]
    found = 0
    ending_of = functools.partial(_table, video)
    for case, ending in zip(cases, each_in_child(ending_of, cases, LONGEST_S), strict=True):
        tried.cases += 1
        fault = ending.fault or ending.value
        found += fault == "refused"
        tried.check(fault in ("", "refused"), f"{case}: {last_line(fault)}")
    tried.said = f"{found} refused, the others unchanged in what they hold"
    return tried


def _table(video, case) -> str:
    name, seed = case
    path = video / name
    content, expected = path.read_bytes(), files.read_rows(path)
    rng = np.random.default_rng([seed, 9])
    damaged = bad_video.DAMAGED_BY[rng.integers(len(bad_video.DAMAGED_BY))]
    path.write_bytes(bytes(damaged(bytearray(content), rng)))
    try:
        files.check_parquet(path, PARQUETS[name], thorough=True)
        same = files.read_rows(path).equals(expected)
        if name == "centrelines.parquet":
            centrelines.read_centrelines(path)
    except ValueError:
        return "refused"
    finally:
        path.write_bytes(content)
    return "" if same else "other numbers than were written, and no word"


# Whole folders --------------------------------------------------------------------------------


def try_folders(folder, effort: Effort) -> Tried:
    """Damage a file of a results folder, and run: it is made again, or named."""
    tried, work = Tried(), _results(folder)
    in_child(stand_in.run, work / "videos", work / "results", seconds=LONGEST_S)
    start = stand_in.copy_of(work, folder / "start")
    expected, named = _numbers(work / "results"), 0
    for seed in range(effort.cases(FOLDERS, 4)):
        stand_in.copy_of(start, work)
        what = _damage_one(work / "results", seed)
        ending = in_child(_outcomes, work, seconds=LONGEST_S)
        tried.cases += 1
        if ending.fault:
            tried.check(False, f"{what}, {seed}: {last_line(ending.fault)}")
            continue
        said, done = ending.value
        named += bool(said)
        tried.check("\n" not in said, f"{what}, {seed}: {said}")
        tried.check(said or done == len(expected) // len(PARQUETS), f"{what}, {seed}: not done")
        faults = [
            fault for fault in whole.faults(work / "results") if what not in fault or not said
        ]
        if not said and what != CORRECTIONS_FILE and _numbers(work / "results") != expected:
            faults.append("the tables hold other numbers")
        tried.broken += [f"{what}, {seed}: {fault}" for fault in faults]
    tried.said = f"{named} named, the others made again, or still readable as they are"
    return tried


def _numbers(out) -> dict:
    """What the parquet tables of a results folder hold, by their names."""
    paths = [path for path in whole.visible(out) if path.suffix == ".parquet"]
    return {str(path.relative_to(out)): files.read_rows(path) for path in paths}


def _damage_one(out, seed) -> str:
    rng = np.random.default_rng([seed, 3])
    paths = whole.visible(out)
    path = paths[rng.integers(len(paths))]
    path.write_bytes(fuzz.changed(path.read_bytes(), rng))
    return path.name


def _outcomes(work) -> tuple[str, int]:
    """What is said of the videos of a run, and how many are done."""
    outcomes = stand_in.run(work / "videos", work / "results").outcomes
    said = "; ".join(each.message for each in outcomes if each.message)
    return said, sum(each.status == "done" for each in outcomes)
