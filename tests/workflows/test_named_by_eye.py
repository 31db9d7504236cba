"""Names along a person's tracks, where the tracks are the truth of a rendered video."""

from dataclasses import replace

import named_by_eye
import numpy as np
import pandas as pd
import pytest
from quick_codec import quick_to_read

from pipeline.tables.centrelines import read_centrelines
from synthetic.session import render_session

pytestmark = pytest.mark.e2e

FRAMES = 60
EXCHANGED = 30  # from this frame on
LOST = slice(10, 15)  # frames without a line of the second whisker
ALONG = 60  # node of the true centreline that a person follows


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    folder = tmp_path_factory.mktemp("row")
    with quick_to_read():
        (path,) = render_session(folder, "row", seed=0, trials=1, frames=FRAMES)
    return path, read_centrelines(folder / "truth" / path.stem / "centrelines.parquet")


def followed(truth, path):
    """The true whiskers as a person's tracks, the last frame of each not sure."""
    node = truth.offsets[:-1] + ALONG
    table = pd.DataFrame({
        "track": [f"{truth.names[k]} by eye" for k in truth.whisker], "frame": truth.frame,
        "x_px": truth.x_px[node], "y_px": truth.y_px[node], "sure": truth.frame < FRAMES - 1,
    })  # fmt: skip
    table.astype({"sure": int}).to_csv(path, index=False)
    return named_by_eye.read_tracks(path)


def test_true_names_are_never_exchanged(video, tmp_path):
    truth = replace(video[1], confidence=np.ones(len(video[1])))
    named = named_by_eye.named_along(followed(truth, tmp_path / "a.csv"), [truth])
    assert len(named) == (FRAMES - 1) * len(truth.names)
    assert (named["name"] + " by eye" == named["track"]).all()
    assert "0.0 of 100" in named_by_eye.report(named)


def test_an_exchange_counts_at_the_confidence_that_both_names_have(video, tmp_path):
    truth = video[1]
    one, other = 0, 1
    whisker = truth.whisker.copy()
    later = truth.frame >= EXCHANGED
    whisker[later & (truth.whisker == one)] = other
    whisker[later & (truth.whisker == other)] = one
    confidence = np.where(later, 0.6, 0.95)
    lines = replace(truth, whisker=whisker, confidence=confidence)
    named = named_by_eye.named_along(followed(truth, tmp_path / "a.csv"), [lines])
    for number, track in enumerate(truth.names):
        own = named[named["track"] == f"{track} by eye"]
        swapped = number in (one, other)
        assert len(named_by_eye.exchanges(own, 0.5)) == swapped
        assert named_by_eye.exchanges(own, 0.7) == []
    before, after = truth.names[one], truth.names[other]
    said = f"{EXCHANGED - 1} {before} → {EXCHANGED} {after}"
    assert said in named_by_eye.report(named)


def test_names_are_compared_with_the_one_that_their_track_mostly_has(video, tmp_path):
    truth = video[1]
    exchanged = (truth.frame >= EXCHANGED + 5) & (truth.whisker < 2)
    confidence = np.where(exchanged, 0.55, 0.8)
    lines = replace(
        truth,
        whisker=np.where(exchanged, 1 - truth.whisker, truth.whisker),
        confidence=np.where(truth.frame < EXCHANGED, confidence, np.minimum(confidence, 0.6)),
    )
    named = named_by_eye.named_along(followed(truth, tmp_path / "a.csv"), [lines])
    shares = dict(zip(named_by_eye.RANGES, named_by_eye.usual_shares(named), strict=True))
    assert shares[0.7] == 1
    assert shares[0.5] == 0
    assert shares[0.6] == 1
    assert np.isnan([shares[0.0], shares[0.3], shares[0.9]]).all()
    said = named_by_eye.report(named)
    assert "confidence 0.5 to 0.6: 0.0% of the names are the track's usual one" in said
    assert "confidence 0.9 to 1.0: – of the names" in said


def test_frames_without_a_line_are_counted(video, tmp_path):
    truth = replace(video[1], confidence=np.ones(len(video[1])))
    gone = np.isin(truth.frame, np.arange(FRAMES)[LOST]) & (truth.whisker == 1)
    away = np.repeat(np.where(gone, 1e3, 0.0), np.diff(truth.offsets))
    lines = replace(truth, y_px=truth.y_px + away)
    named = named_by_eye.named_along(followed(truth, tmp_path / "a.csv"), [lines])
    lost = named[named["name"] == ""]
    assert lost["frame"].tolist() == list(range(FRAMES))[LOST]
    assert set(lost["track"]) == {f"{truth.names[1]} by eye"}
    assert (lost["confidence"] == 0).all()


def test_of_lines_as_near_the_one_meant_before_is_taken():
    through = [(0.2, "A", 0.9), (0.2 + 0.9 * named_by_eye.AS_NEAR_PX, "B", 0.8)]
    assert named_by_eye._chosen(through, "") == ("A", 0.9)
    assert named_by_eye._chosen(through, "B") == ("B", 0.8)
    farther = [through[0], (0.2 + 1.1 * named_by_eye.AS_NEAR_PX, "B", 0.8)]
    assert named_by_eye._chosen(farther, "B") == ("A", 0.9)


def test_a_missing_column_is_named(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("track,frame,x_px,y_px\na,0,1,2\n", "utf-8")
    with pytest.raises(ValueError, match="no sure"):
        named_by_eye.read_tracks(path)


@pytest.mark.slow
def test_it_says_so_for_a_video(video, tmp_path, capsys):
    path, truth = video
    followed(truth, tmp_path / "a.csv")
    assert named_by_eye.main([str(path), str(tmp_path / "a.csv")]) == 0
    said = capsys.readouterr().out
    assert "100.0% with a line" in said
    assert "confidence ≥ 0.0: 100.0% of the frames, names exchanged in 0 tracks" in said


def test_draws_are_summed_by_their_mean_least_and_most(video, tmp_path):
    truth = replace(video[1], confidence=np.ones(len(video[1])))
    tracks = followed(truth, tmp_path / "a.csv")
    later = (truth.frame >= EXCHANGED) & (truth.whisker < 2)
    exchanged = replace(truth, whisker=np.where(later, 1 - truth.whisker, truth.whisker))
    draws = [named_by_eye.named_along(tracks, [each]) for each in (truth, exchanged, exchanged)]
    said = named_by_eye.report_of_draws(draws, 5)
    assert "3 draws of the noise from seed 5" in said
    assert "confidence ≥ 0.9: 100.0% (100.0% to 100.0%) of the frames" in said
    assert "names exchanged in 1.3 (0.0 to 2.0) tracks" in said
    share = 1 - 2 * (FRAMES - 1 - EXCHANGED) / ((FRAMES - 1) * len(truth.names))
    mean, least = f"{(1 + 2 * share) / 3:.1%}", f"{share:.1%}"
    assert f"confidence 0.9 to 1.0: {mean} ({least} to 100.0%) of the names" in said


@pytest.mark.slow
def test_a_video_is_drawn_several_times(video, tmp_path, capsys):
    path, truth = video
    followed(truth, tmp_path / "a.csv")
    assert named_by_eye.main([str(path), str(tmp_path / "a.csv"), "--draws", "2"]) == 0
    assert "names exchanged in 0.0 (0.0 to 0.0) tracks" in capsys.readouterr().out
