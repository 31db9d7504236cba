"""Every codec read back: number of frames and grey levels."""

import av
import cv2
import numpy as np
import pytest
import tifffile

from synthetic.encode import video_suffix, write_video
from synthetic.scene import Codec

# SD of decoded − rendered grey on a picture with noise of SD 1: lossy codecs smooth the noise
loss_sd = {"ffv1": 0.0, "h264": 1.5, "mjpeg": 1.5}
bias_tolerance = 0.1  # grey levels: limited range would stretch by 9 %


@pytest.fixture(scope="module")
def frames():
    rng = np.random.default_rng(0)
    ramp = np.linspace(3, 250, 96)[None, :] + np.zeros((70, 1))
    return [
        np.clip(ramp + 3 * (k % 2) + rng.normal(0, 1, ramp.shape), 0, 255).astype(np.uint8)
        for k in range(12)
    ]


@pytest.mark.parametrize(
    "codec", [Codec("ffv1"), Codec("h264"), Codec("h264", speed="ultrafast"), Codec("mjpeg")]
)
def test_round_trip(tmp_path, frames, codec):
    path = tmp_path / f"video{video_suffix(codec)}"
    assert write_video(path, frames, codec) == len(frames)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    for decode in (by_luma_plane, by_grey_conversion, by_opencv):
        decoded = decode(path)
        assert len(decoded) == len(frames)
        difference = np.stack(decoded).astype(float) - np.stack(frames)
        assert abs(difference.mean()) < bias_tolerance
        assert difference.std() <= loss_sd[codec.name]


def test_the_same_frames_become_the_same_video_each_time(tmp_path):
    rng = np.random.default_rng(1)
    moving = []
    for k in range(10):
        picture = np.full((500, 720), 180.0)
        for whisker in range(24):
            start, end = (700, 20 + 20 * whisker), (60 + 3 * k, 250 + 6 * whisker + 5 * k)
            cv2.line(picture, start, end, 90, 2, cv2.LINE_AA)
        noisy = cv2.GaussianBlur(picture, (0, 0), 1.2) + rng.normal(0, 2, picture.shape)
        moving.append(np.clip(noisy, 0, 255).astype(np.uint8))
    path, seen = tmp_path / "video.mp4", set()
    for _ in range(12):
        write_video(path, moving, Codec("h264", crf=17, speed="veryfast"))
        seen.add(np.stack(by_luma_plane(path)).tobytes())
    assert len(seen) == 1


def test_uneven_quality_changes_from_stretch_to_stretch(tmp_path):
    rng, stretch = np.random.default_rng(1), 10
    still = np.clip(128 + np.cumsum(rng.normal(0, 3, (64, 96)), axis=1), 0, 255)
    frames = [
        np.clip(still + rng.normal(0, 2, still.shape), 0, 255).astype(np.uint8) for _ in range(40)
    ]
    loss = {}
    for uneven in (0, stretch):
        path = tmp_path / f"{uneven}.mp4"
        write_video(path, frames, Codec("h264", crf=10, uneven_frames=uneven))
        difference = np.stack(by_luma_plane(path)).astype(float) - np.stack(frames)
        loss[uneven] = difference.reshape(4, stretch, -1).std(axis=(1, 2))
        with av.open(str(path)) as container:
            keys = [k for k, frame in enumerate(container.decode(video=0)) if frame.key_frame]
        assert keys == ([0, 10, 20, 30] if uneven else [0])
    assert loss[stretch][1::2].min() > 1.3 * loss[stretch][::2].max()
    assert loss[0].max() < 1.15 * loss[0].min()


def by_luma_plane(path):
    with av.open(str(path)) as container:
        planes = [(f.planes[0], f.height, f.width) for f in container.decode(video=0)]
        return [
            np.frombuffer(p, np.uint8).reshape(-1, p.line_size)[:height, :width].copy()
            for p, height, width in planes
        ]


def by_grey_conversion(path):
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]


def by_opencv(path):
    capture, frames = cv2.VideoCapture(str(path)), []
    while (read := capture.read())[0]:
        frames.append(read[1][..., 1])
    return frames


def test_tiff_is_exact(tmp_path, frames):
    path = tmp_path / "stack.tif"
    write_video(path, frames, Codec("tiff"))
    assert np.array_equal(tifffile.imread(path), np.stack(frames))


def test_a_failing_source_leaves_no_file(tmp_path, frames):
    def source():
        yield frames[0]
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError):
        write_video(tmp_path / "video.mp4", source(), Codec("h264"))
    assert list(tmp_path.iterdir()) == []


def test_bad_arguments_are_named(tmp_path, frames):
    with pytest.raises(ValueError, match=r"must end with \.mp4"):
        write_video(tmp_path / "video.avi", frames, Codec("h264"))
    with pytest.raises(ValueError, match="at least one frame"):
        write_video(tmp_path / "video.avi", [], Codec("ffv1"))
    with pytest.raises(ValueError, match="frame 1 must be uint8"):
        write_video(tmp_path / "video.avi", [frames[0], frames[0][:5]], Codec("ffv1"))
    with pytest.raises(ValueError, match=r"even height and width for h264, got 69 × 96 px"):
        write_video(tmp_path / "video.mp4", [frames[0][:69]], Codec("h264"))
    with pytest.raises(ValueError, match="name must be one of"):
        Codec("vp9")
    with pytest.raises(ValueError, match="speed must be one of"):
        Codec("h264", speed="quick")
