"""Text in pictures: all letters and units, smooth, and legible on any background."""

from functools import cache, lru_cache

import numpy as np

FONT = "DejaVuSans.ttf"  # that matplotlib brings along: the same on every machine
HALO_PX = 2


@cache
def _font(size: int):
    from matplotlib import get_data_path
    from PIL import ImageFont

    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{FONT}", size)


@lru_cache(maxsize=4096)
def _mask(words, size, halo):
    """Coverage of a text, 0–1 (height, width), and the place of its first pixel."""
    mask, offset = _font(size).getmask2(words, mode="L", stroke_width=halo)
    width, height = mask.size
    return np.asarray(mask, np.float32).reshape(height, width) / 255, offset


@lru_cache(maxsize=4096)
def text_width(words: str, size: int) -> int:
    """Width of a text [px]."""
    return int(np.ceil(_font(size).getlength(words)))


def line_height(size: int) -> int:
    """Distance of lines of text [px]."""
    return round(1.35 * size)


def put_text(picture, words: str, place, colour, size: int, halo=None) -> None:
    """Draw words into a picture, the top left corner of their line at `place` (x, y) [px].

    What lies outside the picture is left out.

    Parameters
    ----------
    picture : uint8 (height, width, 3)
    colour, halo : as the picture's; `halo` lies around the letters, None: there is none
    """
    if not words:
        return
    if halo is not None:
        _blend(picture, *_mask(words, size, HALO_PX), place, halo)
    _blend(picture, *_mask(words, size, 0), place, colour)


def _blend(picture, mask, offset, place, colour):
    x, y = (int(p) + int(o) for p, o in zip(place, offset, strict=True))
    mask = mask[max(-y, 0) :, max(-x, 0) :]
    x, y = max(x, 0), max(y, 0)
    part = picture[y : y + mask.shape[0], x : x + mask.shape[1]]
    share = mask[: part.shape[0], : part.shape[1], None]
    part[:] = np.round(part + share * (np.asarray(colour, np.float32) - part))
