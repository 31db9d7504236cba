"""Make the pictures of README and docs/curate.md from the results of `whiskerforce demo`.

    whiskerforce demo
    whiskerforce run whiskerforce-demo/videos --out whiskerforce-demo/results --overlay
    python workflows/draw_pictures.py whiskerforce-demo     # touch, report, fig3_demo, curate

Pages are photographed in Chromium: Debian's packages chromium and chromium-driver, and selenium.
"""

import argparse
import io
import itertools
import tempfile
import time
from pathlib import Path

import cv2
from headless import chromium, show
from PIL import Image

from pipeline.reports.overlay import drawn_frames
from pipeline.session.session_file import read_session
from pipeline.tables.run_record import recorded_path
from pipeline.video.open import open_video

IMAGES = Path(__file__).parents[1] / "docs" / "images"
TOUCH = "mouse4_0003", 60  # video and frame of touch.png: near the peak of its first contact
REPORT_PX, CURATE_PX = (1300, 1290), (1440, 880)  # windows
SHOWN_PX = 1080  # width of a page's picture
COLOURS = 128
PATIENCE_S = 60


def main(arguments=None) -> None:
    """Write every picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("demo", type=Path, help="folder of `whiskerforce demo`")
    parser.add_argument("--out", type=Path, default=IMAGES, help="folder to write into")
    args = parser.parse_args(arguments)
    results = args.demo / "results"
    cv2.imwrite(str(args.out / "touch.png"), touch(results))
    small(Image.open(results / "figures" / "fig3.png"), args.out / "fig3_demo.png")
    with tempfile.TemporaryDirectory() as profile:
        driver = chromium(profile)
        try:
            driver.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
            report(driver, results).save(args.out / "report.jpg", quality=85)
            curate_page(driver, results).save(args.out / "curate.jpg", quality=85)
        finally:
            driver.quit()


def touch(results):
    """A frame as `run --overlay` draws it, uint8 (height, width, 3)."""
    name, frame = TOUCH
    folder = results / name
    settings = read_session(folder / "session.toml")
    with open_video(recorded_path(folder)) as video:
        return next(itertools.islice(drawn_frames(video, folder, settings), frame, None))


def report(driver, results) -> Image.Image:
    """The upper part of the report."""
    show(driver, (results / "report.html").resolve().as_uri(), *REPORT_PX)
    return photograph(driver)


def curate_page(driver, results) -> Image.Image:
    """The page of `whiskerforce curate`, at its first doubtful contact."""
    from pipeline.curate import curate

    server = curate(results, open_browser=False, block=False, name="Ada", say=lambda line: None)
    try:
        show(driver, server.url, *CURATE_PX)
        deadline = time.monotonic() + PATIENCE_S
        while not driver.execute_script("return document.body.dataset.answered"):
            if time.monotonic() > deadline:
                raise TimeoutError(f"{server.url}: the page was not shown in {PATIENCE_S} s")
            time.sleep(0.2)
        time.sleep(2)  # until the plots are drawn
        return photograph(driver)
    finally:
        server.stop()


def photograph(driver) -> Image.Image:
    """What the window shows, `SHOWN_PX` wide."""
    picture = Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")
    height = round(picture.height * SHOWN_PX / picture.width)
    return picture.resize((SHOWN_PX, height), Image.Resampling.LANCZOS)


def small(picture, path) -> None:
    """Write a picture of few colours as a small PNG."""
    few = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


if __name__ == "__main__":
    main()
