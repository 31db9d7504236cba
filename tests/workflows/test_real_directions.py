"""Names forwards and backwards, where those of both are known."""

from dataclasses import replace

import numpy as np
import pytest
import real_directions

from pipeline.tables import Centrelines
from pipeline.video import open_video
from synthetic.encode import write_video

FRAMES, WHISKERS, POINTS = 20, 3, 80
CONFIDENCE = 0.9


def row_of_whiskers():
    """Whiskers 20 px apart that move by 1 px a frame, each as the others moved."""
    frame = np.repeat(np.arange(FRAMES), WHISKERS)
    whisker = np.tile(np.arange(WHISKERS), FRAMES)
    n = len(frame)
    y = np.repeat(20.0 * whisker + frame, POINTS)
    return Centrelines(
        names=("A", "B", "C"),
        frame=frame,
        whisker=whisker,
        offsets=np.arange(n + 1) * POINTS,
        x_px=np.tile(np.arange(POINTS, dtype=float), n),
        y_px=y,
        se_px=np.zeros(n * POINTS),
        confidence=np.full(n, CONFIDENCE),
    )


def backwards():
    """The same lines as of the video backwards, with other names, in another order of rows."""
    lines = row_of_whiskers()
    lines = replace(lines, names=("w2", "w1", "w3"), frame=FRAMES - 1 - lines.frame)
    return lines.rows(np.arange(len(lines))[::-1])


def exchanged(lines, rows):
    """The first two whiskers' names exchanged in these rows."""
    whisker = lines.whisker.copy()
    whisker[rows] = np.array([1, 0, 2])[whisker[rows]]
    return replace(lines, whisker=whisker)


def agreement(forwards, other, of=real_directions.names_agree):
    other = real_directions.turned_back(other, FRAMES)
    return of(forwards, other, real_directions.pairs_of_lines(forwards, other))


def test_names_agree_whatever_they_are():
    assert agreement(row_of_whiskers(), backwards()) == (FRAMES * WHISKERS,) * 2


def test_exchanged_names_do_not_agree():
    lines = row_of_whiskers()
    forwards = exchanged(lines, lines.frame < 4)
    assert agreement(forwards, backwards()) == (FRAMES * WHISKERS - 8, FRAMES * WHISKERS)


def test_lines_that_are_unknown_in_one_direction_do_not_count():
    lines = row_of_whiskers()
    confidence = np.where(lines.frame < 4, 0.4, CONFIDENCE)
    forwards = replace(exchanged(lines, lines.frame < 4), confidence=confidence)
    assert agreement(forwards, backwards()) == ((FRAMES - 4) * WHISKERS,) * 2


def test_an_exchange_is_two_links_whatever_the_names():
    lines = row_of_whiskers()
    forwards = exchanged(lines, lines.frame < 4)
    links = (FRAMES - 1) * WHISKERS
    of = real_directions.links_agree
    assert agreement(lines, backwards(), of) == (links, links)
    assert agreement(forwards, backwards(), of) == (links - 2, links)
    assert agreement(lines.rows(np.arange(0)), backwards(), of) == (0, 0)


def test_links_of_lines_that_are_not_found_backwards_do_not_count():
    lines = row_of_whiskers()
    found = backwards().rows(np.flatnonzero(backwards().frame != 7))
    links = (FRAMES - 3) * WHISKERS
    assert agreement(lines, found, real_directions.links_agree) == (links, links)


def test_lines_elsewhere_are_no_pairs():
    lines = row_of_whiskers()
    away = np.repeat(np.where(lines.whisker == 0, 0.0, 5.0), POINTS)
    assert agreement(replace(lines, y_px=lines.y_px + away), backwards()) == (FRAMES, FRAMES)
    assert agreement(lines.rows(np.arange(0)), backwards()) == (0, 0)


@pytest.mark.parametrize("size", [(16, 24), (17, 31)])
def test_frames_come_back_in_reverse_order(tmp_path, size):
    frames = np.random.default_rng(5).integers(0, 256, (9, *size), np.uint8)
    (tmp_path / "there").mkdir()
    write_video(tmp_path / "there" / "a.avi", iter(frames), real_directions.LOSSLESS)
    path = real_directions.write_backwards(tmp_path / "there" / "a.avi", tmp_path)
    with open_video(path) as video:
        assert np.array_equal(np.stack(list(video)), frames[::-1])
