"""StreamPix sequences (`.seq` of NorPix): a header, then frames at a fixed distance.

Numbers are little-endian. Plain grey frames of 8 bits, or of 9 to 16 bits in 16, are read; what
StreamPix has compressed or packed, it must export. Behind a frame is the time at which it came:
seconds, milliseconds and, since version 5 of the header, microseconds.
"""

import contextlib
import struct
from typing import NamedTuple

from pipeline.errors import VideoError, counted, in_words
from pipeline.video.frame_faults import missing_by_times
from pipeline.video.image_stacks import ImageStack, StoredImages, unreadable

MAGIC = 0xFEED
MONO = 100  # image format: one grey value per pixel
FIELDS = struct.Struct("<I24xi516x7I4xId28xI")  # of the first 624 bytes, those that are used
OLD_START, START = 1024, 8192  # byte of the first frame, by the header's version
OLD_STAMP, STAMP = struct.Struct("<IH"), struct.Struct("<IHH")
FIRST_NEW_VERSION = 5
EXPORT = "export it with StreamPix as uncompressed mono .seq, or as AVI or TIFF"


class Header(NamedTuple):
    """What the header says of a sequence; sizes and distances in bytes."""

    magic: int
    version: int
    width: int
    height: int
    bit_depth: int
    true_bit_depth: int
    image_bytes: int
    image_format: int
    frames: int
    stride: int
    frames_per_second: float
    compression: int

    @property
    def is_new(self) -> bool:
        """Whether the header is longer, and times are given to a microsecond."""
        return self.version >= FIRST_NEW_VERSION

    @property
    def start(self) -> int:
        """Byte at which the first frame begins."""
        return START if self.is_new else OLD_START


class StreamPixVideo(ImageStack):
    """The frames of a `.seq` file.

    Attributes
    ----------
    header : Header
    """

    def __init__(self, path):
        self._path = path
        self.header = header = read_header(path)
        shape, dtype = (header.height, header.width), "u1" if header.bit_depth == 8 else "<u2"
        self._images = StoredImages(path, header.start, header.stride, shape, dtype)
        count = header.frames or len(self._images)  # a recording that was broken off counts none
        if not len(self._images):
            raise VideoError(
                path, "holds no complete frame: it is cut off; copy or record it again", 0
            )
        super().__init__(path, count, true_bits=header.true_bit_depth)

    def _image(self, index):
        if index >= len(self._images):
            raise VideoError(
                self._path,
                f"holds {counted(len(self._images), 'frame')}, its header says "
                f"{self.header.frames}: the file is cut off or damaged; copy it again from the "
                "recording computer",
                int(index),
            )
        try:
            return self._images[index]
        except OSError as error:
            raise unreadable(self._path, index, "it", in_words(error)) from error

    def _read(self, start, stop):
        times = []
        try:
            for image in super()._read(start, stop):
                with contextlib.suppress(OSError, struct.error):  # the file ends before its time
                    times.append(self._time(start + len(times)))
                yield image
        finally:
            gaps, coarse = missing_by_times(times, 1e-6 if self.header.is_new else 1e-3)
            self.faults.coarse |= coarse and bool(gaps)
            self.faults.gaps += [(start + at, missing) for at, missing in gaps]

    def _time(self, index) -> float:
        """When a frame came [s]."""
        fields = STAMP if self.header.is_new else OLD_STAMP
        parts = fields.unpack(self._images.behind(index, fields.size))
        return sum(part * unit for part, unit in zip(parts, (1, 1e-3, 1e-6), strict=False))

    def close(self):
        """Close the file."""
        self._images.close()


def read_header(path) -> Header:
    """Read and check the header of a `.seq` file; VideoError where it cannot be read on."""
    with open(path, "rb") as file:
        head = file.read(FIELDS.size)
    if len(head) < FIELDS.size or head[:4] != struct.pack("<I", MAGIC):
        raise VideoError(
            path, "is not a StreamPix sequence, or is damaged; copy it again, or rename it"
        )
    header = Header(*FIELDS.unpack(head))
    if header.compression or header.image_format != MONO:
        raise VideoError(
            path,
            f"has compression {header.compression} and image format {header.image_format}: "
            f"expected 0 and {MONO}, plain grey frames; {EXPORT}",
        )
    bytes_per_pixel = {8: 1, 16: 2}.get(header.bit_depth)
    expected = header.width * header.height * (bytes_per_pixel or 0)
    if not 0 < expected == header.image_bytes <= header.stride:
        raise VideoError(
            path,
            f"has {header.width}×{header.height} pixels of {header.bit_depth} bits in "
            f"{header.image_bytes} bytes: expected 8 or 16 bits per pixel; {EXPORT}",
        )
    return header
