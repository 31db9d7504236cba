"""The parameters of naming as they are without a session.toml, at 1000 frames/s."""

from pipeline.identity.limits import Limits
from pipeline.session.parameters import DEFAULTS

USUAL = Limits(DEFAULTS.identity, 1000.0)
