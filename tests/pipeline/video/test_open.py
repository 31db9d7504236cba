import os
import struct

import av
import cv2
import numpy as np
import pytest
import tifffile
from camera_files import cine, packed_tiff
from PIL import Image

from pipeline.errors import VideoError
from pipeline.video.base import bits_to_drop, to_8_bit
from pipeline.video.open import _looks, find_videos, natural_key, open_video
from pipeline.video.opencv import OpenCvVideo

CODEC_LOSS = 2.0  # grey levels, mean absolute difference at good quality


def picture(i, height=48, width=64):
    """A ramp with a bright block that moves by 2 px per frame; every frame is different."""
    image = np.add.outer(np.arange(height), np.arange(width)).astype(np.uint8) + 20
    image[10:20, (2 * i) % (width - 8) : (2 * i) % (width - 8) + 8] = 200
    return image


def write(path, n=60, codec="ffv1", pixels="gray", size=(48, 64), options=None, container=None):
    """Encode n pictures; returns them as they went in, uint8 (n, height, width)."""
    frames = np.stack([picture(i, *size) for i in range(n)])
    with av.open(str(path), "w", options=container or {}) as file:
        stream = file.add_stream(codec, rate=25, options=options or {})
        stream.height, stream.width, stream.pix_fmt = *size, pixels
        if codec in ("mjpeg", "mpeg4", "libvpx-vp9"):
            stream.bit_rate = 8_000_000
        for frame in frames:
            file.mux(stream.encode(video_frame(frame, pixels)))
        file.mux(stream.encode())
    return frames


