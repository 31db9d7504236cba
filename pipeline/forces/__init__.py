"""The elastic rod fitted to the whisker, and the force that bends it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "estimate": ["estimate_forces"],
        "forces": ["add_forces", "measure_forces"],
        "rest_shape": ["RestModel", "fit_rest"],
        "rod_fit": ["fit_free", "fit_loaded"],
    },
)
