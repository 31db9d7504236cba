"""The pole's place from frame to frame, as run.json keeps it."""

import numpy as np


def pole_runs(track) -> dict | None:
    """A `PoleTrack` as runs of frames at one place, [first frame, x, y], for run.json."""
    if track is None:
        return None
    places = np.column_stack([track.x_px, track.y_px]).round(3)
    same = (places[1:] == places[:-1]) | (np.isnan(places[1:]) & np.isnan(places[:-1]))
    starts = np.flatnonzero(np.concatenate([[True], ~same.all(axis=1)]))
    runs = [[int(i), *(None if np.isnan(v) else float(v) for v in places[i])] for i in starts]
    return {"radius_px": float(track.radius_px), "runs": runs}


def pole_at(state: dict, frame: int) -> tuple[float, float, float] | None:
    """(x, y, radius) [px] of the pole at a frame, from a video's run.json; None: not in view."""
    pole = state.get("pole")
    if not pole:
        return None
    starts = [run[0] for run in pole["runs"]]
    _, x, y = pole["runs"][max(int(np.searchsorted(starts, frame, side="right")) - 1, 0)]
    return None if x is None else (x, y, pole["radius_px"])
