"""Whiskers' dimensions, ring-downs, follicles; two views together."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "dust_files": ["write_dust"],
        "find_whisker": ["NoWhiskerError"],
        "follicle_motion": ["measure_follicle_motion"],
        "geometry": ["measure_geometry"],
        "geometry_files": ["write_geometry"],
        "particle": ["NoParticleError"],
        "ringdown": ["TooShortError", "fit_slip"],
        "ringdown_files": ["write_ringdown"],
        "slips": ["find_slips"],
        "two_views": ["ViewsError", "fit_views"],
        "views": ["measure_views"],
        "views_files": ["write_views"],
    },
)
