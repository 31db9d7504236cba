"""How near a whisker comes to the pole: of several, the one that session.toml names touches it."""

import numpy as np

from pipeline.numerics.polyline import nearest_node
from pipeline.session.quantities import pixels_in

NEAR_MM = 0.5  # from the pole's surface: a whisker so near is about to touch it
NEVER = 0.05  # where none comes near, how well they are seen decides


def nearness(lines, poles, n_frames, pixels_per_m) -> float:
    """How near to the pole a whisker is in the mean over frames, from NEVER to 1 + NEVER.

    Parameters
    ----------
    lines : `Line`s of the whisker; poles : the `PoleTrack` in the frame of each, None: no pole
    n_frames : frames in all, also those without a line
    pixels_per_m : scale [px/m]
    """
    near_px = pixels_in(NEAR_MM, pixels_per_m)
    away = [_away_px(line, pole) for line, pole in zip(lines, poles, strict=True) if pole]
    return NEVER + float(np.exp(-np.array(away) / near_px).sum()) / n_frames


def _away_px(line, pole) -> float:
    """From the pole's surface to the nearest node of a line [px], not less than 0.

    Nodes are 1 px apart: between them a line comes nearer by 0.02 px, at a pole of 6 px radius.
    """
    n = line.n
    _, away = nearest_node(line.x[:n], line.y[:n], pole.x_px[0], pole.y_px[0])
    return max(away - pole.radius_px, 0.0)
