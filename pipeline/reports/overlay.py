"""Findings drawn into the picture: centreline, contact state, pole, force arrow."""

import itertools
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from pipeline.scene import pole_runs
from pipeline.session.session_file import Settings, read_session
from pipeline.tables import centrelines, files
from pipeline.video.open import open_video

FREE, TOUCHING, POLE, INK = (255, 150, 0), (40, 40, 230), (60, 180, 60), (30, 30, 30)  # BGR
DOUBTFUL = (150, 130, 110)  # a line of which it is not known which whisker it is
MM_PER_UN = 0.15  # length of the force arrow
SMALL_PX = 480  # narrower pictures are drawn enlarged, for the text
PLAYBACK_RATE = 25  # frames/s: slow motion
SURE = 0.5  # confidence from which a name is taken for known
SHIFT = 4  # binary digits after the point in OpenCV's coordinates
COLUMNS = [
    "frame", "time_s", "whisker", "follicle_x_px", "follicle_y_px", "base_angle_deg",
    "in_contact", "contact_force_uN", "axial_force_uN", "lateral_force_uN",
    "contact_arc_length_mm", "confidence",
]  # fmt: skip


def write_overlay(video_path, folder, settings: Settings | None = None) -> Path:
    """Write overlay.mp4 (overlay.png for a single frame) into a video's results folder.

    Parameters
    ----------
    video_path : the input that the results are of
    folder : its results folder, with centrelines.parquet and frames.parquet
    settings : None: those in the results folder

    Returns
    -------
    Path of the file written; overlay.avi (MJPG) where this machine cannot encode H.264.
    """
    folder = Path(folder)
    settings = settings or read_session(folder / "session.toml")
    with open_video(video_path) as video:
        pictures = drawn_frames(video, folder, settings)
        first = list(itertools.islice(pictures, 2))
        if len(first) == 1:
            return _write_png(folder / "overlay.png", first[0])
        return _write_video(folder, itertools.chain(first, pictures))


def drawn_frames(video, folder, settings: Settings):
    """Yield all frames with findings, uint8 (height, width, 3), BGR."""
    for _, picture in _drawn(enumerate(video.frames()), folder, settings):
        yield picture


def _drawn(images, folder, settings, inside=None):
    """Yield (number, picture) for `images`, which are (number, frame), in ascending order.

    inside : filters of the tables' rows, which hold those of all these frames; None: all
    """
    frames = files.read_frames(folder / "frames.parquet", COLUMNS, inside)
    places = frames["frame"].to_numpy()
    lines = _by_frame(centrelines.centreline_chunks(folder / "centrelines.parquet", inside))
    state = files.read_json(folder / "run.json", {})
    here = next(lines, None)
    for number, image in images:
        while here is not None and here[0] < number:
            here = next(lines, None)
        shown = here[1] if here is not None and here[0] == number else {}
        rows = frames.iloc[slice(*np.searchsorted(places, [number, number + 1]))]
        yield number, draw(image, shown, rows, pole_runs.pole_at(state, number), settings)


def _by_frame(chunks):
    """Yield (frame, {whisker: points}) for every frame that has centrelines."""
    rows = (
        (int(chunk.frame[i]), chunk.names[chunk.whisker[i]], chunk.row(i))
        for chunk in chunks
        for i in range(len(chunk))
    )
    for frame, group in itertools.groupby(rows, key=lambda row: row[0]):
        yield frame, {name: points for _, name, points in group}


