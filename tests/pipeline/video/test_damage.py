"""Cut, damaged and incomplete inputs: an error or a sentence says so, never silence."""

import contextlib
import errno
import threading
from fractions import Fraction
from itertools import islice

import av
import cv2
import numpy as np
import pytest
import tifffile

from pipeline.errors import VideoError
from pipeline.run import analyse
from pipeline.session.session_file import read_session, settings_from
from pipeline.video import base
from pipeline.video.containers import ContainerVideo, check_memory, reason_of
from pipeline.video.decoder_log import SILENT, decoder_log
from pipeline.video.endings import is_cut
from pipeline.video.frame_faults import FrameFaults, is_black, missing_numbers
from pipeline.video.image_stacks import grey, is_stack
from pipeline.video.open import find_videos, open_video
from synthetic.encode import write_video
from synthetic.scene import Codec

SIZE = (96, 128)  # px
FRAMES = 40


def picture(i, noise=True):
    """A dark line that swings, and the camera's noise."""
    rng = np.random.default_rng(i)
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    line = 80 * np.exp(-((y - 48 - 15 * np.sin(i / 5) - 0.1 * x) ** 2) / 8)
    return (200 - line + noise * rng.normal(0, 2, SIZE)).clip(0, 255).astype(np.uint8)


def write(path, codec, pixels="yuv420p", images=None, times=None, options=None, header_rate=25):
    """A video of 25 frames per second, or with a frame at each of the `times` [1/25 s]."""
    images = [picture(i) for i in range(FRAMES)] if images is None else images
    with av.open(str(path), "w") as file:
        stream = file.add_stream(codec, rate=header_rate, options=options or {})
        stream.height, stream.width, stream.pix_fmt = *SIZE, pixels
        stream.codec_context.time_base = Fraction(1, 25)
        for i, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="gray").reformat(format=pixels)
            frame.pts = i if times is None else times[i]
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    return path


def cut(path, share):
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])


def problems_of(path, **options):
    """What is said of an input that can be read to its end."""
    with open_video(path, **options) as video:
        assert sum(1 for _ in video.watched()) > 0
        return list(video.problems())


CONTAINERS = [
    ("a.mkv", "libx264", "yuv420p"),
    ("a.webm", "libvpx-vp9", "yuv420p"),
    ("a.mxf", "mpeg2video", "yuv420p"),
    ("a.wmv", "wmv2", "yuv420p"),
    ("a.gif", "gif", "rgb8"),
    ("a.y4m", "wrapped_avframe", "yuv420p"),
    ("a.avi", "libx264", "yuv420p"),
    ("a.ts", "libx264", "yuv420p"),
    ("a.mpg", "mpeg2video", "yuv420p"),
]


@pytest.mark.parametrize(("name", "codec", "pixels"), CONTAINERS)
def test_a_file_that_lacks_its_end_is_not_taken_for_whole(tmp_path, name, codec, pixels):
    path = write(tmp_path / name, codec, pixels)
    assert problems_of(path) == []
    whole = path.read_bytes()
    for share in (0.9, 0.5):
        path.write_bytes(whole[: int(share * len(whole))])
        if name == "a.mpg" and share == 0.9:
            continue  # what it lacks is padding
        with pytest.raises(VideoError, match=r"cut off|damaged") as caught:
            list(open_video(path))
        assert name in str(caught.value)


@pytest.mark.parametrize(
    ("name", "codec", "pixels"),
    [
        ("a.avi", "rawvideo", "gray"),
        ("a.avi", "ffv1", "gray"),
        ("a.avi", "mjpeg", "yuvj420p"),
        ("a.mkv", "libx264", "yuv420p"),
        ("a.mxf", "mpeg2video", "yuv420p"),
        ("a.gif", "gif", "rgb8"),
        ("a.y4m", "wrapped_avframe", "yuv420p"),
    ],
)
def test_the_frames_before_a_cut_can_be_used(tmp_path, name, codec, pixels):
    path = write(tmp_path / name, codec, pixels)
    whole = list(open_video(path))
    cut(path, 0.6)
    with open_video(path) as video:
        read = [frame.copy() for frame in video.watched()]
        first, *_ = video.problems()
    assert 0.3 * FRAMES < len(read) < 0.7 * FRAMES
    assert all(map(np.array_equal, read, whole))
    assert "cut off or damaged; copy it again" in first
    assert first.endswith(f"; until then, results are of {len(read)} frames only")
    assert video.faults.damaged <= {0, len(read) - 1}  # at 0, that of the container


