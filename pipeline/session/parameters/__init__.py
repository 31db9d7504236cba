"""Parameters of the analysis: a frozen table per room, set in `[advanced.<room>]`.

Lengths are in millimetres and times in seconds, so that they hold for any camera; rooms convert
them with the recording's scale and frame rate. A room's parameters are declared in the file of its
name, one field each: plausible range and unit, default, meaning, and where the default comes from.
`python -m pipeline.session.parameters` prints docs/parameters.md.
"""

from pydantic.dataclasses import dataclass

from pipeline.session.parameters.contacts import ContactParams
from pipeline.session.parameters.detection import DetectionParams
from pipeline.session.parameters.forces import RodParams
from pipeline.session.parameters.identity import IdentityParams
from pipeline.session.parameters.kinematics import KinematicsParams
from pipeline.session.parameters.scene import SceneParams
from pipeline.session.parameters.tracking import TrackerParams
from pipeline.session.quantities import TABLE

__all__ = [
    "DEFAULTS",
    "ContactParams",
    "DetectionParams",
    "IdentityParams",
    "KinematicsParams",
    "Parameters",
    "RodParams",
    "SceneParams",
    "TrackerParams",
]


@dataclass(frozen=True, config=TABLE)
class Parameters:
    """The parameters of all rooms."""

    scene: SceneParams = SceneParams()
    detection: DetectionParams = DetectionParams()
    tracking: TrackerParams = TrackerParams()
    identity: IdentityParams = IdentityParams()
    kinematics: KinematicsParams = KinematicsParams()
    forces: RodParams = RodParams()
    contacts: ContactParams = ContactParams()


DEFAULTS = Parameters()
