"""Very many videos, very long ones, and very many whiskers: memory and open files are bounded."""

import json
import os
import threading
import time
from contextlib import contextmanager

import cv2
import numpy as np

from pipeline.session.content import stamp
from pipeline.session.session_file import settings_from
from pipeline.tables.run_record import STATE_FILE, read_state
from pipeline.tables.whole_files import sha256
from pipeline.video.base import Video
from promises import stand_in
from promises.children import in_child
from promises.trial import Effort, Tried

VIDEOS, DUE = 10_000, 200  # videos, and those of them that are new
LONG = 1_000_000  # frames
MANY, SPACING, CROWD_FRAMES = 32, 14, 60  # whiskers; px between them; frames
MOST_OPEN = 64  # files at a time
MOST_PER_VIDEO, MOST_PER_FRAME = 20_000, 2_500  # bytes of memory that may be added
BASE = 2**30  # bytes that a process may take in any case
LONGEST_S = 7200
MB = 2**20
LOOP = 200  # frames
SHORT = 10  # times as short is the video beside which a very long one is seen to take more
POLE = 100, 68, 5  # x, y and radius [px]
LOOPED_SETTINGS = settings_from(
    {
        "recording": {"frames_per_second": 1000, "pixels_per_mm": 8, "face": "left"},
        "pole": {"diameter_mm": POLE[2] / 4},
        "whisker": [
            {"name": "C2", "length_mm": 18, "cone_length_mm": 18.947, "base_radius_um": 37}
        ],
    }
)


class Watched:
    """Most files that this process had open while it was watched, beside those it began with."""

    def __init__(self):
        self.files = 0
        self._before = set(os.listdir("/dev/fd"))  # of the program that started it, as tests are
        self._ended = threading.Event()

    def watch(self) -> None:
        """Poll until it is stopped."""
        while not self._ended.wait(0.05):
            self.files = max(self.files, len(set(os.listdir("/dev/fd")) - self._before))

    def end(self) -> None:
        """Stop polling."""
        self._ended.set()


@contextmanager
def watched():
    """Yield a watcher of this process's open files."""
    watch = Watched()
    thread = threading.Thread(target=watch.watch)
    thread.start()
    try:
        yield watch
    finally:
        watch.end()
        thread.join()


def try_many_videos(folder, effort: Effort) -> Tried:
    """Run over a folder of very many videos, most of which were processed before."""
    tried = Tried(cases=effort.cases(VIDEOS, 50))
    due = effort.cases(DUE, 10)
    in_child(_prepare, folder, tried.cases, due, seconds=LONGEST_S)
    ending = in_child(_run, folder, seconds=LONGEST_S)
    tried.check(not ending.fault, ending.fault)
    if not ending.fault:
        seconds, files, done, analysed = ending.value
        most = BASE + MOST_PER_VIDEO * tried.cases
        tried.check(done == tried.cases, f"{done} are done")
        tried.check(analysed == due, f"{analysed} are analysed, {due} are due")
        tried.check(files <= MOST_OPEN, f"{files} files are open at a time")
        tried.check(ending.added < most, f"{ending.peak / MB:.0f} MB are taken")
        tried.said = (
            f"{due} of them new, by a stand-in for the analysis: {seconds:.0f} s, "
            f"{ending.peak / MB:.0f} MB, {files} open files"
        )
    return tried


def _prepare(folder, count, due) -> None:
    """Make so many videos, and results of all but those that are due."""
    videos, out = folder / "videos", folder / "results"
    stand_in.make_videos(videos, 1)
    stand_in.run(videos, out)
    stand_in.make_videos(videos, count)
    contacts = (out / "video0" / "contacts.csv").read_text("utf-8")
    for k in range(1, count - due):
        folder = stand_in.copy_of(out / "video0", out / f"video{k}")
        (folder / "contacts.csv").write_text(contacts.replace("video0", folder.name), "utf-8")
        path = videos / f"video{k}.avi"
        state = {"path": str(path), "video": folder.name, "sha256": sha256(path)}
        record = read_state(folder) | state | {"input": stamp(path)}
        (folder / STATE_FILE).write_text(json.dumps(record), "utf-8")


def _run(folder):
    """Seconds of processor time, most open files, videos done, and analysed."""
    analysed = 0

    def analyse(task, *rest):
        nonlocal analysed
        analysed += 1
        return stand_in.analyse(task, *rest)

    stand_in.STAND_IN = stand_in.batch.Source(stand_in.find_inputs, analyse)
    started = time.process_time()
    with watched() as watch:
        summary = stand_in.run(folder / "videos", folder / "results")
    return time.process_time() - started, watch.files, len(summary.of("done")), analysed


class Looped(Video):
    """Some frames, again and again."""

    def __init__(self, path, frames, count):
        super().__init__(path, frames.shape[2], frames.shape[1], count)
        self._frames = frames

    def starts(self, numbers):
        """The frames themselves."""
        return list(numbers)

    def _read(self, start, stop):
        for i in range(start, self.n_frames if stop is None else min(stop, self.n_frames)):
            yield self._frames[i % len(self._frames)].copy()

    def _sampled(self, n):
        for i in np.unique(np.linspace(0, self.n_frames - 1, n).astype(int)):
            yield int(i), self._frames[i % len(self._frames)].copy()


