"""Contacts: when, how strong, and what they do at the base."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "analysis": ["ContactTables", "ContactOptions", "find_contacts", "no_contacts"],
        "corrections": [
            "apply",
            "corrections_given",
            "left_out",
            "read_corrections",
            "write_corrections",
        ],
    },
)
