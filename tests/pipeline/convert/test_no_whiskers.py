"""Videos in which no whisker was found, or none in any frame, in every format."""

import json

import h5py
import numpy as np
import pytest
import xarray

from pipeline.convert.janelia import write_tracked
from pipeline.convert.matlab import write_matlab
from pipeline.convert.movement import write_movement
from pipeline.convert.nwb import write_nwb
from pipeline.convert.results import read_results
from pipeline.convert.whacc import write_whacc
from pipeline.tables import centrelines, files
from pipeline.tables.columns import CONTACT_COLUMNS, empty_table

FRAMES = 70


@pytest.fixture(params=["no whisker found", "none in any frame"])
def video(request, videos):
    """The first of the videos, without lines: with rows of frames, or without."""
    folder, frames = videos[0].folder, videos[0].frames[:FRAMES]
    frames = frames.assign(tracked=False, in_contact=False, contact_force_uN=float("nan"))
    frames = frames[: 0 if request.param == "no whisker found" else FRAMES]
    files.write_frames(folder / "frames.parquet", frames)
    lines = videos[0].lines().rows(np.arange(0))
    centrelines.write_centrelines(folder / "centrelines.parquet", lines)
    (folder / "run.json").write_text(json.dumps({"frames": FRAMES, "pole": None}))
    files.write_csv(folder / "contacts.csv", empty_table(CONTACT_COLUMNS), CONTACT_COLUMNS)
    return read_results(folder.parent)[0]


@pytest.mark.parametrize("write", [write_matlab, write_nwb, write_movement, write_tracked])
def test_every_format_is_written(video, tmp_path, write):
    paths = write(tmp_path, video)
    assert all(path.stat().st_size for path in paths)


def test_all_frames_count(video, tmp_path):
    (path,) = write_movement(tmp_path, video)
    assert xarray.open_dataset(path, engine="h5netcdf").sizes["time"] == FRAMES
    with h5py.File(write_whacc(tmp_path / "w.h5", [video])) as file:
        assert file["frame_nums"][:].tolist() == [FRAMES]
        assert file["labels"][:].tolist() == [0] * FRAMES
