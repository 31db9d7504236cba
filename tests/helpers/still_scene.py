"""The static scene of a few frames in which only whiskers move."""

from pipeline.scene.estimate import StillState
from pipeline.scene.scale import working_scale
from pipeline.session.parameters import DEFAULTS


def scene_from_frames(frames, recording, pole_diameter_m=0.5e-3, pole_xy=None, n_frames=1):
    """The scene of frames, uint8 (k, height, width); a diameter of None: without a pole."""
    scale = working_scale(frames.shape[1:], recording.pixels_per_mm)
    still = StillState(frames, recording.face, scale, DEFAULTS)
    radius = pole_diameter_m and 0.5e3 * pole_diameter_m * recording.pixels_per_mm
    return still.scene(radius, pole_xy, n_frames)
