"""Measurements that fill session.toml: whiskers' dimensions, ring-downs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "geometry": ["measure_geometry"],
        "geometry_files": ["write_geometry"],
        "ringdown": ["fit_slip"],
        "ringdown_files": ["write_ringdown"],
        "slips": ["find_slips"],
    },
)
