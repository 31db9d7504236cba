"""[image]: only a part of the picture is looked at, bright whiskers are as good as dark ones."""

import cv2
import numpy as np
import pytest
from rendered_frames import rendered_frames

import pipeline.run
from pipeline import __version__
from pipeline.curate.corrected import settings_of_results
from pipeline.errors import VideoError
from pipeline.run import analyse, look_at
from pipeline.session.session_file import (
    SettingsError,
    read_session,
    settings_digest,
    settings_from,
    write_session,
)
from pipeline.tables.run_record import STATE_FILE, write_state
from pipeline.video.arrays import ArrayVideo
from pipeline.video.base import RandomAccessVideo

N_FRAMES = 40
SAME = 0.05  # px, between the centrelines with and without the rest of the picture
AS_DARK = 0.02  # px, of the negative
LEAST = 0.95  # of the rows that are tracked in the whole picture
BLOCK = np.s_[300:460, 440:600]  # rows, columns, of something dark that comes and goes
REGION = [0, 0, 420, 480]
MARGIN = 40  # px, even, around a picture


class Rendered(RandomAccessVideo):
    """A rendered whisker; `bright`: its negative; `disturbed`: beside something that moves."""

    def __init__(self, bright=False, disturbed=False):
        self._images = rendered_frames("single", N_FRAMES)
        self._bright, self._disturbed = bright, disturbed
        super().__init__("rendered", *self._images.shape[:0:-1], N_FRAMES)

    def _load(self, index):
        frame = self._images[index].copy()
        if self._disturbed and (index // 8) % 2:
            frame[BLOCK] = 5
        return np.invert(frame) if self._bright else frame


def settings(**tables):
    recording = {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": "left"}
    whisker = {"name": "C2", "length_mm": 18.0, "cone_length_mm": 19.0, "base_radius_um": 37.0}
    return settings_from({"recording": recording, "whisker": [whisker], **tables})


def traced(monkeypatch, video, session):
    """Nodes of every row, by frame and whisker; the analysis."""
    monkeypatch.setattr(pipeline.run, "open_video", lambda *_: video)
    rows = {}

    def keep(chunk):
        for i in range(len(chunk)):
            rows[int(chunk.frame[i]), int(chunk.whisker[i])] = chunk.row(i)

    return rows, analyse("rendered", session, keep)


@pytest.fixture(scope="module")
def whole():
    with pytest.MonkeyPatch.context() as patch:
        return traced(patch, Rendered(), settings())


def distances(rows, others):
    """Largest distance between the first 100 nodes of rows that both have [px]."""
    both = rows.keys() & others.keys()
    assert len(both) >= LEAST * len(others)
    return max(
        np.min(np.hypot(*(rows[k][:100, None] - others[k][None]).transpose(2, 0, 1)), axis=1).max()
        for k in both
    )


@pytest.mark.e2e
def test_a_region_hides_what_moves_outside_and_keeps_coordinates(monkeypatch, whole):
    session = settings(image={"region_px": REGION})
    rows, analysis = traced(monkeypatch, Rendered(disturbed=True), session)
    inside = {key: row[row[:, 0] < REGION[2] - 10] for key, row in whole[0].items()}
    assert distances(rows, inside) < SAME
    assert max(row[:, 0].max() for row in rows.values()) < REGION[2] + 2
    assert np.nanmax(np.abs(analysis.pole.x_px - whole[1].pole.x_px)) < SAME


@pytest.mark.e2e
def test_a_mask_is_a_region_of_any_shape(monkeypatch, whole, tmp_path):
    mask = np.full((480, 640), 255, np.uint8)
    mask[BLOCK] = 0
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    session = settings(image={"mask": str(tmp_path / "mask.png")})
    rows, _ = traced(monkeypatch, Rendered(disturbed=True), session)
    assert distances(rows, whole[0]) < SAME
    _, _, epochs = look_at(Rendered(disturbed=True), session)
    assert len(epochs) == 1
    assert epochs[0].scene.obstacle_mask[BLOCK].all()


@pytest.mark.e2e
def test_bright_whiskers_are_found_as_dark_ones(monkeypatch, whole):
    rows, analysis = traced(monkeypatch, Rendered(bright=True), settings())
    assert distances(rows, whole[0]) < AS_DARK
    assert len(analysis.contacts) == len(whole[1].contacts)


class Framed(Rendered):
    """The rendered whisker with an even margin on all sides."""

    def __init__(self, grey):
        super().__init__()
        self._grey = grey
        self.width, self.height = self.width + 2 * MARGIN, self.height + 2 * MARGIN

    def _load(self, index):
        return np.pad(super()._load(index), MARGIN, constant_values=self._grey)


@pytest.mark.e2e
@pytest.mark.parametrize("grey", [0, 255])
def test_a_margin_around_the_picture_changes_nothing(monkeypatch, whole, grey):
    rows, analysis = traced(monkeypatch, Framed(grey), settings())
    assert len(rows) >= LEAST * len(whole[0])
    for key, row in rows.items():
        x, y = whole[0][key][30:-30].T
        assert np.abs(np.interp(x, *(row - MARGIN).T) - y).max() < SAME
    assert np.nanmax(np.abs(analysis.pole.x_px - MARGIN - whole[1].pole.x_px)) < SAME


@pytest.mark.e2e
def test_a_person_says_which_polarity(monkeypatch, whole):
    video, _, _ = look_at(Rendered(), settings(image={"polarity": "dark"}))
    assert isinstance(video, Rendered)
    video, _, _ = look_at(Rendered(), settings(image={"polarity": "bright"}))
    assert np.array_equal(next(video.frames()), np.invert(next(Rendered().frames())))


@pytest.mark.e2e
def test_followed_whiskers_alone_are_in_the_tables(monkeypatch):
    names = ["C4", "C3", "C2", "C1"]
    session = {"whisker": [{"name": name} for name in names]}
    results = []
    for follow in ({}, {"follow": ["C3", "C1"]}):
        video = ArrayVideo(rendered_frames("row", N_FRAMES))
        rows, analysis = traced(monkeypatch, video, settings(**session, analysis=follow))
        results.append((rows, analysis.frames))
    (every, all_frames), (some, frames) = results
    assert set(frames["whisker"]) == {"C3", "C1"}
    assert {whisker for _, whisker in some} == {0, 1}
    for name in ("C3", "C1"):
        one, same = (t[t["whisker"] == name].reset_index(drop=True) for t in (all_frames, frames))
        np.testing.assert_array_equal(one["tracked"], same["tracked"])
        np.testing.assert_allclose(one["follicle_x_px"], same["follicle_x_px"])
    assert len(some) < len(every)


def test_a_region_outside_of_the_picture_is_an_error(monkeypatch):
    expected = (
        r"640×480 px, and \[image\] region_px = \[700, 0, 800, 100\] lies beyond it; give x "
        "from 0 to 640 and y from 0 to 480, or leave it out"
    )
    with pytest.raises(VideoError, match=expected):
        look_at(Rendered(), settings(image={"region_px": [700, 0, 800, 100]}))


def test_a_region_too_small_for_a_whisker_is_an_error():
    with pytest.raises(VideoError, match="leave only 100×9 px of it: expected at least 16 px"):
        look_at(Rendered(), settings(image={"region_px": [100, 100, 200, 109]}))


def test_a_mask_of_another_size_is_an_error(tmp_path):
    cv2.imwrite(str(tmp_path / "mask.png"), np.full((48, 64), 255, np.uint8))
    with pytest.raises(VideoError, match=r"is 64×48 px: expected the same size; draw it"):
        look_at(Rendered(), settings(image={"mask": str(tmp_path / "mask.png")}))


def test_results_depend_on_what_the_mask_shows_not_on_where_it_lies(tmp_path):
    digests = []
    for name, level in (("a.png", 255), ("b.png", 255), ("c.png", 0)):
        cv2.imwrite(str(tmp_path / name), np.full((48, 64), level, np.uint8))
        digests.append(settings_digest(settings(image={"mask": str(tmp_path / name)})))
    assert digests[0] == digests[1] != digests[2]


def test_results_that_were_copied_without_the_mask_are_read(tmp_path):
    cv2.imwrite(str(tmp_path / "mask.png"), np.full((48, 64), 255, np.uint8))
    given = settings(image={"mask": str(tmp_path / "mask.png")})
    write_session(tmp_path / "session.toml", given)
    state = {
        "version": __version__, "video": "a", "path": "", "status": "done", "frames": 1,
        "frames_per_s": 1, "message": "", "contacts": 0, "stages": {}, "sha256": "",
        "pole": None, "settings_sha256": settings_digest(given), "input": {},
    }  # fmt: skip
    write_state(tmp_path, state)
    assert settings_of_results(tmp_path) == given
    (tmp_path / "mask.png").unlink()
    assert settings_of_results(tmp_path) == given
    (tmp_path / STATE_FILE).unlink()
    with pytest.raises(SettingsError, match="mask: there is no file"):
        read_session(tmp_path / "session.toml")
