"""Compile the numeric kernels in advance, on a small drawn video.

Compiled code is kept beside the source files, so this matters once, on a fresh machine: `demo`
does it on one core while the other renders.
"""

import contextlib
import multiprocessing
import tempfile
from pathlib import Path

import cv2
import numpy as np

from pipeline.runtime.workers import end_with_parent

FRAMES = 48


def draw(folder: Path) -> None:
    """Write a folder of images: a dark face, a bending line, and a disc that it touches."""
    rng = np.random.default_rng(0)
    x = np.arange(40, 440)
    for i in range(FRAMES):
        image = np.full((300, 480), 180, np.uint8)
        image[:, :60] = 8
        push = 14 * np.sin(np.pi * i / FRAMES)
        y = 140 + push * ((x - 40) / 200) * np.maximum(1 - (x - 40) / 420, 0)
        points = np.round(np.column_stack([x, y]) * 16).astype(np.int32)
        cv2.polylines(image, [points], False, 90, 2, cv2.LINE_AA, 4)
        cv2.circle(image, (250, 158), 6, 5, -1, cv2.LINE_AA)
        noise = rng.normal(0, 1.5, image.shape)
        picture = np.clip(cv2.GaussianBlur(image, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"{i:03d}.png"), picture)


def warm_up() -> None:
    """Analyse the drawn video once, so that everything `run` needs is compiled and cached."""
    from pipeline.run import analyse
    from pipeline.session.session_file import settings_from

    settings = settings_from(
        {
            "recording": {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": "left"},
            "whisker": [
                {
                    "name": "C2",
                    "length_mm": 17.0,
                    "cone_length_mm": 18.0,
                    "base_radius_um": 37.0,
                    "hidden_length_mm": 1.4,
                }
            ],
        },
        "drawn video",
    )
    with tempfile.TemporaryDirectory() as folder:
        draw(Path(folder))
        analyse(folder, settings)


def _warm_up_beside() -> None:
    end_with_parent()
    warm_up()


@contextlib.contextmanager
def meanwhile():
    """Warm up in a separate process during the block, and wait for it; end it if the block fails.

    Yields the process.
    """
    process = multiprocessing.get_context("spawn").Process(target=_warm_up_beside, daemon=True)
    process.start()
    try:
        yield process
    except BaseException:
        process.terminate()
        raise
    finally:
        process.join()