def video_frame(image, pixels):
    """A frame that stores the grey levels as they are; FFmpeg's own conversion may scale them."""
    height, width = image.shape
    if pixels in ("gray", "bgr24", "bgr0"):
        return av.VideoFrame.from_ndarray(image, format="gray").reformat(format=pixels)
    frame = av.VideoFrame(width, height, pixels)
    packed = {"yuyv422": [image, 128], "uyvy422": [128, image]}.get(pixels)
    if packed is not None:
        pairs = np.stack(np.broadcast_arrays(*packed), axis=2).reshape(height, -1)
        contents = [pairs.astype(np.uint8)]
    else:
        grey = np.full((height // 2, width // 2), 128, np.uint8)
        contents = [image, grey, grey]
    for plane, content in zip(frame.planes, contents, strict=True):
        padded = np.zeros((content.shape[0], plane.line_size), np.uint8)
        padded[:, : content.shape[1]] = content
        plane.update(padded.tobytes())
    return frame


def read(path, **kwargs):
    with open_video(path, **kwargs) as video:
        return np.stack(list(video))


def error_of(path):
    with pytest.raises(VideoError) as caught:
        list(open_video(path))
    return caught.value


class TestContainers:
    @pytest.mark.parametrize("pixels", ["gray", "yuv420p", "bgr0"])
    def test_lossless_video_gives_the_stored_grey_levels(self, tmp_path, pixels):
        frames = write(tmp_path / "a.mkv", codec="ffv1", pixels=pixels)
        assert np.array_equal(read(tmp_path / "a.mkv"), frames)

    @pytest.mark.parametrize(
        ("suffix", "codec", "pixels"),
        [
            (".mp4", "libx264", "yuv420p"),
            (".mkv", "libx264", "yuv420p"),
            (".avi", "mjpeg", "yuvj420p"),
            (".avi", "mpeg4", "yuv420p"),
            (".webm", "libvpx-vp9", "yuv420p"),
        ],
    )
    def test_lossy_containers(self, tmp_path, suffix, codec, pixels):
        path = tmp_path / f"a{suffix}"
        frames = write(path, codec=codec, pixels=pixels)
        video = open_video(path)
        got = np.stack(list(video))
        assert video.shape == (48, 64)
        assert got.shape == frames.shape
        assert got.dtype == np.uint8
        assert np.abs(got.astype(int) - frames).mean() < CODEC_LOSS

    @pytest.mark.parametrize("between", [0, 2])
    def test_frames_made_out_of_others_are_reported(self, tmp_path, between):
        """With so many B frames between any two others, at fixed places."""
        fixed = {"x264-params": f"b-adapt=0:bframes={between}:scenecut=0", "g": "300"}
        write(tmp_path / "a.mp4", n=31, codec="libx264", pixels="yuv420p", options=fixed)
        video = open_video(tmp_path / "a.mp4")
        assert video.interpolated == set()
        assert len(list(video)) == 31
        assert video.interpolated == {i for i in range(31) if i % (between + 1)}

    @pytest.mark.parametrize("pixels", ["yuyv422", "uyvy422", "bgr24"])
    def test_packed_uncompressed_formats(self, tmp_path, pixels):
        frames = write(tmp_path / "a.avi", codec="rawvideo", pixels=pixels)
        assert np.abs(read(tmp_path / "a.avi").astype(int) - frames).max() <= 1

    def test_bottom_up_palette_avi_as_matlab_writes_it(self, tmp_path):
        frames = [picture(i) for i in range(5)]
        write_indexed_avi(tmp_path / "m.avi", frames)
        assert np.array_equal(read(tmp_path / "m.avi"), frames)

    @pytest.mark.parametrize(("dtype", "top"), [(np.uint8, 255), (np.uint16, 4095)])
    def test_cine_files_of_phantom_cameras(self, tmp_path, dtype, top):
        frames = np.random.default_rng(0).integers(0, top + 1, (7, 48, 64)).astype(dtype)
        (tmp_path / "a.CINE").write_bytes(cine(frames))
        expected = frames if top == 255 else frames >> 4
        assert find_videos([tmp_path]) == [tmp_path / "a.CINE"]
        with open_video(tmp_path / "a.CINE") as video:
            assert video.n_frames == 7
            assert np.array_equal(np.stack(list(video)), expected)
            assert not list(video.problems())
            (number, frame), *_ = video.some([5])
        assert number == 5
        assert np.array_equal(frame, expected[5])

    def test_a_cut_cine_file_gives_its_frames_and_then_says_so(self, tmp_path):
        frames = np.random.default_rng(0).integers(0, 255, (7, 48, 64)).astype(np.uint8)
        content = cine(frames)
        (tmp_path / "a.cine").write_bytes(content[: -frames[0].nbytes // 2])
        error = error_of(tmp_path / "a.cine")
        assert error.frame == 6
        assert "cut off" in error.problem

    @pytest.mark.parametrize("bits", [12, 16])
    def test_16_bit_video_is_scaled_the_same_in_all_frames(self, tmp_path, bits):
        top = 2**bits - 1
        with av.open(str(tmp_path / "a.mkv"), "w") as file:
            stream = file.add_stream("ffv1", rate=25)
            stream.height, stream.width, stream.pix_fmt = 48, 64, "gray16le"
            for i in range(40):
                image = np.full((48, 64), 16 * 2 ** (bits - 8), np.uint16)
                image[0, 0] = top if i >= 20 else 0  # the first frames alone look like fewer bits
                file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="gray16le")))
            file.mux(stream.encode())
        got = read(tmp_path / "a.mkv")
        assert set(got[:, 5, 5]) == {16}
        assert got[20, 0, 0] == 255

    def test_frames_may_be_written_to_and_kept(self, tmp_path):
        frames = write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=20)
        first, second = [], []
        for image in open_video(tmp_path / "a.mp4"):
            first.append(image.copy())
            second.append(image)
            assert image.flags.c_contiguous
        assert np.array_equal(first, second)
        second[3][:] = 0
        assert np.abs(second[4].astype(int) - frames[4]).mean() < CODEC_LOSS

    @pytest.mark.parametrize("width", [64, 84])  # rows without padding, and with
    def test_lent_frames_are_the_same_and_last(self, tmp_path, width):
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=60, size=(48, width))
        video = open_video(tmp_path / "a.mp4")
        lent = list(video.lent())
        assert np.array_equal(lent, list(video))
        assert all(image.flags.c_contiguous for image in lent)

    @pytest.fixture(params=[12, 1000])
    def video_80(self, tmp_path, request):
        """80 frames with a key frame every 12, and with one only."""
        options = {"g": str(request.param)}
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=80, options=options)
        return open_video(tmp_path / "a.mp4")

    def test_a_pass_may_start_anywhere(self, video_80):
        every = list(video_80)
        for start in (0, 1, 11, 12, 13, 50, 79):
            part = list(video_80.frames(start, start + 5))
            assert len(part) == min(5, 80 - start)
            assert np.array_equal(part, every[start : start + 5])

    def test_some_frames_are_those_of_a_full_pass(self, video_80):
        every = list(video_80)
        wanted = [79, 3, 4, 31, 30, 30, 11, 12, 0, 80]
        found = list(video_80.some(wanted))
        assert [number for number, _ in found] == [0, 3, 4, 11, 12, 30, 31, 79]
        for number, image in found:
            assert np.array_equal(image, every[number])

    def test_reading_starts_at_key_frames(self, video_80):
        with av.open(str(video_80.path)) as file:
            keys = [i for i, frame in enumerate(file.decode(video=0)) if frame.key_frame]
        wanted = [79, 0, 11, 12, 40]
        assert video_80.starts(wanted) == [max(k for k in keys if k <= n) for n in wanted]

    @pytest.mark.parametrize("threads", [0, 2])
    def test_threads_do_not_change_frames(self, tmp_path, threads):
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p")
        assert np.array_equal(read(tmp_path / "a.mp4"), read(tmp_path / "a.mp4", threads=threads))

    def test_two_passes_at_once(self, tmp_path):
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=20)
        video = open_video(tmp_path / "a.mp4")
        assert all(np.array_equal(a, b) for a, b in zip(video, video, strict=True))

    def test_what_only_opencv_opens(self, tmp_path):
        frames = write(tmp_path / "a.avi", codec="mjpeg", pixels="yuvj420p", n=30)
        video = OpenCvVideo(tmp_path / "a.avi", cv2.CAP_FFMPEG)
        got = np.stack(list(video))
        assert np.abs(got.astype(int) - frames).mean() < CODEC_LOSS
        assert np.array_equal(np.stack(list(video.frames(7, 9))), got[7:9])
        indices, some = video.sample(5)
        assert np.array_equal(some, got[indices])

    def test_impossible_range_is_named(self, tmp_path):
        write(tmp_path / "a.avi", n=3)
        with pytest.raises(ValueError, match=r"start, stop must be .* got 5, 2"):
            open_video(tmp_path / "a.avi").frames(5, 2)


