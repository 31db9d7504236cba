"""Which videos to process, where their settings and results lie, and whether they changed."""

import contextlib
import os
import re
import shlex
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError, VideoError, need_content, need_folder
from pipeline.session.content import same_input, sha256, stamp
from pipeline.session.schema import FORMULA
from pipeline.session.session_file import SettingsError, read_session
from pipeline.tables.run_record import STATE_FILE, read_run, read_state, recorded_path
from pipeline.video.open import RESULT_FOLDERS, find_videos, is_result_folder, open_video

SETTINGS_NAME = "session.toml"
MISNAMED = (SETTINGS_NAME, f"{SETTINGS_NAME}.txt", f"{SETTINGS_NAME}.toml", "session.txt")
PREVIEW_NAME = "session_preview.png"
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
GUESS = "GUESS"  # in the comment of a value that `init` does not know
GUESSED = re.compile(rf"^(\w+) = .*#.*\b{GUESS}\b", re.MULTILINE)
RESERVED_NAMES = (*RESULT_FOLDERS, *SESSION_FILES)  # no video's results folder may be called so
LEFT_OVER = ("corrections.csv", "frames.parquet")  # these mark a video's folder without record
UNSAFE = re.compile(r"[/\\\x00-\x1f\x7f]")  # path separators, control characters


@dataclass(frozen=True)
class Input:
    """One video to process: a file or a folder of images; `fault` says why it cannot be.

    `root` is the path the user named: the input itself or a folder above it.
    """

    path: Path
    root: Path
    fault: str = ""


def find_inputs(paths, out=None) -> list[Input]:
    """Return the videos among `paths` (files, folders of images, folders of videos), in order.

    A folder is searched with its subfolders, without hidden ones and results (`out` may be the
    folder itself). A folder with nothing in it is an `Input` with a fault. InputError where a
    path does not exist.
    """
    paths = [Path(path) for path in paths]
    absent = [str(path) for path in paths if not path.exists()]
    if absent:
        raise InputError(f"no such file or folder: {', '.join(absent)}; check the spelling")
    out = None if out is None else Path(out).resolve()
    found = {}
    for root in paths:
        for path in _videos_in(root, out) if root.is_dir() else [root]:
            found.setdefault(path.resolve(), Input(path, root, _fault(path)))
    return list(found.values())


def _videos_in(folder, out, above=()) -> list[Path]:
    """Videos in a folder and in the subfolders that are no videos themselves.

    Links that lead to one of the folders `above` are not followed.
    """
    here = [path for path in find_videos([folder]) if path.resolve() != out] or [folder]
    below, above = [], (*above, folder.resolve())
    for entry in sorted(folder.iterdir()):
        if entry.is_dir() and entry not in here and not _is_result(entry, out):
            if entry.resolve() in above:
                continue
            inside = _videos_in(entry, out, above)
            below += [path for path in inside if path != entry or not _fault(path)]
    if below and here == [folder] and _fault(folder):
        return below
    return here + below


def _is_result(folder, out) -> bool:
    """Hidden, or written by `whiskerforce`, or by Python."""
    return folder.name.startswith(".") or folder.resolve() == out or is_result_folder(folder)


def _fault(path) -> str:
    """Why a folder or a name is no input; files are only opened when their turn comes."""
    if readable(path.resolve()) != str(path.resolve()):
        return "has a name that is not text (a wrong character set?): rename it"
    if path.is_file():
        return ""
    try:
        open_video(path).close()
    except VideoError as error:
        return error.problem
    return ""


def readable(path) -> str:
    """A path as text that any file can hold; "?" for what is no character."""
    return str(path).encode("utf-8", "replace").decode("utf-8")


