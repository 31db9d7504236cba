"""Pictures of contacts at their peaks, with captions, for the report."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.errors import VideoError, counted
from pipeline.reports.plot_style import data_uri
from pipeline.session.content import check_video
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.columns import split_flags
from pipeline.tables.known_names import KNOWN

JPEG_QUALITY = 80


def with_peaks(results, contacts: pd.DataFrame) -> pd.DataFrame:
    """The table of contacts with `peak_frame`, that of largest force in the table of frames.

    The contact's middle where no force is known.
    """
    onset, offset = (contacts[c].to_numpy() for c in ("onset_frame", "offset_frame"))
    peak = (onset + offset) // 2
    for (video, whisker), places in contacts.groupby(["video", "whisker"]).indices.items():
        path = Path(results) / video / "frames.parquet"
        if not path.is_file():
            continue
        wanted, inside = ["frame", "contact_force_uN"], [("whisker", "==", whisker)]
        frame, force = files.read_frames(path, wanted, inside).to_numpy(float).T
        for i in places:
            first, last = np.searchsorted(frame, [onset[i], offset[i]])
            if np.isfinite(force[first:last]).any():
                peak[i] = frame[first + np.nanargmax(force[first:last])]
    return contacts.assign(peak_frame=peak)


def contact_stills(results, contacts, record, indices) -> dict:
    """Contact → picture of its peak, with a caption, if its video can be read."""
    pictures = {}
    for video, rows in contacts.loc[indices].groupby("video"):
        state = record.get("inputs", {}).get(video)
        if state:
            frames = rows["peak_frame"].astype(int)
            pictures |= _drawn(results / video, state["path"], frames)
    return {
        index: {"data": data, "caption": _caption(contacts.loc[index]), "index": index}
        for index, data in pictures.items()
    }


def video_stills(results, videos, record) -> list:
    """A picture of the traced lines in each of some videos, if these can be read.

    It shows the frame with the most names that are sure.
    """
    pictures = []
    for video in videos:
        state = record.get("inputs", {}).get(video)
        path = results / video / "frames.parquet"
        rows = files.read_frames(path, ["frame", "tracked", "confidence"])
        rows = rows[rows["tracked"]].assign(sure=lambda each: each["confidence"] >= KNOWN)
        counts = rows.groupby("frame")["sure"].agg(["sum", "size"])
        if not state or counts.empty:
            continue
        best = counts.sort_values(["sum", "size"], kind="stable").iloc[-1]
        caption = f"{video}, frame {best.name}: {counted(best['size'], 'whisker')} traced"
        if best["sum"] < best["size"]:
            caption += f"; of {best['size'] - best['sum']} it is not sure which they are"
        frame = pd.Series({video: best.name})
        drawn = _drawn(results / video, state["path"], frame, whole=True)
        pictures += [{"data": data, "caption": caption} for data in drawn.values()]
    return pictures


def _drawn(folder, path, frames, **how) -> dict:
    """Contact → its frame with the findings as a data URI, if it is there still."""
    import cv2

    from pipeline.reports.overlay import stills

    try:
        check_video(folder, path)
        pictures = stills(folder, path, frames, read_session(folder / "session.toml"), **how)
    except (VideoError, OSError):
        return {}
    jpeg = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return {
        index: data_uri(cv2.imencode(".jpg", picture, jpeg)[1].tobytes(), "image/jpeg")
        for index, picture in zip(frames.index, pictures, strict=True)
        if picture is not None
    }


def _caption(row) -> str:
    caption = f"{row['video']}, frame {row['peak_frame']:.0f}: {row['whisker']}, contact "
    caption += f"{row['contact']}, "
    if np.isfinite(row["peak_force_uN"]):
        caption += f"peak {row['peak_force_uN']:.3g}\u00a0µN, "
    caption += f"{row['duration_ms']:.3g}\u00a0ms"
    if row["flags"]:
        caption += f"; {', '.join(split_flags(row['flags']))}"
    return caption