class TestSample:
    @pytest.mark.parametrize(
        ("name", "codec", "options"),
        [
            ("many key frames.mp4", "libx264", {"g": "10"}),
            ("every frame a key.avi", "mjpeg", {}),
            ("one key frame.mp4", "libx264", {"g": "10000", "sc_threshold": "0"}),
            ("no times.h264", "libx264", {}),
        ],
    )
    def test_sampled_frames_are_those_of_a_full_pass(self, tmp_path, name, codec, options):
        pixels = "yuvj420p" if codec == "mjpeg" else "yuv420p"
        write(tmp_path / name, codec=codec, pixels=pixels, n=300, options=options)
        video = open_video(tmp_path / name)
        every = list(video)
        indices, frames = video.sample(16)
        assert 8 <= len(indices) <= 33
        assert indices[0] < 20
        assert indices[-1] > 220
        assert np.all(np.diff(indices) > 0)
        assert all(
            np.array_equal(every[i], frame) for i, frame in zip(indices, frames, strict=True)
        )

    def test_a_short_video_gives_all_it_has(self, tmp_path):
        frames = write(tmp_path / "a.avi", n=3)
        indices, some = open_video(tmp_path / "a.avi").sample(20)
        assert list(indices) == [0, 1, 2]
        assert np.array_equal(some, frames)

    def test_sampling_reads_only_a_small_part(self, tmp_path, monkeypatch):
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=600, options={"g": "50"})
        video = open_video(tmp_path / "a.mp4")
        decoded = 0
        index_of = video._index

        def counting(frame):
            nonlocal decoded
            decoded += 1
            return index_of(frame)

        monkeypatch.setattr(video, "_index", counting)
        monkeypatch.setattr(video, "_read", lambda *_: pytest.fail("read everything"))
        indices, _ = video.sample(24)
        assert decoded == len(indices)

    @pytest.mark.parametrize(("n", "offsets"), [(12, [0]), (36, [1, 2, 3])])
    def test_of_many_key_frames_those_behind_them_are_taken(self, tmp_path, n, offsets):
        options = {"g": "50", "sc_threshold": "0"}
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p", n=600, options=options)
        indices, _ = open_video(tmp_path / "a.mp4").sample(n)
        assert list(indices) == [key + i for key in range(0, 600, 50) for i in offsets]

    def test_a_damaged_end_still_leaves_a_sample(self, tmp_path):
        write(tmp_path / "a.avi", codec="mjpeg", pixels="yuvj420p", n=100)
        cut(tmp_path / "a.avi", 0.5)
        indices, _ = open_video(tmp_path / "a.avi").sample(10)
        assert 2 <= len(indices) <= 10
        assert indices[-1] < 60

    def test_impossible_number(self, tmp_path):
        write(tmp_path / "a.avi", n=3)
        with pytest.raises(ValueError, match="n must be at least 1, got 0"):
            open_video(tmp_path / "a.avi").sample(0)


