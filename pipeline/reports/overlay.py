"""Videos and stills with the findings drawn in."""

import itertools
from pathlib import Path

import cv2
import numpy as np

from pipeline.reports.drawing import COLUMNS, View, draw
from pipeline.runtime.timing import Counted
from pipeline.scene import pole_runs
from pipeline.session.schema import Settings
from pipeline.session.session_file import read_session
from pipeline.tables import centrelines, files
from pipeline.tables.known_names import never_shown
from pipeline.tables.own_files import replace_own
from pipeline.tables.run_record import read_pole
from pipeline.video.open import open_video

PLAYBACK_RATE = 25  # frames/s: slow motion
KEY_FRAMES = 50  # from one to the next: a browser that is sent to a contact is there at once
STILL_MM = 10.0, 7.5  # shown about the pole
STILL_PX = 640  # width as drawn
NO_MORE = np.inf, {}  # frame number and lines, after the last frame that has any


def write_overlay(
    video_path, folder, settings: Settings | None = None, progress=None
) -> list[str]:
    """Write overlay.mp4 into a video's results folder.

    overlay.avi (MJPG) where this machine cannot encode H.264; overlay.png for a single frame.

    Parameters
    ----------
    video_path : the input that the results are of
    folder : its results folder, with centrelines.parquet and frames.parquet
    settings : None: those in the results folder
    progress : called with (frames done, frames expected), often

    Returns
    -------
    A sentence on the file that was there, if a person had changed it, and which is kept.
    """
    folder = Path(folder)
    settings = settings or read_session(folder / "session.toml")
    with open_video(video_path) as video:
        pictures = Counted(drawn_frames(video, folder, settings), video.n_frames, progress)
        pictures = iter(pictures)
        first = list(itertools.islice(pictures, 2))
        if len(first) == 1:
            return write_png(folder / "overlay.png", first[0])
        return _write_video(folder, itertools.chain(first, pictures))


def drawn_frames(video, folder, settings: Settings):
    """Yield all frames with findings, uint8 (height, width, 3), BGR."""
    for _, picture in _drawn(enumerate(video.watched()), folder, settings):
        yield picture


def _drawn(images, folder, settings, inside=None, view_of=None):
    """Yield the frame number and the picture with the findings, for each of the images.

    images : (frame number, image), in ascending order
    inside : filters that choose the tables' rows of these frames; None: all rows
    view_of : gives the `View` to be shown of an image, its lines and the pole; None: all of it
    """
    frames = files.read_frames(folder / "frames.parquet", COLUMNS, inside)
    frame_of_row = frames["frame"].to_numpy()
    chunks = centrelines.centreline_chunks(folder / "centrelines.parquet", inside)
    unnamed, poles = _unnamed(folder), read_pole(folder)
    for number, image, lines in _with_lines(images, chunks):
        rows = frames.iloc[slice(*np.searchsorted(frame_of_row, [number, number + 1]))]
        pole = pole_runs.pole_at(poles, number)
        view = view_of(image, lines, pole) if view_of else None
        yield number, draw(image, lines, rows, pole, settings, view, unnamed)


def _with_lines(images, chunks):
    """Yield (frame number, image, {whisker: points}) for each of the images of `_drawn`."""
    lines_of_frames = _by_frame(chunks)
    frame, lines = next(lines_of_frames, NO_MORE)
    for number, image in images:
        while frame < number:
            frame, lines = next(lines_of_frames, NO_MORE)
        yield number, image, lines if frame == number else {}


def _unnamed(folder) -> set[str]:
    """Names of lines that belong to no known whisker and touch nothing."""
    columns = ["whisker", "tracked", "confidence", "in_contact"]
    frames = files.read_frames(folder / "frames.parquet", columns)
    return never_shown(frames)


def _by_frame(chunks):
    """Yield (frame, {whisker: points}) for every frame that has centrelines."""
    rows = (row for chunk in chunks for row in chunk.each())
    for frame, group in itertools.groupby(rows, key=lambda row: row[0]):
        yield frame, {name: points for _, name, points in group}


def write_png(path, picture) -> list[str]:
    """Write a picture (BGR) whole or not at all.

    One that a person has changed is kept; returns what `keep_changed` does.
    """
    return replace_own(path, lambda new: new.write_bytes(cv2.imencode(".png", picture)[1]))


def _write_video(folder, pictures) -> list[str]:
    """Encode BGR pictures as H.264, or MJPG where there is no such encoder; as `write_png`."""
    import av

    try:
        av.codec.Codec("libx264", "w")
        path, codec, pixels = folder / "overlay.mp4", "libx264", "yuv420p"
        options = {"crf": "20", "preset": "veryfast", "g": str(KEY_FRAMES)}
    except ValueError:
        path, codec, pixels = folder / "overlay.avi", "mjpeg", "yuvj420p"
        options = {"qmin": "3", "qmax": "3"}

    def encode(new):
        with av.open(str(new), "w") as container:
            stream = container.add_stream(codec, rate=PLAYBACK_RATE, options=options)
            stream.pix_fmt = pixels
            for picture in pictures:
                picture = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
                if not stream.codec_context.is_open:
                    stream.height, stream.width = picture.shape[:2]
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="bgr24")
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))

    return replace_own(path, encode)


def stills(results_folder, video_path, frames, settings: Settings, whole=False) -> list:
    """Some frames of a processed video with the findings, cut out about the pole or `whole`.

    Returns
    -------
    uint8 (height, width, 3), BGR, for each of `frames`; None for those that cannot be read.

    Raises
    ------
    VideoError
        If the video cannot be opened.
    """

    def view_of(image, lines, pole):
        return _still_view(image, lines, pole, settings.recording.pixels_per_mm)

    numbers = [int(each) for each in frames]
    inside = [("frame", "in", sorted(set(numbers)))]
    with open_video(video_path) as video:
        images = video.some(numbers)
        drawn = dict(
            _drawn(images, Path(results_folder), settings, inside, None if whole else view_of)
        )
    return [drawn.get(number) for number in numbers]


def _still_view(image, lines, pole, pixels_per_mm) -> View:
    """What a still shows: the surroundings of the pole, or else of the whiskers."""
    if pole is not None:
        centre = pole[:2]
    elif lines:
        centre = np.median(np.concatenate(list(lines.values())), axis=0)
    else:
        centre = image.shape[1] / 2, image.shape[0] / 2
    size = [mm * pixels_per_mm for mm in STILL_MM]
    return View.around(image, centre, size, STILL_PX)
