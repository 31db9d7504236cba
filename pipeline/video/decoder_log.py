"""Damage that decoders only report in their log, while they guess and go on."""

import contextlib
import logging
import threading
from typing import ClassVar

import av
import av.logging
import cv2

ENDED_EARLY = "ended prematurely"  # what demuxers log of a file that is cut off
HARMLESS = ("Warning MVs not available",)  # logged for every stream that begins within a group
OF_PAGES = ("page", "corrupted")  # words of tifffile where pages are lost; others do not matter
SILENT = av.logging.PANIC  # a number: threads that are about to log compare with it


class DecoderLog:
    """Messages of FFmpeg, from all threads and all passes that are under way, as they come."""

    _captured: ClassVar[list] = []
    _readers: ClassVar[int] = 0
    _held: ClassVar = contextlib.ExitStack()
    _lock: ClassVar = threading.Lock()

    def __init__(self):
        self._read = len(self._captured)

    def new(self) -> list[str]:
        """Messages since the last call."""
        some = [text.strip() for _, _, text in self._captured[self._read :]]
        self._read += len(some)
        if some and DecoderLog._readers == 1:  # nobody else has to read them
            del self._captured[: self._read]
            self._read = 0
        return [text for text in some if text and not text.startswith(HARMLESS)]

    @classmethod
    def begin(cls) -> "DecoderLog":
        """Begin to read; FFmpeg writes nothing while nobody reads."""
        with cls._lock:
            cls._readers += 1
            if cls._readers == 1:
                av.logging.set_level(av.logging.ERROR)
                av.logging.set_skip_repeated(False)
                cls._captured = cls._held.enter_context(av.logging.Capture(local=False))
            return cls()

    @classmethod
    def end(cls) -> None:
        """Stop reading."""
        with cls._lock:
            cls._readers -= 1
            if not cls._readers:
                av.logging.set_level(SILENT)
                cls._held.close()


@contextlib.contextmanager
def decoder_log():
    """Yield the `DecoderLog` of FFmpeg while the block lasts."""
    log = DecoderLog.begin()
    try:
        yield log
    finally:
        log.end()


@contextlib.contextmanager
def lost_pages():
    """Yield a list that takes what tifffile logs of pages that it cannot find."""
    said = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: said.append(record.getMessage())
    logger = logging.getLogger("tifffile")
    logger.addHandler(handler)
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        said[:] = [text for text in said if any(word in text for word in OF_PAGES)]


@contextlib.contextmanager
def silent_opencv():
    """Let OpenCV write nothing to the terminal while the block lasts; messages name damage."""
    log = cv2 if hasattr(cv2, "setLogLevel") else cv2.utils.logging  # OpenCV 4, 5
    level = log.setLogLevel(0)
    try:
        yield
    finally:
        log.setLogLevel(level)
