"""session.toml, and which videos it holds for."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "given": ["settings_given"],
        "inputs": ["find_inputs"],
        "parameters": [
            "DEFAULTS",
            "ContactParams",
            "KinematicsParams",
            "Parameters",
            "RodParams",
            "SceneParams",
        ],
        "recording": ["Recording"],
        "schema": ["Settings"],
        "session_file": ["SettingsError", "read_session", "settings_from", "write_session"],
    },
)
