"""Other programs, run where they are installed, and how far their numbers are from ours."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
from peer_tracker import NoPeerError


class Others(NamedTuple):
    """Where the other programs are: Pythons that import them, commands, a folder."""

    peer_python: str  # whisk-janelia, movement, pims
    whacc_python: str
    poses_python: str  # DeepLabCut, sleap-io
    octave: str
    imagemagick: str
    toolbox: Path  # Piotr's Computer Vision Matlab Toolbox


def printed_by(python, code, *arguments, environment=None):
    """What a piece of Python prints as JSON, in the other environment; NoPeerError if it fails."""
    return _printed([str(python), "-c", code, *map(str, arguments)], environment)


def octave(program, code, *arguments):
    """What a piece of Octave prints as JSON; NoPeerError if it fails."""
    options = ["--no-gui", "--quiet", "--no-init-file", "--eval", code]
    # with --eval, Octave takes further words for its own: they come as a list of the code
    given = "argument = {" + ", ".join(f"'{a}'" for a in arguments) + "};\n"
    options[-1] = given + code
    return _printed([program, *options])


def _printed(command, environment=None):
    if shutil.which(command[0]) is None:
        raise NoPeerError(f"{command[0]} is not installed")
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise NoPeerError(f"{Path(command[0]).name}: {said[-1] if said else 'it failed'}")
    return json.loads(done.stdout.strip().splitlines()[-1])


def largest(one, other) -> float:
    """Largest difference; NaN on both sides counts as none, NaN on one side as infinite."""
    one, other = np.asarray(one, float), np.asarray(other, float)
    if one.shape != other.shape or (np.isnan(one) != np.isnan(other)).any():
        return np.inf
    return float(np.nanmax(np.abs(one - other), initial=0))
