"""Each format both ways, on files that another program made or reads; prints a table.

    python -m venv peer && peer/bin/pip install whisk-janelia av==12.3.0 movement pims mat4py
    python workflows/exchange.py --peer-python peer/bin/python --write

A short video is rendered and processed. What we export is read by the other program, and what it
makes of it by us; what it makes of the video itself, or of numbers, is imported. Where a program
is not installed, its rows say so. `--measurements FILE` adds a file that someone has recorded.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pages
from peer_tracker import NoPeerError, find_peer

from pipeline.app import batch
from pipeline.convert import janelia_files, movement, nwb
from pipeline.convert.deeplabcut import read_deeplabcut
from pipeline.convert.janelia import read_tracked, write_tracked
from pipeline.convert.matlab import write_matlab
from pipeline.convert.results import read_results
from pipeline.convert.sleap import read_sleap
from pipeline.run import analyse_lines
from synthetic import render_session

PAGE = Path(__file__).resolve().parents[1] / "docs" / "formats.md"
FRAMES = 200
HEADER = ["format", "way", "other program", "what came of it"]

MOVEMENT = """
import json, sys
from movement.io import load_dataset, save_poses
source, folder = sys.argv[1:]
try:
    poses = load_dataset(source, source_software="netCDF")
except (TypeError, ValueError):
    import xarray
    from movement.validators.datasets import ValidPosesInputs
    poses = xarray.open_dataset(source).load()
    ValidPosesInputs.validate(poses)
poses.attrs["source_file"] = ""
save_poses.to_dlc_file(poses, folder + "/aDLC.csv", split_individuals=False)
save_poses.to_dlc_file(poses, folder + "/bDLC.h5", split_individuals=False)
save_poses.to_sleap_analysis_file(poses, folder + "/a.analysis.h5")
print(json.dumps(dict(poses.sizes)))
"""
PIMS = """
import hashlib, json, sys
import numpy, pims
frames = pims.NorpixSeq(sys.argv[1])
data = numpy.stack([numpy.asarray(frame) for frame in frames])
print(json.dumps([len(data), hashlib.sha256(data.tobytes()).hexdigest()]))
"""
MAT4PY = """
import json, sys
from mat4py import loadmat
w = loadmat(sys.argv[1])["w"]
print(json.dumps([w["M0"][0] if isinstance(w["M0"][0], list) else w["M0"], w["pxPerMm"]]))
"""


def asked(python, code, *arguments):
    """What a piece of Python prints as JSON, in the other environment; NoPeerError if it fails."""
    command = [str(python), "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise NoPeerError(done.stderr.strip().splitlines()[-1] if done.stderr else "it failed")
    return json.loads(done.stdout.strip().splitlines()[-1])


def largest(one, other) -> float:
    """Largest difference; NaN on both sides counts as none."""
    one, other = np.asarray(one, float), np.asarray(other, float)
    return float(np.nanmax(np.abs(one - other)))


def janelia_out(video, folder, peer):
    """Rows of what the tracker's own programs make of our files."""
    lines_path, table_path, *_ = write_tracked(folder, video)
    ours = janelia_files.read_whiskers(lines_path)
    peer.run("whisker_convert", lines_path, folder / "text.whisk1", "whisk1")
    peer.run("whisker_convert", folder / "text.whisk1", folder / "back.whiskers", "whiskbin1")
    back = janelia_files.read_whiskers(folder / "back.whiskers")
    off = max(largest([a.x, a.y], [b.x, b.y]) for a, b in zip(ours, back, strict=True))
    yield ".whiskers", "out, and back in", "whisker_convert", (
        f"{len(back)} of {len(ours)} lines; points differ by {off:.2g} px at most"
    )  # fmt: skip
    peer.run("measure", "--face", "left", lines_path, folder / "peer.measurements")
    found = janelia_files.read_measurements(folder / "peer.measurements")
    table = janelia_files.read_measurements(table_path)
    yield ".whiskers", "out", "measure", compared(table, found)
    for version in ("v1", "v2", "v3"):
        peer.run("measurements_convert", table_path, folder / version, version)
        same = janelia_files.read_measurements(folder / version)
        off = largest(same.values, table.values)
        yield ".measurements", "out, and back in", f"measurements_convert {version}", (
            f"{len(same.frame)} of {len(table.frame)} rows; values differ by {off:.2g} at most"
        )  # fmt: skip


def compared(table, found) -> str:
    """Our measures of the same lines beside the tracker's."""
    order = [np.lexsort([each.segment, each.frame]) for each in (table, found)]
    ours, theirs = (each.values[rows] for each, rows in zip((table, found), order, strict=True))
    length, angle = (np.median(np.abs(ours[:, k] - theirs[:, k])) for k in (0, 2))
    return (
        f"{len(theirs)} of {len(ours)} lines measured; median differences from ours: length "
        f"{length:.2g} px, angle {angle:.2g}°"
    )


def janelia_in(video, folder, peer):
    """What we make of what the tracker traces, measures and labels in the same video."""
    peer.run("trace", video.path, folder / "t.whiskers")
    peer.run("measure", "--face", "left", folder / "t.whiskers", folder / "t.measurements")
    scale = video.settings.recording.pixels_per_mm
    table = folder / "t.measurements"
    peer.run("classify", table, table, "left", "--px2mm", 1 / scale, "-n", 1)
    lines, _, n_frames = read_tracked(folder / "t.whiskers", video.settings)
    found = analyse_lines(lines, video.settings, video.pole(), n_frames).contacts
    ours = video.contacts
    ratio = np.median(found["peak_force_uN"]) / np.median(ours["peak_force_uN"])
    yield ".whiskers, .measurements", "in", "trace, measure, classify", (
        f"{len(lines)} lines in {n_frames} frames; {len(found)} contacts ({len(ours)} by `run`), "
        f"median peak force {ratio:.2f} of that of `run`"
    )  # fmt: skip