def cut(path, share):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])


class TestBrokenFiles:
    @pytest.mark.parametrize(
        ("name", "codec", "pixels"),
        [("a.avi", "mjpeg", "yuvj420p"), ("a.avi", "mpeg4", "yuv420p"), ("a.mkv", "ffv1", "gray")],
    )
    @pytest.mark.parametrize("read", ["frames", "lent"])
    def test_cut_off_file_gives_its_frames_and_then_says_so(
        self, tmp_path, name, codec, pixels, read
    ):
        path = tmp_path / name
        write(path, codec=codec, pixels=pixels, n=100)
        cut(path, 0.6)
        good = []
        with pytest.raises(VideoError, match=r"cut off|damaged") as caught:
            good.extend(getattr(open_video(path), read)())
        assert 20 < len(good) < 80
        assert caught.value.frame == len(good)
        assert str(path) in str(caught.value)

    def test_mp4_without_index(self, tmp_path):
        write(tmp_path / "a.mp4", codec="libx264", pixels="yuv420p")
        cut(tmp_path / "a.mp4", 0.6)
        assert "no index" in str(error_of(tmp_path / "a.mp4"))

    def test_text_file_named_avi(self, tmp_path):
        (tmp_path / "notes.avi").write_text("Trial 7: the mouse licked.\n" * 50)
        message = str(error_of(tmp_path / "notes.avi"))
        assert "notes.avi" in message
        assert "text file beginning 'Trial 7: the mouse licked.'" in message

    def test_random_bytes_are_no_text(self, tmp_path):
        path = tmp_path / "a.mp4"
        path.write_bytes(np.random.default_rng(0).bytes(4000))
        assert "damaged or cut off" in str(error_of(path))

    def test_text_cut_within_a_character_is_still_text(self, tmp_path):
        path = tmp_path / "a.avi"
        path.write_bytes(("x" + "é" * 400).encode())
        assert "text file" in _looks(path, "Invalid data")

    @pytest.mark.parametrize("name", ["a.avi", "a.mp4", "a.cine", "a.seq", "a.tif", "a.png"])
    def test_empty_file(self, tmp_path, name):
        (tmp_path / name).touch()
        assert "as a video: the file is empty; copy" in str(error_of(tmp_path / name))

    def test_missing_file(self, tmp_path):
        assert "does not exist" in str(error_of(tmp_path / "a.avi"))

    def test_no_frames_at_all(self, tmp_path):
        with av.open(str(tmp_path / "a.avi"), "w") as file:
            stream = file.add_stream("mjpeg", rate=25)
            stream.height, stream.width, stream.pix_fmt = 48, 64, "yuvj420p"
            file.start_encoding()
        assert "a.avi: holds no frames" in str(error_of(tmp_path / "a.avi"))

    def test_frame_size_changes_half_way(self, tmp_path):
        small, large = tmp_path / "small.ts", tmp_path / "large.ts"
        write(small, codec="libx264", pixels="yuv420p", n=30)
        write(large, codec="libx264", pixels="yuv420p", n=20, size=(64, 96))
        path = tmp_path / "both.ts"
        path.write_bytes(small.read_bytes() + large.read_bytes())
        good = []
        with pytest.raises(VideoError, match=r"frame 30 is 96×64 px.*64×48") as caught:
            good.extend(open_video(path))
        assert len(good) == caught.value.frame == 30

    def test_errors_travel_between_processes(self):
        import pickle

        error = pickle.loads(pickle.dumps(VideoError("a.avi", "is broken", 7)))
        assert (str(error), error.path, error.frame) == ("a.avi: is broken", "a.avi", 7)


