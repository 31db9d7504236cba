"""Processes, progress, timing, and compiled code kept on disk."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "folder_lock": ["locked"],
        "numba_cache": ["prepare_cache"],
        "progress": ["Progress", "Step"],
        "run_log": ["RunLog"],
        "timing": ["Clock", "Counted"],
        "workers": ["run_tasks"],
    },
)
