"""One video by itself, as a job of a cluster: `python -m pipeline.app.one_video VIDEO --out DIR`.

Several jobs may work in one results folder at once. When all have ended, `whiskerforce run` with
the same `--out` skips what they have finished, and writes the session's tables, figures, report.

Exit status: 0 the results are there; 1 the video cannot be processed, `whiskerforce run` will list
why; 2 unusable arguments or settings; 3 out of memory. Anything else: the job was killed.
"""

import argparse
import sys
import traceback
from pathlib import Path

from pipeline.app.terminal import FAILED, UNUSABLE
from pipeline.errors import InputError, counted
from pipeline.session.results_folders import make_results_folder, results_folders
from pipeline.session.session_file import SettingsError

JOBS = ".jobs"  # folder in the results folder, for what jobs leave
NAMES = "names.json"
PATIENCE_S = 600  # that a job waits while others are given their names
NO_MEMORY = 3


def job_folder(out, name) -> Path:
    """Where the job of a video keeps its log and its mark."""
    return Path(out) / JOBS / name


def planned_names(inputs, out) -> dict:
    """Name of each input's results folder, by its path: as `run` gives them, and then for good.

    They are decided once and written down, for jobs that begin while others are at work: two
    videos of one name, whose jobs begin together, have distinct ones.
    """
    from pipeline.runtime.folder_lock import locked
    from pipeline.tables.whole_files import read_json, write_json

    out = Path(out)
    make_results_folder(out)
    plan = out / JOBS / NAMES
    plan.parent.mkdir(exist_ok=True)
    paths = {each.path: str(each.path.resolve()) for each in inputs}
    with locked(plan.parent, PATIENCE_S):
        known = read_json(plan, {})
        new = [each for each in inputs if paths[each.path] not in known]
        if new:
            names = results_folders(new, out, planned=known.values())
            known |= {paths[path]: name for path, name in names.items()}
            write_json(plan, known)
    return {path: known[resolved] for path, resolved in paths.items()}


def process(video, out, name=None, config=None) -> int:
    """Process one video into its folder in `out`, unless its results are there; exit status."""
    from pipeline.app.earlier_results import finished_outcome
    from pipeline.app.video_task import Task, process_video, settled_outcome
    from pipeline.runtime.folder_lock import locked
    from pipeline.session.input_settings import session_of
    from pipeline.session.inputs import find_inputs
    from pipeline.session.session_file import read_session, settings_digest
    from pipeline.tables.result_exchange import settle

    (each,) = _only(find_inputs([video], out), video)
    settings = read_session(session_of(each, config))
    path, digest = each.path.resolve(), settings_digest(settings)
    name = name or planned_names([each], out)[each.path]
    job = job_folder(out, name)
    job.mkdir(parents=True, exist_ok=True)
    folder = Path(out) / name
    with locked(job):
        for line in settle(folder) if folder.is_dir() else ():
            print(line, flush=True)
        outcome = finished_outcome(path, folder, digest)
        if outcome is None:
            task = Task(path, folder, settings, digest)
            outcome = process_video(task)
            if folder.is_dir():
                outcome = settled_outcome(task, outcome)
    print(f"{name}: {outcome.line()}", flush=True)
    return FAILED if outcome.status == "failed" else 0


def _only(inputs, video):
    """The inputs, of which there must be one."""
    if len(inputs) != 1 or inputs[0].fault:
        reason = inputs[0].fault if len(inputs) == 1 else f"holds {counted(len(inputs), 'video')}"
        raise InputError(f"{video}: expected one video ({reason})")
    return inputs


def main(arguments=None) -> int:
    """Process the video that the command line names."""
    from pipeline.runtime.address_space import shortage
    from pipeline.runtime.numba_cache import prepare_cache

    prepare_cache()
    if said := shortage():
        print(said, file=sys.stderr, flush=True)
    parser = argparse.ArgumentParser(prog="python -m pipeline.app.one_video", description=__doc__)
    parser.add_argument("video", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="results folder")
    parser.add_argument("--name", help="of the video's folder in it, where that is planned")
    parser.add_argument("--config", type=Path, help="the session.toml to use")
    args = parser.parse_args(arguments)
    try:
        return process(args.video, args.out, args.name, args.config)
    except MemoryError:
        traceback.print_exc()
        return NO_MEMORY
    except (InputError, SettingsError) as error:
        print(f"error: {error}", file=sys.stderr)
        return UNUSABLE
    except Exception:  # `run` will list it as a fault of the program
        traceback.print_exc()
        return FAILED


if __name__ == "__main__":
    sys.exit(main())
