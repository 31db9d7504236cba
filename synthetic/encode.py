"""Grey frames → a video file that appears whole or not at all.

Grey levels are stored as they are, in full range and marked so: a decoder's luma plane is the
rendered grey exactly for ffv1 and tiff, and to within the codec's loss for h264 and mjpeg.
"""

import itertools
from pathlib import Path

import numpy as np

from pipeline.tables.whole_files import whole_file
from synthetic.scene import Codec

_LONGEST = 20000  # frames, beyond them quality no longer changes
_POOR = 0.5  # share of the bits that a poor stretch gets
_PLAYBACK_RATE = 25  # the container's; high-speed cameras write slow-motion files
_SUFFIX = {"ffv1": ".avi", "h264": ".mp4", "mjpeg": ".avi", "tiff": ".tif"}


def video_suffix(codec: Codec) -> str:
    """File name suffix of a codec's container, e.g. ".avi"."""
    return _SUFFIX[codec.name]


def write_video(path, frames, codec: Codec) -> int:
    """Write grey frames to `path`, under its name only once complete.

    Parameters
    ----------
    path : where to; its suffix must be video_suffix(codec)
    frames : iterable of uint8 (height, width), all of one size, at least one
    codec : Codec

    Returns
    -------
    int, the number of frames written

    Raises
    ------
    ValueError
        Where the suffix does not fit, there is no frame, a frame is not grey uint8, or h264 is
        asked for with an odd width or height.
    """
    path = Path(path)
    if path.suffix != video_suffix(codec):
        raise ValueError(f"path must end with {video_suffix(codec)} for {codec.name}, got {path}")
    frames = iter(frames)
    first = next(frames, None)
    if first is None:
        raise ValueError("frames must hold at least one frame, got none")
    write = _write_tiff if codec.name == "tiff" else _write_container
    with whole_file(path) as temporary:
        return write(temporary, _checked(itertools.chain([first], frames), first.shape), codec)


def _checked(frames, shape):
    for i, frame in enumerate(frames):
        if frame.dtype != np.uint8 or frame.shape != shape:
            raise ValueError(
                f"frame {i} must be uint8 of shape {shape}, got {frame.dtype} {frame.shape}"
            )
        yield frame


def _write_tiff(path, frames, codec):
    import tifffile

    count = 0
    with tifffile.TiffWriter(path) as writer:
        for frame in frames:
            writer.write(frame, contiguous=True)
            count += 1
    return count


def _write_container(path, frames, codec):
    import av
    from av.video.reformatter import ColorRange

    count = 0
    with av.open(str(path), "w") as container:
        stream = None
        for frame in frames:
            if stream is None:
                stream = _add_stream(container, frame.shape, codec)
                picture = _grey_picture(frame.shape, stream.pix_fmt)
                picture.color_range = ColorRange.JPEG
            _fill(picture.planes[0], frame)  # one picture for all: encoders keep their own copy
            picture.pts = count
            container.mux(stream.encode(picture))
            count += 1
        container.mux(stream.encode(None))
    return count


def _add_stream(container, shape, codec):
    """Add a video stream of the codec, full range."""
    if codec.name == "h264" and (shape[0] % 2 or shape[1] % 2):
        raise ValueError(
            f"frames must have an even height and width for h264, got {shape[0]} × {shape[1]} px; "
            "change the camera's size or the codec"
        )
    name, pixel_format, options = encoder_of(codec)
    stream = container.add_stream(name, rate=_PLAYBACK_RATE, options=options)
    stream.height, stream.width = shape
    stream.pix_fmt = pixel_format
    stream.codec_context.color_range = 2  # full ("jpeg")
    stream.codec_context.thread_count = 1
    return stream


def encoder_of(codec: Codec) -> tuple[str, str, dict[str, str]]:
    """FFmpeg's encoder for a codec, its format of pixels and its options."""
    return {
        "ffv1": ("ffv1", "gray", {"level": "3", "slices": "4"}),
        "h264": ("libx264", "yuv420p", _h264_options(codec)),
        "mjpeg": ("mjpeg", "yuvj420p", {"qmin": str(codec.quality), "qmax": str(codec.quality)}),
    }[codec.name]


def _h264_options(codec: Codec) -> dict[str, str]:
    """x264's options; zones [frames] of fewer bits where the quality is to change."""
    repeatable = "cpu-independent=1"  # else the same frames get other bits from time to time
    options = {"crf": str(codec.crf), "preset": codec.speed, "x264-params": repeatable}
    if codec.uneven_frames:
        stretch = codec.uneven_frames
        poor = range(stretch, _LONGEST, 2 * stretch)
        zones = "/".join(f"{first},{first + stretch - 1},b={_POOR}" for first in poor)
        options |= {"g": str(stretch), "x264-params": f"{repeatable}:zones={zones}"}
    return options


def _grey_picture(shape, pixel_format):
    """An av.VideoFrame of (height, width) whose colour planes are grey."""
    import av

    picture = av.VideoFrame(shape[1], shape[0], pixel_format)
    for plane in picture.planes[1:]:
        _fill(plane, 128)
    return picture


def _fill(plane, values):
    rows = np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size)
    rows[: plane.height, : plane.width] = values
