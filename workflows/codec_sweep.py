"""How compression changes the forces: the same scenes without loss, as H.264 and as MJPG.

    python workflows/codec_sweep.py                      # a few short videos per codec
    python workflows/codec_sweep.py --videos 20 --frames 1000 --write docs/accuracy_codecs.md

All codecs show the same scenes, of the preset `noisy`, with the same seeds, hidden lengths wrong
by their stated uncertainty. Prints a table (docs/accuracy_codecs.md holds a run's) and, with
--figure, draws it.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import accuracy
import measuring
import numpy as np
import pages
from accuracy_figures import SPREADS, figures_of
from over_videos import with_interval

from synthetic.presets import PRESETS, noisy_with
from synthetic.scene import Codec

FRAMES, VIDEOS = 500, 4
CODECS = {
    "lossless (FFV1)": Codec("ffv1"),
    **{f"H.264, crf {crf}": Codec("h264", crf=crf) for crf in (12, 18, 23, 28)},
    **{f"MJPG, quality {q}": Codec("mjpeg", quality=q) for q in (2, 4, 7, 12)},
}
SHOWN = (  # of accuracy_figures.SPREADS
    "peak force: median error",
    "peak force: 95 % of them",
    "peak force: within 4 % or 0.1 µN",
    "peak force: coverage",
    "force per frame: coverage",
)


def measure_codec(name, folder: Path, args) -> dict:
    """One codec's figures: kB per frame, lines, curvature, and the forces' with intervals."""
    PRESETS[name] = noisy_with(CODECS[name])
    seeds = np.random.SeedSequence(args.seed).generate_state(args.videos) >> 1
    tasks = [
        accuracy.Task(folder / name / str(k), name, k, int(seed), args.frames, True, False)
        for k, seed in enumerate(seeds)
    ]
    videos, samples, _ = zip(*(accuracy.measure_task(task) for task in tasks), strict=True)
    files = [path for path in (folder / name).glob("*/*") if path.suffix in (".avi", ".mp4")]
    figures = figures_of(list(videos), videos[0].pixels_per_mm)
    print(f"{name}: done", file=sys.stderr)
    return {
        "kB": sum(path.stat().st_size for path in files) / 1000 / figures["frames"],
        "rms_px": figures["rms_px"],
        "curvature_sd": figures["curvature_robust_sd"],
        "contacts": figures["contacts"],
        "missed": figures["missed"] + figures["invented"],
        **{
            what: with_interval([each[sample] for each in samples], statistic, rng)
            for what, (sample, statistic, _) in SPREADS.items()
            if what in SHOWN
            for rng in [np.random.default_rng(args.seed)]
        },
    }


def table_of(results: dict[str, dict]) -> str:
    """A row per codec."""
    rows = [
        [
            name, f"{row['kB']:.1f}", f"{row['rms_px']:.3f}", f"{row['curvature_sd']:.2f}",
            f"{row['contacts']:.0f}", f"{row['missed']:.0f}",
            *(pages.cell_and_ends(SPREADS[what][2], *row[what]) for what in SHOWN),
        ]
        for name, row in results.items()
    ]  # fmt: skip
    header = [
        "codec", "kB/frame", "centreline RMS [px]", "κ robust SD [1/m]", "contacts",
        "missed or invented", *SHOWN,
    ]  # fmt: skip
    return pages.table(header, rows)


def draw(results: dict[str, dict], path: Path) -> None:
    """Force error against file size, a line per kind of codec."""
    from matplotlib.figure import Figure

    figure = Figure((5.2, 3.6), layout="constrained")
    axes = figure.subplots()
    what = "peak force: median error"
    for kind, colour in (("lossless", "black"), ("H.264", "tab:blue"), ("MJPG", "tab:orange")):
        rows = {name: row for name, row in results.items() if name.startswith(kind)}
        size = [row["kB"] for row in rows.values()]
        value, *ends = np.reshape([row[what] for row in rows.values()], (-1, 3)).T
        ends = np.abs(value - np.array(ends))
        axes.errorbar(size, 100 * value, 100 * ends, color=colour, marker="o", label=kind)
        for name, x, y in zip(rows, size, 100 * value, strict=True):
            label = name.rpartition(", ")[2]
            if kind != "lossless":
                axes.annotate(label, (x, y), (4, 4), textcoords="offset points", fontsize=7)
    axes.set(xscale="log", yscale="log", xlabel="file size [kB per frame]")
    axes.set_yticks([0.1, 0.2, 0.5, 1, 2, 5, 10])
    axes.minorticks_off()
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set_ylabel("median error of the peak force [%]")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--videos", type=int, default=VIDEOS, help="per codec")
    parser.add_argument("--frames", type=int, default=FRAMES, help="of each video")
    measuring.add_seed(parser, "of all videos")
    parser.add_argument("--write", type=Path, help="a Markdown file to put the table into")
    parser.add_argument("--figure", type=Path, help="a picture to draw")
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Measure every codec on the same scenes."""
    measuring.limit_threads()
    args = arguments(argv)
    with tempfile.TemporaryDirectory() as folder:
        results = {name: measure_codec(name, Path(folder), args) for name in CODECS}
    text = (
        f"{args.videos} videos of {args.frames} frames per codec, drawn from seed {args.seed} "
        f"(`python workflows/codec_sweep.py --seed {args.seed} --videos {args.videos} --frames "
        f"{args.frames}` makes the same); in brackets 95 % intervals that resample videos.\n\n"
        + table_of(results)
    )
    pages.publish(text, args.write, "codecs")
    if args.figure:
        draw(results, args.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
