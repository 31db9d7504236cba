"""run.json of one video: how its results were made. It may be damaged, so it is checked."""

from pathlib import Path, PureWindowsPath

from pipeline.tables.whole_files import read_json, write_json

STATE_FILE = "run.json"
KINDS = {
    "version": str,
    "video": str,
    "path": str,
    "status": str,
    "frames": int,
    "frames_per_s": (int, float),
    "message": str,
    "contacts": int,
    "stages": dict,
    "sha256": str,
    "pole": (dict, type(None)),
    "settings_sha256": str,
    "input": dict,
}


OF_INPUT = ("path", "status", "frames", "stages")  # of these, what the session's record repeats
OF_RUN = {
    "version": str,
    "finished": str,
    "command": list,
    "python": str,
    "platform": str,
    "inputs": dict,
    "pictures_of": str,
    "session_sha256": str,
}


def read_state(folder) -> dict:
    """The record in a video's results folder; {} where there is none, or it is damaged."""
    state = read_json(Path(folder) / STATE_FILE, {})
    return state if _has(state, KINDS) and _is_pole(state["pole"]) else {}


def write_state(folder, state: dict) -> None:
    """Write the record, whole or not at all."""
    write_json(Path(folder) / STATE_FILE, state)


def write_saved(folder, frames: int, pole: dict | None) -> None:
    """Write what a record says of tables that no run has made: `Analysis.save` did."""
    write_json(Path(folder) / STATE_FILE, {"frames": frames, "pole": pole})


def is_saved(folder) -> bool:
    """Whether the tables in a folder are of `Analysis.save`."""
    return set(read_json(Path(folder) / STATE_FILE, {})) == {"frames", "pole"}


def recorded_path(folder) -> str:
    """Where the video of a results folder lay, of whatever version or state; '' if not known."""
    path = read_json(Path(folder) / STATE_FILE, {}).get("path")
    return path if isinstance(path, str) else ""


def found_video(folder, recorded) -> Path:
    """Where the video of a results folder is: where it was `recorded`, or else beside the results.

    The record may be from another computer, with its system's paths. What is there may be another
    video: see `session.content`.
    """
    path, name = Path(recorded), PureWindowsPath(recorded).name  # which knows both separators
    places = (path, folder.parent / name, folder.parent.parent / name)
    # a folder of images is called as its results are
    return next((place for place in places if place.exists() and place != folder), path)


def frame_count(folder, frames) -> int:
    """Frames of a results folder's video, by its table `frames` or, if that is empty, its record.

    It is empty where no whisker was found.
    """
    if len(frames):
        return int(frames["frame"].max()) + 1
    recorded = read_json(Path(folder) / STATE_FILE, {}).get("frames")
    return recorded if _is_a(recorded, int) else 0


def read_pole(folder) -> dict:
    """The record's `pole` alone, {"pole": …}, None in it where it was never seen or is damaged."""
    pole = read_json(Path(folder) / STATE_FILE, {}).get("pole")
    return {"pole": pole if isinstance(pole, dict) and _is_pole(pole) else None}


def read_run(results) -> dict:
    """run.json of a whole results folder; `inputs`, by video, is always there."""
    record = read_json(Path(results) / STATE_FILE, {})
    sound = {key: record[key] for key, kind in OF_RUN.items() if isinstance(record.get(key), kind)}
    inputs = sound.get("inputs", {})
    sound["inputs"] = {name: state for name, state in inputs.items() if _has(state, OF_INPUT)}
    return sound


def _has(state, keys) -> bool:
    """The record has these keys, each with a value of its kind."""
    return isinstance(state, dict) and all(
        key in state and _is_a(state[key], KINDS[key]) for key in keys
    )


def _is_a(value, kind) -> bool:
    if kind is dict:
        return isinstance(value, dict) and all(_is_a(v, (int, float)) for v in value.values())
    return isinstance(value, kind) and not isinstance(value, bool)


def _is_pole(pole) -> bool:
    """None, or {radius_px, runs}, a run being [first frame, x, y], x and y None while away."""
    if pole is None:
        return True
    runs, radius = pole.get("runs"), pole.get("radius_px")
    if not (isinstance(radius, (int, float)) and isinstance(runs, list) and runs):
        return False
    return all(
        isinstance(run, list)
        and len(run) == 3
        and isinstance(run[0], int)
        and all(value is None or isinstance(value, (int, float)) for value in run[1:])
        and (run[1] is None) == (run[2] is None)
        for run in runs
    )
