"""NWB: the inspector reports nothing severe; pynwb reads what was written."""

import numpy as np

from exchanges.others import largest
from pipeline.convert import nwb

ABOUT = {"subject_id": "m1", "species": "Mus musculus", "sex": "U", "age": "P90D"}


def rows(video, folder, others):
    """A file of a video."""
    import nwbinspector
    import pynwb

    (path,) = nwb.write_nwb(folder, video, start="2020-01-01T00:00:00+00:00", **ABOUT)
    said = list(nwbinspector.inspect_nwbfile(nwbfile_path=str(path)))
    worst = max((message.importance.name for message in said), default="nothing")
    name = video.whiskers[0]
    with pynwb.NWBHDF5IO(str(path), "r") as file:
        series = [o for o in file.read().objects.values() if isinstance(o, pynwb.TimeSeries)]
        moments = next(s for s in series if s.name == f"{name}_base_moment")
        off = largest(moments.data[:], 1e-9 * video.of(name)["base_moment_nN_m"].to_numpy(float))
    yield "NWB", "out", "nwbinspector, pynwb", (
        f"{len(said)} remarks of the inspector (worst: {worst}); {len(series)} time series read, "
        f"base moment differs by {np.float32(off):.2g} N m at most"
    )  # fmt: skip
