"""Poses for `movement`: dimensions, attributes and places."""

import numpy as np
import pytest
import xarray

from pipeline.convert import optional
from pipeline.convert.keypoints import points_along
from pipeline.convert.movement import KEY_POINTS, write_movement
from pipeline.errors import InputError


def test_poses_read_back(videos, tmp_path):
    (path,) = write_movement(tmp_path, videos[0])
    poses = xarray.open_dataset(path, engine="h5netcdf")
    assert poses["position"].dims == ("time", "space", "keypoints", "individuals")
    assert poses["confidence"].dims == ("time", "keypoints", "individuals")
    assert poses["position"].shape == (120, 2, KEY_POINTS, 1)
    assert list(poses["individuals"].values) == ["C2"]
    assert list(poses["space"].values) == ["x", "y"]
    assert poses.attrs["fps"] == 1000.0
    assert (poses.attrs["ds_type"], poses.attrs["time_unit"]) == ("poses", "seconds")
    np.testing.assert_allclose(poses["time"], np.arange(120) / 1000)
    line = videos[0].lines().row(7)
    found = poses["position"].isel(time=7, individuals=0).transpose("keypoints", "space")
    np.testing.assert_allclose(found, points_along(line, KEY_POINTS), atol=1e-4)
    np.testing.assert_allclose(found[[0, -1]], line[[0, -1]], atol=1e-4)


def test_points_lie_at_even_distances():
    line = np.array([[0.0, 0], [3, 4], [3, 14]])
    points = points_along(line, 4)
    np.testing.assert_allclose(points, [[0, 0], [3, 4], [3, 9], [3, 14]])


def test_a_missing_library_says_what_to_install():
    with pytest.raises(InputError, match=r'pip install "whiskerforce\[formats\]"'):
        optional.library("no_such_library_anywhere", "formats")
