"""What takes the parameters of session.toml, with those that hold without one."""

from functools import partial

from pipeline.kinematics import resampled
from pipeline.session.parameters import DEFAULTS
from pipeline.tracking import options

options_for = partial(options.options_for, params=DEFAULTS)
measure_stations = partial(resampled.measure_stations, params=DEFAULTS.kinematics)