def session_of(each: Input, config=None) -> Path:
    """The session.toml for an input: `config`, or the nearest one.

    That is: in a folder of images, beside the video, or above it up to the folder that the
    user named; of a link, there first, and then where it leads. InputError where there is none.
    """
    found = Path(config) if config is not None else _session_beside(each)
    if found is None:
        folder = each.path.absolute().parent
        if find_videos([folder]) == [folder]:  # what another program has tracked
            raise InputError(
                f"no session.toml in {folder}; copy the one of the recording there, or give it "
                "with --config"
            )
        check_settings_name(folder)
        raise InputError(
            f"no session.toml in {folder}, beside the videos; give one with --config, or let "
            f"`whiskerforce init {shlex.quote(str(each.path.parent))}` write one"
        )
    return found


def check_settings_name(folder) -> None:
    """InputError where a file was meant to be session.toml, but has capitals or another ending."""
    if (Path(folder) / SETTINGS_NAME).exists():
        return
    for file in sorted(Path(folder).iterdir()):
        if file.is_file() and file.name.casefold() in MISNAMED:
            raise InputError(
                f"no session.toml in {folder}, but {file.name}: rename it to session.toml (to "
                "see the ends of names in Windows, let the Explorer show file name extensions)"
            )


def _session_beside(each: Input) -> Path | None:
    """The session.toml nearest to an input, up to the folder that the user named, if any."""
    for path, root in (
        (each.path.absolute(), each.root.absolute()),
        (each.path.resolve(), each.root.resolve()),
    ):
        places = [path, path.parent] if path.is_dir() else [path.parent]
        places += [p for p in path.parents if p == root or root in p.parents]
        for folder in places:
            if (folder / SETTINGS_NAME).is_file():
                return folder / SETTINGS_NAME
    return None


def has_session_of(inputs, out, config=None) -> bool:
    """Whether `out` has the session.toml that a person wrote for some of the inputs."""
    target = Path(out) / SETTINGS_NAME
    given = [config, *map(_session_beside, inputs)] if target.is_file() else []
    return any(target.samefile(each) for each in given if each is not None)


def settings_of(inputs, config=None) -> dict:
    """Settings of each input without a fault, by its path; every file is read once.

    InputError or SettingsError with all that is wrong, before anything is processed.
    """
    read, problems, settings = {}, [], {}
    for each in inputs:
        if each.fault:
            continue
        try:
            session = session_of(each, config)
            if session not in read:
                read[session] = None
                read[session] = read_session(session)
            settings[each.path] = read[session]
        except (InputError, SettingsError) as error:
            problems.append(str(error))
    if problems:
        raise InputError("\n".join(dict.fromkeys(problems)))
    return settings


def guesses_left(inputs, config=None) -> list[str]:
    """A sentence on each session.toml in use in which values are still marked as a guess."""
    sessions = dict.fromkeys(session_of(each, config) for each in inputs if not each.fault)
    said = []
    for path in sessions:
        keys = GUESSED.findall(path.read_text(encoding="utf-8-sig"))
        if keys:
            said.append(
                f"{path}: {', '.join(keys)}: still marked as a {GUESS}; measure or check these "
                "values, then delete the word"
            )
    return said


def results_folders(inputs, out, planned=()) -> dict:
    """Give each input the name of its results folder in `out`, distinct for distinct inputs.

    The name is the stem, made safe; where two inputs share one (whatever the case of its
    letters) or something else has it, the later becomes stem_2, stem_3, … An input keeps the
    folder that an earlier run gave it, also where it has been moved or renamed since.

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
    name = _safe_name(readable(path.name if path.is_dir() else path.stem))
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
    if not _has_results(folder):
        below = next((each for each in sorted(folder.iterdir()) if _has_results(each)), None)
        advice = (
            f"did you mean {below}?" if below else "give the --out folder of `whiskerforce run`"
        )
        raise InputError(f"{folder}: no results in it (contacts.csv, videos.csv); {advice}")


def _has_results(folder) -> bool:
    return all((folder / name).is_file() for name in ("contacts.csv", "videos.csv"))
