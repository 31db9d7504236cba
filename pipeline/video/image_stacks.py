"""TIFF stacks and folders of images as videos, read page by page."""

import contextlib
import os
import struct
from pathlib import Path

import cv2
import numpy as np
import tifffile
from PIL import Image

from pipeline.errors import VideoError, counted
from pipeline.numerics.runs import evenly
from pipeline.video.base import RandomAccessVideo, bits_to_drop, check_pixels, to_8_bit
from pipeline.video.decoder_log import lost_pages
from pipeline.video.frame_faults import SHOWN, missing_numbers, renumbered
from pipeline.video.image_file import decoded

PNG = b"\x89PNG\r\n\x1a\n"  # a file of that kind begins so; width and height are at byte 16
PACKED_BITS = (10, 12, 14)
MOST_BROKEN = 1000  # images in a row: behind more, none is looked for
PROBES = 16  # frames looked at to find the bit depth of a 16-bit stack


class ImageStack(RandomAccessVideo):
    """Images of one size; 16-bit images are all scaled by the same power of two.

    `true_bits` says how many of the 16 the camera fills, where that is known.
    """

    def __init__(self, path, n_frames, true_bits=8):
        first = self._first_image(n_frames)
        super().__init__(path, first.shape[1], first.shape[0], n_frames)
        self._drop = 0
        if first.dtype == np.uint16:
            probes = evenly(n_frames, PROBES)
            largest = bits_to_drop(max(self._largest(i) for i in probes))
            self._drop = max(largest, min(true_bits, 16) - 8)

    def _image(self, index) -> np.ndarray:
        """Return image `index`, uint8 or uint16 (height, width)."""
        raise NotImplementedError

    def _first_image(self, n_frames):
        """The first image that can be read; VideoError of the first one where none can."""
        try:
            return self._image(0)
        except VideoError:
            later = self._readable_after(0, n_frames)
            if later is None:
                raise
            return self._image(later)

    def _readable_after(self, index, n_frames) -> int | None:
        """The next image behind `index` that can be read, of the MOST_BROKEN that follow."""
        for later in range(index + 1, min(index + 1 + MOST_BROKEN, n_frames)):
            with contextlib.suppress(VideoError):
                self._image(later)
                return later
        return None

    def _read(self, start, stop):
        for i in range(start, self.n_frames if stop is None else min(stop, self.n_frames)):
            try:
                image = self._image(i)
            except VideoError:
                if self._readable_after(i, self.n_frames) is None:
                    raise
                yield self._without(i)
                continue
            self.check_size(image, i)
            yield to_8_bit(image, self._drop)

    def _largest(self, index):
        try:
            return int(self._image(index).max())
        except VideoError:
            return 0  # raised again when the pass comes to that frame

    def _load(self, index):
        image = self._image(index)
        self.check_size(image, index)
        return to_8_bit(image, self._drop)


