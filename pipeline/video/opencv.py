"""Video files that only OpenCV reads, through a codec of the operating system, say."""

import cv2

from pipeline.errors import VideoError
from pipeline.video.base import Video
from pipeline.video.decoder_log import silent_opencv


class OpenCvVideo(Video):
    """A video file read through OpenCV, by any backend but FFmpeg."""

    def __init__(self, path, backend: int | None = None):
        self._backend = _backend_for(path) if backend is None else backend
        capture = cv2.VideoCapture(str(path), self._backend)
        ok, frame = capture.read()
        count = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        if not ok:
            raise VideoError(path, "OpenCV can read no frame of it")
        height, width = frame.shape[:2]
        super().__init__(path, width, height, count if count > 0 else None, exact_count=False)

    def _read(self, start, stop):
        capture = cv2.VideoCapture(str(self.path), self._backend)
        index = 0
        try:
            while (stop is None or index < stop) and capture.grab():
                if index >= start:
                    _, frame = capture.retrieve()
                    self.check_size(frame, index)
                    yield frame if frame.ndim == 2 else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
                index += 1
        finally:
            capture.release()


def _backend_for(path):
    """Return the first OpenCV backend that opens the file; FFmpeg was tried already."""
    with silent_opencv():
        for backend in cv2.videoio_registry.getStreamBackends():
            if backend in (cv2.CAP_FFMPEG, cv2.CAP_IMAGES):
                continue
            capture = cv2.VideoCapture(str(path), backend)
            if capture.isOpened():
                capture.release()
                return backend
    raise VideoError(path, "OpenCV cannot open it")
