"""Pages of a PDF: their words, and how full they are; by the tools of Poppler."""

import re
import shutil
import subprocess
from html import unescape

import cv2
import numpy as np
import pytest

DPI = 40
PAGE = re.compile(r'<page width="([\d.]+)" height="([\d.]+)">(.*?)</page>', re.DOTALL)
WORD = re.compile(r'xMin="([\d.-]+)" yMin="([\d.-]+)" xMax="([\d.-]+)" yMax="([\d.-]+)">(.*?)<')


def need_poppler() -> None:
    """Skip the test where pdftotext and pdftoppm are not installed."""
    if not all(map(shutil.which, ("pdftotext", "pdftoppm"))):
        pytest.skip("no pdftotext and pdftoppm (poppler-utils) on this computer")


def pages_of(pdf) -> list[dict]:
    """Each page's `size` [pt], `words` (text, left, top, right, bottom) and `ink`, by row."""
    text = subprocess.run(
        ["pdftotext", "-bbox", str(pdf), "-"], capture_output=True, text=True, check=True
    ).stdout
    stem = pdf.with_suffix("")
    subprocess.run(["pdftoppm", "-r", str(DPI), "-gray", "-png", str(pdf), str(stem)], check=True)
    pictures = sorted(stem.parent.glob(f"{stem.name}-*.png"))
    return [
        {
            "size": (float(width), float(height)),
            "words": [
                (unescape(word), *(float(v) for v in box)) for *box, word in WORD.findall(content)
            ],
            "ink": (cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE) < 200).any(axis=1),
        }
        for (width, height, content), picture in zip(PAGE.findall(text), pictures, strict=True)
    ]


def filled(page) -> float:
    """How far down the page is full, 0 to 1."""
    rows = np.flatnonzero(page["ink"])
    return (rows[-1] + 1) / len(page["ink"]) if len(rows) else 0.0


def ink_below(page, bottom_pt) -> int:
    """Rows of the page with ink below a height [pt]."""
    first = int(np.ceil(bottom_pt / page["size"][1] * len(page["ink"]))) + 1
    return int(page["ink"][first:].sum())
