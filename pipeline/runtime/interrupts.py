"""Ctrl-C that is never lost.

Python raises KeyboardInterrupt wherever the main thread is. Where exceptions are ignored (while
an object is deleted, in a callback of a library), it would be ignored, too, and the run would go
on. So it is remembered, and raised again at the next `check`.
"""

import signal

INTERRUPTED = 130  # exit status

_pressed = False


def listen() -> None:
    """Raise KeyboardInterrupt at Ctrl-C, and where the process is asked to end (SIGTERM)."""
    global _pressed
    _pressed = False
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _remember)


def _remember(number, frame):
    global _pressed
    _pressed = True
    raise KeyboardInterrupt


def check() -> None:
    """Raise KeyboardInterrupt where Ctrl-C was pressed since `listen`."""
    if _pressed:
        raise KeyboardInterrupt