def spoil(path, *packets):
    """Overwrite the data of some packets, numbered in the order in which they are stored."""
    with av.open(str(path)) as file:
        stored = [packet for packet in file.demux(video=0) if packet.size]
        spans = [(stored[k].pos + 8, stored[k].pos + stored[k].size) for k in packets]
    content = bytearray(path.read_bytes())
    for start, stop in spans:
        content[start:stop] = bytes(37 * i % 251 for i in range(stop - start))
    path.write_bytes(content)


# a key frame in ten, and two frames between others that are made from them
GROUPS = {"g": "10", "bf": "2", "x264-params": "b-adapt=0:scenecut=0:b-pyramid=none"}
BROKEN = [  # container, codec, pixels, broken packet, frames that are lost with it, and changed
    ("a.avi", "mjpeg", "yuvj420p", 0, [0], []),
    ("a.avi", "mjpeg", "yuvj420p", 15, [15], []),
    ("a.mov", "png", "gray", 0, [0], []),
    ("a.avi", "ffv1", "gray", 0, list(range(12)), []),
    ("a.avi", "ffv1", "gray", 20, [20], [21, 22, 23]),
    ("a.mkv", "libx264", "yuv420p", 0, list(range(10)), []),
    ("a.mp4", "libx264", "yuv420p", 0, list(range(10)), []),
    ("a.mp4", "libx264", "yuv420p", 20, list(range(20, 29)), [29]),
]


@pytest.mark.parametrize("threads", [1, 8])
@pytest.mark.parametrize(("name", "codec", "pixels", "packet", "lost", "changed"), BROKEN)
def test_a_broken_frame_costs_itself_alone(
    tmp_path, name, codec, pixels, packet, lost, changed, threads
):
    """All others keep their numbers, also those before the first one that can be read."""
    options = GROUPS if codec == "libx264" else {}
    path = write(tmp_path / name, codec, pixels, options=options)
    whole = list(open_video(path))
    spoil(path, packet)
    with open_video(path, threads=threads) as video:
        read = [frame.copy() for frame in video.watched()]
        damaged, said = video.faults.damaged, list(video.problems())
        sampled = [frame.max() for _, frame in video.sampled(20)]
        some = [number for number, _ in video.some([lost[0], 35])]
        assert np.array_equal(next(video.frames(35)), whole[35])
    others = [not np.array_equal(*pair) for pair in zip(read, whole, strict=True)]
    assert np.flatnonzero(others).tolist() == lost + changed
    assert [i for i, frame in enumerate(read) if not frame.any()] == lost
    assert set(lost) <= damaged
    assert min(damaged) >= lost[0] - 1
    assert len(said) == 1 + any(is_black(read[i]) for i in changed)  # which is said by itself
    assert "trust no contact there" in said[0]
    assert min(sampled) > 0
    assert some == [35]


def test_a_broken_frame_never_spoils_those_before_it(tmp_path):
    """FFmpeg's threads, each with a frame of its own, spoil them in most passes over this file."""
    path = write(tmp_path / "a.avi", "ffv1", "gray")
    whole = list(open_video(path))[:20]
    spoil(path, 20)
    for _ in range(20):
        with open_video(path, threads=8) as video:
            assert np.array_equal([frame.copy() for frame in islice(video, 20)], whole)


def test_a_broken_frame_that_is_stored_last_but_shown_before_is_not_the_end(tmp_path):
    path = write(tmp_path / "a.mp4", "libx264", options=GROUPS)
    spoil(path, FRAMES - 1)
    (said,) = problems_of(path)
    assert said.startswith(f"damaged at or near frame {FRAMES - 2}: copy the video again")