def draw(image, lines: dict, rows: pd.DataFrame, pole, settings: Settings) -> np.ndarray:
    """One frame with its findings, uint8 (height, width, 3), BGR.

    Parameters
    ----------
    image : uint8 (height, width)
    lines : whisker → points (n, 2) [px]
    rows : this frame's rows of frames.parquet, with COLUMNS
    pole : (x, y, radius) [px] or None
    """
    zoom = 2 if image.shape[1] < SMALL_PX else 1
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    if zoom > 1:
        canvas = cv2.resize(canvas, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC)
    table = {row["whisker"]: row for row in rows.to_dict("records")}
    if pole is not None:
        x, y, radius = pole
        centre = _pixels(np.array([[x, y]]), zoom)[0]
        cv2.circle(canvas, centre, round(radius * zoom * 2**SHIFT), POLE, 1, cv2.LINE_AA, SHIFT)
    for name, points in lines.items():
        row = table.get(name)
        place, colour = _pixels(points, zoom), _colour(row)
        cv2.polylines(canvas, [place], False, colour, 1, cv2.LINE_AA, SHIFT)
        if len(table or lines) > 1:
            _put_text(canvas, name, tuple(place[-1] // 2**SHIFT + 3), colour)
        if colour == TOUCHING:
            _draw_force(canvas, points, row, settings, zoom)
    _write_state(canvas, table, lines)
    return canvas


def _colour(row):
    """Of a whisker in a frame, from its row of frames.parquet (None: there is none)."""
    if row is None:
        return FREE
    if row["in_contact"]:
        return TOUCHING
    return DOUBTFUL if row["confidence"] < SURE else FREE


def _put_text(canvas, words, place, colour):
    cv2.putText(canvas, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)


def _pixels(points, zoom):
    """Image points as OpenCV's fixed-point coordinates on the enlarged canvas."""
    return np.round(((np.asarray(points) + 0.5) * zoom - 0.5) * 2**SHIFT).astype(np.int32)


def _draw_force(canvas, points, row, settings, zoom):
    """Arrow of the force on the whisker, its head at the contact point."""
    scale = settings.recording.pixels_per_mm
    angle = np.radians(row["base_angle_deg"])
    along, across = row["axial_force_uN"], row["lateral_force_uN"]
    # base tangent (cos, −sin) and normal (−sin, −cos) in image axes, y down
    force = np.array(
        [along * np.cos(angle) - across * np.sin(angle),
         -along * np.sin(angle) - across * np.cos(angle)]
    )  # fmt: skip
    head = _point_at(points, row, scale)
    if head is None or not np.isfinite(force).all():
        return
    tail, head = _pixels(np.array([head - MM_PER_UN * scale * force, head]), zoom)
    if np.hypot(*(head - tail)) > 2**SHIFT:
        cv2.line(canvas, tail, head, TOUCHING, 2, cv2.LINE_AA, SHIFT)
        barb = (tail - head) / np.hypot(*(tail - head)) * 7 * zoom * 2**SHIFT
        for turn in (0.4, -0.4):
            c, s = np.cos(turn), np.sin(turn)
            end = head + np.array([c * barb[0] - s * barb[1], s * barb[0] + c * barb[1]])
            cv2.line(canvas, head, end.astype(np.int32), TOUCHING, 2, cv2.LINE_AA, SHIFT)


def _point_at(points, row, scale):
    """The centreline's point at the contact's arc length, None if that is not known."""
    arc = row["contact_arc_length_mm"]
    if not np.isfinite(arc):
        return None
    steps = np.hypot(*np.diff(points, axis=0).T)
    follicle = np.array([row["follicle_x_px"], row["follicle_y_px"]])
    s = np.hypot(*(points[0] - follicle)) + np.concatenate([[0], np.cumsum(steps)])
    return np.array([np.interp(arc * scale, s, points[:, axis]) for axis in (0, 1)])


def _write_state(canvas, table, lines):
    """Frame, time, and each whisker's state in the picture's corner."""
    text = []
    for name in table or lines:
        row = table.get(name)
        if name not in lines:
            text.append((f"{name} -", INK))
        elif _colour(row) == TOUCHING:
            text.append((f"{name} {row['contact_force_uN']:.1f} uN", TOUCHING))
        else:
            text.append((name, _colour(row)))
    first = next(iter(table.values()), None)
    head = "" if first is None else f"{first['frame']}  {1e3 * first['time_s']:.0f} ms"
    text = [(head, INK), *text]
    width = 12 + 8 * max(len(words) for words, _ in text)
    box = canvas[: 10 + 15 * len(text), :width]
    box[:] = (0.35 * box + 0.65 * 255).astype(np.uint8)
    for i, (words, colour) in enumerate(text):
        _put_text(canvas, words, (6, 16 + 15 * i), colour)


def _write_png(path, picture) -> Path:
    with files.whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(".png", picture)[1])
    return path


def _write_video(folder, pictures) -> Path:
    """Encode BGR pictures as H.264, or MJPG where there is no such encoder."""
    import av

    try:
        av.codec.Codec("libx264", "w")
        path, codec, pixels = folder / "overlay.mp4", "libx264", "yuv420p"
        options = {"crf": "20", "preset": "veryfast"}
    except ValueError:
        path, codec, pixels = folder / "overlay.avi", "mjpeg", "yuvj420p"
        options = {"qmin": "3", "qmax": "3"}
    with files.whole_file(path) as temporary, av.open(str(temporary), "w") as container:
        stream = container.add_stream(codec, rate=PLAYBACK_RATE, options=options)
        stream.pix_fmt = pixels
        for picture in pictures:
            picture = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
            if not stream.codec_context.is_open:
                stream.height, stream.width = picture.shape[:2]
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def pictures_of(results_folder, video_path, frames, settings: Settings) -> list:
    """Some frames of a processed video with its findings.

    Returns
    -------
    uint8 (height, width, 3), BGR, for each of `frames`; None for those that cannot be read.

    Raises
    ------
    VideoError
        If the video cannot be opened.
    """
    numbers = [int(each) for each in frames]
    inside = [("frame", "in", sorted(set(numbers)))]
    with open_video(video_path) as video:
        drawn = dict(_drawn(video.some(numbers), Path(results_folder), settings, inside))
    return [drawn.get(number) for number in numbers]
