"""The Janelia Whisker Tracker (PyPI `whisk-janelia`) as a peer: find it, run it, read its lines.

Its wheel's `trace` is linked against FFmpeg 6; the wheel of `av` 12.3.0 holds these libraries, so
an environment of its own does:

    python -m venv peer && peer/bin/pip install whisk-janelia av==12.3.0
    python workflows/benchmark_tracking.py --peer-python peer/bin/python
"""

import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.tables.centrelines import Centrelines

OPTIMISED = 3.3  # a build with optimisation is so many times faster than the wheel's
PROGRAMS = ("trace", "measure", "classify", "whisker_convert", "measurements_convert")
_MAGIC = b"bwhiskbin1\0\0"
_LOCATE = """
import importlib.util as u
for name in ("whisk", "av"):
    spec = u.find_spec(name)
    print(list(spec.submodule_search_locations)[0] if spec else "")
"""


class NoPeerError(RuntimeError):
    """The peer is not installed or does not start; the message says what to do."""


@dataclass(frozen=True)
class Peer:
    """The peer's `trace`, ready to run in a folder that holds its filter banks."""

    folder: Path
    environment: dict

    def run(self, program, *arguments) -> None:
        """Run one of PROGRAMS; RuntimeError where it fails."""
        timed([str(self.folder / program), *map(str, arguments)], self)

    def trace(self, video) -> tuple[Centrelines, float, float]:
        """Trace a video; lines, wall and CPU time [s]. Lines are all called "peer"."""
        out = self.folder / "lines.whiskers"
        out.unlink(missing_ok=True)
        wall, cpu = timed([str(self.folder / "trace"), str(video), str(out)], self)
        return read_whiskers(out), wall, cpu


def find_peer(python=None, banks_video=None) -> Peer:
    """Set the peer up in a folder of its own, from the environment of `python` or this one.

    `banks_video` is a short video: the first run makes filter banks, which later ones read; with
    none, nothing is tried.
    NoPeerError where it is not there or does not start.
    """
    where = subprocess.run(
        [str(python or sys.executable), "-c", _LOCATE], capture_output=True, text=True
    )
    package, decoder = (
        ((*where.stdout.splitlines(), "", "")[:2]) if not where.returncode else ("", "")
    )
    binary = Path(package) / "bin" / "trace"
    if not package or not binary.is_file():
        raise NoPeerError(
            f"whisk-janelia is not installed for {python or sys.executable}; install it with "
            "av==12.3.0 into an environment and give its python with --peer-python"
        )
    folder = Path(tempfile.mkdtemp(prefix="peer_"))
    for program in (*PROGRAMS, *(p.name for p in binary.parent.glob("lib*.so"))):
        shutil.copy(binary.with_name(program), folder / program)
        (folder / program).chmod(0o755)
    peer = Peer(folder, _environment(folder, decoder))
    if banks_video is None:
        return peer
    try:
        peer.trace(banks_video)
    except (OSError, RuntimeError, ValueError) as error:
        shutil.rmtree(folder)
        raise NoPeerError(
            f"the peer does not run ({error}); it needs the libraries of FFmpeg 6, which the "
            "wheel of av==12.3.0 brings when it is installed beside it"
        ) from None
    return peer


def _environment(folder, decoder) -> dict:
    """Environment with the FFmpeg libraries of the wheel of `av` under their plain names."""
    environment = dict(os.environ)
    libraries = Path(decoder).parent / "av.libs"
    if decoder and libraries.is_dir():
        for path in libraries.glob("lib*-*.so.*"):
            name, rest = path.name.split("-", 1)
            plain = folder / f"{name}.so.{rest.split('.so.', 1)[1].split('.')[0]}"
            if not plain.exists():
                plain.symlink_to(path)
        environment["LD_LIBRARY_PATH"] = f"{folder}{os.pathsep}{libraries}"
    return environment


def timed(command, peer: Peer | None = None) -> tuple[float, float]:
    """Run a command to its end: wall time [s], CPU time [s].

    RuntimeError with the end of what it said where it fails.
    """
    with tempfile.TemporaryFile() as said:
        started = time.perf_counter()
        child = subprocess.Popen(
            command,
            stdout=said,
            stderr=subprocess.STDOUT,
            cwd=peer.folder if peer else None,
            env=peer.environment if peer else None,
        )
        _, status, used = os.wait4(child.pid, 0)
        wall = time.perf_counter() - started
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            said.seek(0)
            text = said.read().decode(errors="replace").strip().splitlines()
            raise RuntimeError(f"{Path(command[0]).name} failed: {' '.join(text[-3:])}")
    return wall, used.ru_utime + used.ru_stime


def read_whiskers(path) -> Centrelines:
    """Read the lines of a binary `.whiskers` file.

    After a magic word, each line is: its number, frame and count n as int32; then x, y,
    thickness and score as n float32 each. The file ends with the number of lines.

    Raises ValueError for a file of another kind.
    """
    data = Path(path).read_bytes()
    if not data.startswith(_MAGIC):
        raise ValueError(f"{path} is not a binary .whiskers file: it starts with {data[:12]!r}")
    place, end, frames, lines = len(_MAGIC), len(data) - 4, [], []
    while place < end:
        _, frame, n = struct.unpack_from("<3i", data, place)
        values = np.frombuffer(data, "<f4", 4 * n, place + 12).reshape(4, n)
        frames.append(frame)
        lines.append(values[:2])
        place += 12 + 16 * n
    order = np.argsort(frames, kind="stable")
    sizes = [lines[k].shape[1] for k in order]
    points = np.concatenate([lines[k] for k in order], axis=1) if lines else np.empty((2, 0), "f4")
    return Centrelines(
        names=("peer",),
        frame=np.array(frames, np.int32)[order],
        whisker=np.zeros(len(lines), np.int32),
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        x_px=points[0].copy(),
        y_px=points[1].copy(),
        se_px=np.full(points.shape[1], np.nan, np.float32),
        confidence=np.ones(len(lines), np.float32),
    )