class StoredImages:
    """Images of plain pixels that lie in a file at equal distances.

    They are read, not mapped into memory: where a disk fails, or the file is cut off meanwhile,
    that would end the whole program.

    start, stride : byte at which the first image begins, bytes from one to the next
    """

    def __init__(self, path, start, stride, shape, dtype):
        self._file = open(path, "rb")  # noqa: SIM115, closed by close
        self._start, self._stride, self._shape = start, stride, shape
        self._dtype = np.dtype(dtype)
        self._bytes = int(np.prod(shape)) * self._dtype.itemsize

    def __len__(self):
        """How many whole images the file holds."""
        size = os.fstat(self._file.fileno()).st_size
        return max((size - self._start - self._bytes) // self._stride + 1, 0)

    def __getitem__(self, index):
        self._file.seek(self._start + int(index) * self._stride)
        data = self._file.read(self._bytes)
        if len(data) < self._bytes:
            raise EOFError("the file ends before it")
        image = np.frombuffer(data, self._dtype).reshape(self._shape)
        return image.astype(self._dtype.newbyteorder("="), copy=False)

    def behind(self, index, count) -> bytes:
        """So many bytes behind an image, fewer where the next one begins or the file ends."""
        self._file.seek(self._start + index * self._stride + self._bytes)
        return self._file.read(min(count, self._stride - self._bytes))

    def close(self):
        """Close the file."""
        self._file.close()


class TiffVideo(ImageStack):
    """The pages of a TIFF file."""

    def __init__(self, path):
        self._path, self._pillow = path, None
        try:
            with lost_pages() as lost:
                self._tiff = tifffile.TiffFile(path)
                self._pages = len(self._tiff.pages)
                self._volume = self._stored() if self._pages == 1 and not lost else None
        except Exception as error:  # tifffile raises many kinds on a broken file
            raise VideoError(
                path,
                f"cannot be read as TIFF ({error}): damaged or not a TIFF file; export it again",
            ) from error
        if self._volume is not None:
            self._pages = int(np.prod(self._tiff.series[0].shape[:-2]))
        self._lost = lost[0] if lost else ""
        super().__init__(path, self._pages + bool(lost))

    def _stored(self):
        """The images of a volume stored behind one page (as ImageJ does beyond 4 GB), or None."""
        series = self._tiff.series[0]
        if len(series.shape) < 3 or series.shape[-1] in (3, 4) or series.dataoffset is None:
            return None
        shape, dtype = series.shape[-2:], series.dtype.newbyteorder(self._tiff.byteorder)
        size = int(np.prod(shape)) * dtype.itemsize
        return StoredImages(self._path, series.dataoffset, size, shape, dtype)

    def _image(self, index):
        if index >= self._pages:
            raise VideoError(
                self._path,
                f"gives {counted(self._pages, 'page')}, then no more can be found ({self._lost}): "
                "the file is cut off or damaged; copy it again from the recording computer",
                int(index),
            )
        try:
            image = self._page(int(index)) if self._volume is None else self._volume[index]
        except VideoError:
            raise
        except Exception as error:
            raise unreadable(self._path, index, f"page {index}", error) from error
        return grey(image, self._path, index, cv2.COLOR_RGB2GRAY)

    def _page(self, index):
        page = self._tiff.pages[index]
        check_pixels(self._path, page.imagewidth, page.imagelength)
        if page.bitspersample in PACKED_BITS and page.compression == 1 and page.fillorder == 1:
            return _unpacked(page)
        try:
            return page.asarray()
        except ValueError as error:  # tifffile decodes few kinds of pages by itself
            if "imagecodecs" not in str(error):
                raise
        return self._decoded(index)

    def _decoded(self, index):
        """A compressed page, as of LZW, as Pillow reads it."""
        self._pillow = self._pillow or Image.open(self._path)
        self._pillow.seek(index)
        return np.asarray(self._pillow)

    def close(self):
        """Close the file."""
        for file in (self._volume, self._pillow, self._tiff):
            if file is not None:
                file.close()


def _unpacked(page):
    """Image of a page with packed pixels of 10 to 14 bits."""
    bits, file, data = page.bitspersample, page.parent.filehandle, bytearray()
    for start, size in zip(page.dataoffsets, page.databytecounts, strict=True):
        file.seek(start)
        data += file.read(size)
    rows = np.frombuffer(data, np.uint8).reshape(page.imagelength, -1)
    single = np.unpackbits(rows, axis=1)[:, : page.imagewidth * bits]
    weights = (1 << np.arange(bits)[::-1]).astype(np.uint16)
    return single.reshape(page.imagelength, page.imagewidth, bits) @ weights


class ImageFolderVideo(ImageStack):
    """Image files, in the given order, as one video.

    left_out, strangers : files beside them that are of other kinds, or have other names
    """

    def __init__(self, path, files, left_out=(), strangers=()):
        self._path = path
        self._files = list(files)
        super().__init__(path, len(self._files))
        if left_out:
            self.notes += (
                f"{counted(len(left_out), 'image')} of another kind left out "
                f"({_first(left_out)}): a video has images of one kind, here "
                f"{self._files[0].suffix}; convert them if they are frames, else move them away",
            )
        if strangers:
            self.notes += (
                f"{counted(len(strangers), 'image')} left out ({_first(strangers)}): names of a "
                f"video's images differ in their numbers alone, here {_first(self._files)}; "
                "rename them if they are frames, else put them into a folder of their own",
            )
        if restarts := renumbered([file.stem for file in self._files]):
            self.notes += (
                f"the numbers of the images begin again at {self._files[restarts[0]].name}: if "
                "other cameras or recordings begin there, put each into a folder of its own",
            )
        missing = missing_numbers([file.name for file in self._files])
        if missing:
            self.notes += (
                f"the numbers of the images leave out {len(missing)} "
                f"({', '.join(map(str, missing[:SHOWN]))}{', …' * (len(missing) > SHOWN)}): "
                "later times are too early; copy them here, if they were recorded",
            )

    def _image(self, index):
        file = self._files[index]
        image = self._decoded(file)
        if image is None:
            what = file.name if file != self._path else "it"
            raise unreadable(self._path, index, what, "damaged or no image")
        return grey(image, file, index, cv2.COLOR_BGR2GRAY)

    def _decoded(self, file):
        """The image in a file, None where it holds none."""
        try:
            data = np.fromfile(file, np.uint8)
        except OSError:
            return None
        if data[:8].tobytes() == PNG:
            check_pixels(file, *struct.unpack(">II", data[16:24].tobytes().ljust(8, b"\1")))
        return decoded(data)


def _first(files) -> str:
    """The first one's name, and whether there are more."""
    return f"{files[0].name}{', …' * (len(files) > 1)}"


def unreadable(path, index, what, reason) -> VideoError:
    """The error for a frame that cannot be read; `what` is its file or page."""
    return VideoError(
        path,
        f"frame {index}: {what} cannot be read ({reason}); export it again or remove it",
        int(index),
    )


def grey(image, path, index, conversion):
    """Return a (height, width) uint8 or uint16 image of a grey or colour one."""
    if image.dtype == bool:
        image = image.astype(np.uint8) * 255
    if image.dtype not in (np.uint8, np.uint16):
        raise VideoError(
            path,
            f"has {image.dtype} pixels: expected unsigned 8 or 16 bit; convert it (in ImageJ: "
            f"Image > Type > 8-bit)",
            int(index),
        )
    if image.ndim == 3 and image.shape[2] in (3, 4):
        return cv2.cvtColor(np.ascontiguousarray(image[..., :3]), conversion)
    if image.ndim == 3 and image.shape[2] in (1, 2):  # grey, or grey and alpha
        return image[..., 0]
    if image.ndim != 2:
        raise VideoError(
            path, f"has pages of shape {image.shape}: expected grey or RGB images; export it so", 0
        )
    return image


def is_stack(path: Path) -> bool | None:
    """Whether a TIFF file holds more than one image; None if it cannot be read."""
    try:
        with lost_pages() as lost, tifffile.TiffFile(path) as tiff:
            if len(tiff.pages) > 1:
                return True
            shape = tiff.series[0].shape
        return None if lost else len(shape) > 2 and shape[-1] > 4
    except Exception:  # tifffile raises many kinds on a broken file
        return None