def swinging(i) -> np.ndarray:
    """A frame of a whisker that swings against a pole, its face on the left."""
    rng, (pole_x, pole_y, radius) = np.random.default_rng(i), POLE
    y, x = np.mgrid[:96, :160].astype(float)
    swing = np.sin(2 * np.pi * i / LOOP)
    pushed = max(48 + (10 + 0.12 * pole_x) * swing - (pole_y - radius - 1), 0.0)
    middle = 48 + (10 + 0.12 * x) * swing - pushed * _bend((x - 12) / (pole_x - 12))
    whisker = 130 * np.exp(-((y - middle) ** 2) / (1.2 - 0.005 * x)) * (x < 145)
    image = np.where(x < 12, 20, 190 - whisker)
    beside_pole = np.clip(np.hypot(x - pole_x, y - pole_y) - radius + 0.5, 0, 1)
    image = 20 + (image - 20) * beside_pole + rng.normal(0, 2, image.shape)
    return image.clip(0, 255).astype(np.uint8)


def _bend(u):
    """Deflection of a beam, held at 0 and pushed by one at 1, at `u`."""
    u = np.maximum(u, 0)
    return np.where(u < 1, u**2 * (3 - u) / 2, 1 + 1.5 * (u - 1))


def try_long(folder, effort: Effort) -> Tried:
    """Analyse a very long video, made of some frames again and again, and a shorter one."""
    count = effort.cases(LONG, 20_000)
    tried = Tried(cases=1)
    frames = np.stack([swinging(i) for i in range(LOOP)])
    lengths = 2 * LOOP, count // SHORT, count  # the first one compiles, which takes memory, too
    _, short, ending = (in_child(_analysed, frames, n, seconds=LONGEST_S) for n in lengths)
    tried.check(not short.fault, short.fault)
    tried.check(not ending.fault, ending.fault)
    if not (short.fault or ending.fault):
        files, rows, contacts = ending.value
        each = (ending.peak - short.peak) / (count - count // SHORT)
        tried.check(rows == count, f"{rows} frames are in the tables")
        tried.check(contacts > count // LOOP // 2, f"{contacts} contacts of {count // LOOP}")
        tried.check(files <= MOST_OPEN, f"{files} files are open at a time")
        tried.check(each < MOST_PER_FRAME, f"{each:.0f} bytes a frame")
        tried.check(ending.added < BASE + MOST_PER_FRAME * count, f"{ending.peak / MB:.0f} MB")
        tried.said = (
            f"{count} frames with {contacts} contacts: {ending.peak / MB:.0f} MB, "
            f"{each / 1e3:.1f} kB for each frame more; {files} open files"
        )
    return tried


def crowd(i) -> np.ndarray:
    """A frame of many whiskers that swing together."""
    rng = np.random.default_rng(i)
    image = np.full((MANY * SPACING + 60, 260), 190, np.uint8)
    image[:, :14] = 20
    swing = 8 * np.sin(2 * np.pi * i / 60)
    for k in range(MANY):
        y = 30 + (k + 0.5) * SPACING
        tip = 230 - 30 * (k % 3), y + swing + 2 * np.sin(i / 7 + k)
        points = (np.array([[10, y], [120, y + 0.4 * swing], tip]) * 16).astype(np.int32)
        cv2.polylines(image, [points], False, 60, 2, cv2.LINE_AA, 4)
    image = cv2.GaussianBlur(image, (0, 0), 0.8) + rng.normal(0, 2, image.shape)
    return image.clip(0, 255).astype(np.uint8)


def try_many_whiskers(folder, effort: Effort) -> Tried:
    """Analyse a short video of very many whiskers."""
    tried = Tried(cases=1)
    count = effort.cases(CROWD_FRAMES, 10)
    ending = in_child(_crowd_analysed, np.stack([crowd(i) for i in range(count)]),
                      seconds=LONGEST_S)  # fmt: skip
    tried.check(not ending.fault, ending.fault)
    if not ending.fault:
        files, names, seconds = ending.value
        tried.check(files <= MOST_OPEN, f"{files} files are open at a time")
        tried.check(ending.added < BASE, f"{ending.peak / MB:.0f} MB are taken")
        tried.check(names >= MANY // 2, f"{names} whiskers are in the tables")
        tried.said = (
            f"{count} frames of {MANY} whiskers, {names} of them found: "
            f"{ending.peak / MB:.0f} MB, {files} open files, {seconds:.0f} s"
        )
    return tried


def _crowd_analysed(frames) -> tuple[int, int, float]:
    """Most open files, whiskers in the tables, and seconds of processor time."""
    import pipeline.run

    recording = {"frames_per_second": 500, "pixels_per_mm": 10, "face": "left"}
    pipeline.run.open_video = lambda path, threads: Looped(path, frames, len(frames))
    started = time.process_time()
    with watched() as watch:
        analysis = pipeline.run.analyse("crowd", settings_from({"recording": recording}))
    seconds = time.process_time() - started
    return watch.files, analysis.frames["whisker"].nunique(), seconds


def _analysed(frames, count) -> tuple[int, int, int]:
    """Most open files, frames in the tables, and contacts of a looped video's analysis."""
    import pipeline.run

    pipeline.run.open_video = lambda path, threads: Looped(path, frames, count)
    with watched() as watch:
        analysis = pipeline.run.analyse("looped", LOOPED_SETTINGS, lambda lines: None)
    tracked = analysis.frames["tracked"].sum()
    if tracked < count / 2:
        raise RuntimeError(f"tracked in {tracked} of {count} frames: {analysis.messages}")
    return watch.files, int(analysis.frames["frame"].max()) + 1, len(analysis.contacts)
