"""What people look at: figures, report, overlay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "notebook_plots": ["plot_centrelines", "plot_contacts", "plot_course"],
        "figures": ["write_fig3"],
        "overlay": ["write_overlay"],
        "report": ["write_report"],
    },
)
