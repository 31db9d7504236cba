"""Where a video's results lie: in the folder of earlier runs, or in one whose name is free."""

import contextlib
import os
import re
import unicodedata
from pathlib import Path

from pipeline.errors import InputError, need_content, need_folder
from pipeline.runtime.run_log import LOG_FILE
from pipeline.session.content import same_input, sha256, stamp
from pipeline.session.input_settings import PREVIEW_NAME, SETTINGS_NAME
from pipeline.session.inputs import Input, readable
from pipeline.session.schema import FORMULA
from pipeline.tables.own_files import make_folder
from pipeline.tables.run_record import STATE_FILE, read_run, read_state, recorded_path
from pipeline.video.open import RESULT_FOLDERS

SESSION_FILES = (
    "videos.csv",
    "contacts.csv",
    "decisions.csv",
    "run.json",
    "run.log",
    "report.html",
    SETTINGS_NAME,
    PREVIEW_NAME,
)
RESERVED_NAMES = (*RESULT_FOLDERS, *SESSION_FILES)  # no video's results folder may be called so
LONGEST = 230  # bytes of a new name: of a file's 255, with what files made of it are called by
LEFT_OVER = ("corrections.csv", "frames.parquet")  # these mark a video's folder without record
UNSAFE = re.compile(r"[/\\\x00-\x1f\x7f]")  # path separators, control characters


def make_results_folder(out) -> None:
    """Make `out` where it is missing.

    InputError where that cannot be, or where no run has used it yet, but it holds files of the
    names of results.
    """
    if readable(out.resolve()) != str(out.resolve()):
        raise InputError(
            f"--out {readable(out)}: its path is not text (a wrong character set?); choose another"
        )
    make_folder(out, "--out ")
    if (out / LOG_FILE).exists() or "version" in read_run(out):
        return
    written = set(SESSION_FILES) - {SETTINGS_NAME, PREVIEW_NAME}
    there = sorted(name for name in written if (out / name).is_file())
    there += [f"figures/{path.name}" for path in sorted(out.glob("figures/fig3*"))]
    if there:
        raise InputError(
            f"--out {out}: holds {there[0]}, which no run of whiskerforce has written there and "
            "this one would replace; move it away, or choose another folder"
        )


def results_folders(inputs, out, planned=()) -> dict:
    """Give each input the name of its results folder in `out`, distinct for distinct inputs.

    The name is the stem, made safe and cut to LONGEST; where two inputs share one (whatever the
    case of its letters) or something else has it, the later becomes stem_2, stem_3, … An input
    keeps the folder that an earlier run gave it, also where it has been moved or renamed since.

    planned : names that other videos will have
    """
    out = Path(out)
    before = read_run(out)["inputs"]
    owner = _owners(inputs, out, before)
    moved = _moved(inputs, owner, out, before)
    owner = {path: name for path, name in owner.items() if name not in moved.values()} | moved
    owner = {path: name for path, name in owner.items() if _is_safe(name)}
    taken = {_folded(name) for name in (*RESERVED_NAMES, *owner.values(), *planned)}
    taken.update(_folded(entry.name) for entry in out.iterdir() if not _is_left_over(entry))
    names = {}
    for each in inputs:
        name = owner.get(_resolved(each))
        names[each.path] = name or _free_name(_stem(each.path), taken)
        taken.add(_folded(names[each.path]))
    return names


def _folded(text) -> str:
    """A name or path as disks know it that tell neither capitals nor forms of accents apart."""
    return unicodedata.normalize("NFC", text).casefold()


def _resolved(each: Input) -> str:
    return str(each.path.resolve())


def _owners(inputs, out, before) -> dict:
    """Names of the folders that earlier runs gave to videos, by the videos' paths.

    before : what the record of the whole folder says of each; a folder's own one is newer
    """
    paths = {_resolved(each) for each in inputs}
    own = {recorded_path(state.parent): state.parent.name for state in out.glob(f"*/{STATE_FILE}")}
    own.pop("", None)
    others = {state["path"]: n for n, state in before.items() if n not in own.values()}
    others = {path: n for path, n in others.items() if path in paths or (out / n).is_dir()}
    return _as_spelt(others | own, paths)


