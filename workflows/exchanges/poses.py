"""Key points: `movement`'s netCDF out; DeepLabCut and SLEAP in, from their own writers."""

import numpy as np

from exchanges.others import largest, printed_by
from pipeline.convert import movement
from pipeline.convert.deeplabcut import read_deeplabcut
from pipeline.convert.sleap import read_sleap

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
SLEAP = """
import json, sys
import numpy, sleap_io
source, folder, video = sys.argv[1:]
xy = numpy.load(source)  # frames, whiskers, points, 2
skeleton = sleap_io.Skeleton([f"point_{i}" for i in range(xy.shape[2])])
tracks = [sleap_io.Track(f"whisker_{i}") for i in range(xy.shape[1])]
videos = [sleap_io.load_video(video)]
labels = sleap_io.Labels.from_numpy(xy, videos=videos, skeletons=[skeleton], tracks=tracks)
sleap_io.save_analysis_h5(labels, folder + "/b.analysis.h5")
sleap_io.save_csv(labels, folder + "/b.csv", format="sleap")
print(json.dumps(sleap_io.__version__))
"""
# Only the module that writes is loaded: the package as a whole wants its neural networks.
DEEPLABCUT = """
import importlib.util, json, sys, types
import numpy, pandas
folder = importlib.util.find_spec("deeplabcut").submodule_search_locations[0]
for name, path in ("deeplabcut", folder), ("deeplabcut.utils", folder + "/utils"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [path]
from deeplabcut.utils.auxiliaryfunctions import save_data
source, out = sys.argv[1:]
xy = numpy.load(source)
n, whiskers, points, _ = xy.shape
values = numpy.concatenate([xy, numpy.ones((n, whiskers, points, 1))], axis=-1)
levels = [["DLC_net"], [f"whisker{i}" for i in range(whiskers)],
          [f"point_{i}" for i in range(points)], ["x", "y", "likelihood"]]
names = ["scorer", "individuals", "bodyparts", "coords"]
for file, keep in (("/several.h5", [0, 1, 2, 3]), ("/one.h5", [0, 2, 3])):
    columns = pandas.MultiIndex.from_product(
        [levels[k] for k in keep], names=[names[k] for k in keep])
    save_data(values.reshape(n, -1)[:, :len(columns)], {}, out + file, columns, range(n), True)
print(json.dumps(n))
"""


def rows(video, folder, others):
    """`movement` reads our netCDF, and writes files of DeepLabCut and SLEAP, which we read."""
    (source,) = movement.write_movement(folder, video)
    sizes = printed_by(others.peer_python, MOVEMENT, source, folder)
    shape = " × ".join(f"{n} {name}" for name, n in sizes.items())
    yield "netCDF", "out", "movement", f"read: {shape}"
    files = {
        "DeepLabCut CSV": (read_deeplabcut, "aDLC.csv"),
        "DeepLabCut HDF5": (read_deeplabcut, "bDLC.h5"),
        "SLEAP HDF5": (read_sleap, "a.analysis.h5"),
    }
    yield from _read(files, folder, "written by movement", places(video))


def places(video):
    """Key points (frames, whiskers, points, 2) [px]."""
    poses = movement.as_poses(video).position
    return poses.transpose("time", "individuals", "keypoints", "space").values


def sleap(video, folder, others):
    """SLEAP's own writer (sleap-io), HDF5 and CSV, of the whole video."""
    np.save(folder / "points.npy", places(video))
    version = printed_by(others.poses_python, SLEAP, folder / "points.npy", folder, video.path)
    files = {"SLEAP HDF5": (read_sleap, "b.analysis.h5"), "SLEAP CSV": (read_sleap, "b.csv")}
    yield from _read(files, folder, f"sleap-io {version}", places(video))


def deeplabcut(video, folder, others):
    """DeepLabCut's own writer, of one animal and of several, HDF5 and CSV."""
    np.save(folder / "points.npy", places(video))
    printed_by(others.poses_python, DEEPLABCUT, folder / "points.npy", folder)
    files = {
        "DeepLabCut HDF5": (read_deeplabcut, "one.h5"),
        "DeepLabCut CSV": (read_deeplabcut, "one.csv"),
        "DeepLabCut HDF5, individuals": (read_deeplabcut, "several.h5"),
        "DeepLabCut CSV, individuals": (read_deeplabcut, "several.csv"),
    }
    yield from _read(files, folder, "deeplabcut `save_data`", places(video))


def _read(files, folder, writer, ours):
    for name, (read, file) in files.items():
        points = read(folder / file)
        order = [points.parts.index(f"point_{i}") for i in range(ours.shape[2])]
        off = largest(points.xy[:, :, order], ours)
        yield name, "in", writer, (
            f"{len(points.xy)} frames; points differ by {off:.2g} px at most"
        )  # fmt: skip
