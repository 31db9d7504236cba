"""Files as cameras write them, byte by byte: StreamPix, Phantom's CINE, packed TIFF."""

import struct

import numpy as np


def streampix(frames, true_bits=None, version=3, count=None, rate=1000.0, **other) -> bytes:
    """A `.seq` file of uint8 or uint16 `frames` (n, height, width), a time stamp after each.

    The `times` [s] of these are those of the `rate` where none are given.
    """
    n, height, width = frames.shape
    bits = 8 * frames.dtype.itemsize
    size = frames[0].nbytes
    stride = -(-(size + 8) // 512) * 512  # whole sectors
    fields = width, height, bits, true_bits or bits, size, other.get("image_format", 100)
    head = struct.pack(
        "<I24siI512s", 0xFEED, "Norpix seq\n".encode("utf-16-le"), version, 1024, b""
    )
    head += struct.pack("<8IId", *fields, n if count is None else count, 0, stride, rate)
    head += bytes(28) + struct.pack("<I", other.get("compression", 0))
    out = bytearray(head.ljust(8192 if version >= 5 else 1024, b"\0"))
    for frame, time in zip(frames, other.get("times", np.arange(n) / rate), strict=True):
        micro = round(1e6 * time)
        parts = micro // 1_000_000, micro // 1000 % 1000, micro % 1000 * (version >= 5)
        stamp = struct.pack("<IHH", 1_500_000_000 + parts[0], *parts[1:])
        out += (frame.astype(frame.dtype.newbyteorder("<")).tobytes() + stamp).ljust(stride, b"\0")
    return bytes(out)


def cine(frames, rate=1000) -> bytes:
    """A `.cine` file of uint8 or uint16 `frames` (n, height, width), the lowest row first."""
    n, height, width = frames.shape
    bits, size, setup_bytes = 8 * frames.dtype.itemsize, frames[0].nbytes, 0x163C
    image_head, setup, offsets = 44, 44 + 40, 44 + 40 + setup_bytes
    out = bytearray(
        struct.pack("<2s3HiIiIIIIQ", b"CI", 44, 0, 1, 0, n, 0, n, image_head, setup, offsets, 0)
    )
    out += struct.pack("<IiiHHIIiiII", 40, width, height, 1, bits, 0, size, 0, 0, 0, 0)
    out += bytes(setup_bytes)
    struct.pack_into("<2sH", out, setup + 140, b"ST", setup_bytes)
    struct.pack_into("<I", out, setup + 768, rate)
    first = offsets + 8 * n
    out += struct.pack(f"<{n}q", *(first + k * (8 + size) for k in range(n)))
    for frame in frames:
        upright = frame[::-1].astype(frame.dtype.newbyteorder("<"))
        out += struct.pack("<II", 8, size) + upright.tobytes()
    return bytes(out)


def packed_tiff(frames, bits=12) -> bytes:
    """A TIFF stack whose pixels of `bits` bits follow upon each other without gaps."""
    out, place = bytearray(b"II*\0"), 4
    out += bytes(4)
    for frame in frames:
        data = _packed(frame, bits)
        start = len(out)
        out += data + bytes(len(data) % 2)
        struct.pack_into("<I", out, place, len(out))
        entries = _tags(*frame.shape, bits, start, len(data))
        out += struct.pack("<H", len(entries))
        for tag, kind, value in entries:
            out += struct.pack("<HHII", tag, kind, 1, value)
        place = len(out)
        out += bytes(4)
    return bytes(out)


def _tags(height, width, bits, start, size):
    """Directory entries (tag, type, value) of one grey, uncompressed page in one strip."""
    short, long = 3, 4
    return [
        (256, short, width), (257, short, height), (258, short, bits), (259, short, 1),
        (262, short, 1), (273, long, start), (277, short, 1), (278, short, height),
        (279, long, size),
    ]  # fmt: skip


def _packed(frame, bits):
    """Rows of pixels as bits, the highest first, each row to whole bytes."""
    single = (frame[..., None] >> np.arange(bits)[::-1]) & 1
    return np.packbits(single.reshape(len(frame), -1).astype(np.uint8), axis=1).tobytes()
