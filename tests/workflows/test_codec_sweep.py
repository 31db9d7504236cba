"""The table of what compression costs."""

import codec_sweep
import pytest

pytestmark = pytest.mark.e2e


def test_a_row_is_printed_for_every_codec(monkeypatch, capsys, tmp_path):
    name = "MJPG, quality 4"
    monkeypatch.setattr(codec_sweep, "CODECS", {name: codec_sweep.CODECS[name]})
    picture = tmp_path / "codecs.png"
    argv = ["--videos", "1", "--frames", "120", "--seed", "3", "--figure", str(picture)]
    assert not codec_sweep.main(argv)
    out = capsys.readouterr().out
    (row,) = (line for line in out.splitlines() if line.startswith(f"| {name}"))
    size, rms, *_ = (float(cell) for cell in row.split("|")[2:4])
    assert 2 < size < 100  # kB per frame
    assert rms < 0.2  # px
    assert picture.stat().st_size > 0
