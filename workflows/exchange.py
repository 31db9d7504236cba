"""Tests each format in both directions with the other program itself; prints a table.

    python -m venv peer && peer/bin/pip install whisk-janelia av==12.3.0 movement pims
    python workflows/exchange.py --peer-python peer/bin/python --write

A short video is rendered and processed. The other program reads what we export, and we
read its output; its own results from the video, or from numbers, are imported. Where a program
is not installed, its rows say so. WhACC goes into an environment of its own, SLEAP's reader and
DeepLabCut into another:

    whacc/bin/pip install tensorflow-cpu h5py "pillow<10" opencv-python-headless scipy pandas \
        matplotlib tqdm natsort==7.1.1 ipython scikit-learn lightgbm pytz seaborn
    whacc/bin/pip install --no-deps whacc
    poses/bin/pip install sleap-io tables scipy matplotlib tqdm opencv-python-headless \
        scikit-image ruamel.yaml pydantic filterpy networkx numba
    poses/bin/pip install --no-deps deeplabcut

WhACC's page needs a screen; `xvfb-run -a` before the command provides one. Octave, ImageMagick and
Piotr's Computer Vision Matlab Toolbox (for StreamPix files) are used where they are found.
`--measurements FILE` adds a Janelia file that someone has recorded.
"""

import argparse
import tempfile
from pathlib import Path

import pages
from exchanges import janelia, matlab, neurodata, poses, videos, whacc
from exchanges.others import Others
from peer_tracker import NoPeerError

from pipeline.app import batch
from pipeline.convert.results import read_results
from synthetic import render_session

PAGE = Path(__file__).resolve().parents[1] / "docs" / "formats.md"
FRAMES = 200
HEADER = ["format", "way", "other program", "what came of it"]
CHECKS = {
    "Janelia": janelia.rows,
    "WhACC": whacc.rows,
    "MAT": matlab.rows,
    "NWB": neurodata.rows,
    "movement": poses.rows,
    "SLEAP": poses.sleap,
    "DeepLabCut": poses.deeplabcut,
    "StreamPix .seq": videos.streampix,
    "StreamPix .seq, written": videos.toolbox,
    "TIFF": videos.tiff,
}


def rows_of(name, check, *arguments):
    """Rows of a check, or one that says why there are none."""
    try:
        yield from check(*arguments)
    except (NoPeerError, RuntimeError, ImportError, OSError) as error:
        words = " ".join(str(error).split())[:120]
        yield name, "", "", f"not tried: {words}"


def try_all(folder, others, only, measurements=None, results=None):
    """Rows of the table."""
    if results is None:
        (path,) = render_session(folder / "videos", "single", seed=3, trials=1, frames=FRAMES)
        results = folder / "results"
        batch.run([path.parent], results)
    video = read_results(results)[0]
    for i, (name, check) in enumerate(CHECKS.items()):
        if not only or name in only:
            place = folder / str(i)
            place.mkdir()
            yield from rows_of(name, check, video, place, others)
    if measurements:
        yield from janelia.recorded(measurements)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--peer-python", default="python", help="with the other programs")
    parser.add_argument("--whacc-python", default="python", help="with WhACC")
    parser.add_argument("--poses-python", default="python", help="with DeepLabCut and sleap-io")
    parser.add_argument("--octave", default="octave", help="GNU Octave")
    parser.add_argument("--imagemagick", default="convert", help="ImageMagick's convert")
    parser.add_argument("--toolbox", type=Path, default=Path("toolbox"), help="Piotr's toolbox")
    parser.add_argument("--measurements", type=Path, help="a recorded .measurements file")
    parser.add_argument("--results", type=Path, help="of `run`, instead of rendering a video")
    parser.add_argument("--only", nargs="+", choices=CHECKS, default=(), help="these checks")
    parser.add_argument("--write", action="store_true", help="write into docs/formats.md")
    args = parser.parse_args()
    others = Others(
        args.peer_python,
        args.whacc_python,
        args.poses_python,
        args.octave,
        args.imagemagick,
        args.toolbox,
    )
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for row in try_all(Path(folder), others, args.only, args.measurements, args.results):
            rows.append(list(row))
            print(" | ".join(row), flush=True)
    if args.write:
        pages.write_between(PAGE, "exchange", pages.table(HEADER, rows))


if __name__ == "__main__":
    main()
