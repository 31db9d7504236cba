"""A stand-in for `pipeline.run.analyse`, for tests of what happens around it."""

import numpy as np
import pandas as pd

from pipeline.analysis import Analysis
from pipeline.contacts import left_out
from pipeline.detection.static_scene import PoleTrack
from pipeline.errors import VideoError

FRAMES = 10


def quick_analyse(path, settings, keep=None, progress=None, corrections=None, threads=1):
    """One contact in ten frames; what the "video" holds may ask for a fault instead."""
    content = path.read_bytes()
    if content.startswith(b"bad"):
        raise VideoError(path, "frame 3 is broken: record it again", 3)
    if content.startswith(b"fault"):
        raise ZeroDivisionError("oops")
    if content.startswith(b"large"):
        raise MemoryError
    if content.startswith(b"library"):
        raise ImportError("libx.so: failed to map segment from shared object")
    frames = pd.DataFrame({"frame": range(FRAMES), "whisker": "C2", "tracked": True})
    row = {"whisker": "C2", "contact": 1, "onset_frame": 2, "peak_force_uN": float(len(content))}
    return Analysis(
        frames=frames,
        contacts=pd.DataFrame([row]),
        evidence=frames[["frame", "whisker"]],
        pole=PoleTrack(np.full(1, 3.0), np.full(1, 4.0), 6.0),
        n_frames=FRAMES,
        messages=() if corrections is None else tuple(left_out(corrections, ["C2"], FRAMES)),
        settings=settings,
    )