def write_indexed_avi(path, frames):
    """Write an uncompressed AVI of 8-bit palette indices, rows bottom-up."""
    height, width = frames[0].shape
    palette = b"".join(struct.pack("4B", i, i, i, 0) for i in range(256))
    bitmap = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 8, 0, width * height, 0, 0, 256, 0)
    main = struct.pack(
        "<14I", 40000, 0, 0, 0x10, len(frames), 0, 1, width * height, width, height, 0, 0, 0, 0
    )
    stream = struct.pack("<4s4sIIIIIIIIIII", b"vids", b"DIB ", *[0] * 3, 1, 25, 0, len(frames),
                         width * height, 0, 0, 0)  # fmt: skip
    stream += struct.pack("<4h", 0, 0, width, height)
    stream_list = chunk(
        b"LIST", b"strl" + chunk(b"strh", stream) + chunk(b"strf", bitmap + palette)
    )
    headers = chunk(b"LIST", b"hdrl" + chunk(b"avih", main) + stream_list)
    data = b"".join(chunk(b"00db", frame[::-1].tobytes()) for frame in frames)
    path.write_bytes(chunk(b"RIFF", b"AVI " + headers + chunk(b"LIST", b"movi" + data)))


def chunk(name, data):
    return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


class TestTiffStacks:
    @pytest.mark.parametrize("how", ["pages", "volume", "compressed", "big"])
    def test_stack_gives_its_pages(self, tmp_path, how):
        frames = np.stack([picture(i) for i in range(20)])
        options = {
            "pages": {"metadata": None},
            "volume": {},
            "compressed": {"compression": "zlib", "metadata": None},
            "big": {"bigtiff": True},
        }[how]
        with tifffile.TiffWriter(
            tmp_path / "a.tif", bigtiff=options.pop("bigtiff", False)
        ) as writer:
            writer.write(frames, photometric="minisblack", **options)
        video = open_video(tmp_path / "a.tif")
        assert (video.n_frames, video.shape) == (20, (48, 64))
        assert np.array_equal(list(video), frames)
        assert np.array_equal(list(video.frames(3, 5)), frames[3:5])
        indices, some = video.sample(7)
        assert np.array_equal(some, frames[indices])

    def test_imagej_hyperstack(self, tmp_path):
        frames = np.stack([picture(i) for i in range(10)])
        tifffile.imwrite(tmp_path / "a.tif", frames, imagej=True)
        assert np.array_equal(read(tmp_path / "a.tif"), frames)

    @pytest.mark.parametrize("byteorder", "<>")
    @pytest.mark.parametrize("cut", [False, True])
    def test_a_volume_behind_one_page_as_imagej_writes_beyond_4_gb(self, tmp_path, byteorder, cut):
        frames = np.stack([picture(i).astype(np.uint16) * 16 for i in range(10)])
        path = tmp_path / "a.tif"
        tifffile.imwrite(path, frames, imagej=True, byteorder=byteorder)
        with tifffile.TiffFile(path) as tiff:
            end = tiff.pages.first.offset + 2 + 12 * len(tiff.pages.first.tags)
            start = tiff.series[0].dataoffset
        data = bytearray(path.read_bytes())
        data[end : end + 4] = bytes(4)  # no further page
        path.write_bytes(data)
        with open_video(path) as video:
            assert video.n_frames == 10
            read = iter(video)
            assert np.array_equal(next(read), frames[0] // 16)
            if not cut:
                assert np.array_equal(list(read), frames[1:] // 16)
                return
            os.truncate(path, start + 2 * 2 * 48 * 64)
            with pytest.raises(VideoError, match=r"page 2 cannot be read \(the file ends"):
                list(read)

    def test_12_bits_in_16_keep_their_contrast(self, tmp_path):
        frames = np.stack([picture(i).astype(np.uint16) * 16 for i in range(5)])
        tifffile.imwrite(tmp_path / "a.tif", frames, photometric="minisblack")
        assert np.array_equal(read(tmp_path / "a.tif"), frames // 16)

    def test_colour_pages(self, tmp_path):
        frames = np.stack([picture(i) for i in range(4)])
        rgb = np.repeat(frames[..., None], 3, axis=3)
        tifffile.imwrite(tmp_path / "a.tif", rgb, photometric="rgb", metadata=None)
        assert np.array_equal(read(tmp_path / "a.tif"), frames)

    def test_single_page(self, tmp_path):
        tifffile.imwrite(tmp_path / "a.tif", picture(3))
        assert np.array_equal(read(tmp_path / "a.tif"), [picture(3)])

    def test_page_of_another_size(self, tmp_path):
        with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
            for i in range(4):
                writer.write(picture(i), metadata=None)
            writer.write(picture(4, 50, 60), metadata=None)
        error = error_of(tmp_path / "a.tif")
        assert error.frame == 4
        assert "frame 4 is 60×50 px" in str(error)

    def test_cut_off_stack(self, tmp_path):
        with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
            for i in range(20):
                writer.write(picture(i), metadata=None)
        cut(tmp_path / "a.tif", 0.6)
        error = error_of(tmp_path / "a.tif")
        assert "a.tif" in str(error)

    @pytest.mark.parametrize("kind", ["tiff_lzw", "packbits", "tiff_adobe_deflate"])
    @pytest.mark.parametrize("colour", [False, True])
    def test_compressed_pages(self, tmp_path, kind, colour):
        frames = np.stack([picture(i) for i in range(4)])
        pages = [Image.fromarray(frame).convert("RGB" if colour else "L") for frame in frames]
        several = {"save_all": True, "append_images": pages[1:], "compression": kind}
        pages[0].save(tmp_path / "a.tif", **several)
        assert np.array_equal(read(tmp_path / "a.tif"), frames)
        with open_video(tmp_path / "a.tif") as video:
            assert np.array_equal(next(video.frames(2)), frames[2])

    def test_compressed_pages_of_16_bits(self, tmp_path):
        frames = [picture(i).astype(np.uint16) * 200 for i in range(3)]
        cv2.imwritemulti(str(tmp_path / "a.tif"), frames)  # LZW
        assert np.array_equal(read(tmp_path / "a.tif"), np.stack(frames) >> 8)

    def test_no_tiff(self, tmp_path):
        (tmp_path / "a.tif").write_text("hello")
        assert "damaged or not a TIFF file" in str(error_of(tmp_path / "a.tif"))

    def test_floating_point_pixels_are_refused_with_advice(self, tmp_path):
        tifffile.imwrite(tmp_path / "a.tif", picture(0).astype(np.float32))
        assert "float32 pixels: expected unsigned 8 or 16 bit" in str(error_of(tmp_path / "a.tif"))


class TestImageFolders:
    def test_natural_order(self, tmp_path):
        for i in range(12):
            cv2.imwrite(str(tmp_path / f"frame{i}.png"), picture(i))
        assert np.array_equal(read(tmp_path), [picture(i) for i in range(12)])

    def test_16_bit_images(self, tmp_path):
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i).astype(np.uint16) * 256)
        assert np.array_equal(read(tmp_path), [picture(i) for i in range(3)])

    def test_one_image_alone(self, tmp_path):
        cv2.imwrite(str(tmp_path / "a.png"), picture(0))
        assert np.array_equal(read(tmp_path / "a.png"), [picture(0)])

    def test_name_outside_ascii(self, tmp_path):
        folder = tmp_path / "Mäuse 3µm"
        folder.mkdir()
        (folder / "é.png").write_bytes(cv2.imencode(".png", picture(0))[1].tobytes())
        assert np.array_equal(read(folder), [picture(0)])

    def test_differing_sizes(self, tmp_path):
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
        cv2.imwrite(str(tmp_path / "3.png"), picture(3, 40, 60))
        error = error_of(tmp_path)
        assert error.frame == 3
        assert "frame 3 is 60×40 px" in str(error)

    def test_damaged_image(self, tmp_path):
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
        (tmp_path / "2.png").write_bytes(b"no image")
        error = error_of(tmp_path)
        assert (error.frame, "2.png" in str(error)) == (2, True)

    def test_nothing_is_printed_of_an_image_that_is_cut_off(self, tmp_path, capfd):
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
        path = tmp_path / "1.png"
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        assert len(read(tmp_path)) == 3
        assert capfd.readouterr() == ("", "")

    def test_preview_and_other_kinds_are_no_frames(self, tmp_path):
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
        cv2.imwrite(str(tmp_path / "session_preview.png"), picture(0, 10, 10))
        with open_video(tmp_path) as video:
            assert not video.notes
        cv2.imwrite(str(tmp_path / "photo.jpg"), picture(0, 10, 10))
        assert len(read(tmp_path)) == 3
        with open_video(tmp_path) as video:
            (said,) = video.notes
        assert "1 image of another kind left out (photo.jpg): " in said
        assert "here .png; convert" in said

    @pytest.mark.parametrize("other", [["ruler.png"], ["camB_0001.png", "camB_0002.png"]])
    def test_images_of_another_name_are_no_frames_and_named(self, tmp_path, other):
        for i, name in enumerate([f"camA_{k:04}.png" for k in range(3)] + other):
            cv2.imwrite(str(tmp_path / name), picture(i))
        with open_video(tmp_path) as video:
            (said,) = video.notes
        assert len(read(tmp_path)) == 3
        assert f"{len(other)} image" in said
        assert f"left out ({other[0]}" in said
        assert "here camA_0000.png, …; rename them" in said

    def test_names_without_a_pattern_are_all_frames(self, tmp_path):
        for i, name in enumerate("abc"):
            cv2.imwrite(str(tmp_path / f"{name}.png"), picture(i))
        with open_video(tmp_path) as video:
            assert not video.notes
        assert len(read(tmp_path)) == 3

    def test_cameras_with_numbers_are_said_where_their_images_begin(self, tmp_path):
        for i, name in enumerate(["cam1_0001", "cam1_0002", "cam2_0001", "cam2_0002"]):
            cv2.imwrite(str(tmp_path / f"{name}.png"), picture(i))
        with open_video(tmp_path) as video:
            (said,) = video.notes
        assert "begin again at cam2_0001.png: if other cameras" in said

    def test_times_in_names_are_no_cameras(self, tmp_path):
        for i, name in enumerate(["t_05_998", "t_05_999", "t_06_000", "t_06_001"]):
            cv2.imwrite(str(tmp_path / f"{name}.png"), picture(i))
        with open_video(tmp_path) as video:
            assert not video.notes

    def test_a_folder_of_videos_is_no_video(self, tmp_path):
        (tmp_path / "session.toml").touch()
        (tmp_path / "trial.avi").touch()
        assert "is a folder of videos: name one, such as trial.avi" in str(error_of(tmp_path))

    def test_endings_of_one_kind_are_spelt_in_two_ways(self, tmp_path):
        for i in range(4):
            cv2.imwrite(str(tmp_path / f"{i}.{'tif' if i % 2 else 'tiff'}"), picture(i))
        assert len(read(tmp_path)) == 4

    def test_empty_folder(self, tmp_path):
        assert "is an empty folder" in str(error_of(tmp_path))

    def test_folder_of_other_things(self, tmp_path):
        (tmp_path / "session.toml").touch()
        assert "neither videos nor images (only session.toml)" in str(error_of(tmp_path))


class TestFindVideos:
    def test_videos_of_a_folder_in_natural_order(self, tmp_path):
        for name in ("t10.avi", "t9.avi", "T1.MP4", "notes.txt", "session.toml", ".hidden.avi"):
            (tmp_path / name).write_text("x")
        found = [path.name for path in find_videos([tmp_path])]
        assert found == ["T1.MP4", "t9.avi", "t10.avi"]

    def test_results_and_other_programs_files_are_left_out(self, tmp_path):
        for name in ("a.avi", "a_overlay.mp4", "aDLC_resnet50_xshuffle1_1000_labeled.mp4"):
            (tmp_path / name).write_text("x")
        for name in ("a.whiskers", "a.measurements", "a.h5", "session_preview.png"):
            (tmp_path / name).write_text("x")
        (tmp_path / "truth" / "a").mkdir(parents=True)
        results = tmp_path / "results"
        results.mkdir()
        (results / "videos.csv").touch()
        cv2.imwrite(str(results / "overlay.png"), picture(0))
        assert [path.name for path in find_videos([tmp_path])] == ["a.avi"]
        for single in (tmp_path, str(tmp_path)):
            assert find_videos(single) == find_videos([tmp_path])

    def test_each_input_once(self, tmp_path):
        (tmp_path / "a.avi").write_text("x")
        again = tmp_path / "." / "a.avi"
        assert len(find_videos([tmp_path, tmp_path / "a.avi", again])) == 1

    def test_a_folder_of_images_is_one_video(self, tmp_path):
        for folder in ("trial1", "trial2"):
            (tmp_path / folder).mkdir()
            cv2.imwrite(str(tmp_path / folder / "0.png"), picture(0))
        assert find_videos([tmp_path / "trial1"]) == [tmp_path / "trial1"]
        assert [path.name for path in find_videos([tmp_path])] == ["trial1", "trial2"]

    def test_stacks_are_videos_and_single_pages_frames(self, tmp_path):
        stacks, pages = tmp_path / "stacks", tmp_path / "pages"
        for folder, content in ((stacks, np.stack([picture(0)] * 2)), (pages, picture(0))):
            folder.mkdir()
            for i in range(2):
                tifffile.imwrite(folder / f"{i}.tif", content, photometric="minisblack")
        assert [path.name for path in find_videos([stacks])] == ["0.tif", "1.tif"]
        assert find_videos([pages]) == [pages]

    def test_an_empty_folder_is_an_input_that_fails(self, tmp_path):
        (tmp_path / "empty").mkdir()
        (tmp_path / "a.avi").write_text("x")
        assert [path.name for path in find_videos([tmp_path])] == ["a.avi", "empty"]
        assert find_videos([tmp_path / "empty"]) == [tmp_path / "empty"]

    def test_missing_path(self, tmp_path):
        with pytest.raises(VideoError, match="does not exist"):
            find_videos([tmp_path / "nowhere"])

    def test_natural_key(self, tmp_path):
        names = ["b2", "a10", "a9", "a9b", "1", "a"]
        ordered = sorted((tmp_path / name for name in names), key=natural_key)
        assert [path.name for path in ordered] == ["1", "a", "a9", "a9b", "a10", "b2"]


class TestBitDepth:
    @pytest.mark.parametrize(
        ("largest", "drop"),
        [(0, 0), (255, 0), (256, 2), (1023, 2), (4095, 4), (16383, 6), (65535, 8)],
    )
    def test_least_depth_that_holds(self, largest, drop):
        assert bits_to_drop(largest) == drop

    def test_later_frames_are_clipped_not_wrapped(self):
        assert to_8_bit(np.array([[5000]], np.uint16), 4)[0, 0] == 255


@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("width", [31, 32])
def test_tiff_with_packed_pixels(tmp_path, bits, width):
    rng = np.random.default_rng(bits)
    frames = rng.integers(0, 1 << bits, (3, 5, width)).astype(np.uint16)
    frames[0, 0, 0] = (1 << bits) - 1
    (tmp_path / "a.tif").write_bytes(packed_tiff(frames, bits))
    np.testing.assert_array_equal(read(tmp_path / "a.tif"), frames >> (bits - 8))