@pytest.mark.e2e
def test_results_of_a_video_whose_first_frames_are_broken(video, rendered, tmp_path):
    settings = read_session(rendered / "session.toml")
    path = tmp_path / "a.avi"
    write_video(path, open_video(video).frames(0, 120), Codec("ffv1"))  # a key frame in twelve
    whole = analyse(path, settings)
    spoil(path, 0)
    found = analyse(path, settings)
    assert len(found.frames) == len(whole.frames) == 120
    assert len(whole.contacts) >= 3
    lost = found.frames.loc[~found.frames["tracked"], "frame"]
    assert set(lost) - set(whole.frames.loc[~whole.frames["tracked"], "frame"]) == set(range(12))
    assert "damaged at or near frames 0–11" in found.messages[0]
    for column in ("onset_frame", "offset_frame"):
        assert found.contacts[column].tolist() == whole.contacts[column].tolist()
    peaks = found.contacts["peak_force_uN"], whole.contacts["peak_force_uN"]
    np.testing.assert_allclose(*peaks, rtol=0.02)


@pytest.mark.parametrize(
    ("name", "codec", "pixels"), [("a.mp4", "libx264", "yuv420p"), ("a.avi", "mjpeg", "yuvj420p")]
)
def test_where_no_frame_can_be_decoded_the_file_is_named(tmp_path, name, codec, pixels):
    path = write(tmp_path / name, codec, pixels)
    spoil(path, *range(FRAMES))
    with pytest.raises(VideoError, match=r"none of its frames can be decoded .* copy it again"):
        open_video(path)


def test_where_the_times_do_not_number_the_frames_a_broken_one_is_the_end(tmp_path):
    """AVI files hold frames that refer to later ones in another order, without their times."""
    path = write(tmp_path / "a.avi", "libx264", options=GROUPS)
    spoil(path, 15)
    with open_video(path) as video:
        read = sum(1 for _ in video.watched())
        first, *_ = video.problems()
    assert 10 <= read <= 15
    assert first.startswith(f"frame {read} cannot be decoded")


def test_an_image_that_cannot_be_read_costs_itself_alone(tmp_path):
    for i in range(5):
        cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
    for i in (0, 2):
        (tmp_path / f"{i}.png").write_bytes(b"")
    with open_video(tmp_path) as video:
        assert [bool(frame.any()) for frame in video.watched()] == [False, True, False, True, True]
        (said,) = video.problems()
        assert [number for number, _ in video.some(range(5))] == [1, 3, 4]
    assert said.startswith("damaged at or near frames 0, 2: copy the video again")


def test_where_no_image_can_be_read_there_is_an_error(tmp_path):
    for i in range(3):
        cv2.imwrite(str(tmp_path / f"{i}.png"), picture(i))
    with open_video(tmp_path) as video:
        for i in range(3):
            (tmp_path / f"{i}.png").write_bytes(b"")
        with pytest.raises(VideoError, match=r"0\.png cannot be read"):
            list(video.watched())


LAST_BYTES = (0.999, 0.99, 0.97, 0.7, 0.3)  # shares that are left of a file
WITH_LENGTH = [c for c in CONTAINERS if c[0] != "a.mpg"]  # which does not say how long it is
WITH_LENGTH += [(f"a.{end}", "libx264", "yuv420p") for end in ("mp4", "mov")]


@pytest.mark.parametrize(("name", "codec", "pixels"), WITH_LENGTH)
def test_no_frame_is_lost_in_silence_wherever_a_file_is_cut(tmp_path, name, codec, pixels):
    path = write(tmp_path / name, codec, pixels)
    whole, kept = path.read_bytes(), []
    for share in LAST_BYTES:
        path.write_bytes(whole[: int(share * len(whole))])
        with contextlib.suppress(VideoError), open_video(path) as video:
            frames = sum(1 for _ in video.watched())
            kept.append((frames == FRAMES, any(video.problems())))
    assert all(whole or said for whole, said in kept)
    assert len(kept) < len(LAST_BYTES) or any(said for _, said in kept)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 0])
