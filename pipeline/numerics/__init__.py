"""Splines, polylines, chains, statistics: nothing of whiskers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submod_attrs={"angles": ["wrap_angle"], "runs": ["runs_of_true"]}
)
