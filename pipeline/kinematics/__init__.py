"""Follicle, angle, curvature and distance to the pole, from centrelines."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "fur_noise": ["locate_follicles"],
        "measure": ["Kinematics", "KinematicsMeter", "as_recorded"],
        "resampled": ["measure_stations"],
        "resampled_store": ["StationStore"],
        "stations": ["Stations"],
    },
)