def recorded(path):
    """Someone's own .measurements, read and written again."""
    table = janelia_files.read_measurements(path)
    with tempfile.TemporaryDirectory() as folder:
        again = Path(folder) / "again.measurements"
        janelia_files.write_measurements(again, table)
        same = again.read_bytes() == Path(path).read_bytes()
    yield ".measurements", "in, and back out", "a recorded file", (
        f"{len(table.frame)} rows; {'the same bytes' if same else 'OTHER BYTES'}"
    )  # fmt: skip


def poses(video, folder, python):
    """`movement` reads our netCDF, and writes files of DeepLabCut and SLEAP, which we read."""
    (source,) = movement.write_movement(folder, video)
    sizes = asked(python, MOVEMENT, source, folder)
    shape = " × ".join(f"{n} {name}" for name, n in sizes.items())
    yield "netCDF", "out", "movement", f"read: {shape}"
    ours = movement.as_poses(video).position.transpose("time", "individuals", "keypoints", "space")
    files = {
        "DeepLabCut CSV": (read_deeplabcut, "aDLC.csv"),
        "DeepLabCut HDF5": (read_deeplabcut, "bDLC.h5"),
        "SLEAP HDF5": (read_sleap, "a.analysis.h5"),
    }
    for name, (read, file) in files.items():
        points = read(folder / file)
        off = largest(points.xy, ours.values)
        yield name, "in", "written by movement", (
            f"{len(points.xy)} frames; points differ by {off:.2g} px at most"
        )  # fmt: skip


def matlab(video, folder, python):
    """Another reader of MAT files finds the numbers of frames.parquet."""
    (path,) = write_matlab(folder, video)
    moment, scale = asked(python, MAT4PY, path)
    name = video.whiskers[0]
    rows = video.of(name)
    expected = 1e-9 * rows.loc[rows["tracked"], "base_moment_nN_m"].to_numpy()
    off = largest(np.ravel(moment), expected)
    yield "MAT", "out", "mat4py", (
        f"{len(expected)} frames, {scale:g} px/mm; M0 differs by {off:.2g} N m at most"
    )  # fmt: skip


def neurodata(video, folder):
    """The inspector has nothing severe to say; pynwb reads what was written."""
    import nwbinspector
    import pynwb

    about = {"subject_id": "m1", "species": "Mus musculus", "sex": "U", "age": "P90D"}
    (path,) = nwb.write_nwb(folder, video, start="2020-01-01T00:00:00+00:00", **about)
    said = list(nwbinspector.inspect_nwbfile(nwbfile_path=str(path)))
    worst = max((message.importance.name for message in said), default="nothing")
    with pynwb.NWBHDF5IO(str(path), "r") as file:
        content = file.read()
        series = sum(isinstance(o, pynwb.TimeSeries) for o in content.objects.values())
    yield "NWB", "out", "nwbinspector, pynwb", (
        f"{len(said)} remarks of the inspector (worst: {worst}); {series} time series read"
    )  # fmt: skip


def streampix(folder, python):
    """A reader of StreamPix sequences finds the frames that we find."""
    import hashlib
    import sys

    sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))
    from camera_files import streampix as sequence

    from pipeline.video import open_video

    pixels = np.random.default_rng(0).integers(0, 255, (7, 48, 64)).astype(np.uint8)
    path = folder / "a.seq"
    path.write_bytes(sequence(pixels))
    count, digest = asked(python, PIMS, path)
    with open_video(path) as video:
        ours = np.stack(list(video.frames()))
    same = hashlib.sha256(ours.tobytes()).hexdigest() == digest
    yield "StreamPix .seq", "in", "pims", f"{count} frames; {'the same' if same else 'OTHER'}"


def rows_of(check, *arguments):
    """Rows of a check, or one that says why there are none."""
    try:
        yield from check(*arguments)
    except (NoPeerError, RuntimeError, ImportError) as error:
        words = " ".join(str(error).split())[:120]
        yield check.__name__.replace("_", " "), "", "", f"not tried: {words}"


def try_all(folder, python, measurements, results=None):
    """Rows of the table."""
    if results is None:
        (path,) = render_session(folder / "videos", "single", seed=3, trials=1, frames=FRAMES)
        results = folder / "results"
        batch.run([path.parent], results)
    video = read_results(results)[0]
    yield from rows_of(neurodata, video, folder)
    for check in (poses, matlab):
        yield from rows_of(check, video, folder, python)
    yield from rows_of(streampix, folder, python)
    if measurements:
        yield from recorded(measurements)
    try:
        peer = find_peer(python)
    except NoPeerError as error:
        yield "Janelia", "", "", f"not tried: {error}"
        return
    yield from rows_of(janelia_out, video, folder, peer)
    yield from rows_of(janelia_in, video, folder, peer)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peer-python", default="python", help="of the other programs")
    parser.add_argument("--measurements", type=Path, help="a recorded .measurements file")
    parser.add_argument("--results", type=Path, help="of `run`, instead of rendering a video")
    parser.add_argument("--write", action="store_true", help="write into docs/formats.md")
    args = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for row in try_all(Path(folder), args.peer_python, args.measurements, args.results):
            rows.append(list(row))
            print(" | ".join(row), flush=True)
    if args.write:
        pages.write_between(PAGE, "exchange", pages.table(HEADER, rows))


if __name__ == "__main__":
    main()
