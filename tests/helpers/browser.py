"""A headless Chromium, and what is wrong with the words of the page that it shows."""

import base64

import headless
import pytest

A4_IN = 8.27, 11.69
WORDS = """
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
const found = [];
for (let node; (node = walker.nextNode()); ) {
  const parent = node.parentElement;
  if (!node.data.trim() || parent.closest("script, style, title")) continue;
  const range = document.createRange();
  range.selectNodeContents(node);
  let room = [0, document.documentElement.clientWidth], seen = [-Infinity, Infinity];
  for (let box = parent; box !== document.body; box = box.parentElement) {
    const style = getComputedStyle(box), place = box.getBoundingClientRect();
    if (style.overflowX !== "visible") {
      room = [Math.max(room[0], place.left), Math.min(room[1], place.right)];
    }
    if (/auto|scroll/.test(style.overflowY)) {
      seen = [Math.max(seen[0], place.top), Math.min(seen[1], place.bottom)];
    }
  }
  for (const r of range.getClientRects()) {
    const scrolled = r.bottom > seen[1] + 1 || r.top < seen[0] - 1;
    if (r.width < 1 || scrolled) continue;
    const text = node.data.trim().slice(0, 40);
    found.push([text, r.left, r.top, r.right, r.bottom, ...room]);
  }
}
return found;
"""
SLACK_PX, SLACK_LINE = 1.5, 0.35  # share of a line's height in which boxes may lie upon each other


def chromium(profile):
    """A browser; the test is skipped where this computer has none."""
    try:
        return headless.chromium(profile)
    except headless.NoBrowserError as error:
        pytest.skip(str(error))


def show_as_before(driver) -> None:
    """Give the window its own width again."""
    driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def word_faults(driver) -> list[str]:
    """Words of the page that are cut at the side, or lie upon others."""
    words = driver.execute_script(WORDS)
    assert words
    cut = [
        f"{text!r} is cut"
        for text, left, _, right, _, low, high in words
        if left < low - SLACK_PX or right > high + SLACK_PX
    ]
    return cut + overlapping([word[:5] for word in words])


def overlapping(words) -> list[str]:
    """Which of (text, left, top, right, bottom) lie upon others."""
    faults = []
    words = sorted(words, key=lambda word: word[2])
    for k, (text, left, top, right, bottom) in enumerate(words):
        for other in words[k + 1 :]:
            if other[2] >= bottom:
                break
            line = SLACK_LINE * min(bottom - top, other[4] - other[2])
            across = min(right, other[3]) - max(left, other[1])
            along = min(bottom, other[4]) - max(top, other[2])
            if across > SLACK_PX and along > line:
                faults.append(f"{text!r} is upon {other[0]!r}")
    return faults


def write_pdf(driver, path) -> None:
    """Print the page on A4."""
    options = {"paperWidth": A4_IN[0], "paperHeight": A4_IN[1], "preferCSSPageSize": True}
    printed = driver.execute_cdp_cmd("Page.printToPDF", {**options, "printBackground": False})
    path.write_bytes(base64.b64decode(printed["data"]))
