"""What does not move: background, noise, face, pole."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "dust": ["is_passed_over"],
        "circle_fit": ["Pole"],
        "estimate": ["find_scenes", "pole_of_another_size", "still_states", "survey"],
        "preparation": ["prepare_video"],
        "epochs": ["Epoch", "face_side_of", "pole_track", "without_pole", "without_poles"],
        "pole_runs": ["pole_at"],
        "scale": ["scale_of", "working_scale"],
    },
)