def _as_spelt(owner, paths) -> dict:
    """The owners with the `paths` of inputs in place of other spellings of the same files' paths.

    Where a disk takes both, a person may have typed other capitals than the time before.
    """
    folded = {_folded(path): path for path in paths - set(owner)}
    spelt = {}
    for path, name in owner.items():
        other = folded.get(_folded(path), path)
        with contextlib.suppress(OSError):
            path = other if path not in paths and os.path.samefile(path, other) else path
        spelt[path] = name
    return spelt


def _moved(inputs, owner, out, before) -> dict:
    """Folders of inputs that lay elsewhere when they were processed: recognised by their content.

    A copy is no move: where the file of before is still there, it keeps its results.
    """
    records = {path: read_state(out / n) or before.get(n, {}) for path, n in owner.items()}
    homeless = [each for each in inputs if not each.fault and not _is_at_home(each, records)]
    found, left = {}, _without_video(records) if homeless else {}
    sizes = {record.get("input", {}).get("bytes") for record in left.values()}
    for each in homeless:
        if not sizes & {stamp(each.path)["bytes"], None}:
            continue
        content = sha256(each.path)
        path = next((path for path, record in left.items() if record["sha256"] == content), None)
        if path is not None:
            found[_resolved(each)] = owner[path]
            del left[path]
    return found


def _is_at_home(each, records) -> bool:
    """Whether an earlier run processed this content at this place."""
    record = records.get(_resolved(each))
    return bool(record) and same_input(record, each.path)


def _without_video(records) -> dict:
    """Records, by path, of videos that are gone or have other content."""
    return {path: s for path, s in records.items() if s and not same_input(s, Path(path))}


def _is_left_over(folder) -> bool:
    """A video's results whose record is lost; its corrections belong to the video of its name.

    So does an empty folder: the run that made it was killed.
    """
    return (
        not recorded_path(folder)
        and not (folder / "videos.csv").exists()
        and (
            any((folder / name).is_file() for name in LEFT_OVER)
            or (folder.is_dir() and not any(folder.iterdir()))
        )
    )


def _stem(path) -> str:
    """Name for results of `path`; the folder's own name where the path is `.`."""
    path = path if path.name not in ("", "..") else path.resolve()
    name = readable(path.name if path.is_dir() else path.stem)
    name = _safe_name(name.encode()[:LONGEST].decode(errors="ignore"))
    return f"_{name}" if name.startswith(FORMULA) else name


def _safe_name(name) -> str:
    """The nearest name of a folder that is visible and lies in the results folder."""
    return UNSAFE.sub("_", name).strip(". ") or "video"


def _is_safe(name) -> bool:
    return name == _safe_name(name) and _folded(name) not in RESERVED_NAMES


def _free_name(stem, taken) -> str:
    name, number = stem, 2
    while _folded(name) in taken:
        name, number = f"{stem}_{number}", number + 1
    return name


def need_results(folder) -> None:
    """InputError unless a folder holds results of `whiskerforce run`."""
    folder = Path(folder)
    need_folder(folder, "the --out folder of `whiskerforce run`")
    need_content(folder, "results of `whiskerforce run`")
    lacking = _lacking(folder)
    if lacking and "command" in read_run(folder):  # not one video's folder
        raise InputError(
            f"{folder}: without {' and '.join(lacking)}; the same `whiskerforce run` again writes "
            "what is missing, and computes nothing twice"
        )
    if lacking:
        below = next((each for each in sorted(folder.iterdir()) if not _lacking(each)), None)
        advice = (
            f"did you mean {below}?" if below else "give the --out folder of `whiskerforce run`"
        )
        raise InputError(f"{folder}: no results in it (contacts.csv, videos.csv); {advice}")


def _lacking(folder) -> list[str]:
    """Tables of a session's results that a folder lacks."""
    return [name for name in ("contacts.csv", "videos.csv") if not (folder / name).is_file()]