def test_flipped_bits_are_heard_from_the_decoder(tmp_path, threads):
    """Three in the pictures: the decoder guesses and goes on."""
    path = write(tmp_path / "a.avi", "libx264", options={"crf": "12"})
    good = np.stack(list(open_video(path)))
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    silent = changed = failed = 0
    for _ in range(20):
        bad = bytearray(content)
        for at in rng.integers(len(bad) // 4, len(bad) * 3 // 4, 3):
            bad[at] ^= 1 << rng.integers(8)
        path.write_bytes(bad)
        try:
            said = problems_of(path, threads=threads)
            images = np.stack(list(open_video(path)))
        except VideoError:
            failed += 1
            continue
        if images.shape != good.shape or (images != good).any():
            changed += 1
            silent += not any("damaged at or near frame" in each for each in said)
    assert changed > 0
    assert changed + failed > 10
    assert silent <= 1


@pytest.mark.slow
def test_damaged_videos_can_be_read_from_several_threads_that_all_decode_in_threads(tmp_path):
    """A decoder was freed while its threads waited to log: none of them went on, ever."""
    path = write(tmp_path / "a.avi", "libx264", options={"crf": "12", "g": "10"})
    damaged = bytearray(path.read_bytes())
    for at in np.random.default_rng(0).integers(len(damaged) // 4, len(damaged), 200):
        damaged[at] ^= 8
    path.write_bytes(damaged)
    threads = [threading.Thread(target=_read_in_parts, args=(path,)) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def _read_in_parts(path):
    for i in range(30):
        with contextlib.suppress(VideoError), open_video(path, threads=0) as video:
            frames = video.frames(i % 20)
            for _ in range(i % 7):
                next(frames, None)
            frames.close()


def test_passes_read_the_decoders_log_and_end_in_any_order():
    first, second = decoder_log(), decoder_log()
    one, two = first.__enter__(), second.__enter__()
    with pytest.raises(av.FFmpegError):
        av.open(b"nothing".hex() + "/nowhere.avi")
    thread = threading.Thread(target=lambda: _log("from another thread"))
    thread.start()
    thread.join()
    assert "from another thread" in one.new()
    first.__exit__(None, None, None)
    _log("later")
    assert two.new()[-2:] == ["from another thread", "later"]
    second.__exit__(None, None, None)
    assert av.logging.get_level() == SILENT


def _log(text):
    av.logging.log(av.logging.ERROR, "test", text)


TIFFS = {
    "plain": {},
    "imagej": {"imagej": True},
    "ome": {"ome": True},
    "big": {"bigtiff": True},
    "zlib": {"compression": "zlib"},
}


@pytest.mark.parametrize("kind", TIFFS)
@pytest.mark.parametrize("share", [0.98, 0.5, 0.2])
def test_a_cut_tiff_stack_is_an_input_that_fails(tmp_path, kind, share):
    stack = np.stack([picture(i) for i in range(FRAMES)])
    names = [tmp_path / f"trial{k}.tif" for k in range(3)]
    for path in names:
        tifffile.imwrite(path, stack, photometric="minisblack", **TIFFS[kind])
        assert is_stack(path)
        cut(path, share)
    assert find_videos([tmp_path]) == names  # not one video of three images
    with pytest.raises(
        VideoError, match=r"cut off or damaged|damaged or not a TIFF file|cannot be read"
    ):
        list(open_video(names[0]))


def test_numbers_that_are_missing_in_a_folder_of_images(tmp_path):
    for i in range(30):
        if i not in (7, 12, 13):
            cv2.imwrite(str(tmp_path / f"day2_frame{i:04}.png"), picture(i))
    (said,) = problems_of(tmp_path)
    assert "leave out 3 (7, 12, 13)" in said
    assert "copy them here, if they were recorded" in said


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [([1, 2, 3], []), ([0, 2, 4, 8], [6]), ([1, 5, 9, 30, 31], []), ([5], [])],
)
def test_missing_numbers(numbers, missing):
    assert missing_numbers([f"a{n:05}.png" for n in numbers]) == missing


def test_names_without_numbers_miss_none():
    assert missing_numbers(["a.png", "b.png"]) == []
    assert len(missing_numbers(["a1.png", "a999999999.png", "a2.png"])) <= 10_000


def test_repeated_and_black_frames_are_said(tmp_path):
    images = [picture(i) for i in range(FRAMES)]
    images[11] = images[10]
    images[20] = images[21] = np.full(SIZE, 3, np.uint8)
    said = problems_of(write(tmp_path / "a.avi", "ffv1", "gray", images))
    assert said == [
        "frame 11 repeats the one before: were frames dropped?",
        "frames 20–21 black: no whisker can be seen there",
    ]


@pytest.mark.parametrize("copies", [(2,), (4,), (2, 3)])
def test_a_video_whose_frame_rate_was_raised_by_copies_is_said(copies):
    times = np.resize(copies, FRAMES)
    said = said_of([picture(i) for i in np.repeat(np.arange(FRAMES), times)])
    assert said[0].startswith(f"{times.sum()} frames show only {FRAMES} pictures: ")
    assert len(said) == 1


def test_pictures_that_change_with_key_frames_only_are_no_copies():
    assert said_of([picture(i // 12, noise=False) for i in range(60)]) == []


def test_a_scene_without_noise_in_which_nothing_moves_repeats_nothing():
    assert said_of([picture(0, noise=False)] * 20) == []


def said_of(images):
    """Sentences on what is wrong with a video of these images."""
    faults = FrameFaults()
    for image in images:
        faults.see(image)
    return list(faults.sentences())


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4"])
def test_frames_that_the_files_times_leave_out(tmp_path, name):
    times = [i + 2 * (i >= 15) for i in range(FRAMES)]
    said = problems_of(write(tmp_path / name, "libx264", times=times))
    assert said == [
        "2 missing by the file's own times, before frame 15: later times are too early"
    ]


@pytest.mark.parametrize("name", ["a.mkv", "a.mp4"])
@pytest.mark.parametrize("steps", [[1] * 14 + [4] + [1] * 24, [1, 1, 7, 2] * 10])
def test_frames_at_uneven_times_are_found_by_their_numbers(tmp_path, name, steps):
    """Else the page of `curate` would show other frames than the tables are of."""
    times = np.cumsum([0, *steps])[:FRAMES].tolist()
    with open_video(write(tmp_path / name, "libx264", times=times)) as video:
        images = list(video)
        assert len(images) == FRAMES
        for number, image in enumerate(images):
            np.testing.assert_array_equal(next(video.frames(number)), image)
        some = dict(video.some(range(0, FRAMES, 3)))
        assert list(some) == list(range(0, FRAMES, 3))
        assert all(np.array_equal(images[number], image) for number, image in some.items())


@pytest.mark.parametrize(("codec", "pixels"), [("mjpeg", "yuvj420p"), ("libx264", "yuv420p")])
@pytest.mark.parametrize("rate", [1, 1000])
def test_a_wrong_rate_in_the_header_leaves_a_sample_of_the_whole(tmp_path, codec, pixels, rate):
    images = [picture(i % FRAMES) for i in range(300)]
    path = write(tmp_path / "a.mkv", codec, pixels, images, header_rate=rate)
    with open_video(path) as video:
        numbers, _ = video.sample(24)
        assert (len(numbers), numbers[0], numbers[-1]) == (24, 0, 299)
        assert np.diff(numbers).max() <= 15
        assert video.n_frames == 300


def test_a_codec_that_is_not_known(tmp_path):
    path = write(tmp_path / "a.avi", "mjpeg", "yuvj420p")
    path.write_bytes(path.read_bytes().replace(b"MJPG", b"QQQQ"))
    with pytest.raises(VideoError, match=r"a\.avi: "):
        list(ContainerVideo(path))


Y4M = b"YUV4MPEG2 W4 H2 F25:1 Cmono\n" + (b"FRAME\n" + bytes(8)) * 3


@pytest.mark.parametrize(
    ("container", "content", "lacks"),
    [
        ("gif", b"GIF89a" + bytes(50) + b";", False),
        ("gif", b"GIF89a" + bytes(50), True),
        ("mpegts", bytes(188 * 5), False),
        ("mpegts", bytes(188 * 5 + 7), True),
        ("yuv4mpegpipe", Y4M, False),
        ("yuv4mpegpipe", Y4M + b"F", True),
        ("yuv4mpegpipe", b"YUV4MPEG2 W4 H2 C420p10\nFRAME\n" + bytes(5), False),
        ("avi", b"", False),
    ],
)  # fmt: skip
def test_ends_of_containers(tmp_path, container, content, lacks):
    (tmp_path / "a").write_bytes(content)
    assert is_cut(tmp_path / "a", container) is lacks


@pytest.mark.parametrize("kind", ["png", "jpg", "bmp", "tif", "avi", "pgm"])
def test_frames_beyond_all_memory_are_refused(tmp_path, kind, monkeypatch):
    """The bound is lowered here; a real picture of that size would be slow to write."""
    monkeypatch.setattr(base, "MOST_PIXELS", SIZE[0] * SIZE[1] - 1)
    path = tmp_path / f"a.{kind}"
    if kind == "avi":
        write(path, "mjpeg", "yuvj420p")
    else:
        cv2.imwrite(str(path), picture(0))
    with pytest.raises(VideoError, match=r"128×96 px: expected at most"):
        list(open_video(path))


@pytest.mark.parametrize("shape", [(1, 1), (48, 2), (1, 10_000), (15, 64)])
def test_frames_too_small_for_a_whisker_are_refused(tmp_path, shape):
    settings = settings_from(
        {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}}
    )
    stack = np.random.default_rng(0).integers(0, 255, (5, *shape), dtype=np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", stack, photometric="minisblack")
    with pytest.raises(VideoError, match=f"{shape[1]}×{shape[0]} px: expected at least 16"):
        analyse(tmp_path / "a.tif", settings)


@pytest.mark.parametrize("number", [errno.ENOMEM, errno.EAGAIN])
def test_a_decoder_without_memory_does_not_make_a_video_damaged(tmp_path, monkeypatch, number):
    """Memory is asked for where frames are read, and where a file is opened."""
    error = av.error.FFmpegError(number, "no thread could be started")
    with pytest.raises(MemoryError):
        check_memory(error)
    assert reason_of(error) == "no thread could be started"
    path = write(tmp_path / "a.avi", "mjpeg", "yuvj420p")

    def fail(*args):
        raise error

    with open_video(path) as video:
        monkeypatch.setattr(ContainerVideo, "_filled", fail)
        with pytest.raises(MemoryError, match="no thread"):
            list(video)
    monkeypatch.setattr(ContainerVideo, "__init__", fail)
    with pytest.raises(MemoryError, match="no thread"):
        open_video(path)


@pytest.mark.parametrize("is_short", [False, True])
def test_a_header_that_counts_too_much_is_damage_unless_memory_is_short(
    tmp_path, monkeypatch, is_short
):
    """A time-to-sample table of 2**28 - 1 entries is more than FFmpeg lets a program allocate."""
    path = write(tmp_path / "a.mp4", "libx264", "yuv420p")
    data = path.read_bytes()
    count = data.index(b"stts") + 8
    path.write_bytes(data[:count] + b"\x0f\xff\xff\xff" + data[count + 4 :])
    if is_short:
        monkeypatch.setattr("pipeline.video.containers._can_get", lambda size: False)
    with pytest.raises(MemoryError if is_short else VideoError, match=r"[Mm]emory"):
        open_video(path)


def test_another_failure_is_damage_and_says_what_the_decoder_said():
    error = av.error.FFmpegError(errno.EINVAL, "is broken")
    check_memory(error)
    assert reason_of(error) == "is broken"


def test_pictures_that_are_too_small_or_no_pictures_say_what_to_do(tmp_path):
    settings = settings_from(
        {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}}
    )
    with pytest.raises(VideoError, match=r"can be seen; export it larger$"):
        analyse(np.zeros((5, 8, 8), np.uint8), settings)
    with pytest.raises(VideoError, match=r"pages of shape \(9, 9, 7\).*; export it so$"):
        grey(np.zeros((9, 9, 7), np.uint8), "a.tif", 0, cv2.COLOR_RGB2GRAY)
