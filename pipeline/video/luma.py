"""The luma plane of a decoded frame, as the codec stored it.

Luma is passed on as stored: a limited-range stream keeps black at 16 and white at 235, a
full-range one 0 and 255. No scaling, so frames stay comparable and cost no conversion; contrasts
in a limited-range video are 14 % lower, which nothing downstream depends on. Only formats without
a luma plane (RGB, palettes) are converted.
"""

import av
import cv2
import numpy as np

from pipeline.video.base import bits_to_drop, to_8_bit

# Byte offset of the first luma sample and step to the next in packed formats.
PACKED_LUMA = {"yuyv422": (0, 2), "yvyu422": (0, 2), "uyvy422": (1, 2), "ya8": (0, 2)}
GREY_16 = "gray16"
PLANAR_LUMA = ("yuv4", "yuvj4", "yuva4", "gray", "nv12", "nv21", "nv16")


class LumaReader:
    """Turns PyAV frames into uint8 images, 16-bit ones with one scale for the whole stream."""

    def __init__(self):
        self.drop = None
        self.bits = {}  # by format: to ask for them takes as long as all else

    def __call__(self, frame: av.VideoFrame, lend: bool = False) -> np.ndarray:
        """Return the luma of `frame`, uint8 (height, width), C-contiguous.

        It is in memory of its own, or, with `lend`, in the decoder's, where that holds it so: then
        it lasts as long as the array, but must not be written to, as other frames refer to it.
        """
        name = frame.format.name
        plane = frame.planes[0]
        if plane.line_size > 0:
            if name in PACKED_LUMA:
                offset, step = PACKED_LUMA[name]
                return _rows(plane, frame, np.uint8, step)[:, offset::step].copy()
            if name.startswith(PLANAR_LUMA):
                return self._planar(frame, plane, name, lend)
        elif name.startswith(GREY_16):
            return self._reduced(_grey_16(frame), 16)
        rgb = frame.to_ndarray(format="rgb24")  # palettes, RGB, and images stored bottom-up
        return cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)

    def _planar(self, frame, plane, name, lend):
        if name not in self.bits:
            self.bits[name] = frame.format.components[0].bits
        bits = self.bits[name]
        if bits == 8:
            image = _rows(plane, frame, np.uint8)
            return np.ascontiguousarray(image) if lend else image.copy()
        return self._reduced(_rows(plane, frame, _words(name)), bits)

    def _reduced(self, image, bits):
        """An image of more than 8 bits in 8."""
        drop = bits - 8 if bits < 16 else self.drop
        return to_8_bit(image, bits_to_drop(int(image.max())) if drop is None else drop)

    def largest(self, frame: av.VideoFrame) -> int | None:
        """Return the largest value of a 16-bit grey frame, None for all other formats."""
        return int(_grey_16(frame).max()) if frame.format.name.startswith(GREY_16) else None


def _grey_16(frame):
    """Values of a 16-bit grey frame, also of one that is stored bottom-up."""
    if frame.planes[0].line_size < 0:  # cannot be viewed; another order of bytes is a copy
        other = "gray16be" if frame.format.name == "gray16le" else "gray16le"
        frame = frame.reformat(format=other)
    return _rows(frame.planes[0], frame, _words(frame.format.name))


def _words(name) -> str:
    """Type of the values of a format of more than 8 bits."""
    return ">u2" if name.endswith("be") else "<u2"


def _rows(plane, frame, dtype, step=1):
    """View a plane as (height, width · step) without the padding at the end of its rows."""
    dtype = np.dtype(dtype)
    shape = frame.height, frame.width * step
    return np.ndarray(shape, dtype, plane, strides=(plane.line_size, dtype.itemsize))
