"""Whiskers as poses for `movement` (neuroinformatics-unit): netCDF by way of xarray.

An individual is a whisker, its key points lie at even distances from the first visible point to
the tip.
"""

from pathlib import Path

import numpy as np

from pipeline.convert.hdf5 import whole_hdf5
from pipeline.convert.keypoints import points_along
from pipeline.convert.optional import library

KEY_POINTS = 20  # of every whisker


def as_poses(video):
    """The whiskers as an xarray.Dataset as `movement` has it: position and confidence."""
    xarray = library("xarray", "formats")
    position, confidence = key_points(video)
    rate = video.settings.recording.frames_per_second
    return xarray.Dataset(
        {
            "position": (("time", "space", "keypoints", "individuals"), position),
            "confidence": (("time", "keypoints", "individuals"), confidence),
        },
        {
            "time": np.arange(video.n_frames) / rate,
            "space": ["x", "y"],
            "keypoints": [f"point_{i}" for i in range(KEY_POINTS)],
            "individuals": list(video.whiskers),
        },
        {
            "source_software": "whiskerforce",
            "ds_type": "poses",
            "fps": rate,
            "time_unit": "seconds",
            "source_file": video.path,
        },
    )


def key_points(video):
    """Places (frames, 2, points, whiskers) [px] and confidences (frames, points, whiskers)."""
    names = list(video.whiskers)
    position = np.full((video.n_frames, 2, KEY_POINTS, len(names)), np.nan, np.float32)
    for frame, name, points in video.lines().each():
        position[frame, :, :, names.index(name)] = points_along(points, KEY_POINTS).T
    sure = np.full((video.n_frames, KEY_POINTS, len(names)), np.nan, np.float32)
    for whisker, name in enumerate(names):
        sure[:, :, whisker] = video.of(name)["confidence"].to_numpy()[:, None]
    return position, sure


def write_movement(folder, video) -> list[Path]:
    """Write NAME.nc; return its path in a list."""
    netcdf = library("h5netcdf", "formats")
    store = library("xarray.backends", "formats").H5NetCDFStore
    path = Path(folder) / f"{video.name}.nc"
    poses = as_poses(video)
    with whole_hdf5(path) as held, netcdf.File(held, "w") as file:
        poses.dump_to_store(store(file))
    return [path]
