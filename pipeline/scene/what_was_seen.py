"""What a video shows instead, in words, where no whisker or no pole is found."""

import cv2
import numpy as np

from pipeline.scene.face import SIDES, border

MOST = 2  # things that are named
LEAST_SHARE = 0.0005  # of the picture: smaller things are not worth a word


def seen_instead_of_pole(scenes, shade="dark") -> str:
    """What was seen where no pole is found: words that follow "what was seen is ".

    `shade`: of the whiskers, "dark" or "bright", against the ground.
    """
    things = " and ".join(_things(scenes, shade))
    return "; ".join(_refused(scenes)) or things or f"nothing {shade} and round"


def seen_instead_of_whiskers(scenes, shade="dark") -> str:
    """What was seen where no whisker is found: words that follow "what was seen is "."""
    scene = max(scenes, key=lambda each: each.face_mask.mean(), default=None)
    if scene is None:
        return "a picture in which everything moves"
    face = (
        f"something {shade} at the {scene.face_side} ({_share(scene.face_mask)}), with nothing "
        "thin moving out of it"
        if scene.face_seen and scene.face_mask.any()
        else f"nothing {shade} at the {scene.face_side}, where the face should be"
    )
    return " and ".join([face, *_refused(scenes), *_things(scenes, shade)])


def _refused(scenes) -> list[str]:
    """What looked like a pole, and why it is none, each in some words."""
    refused = [
        f"{why} (at {x:.0f}, {y:.0f} px)" for each in scenes for x, y, why in each.refused_poles
    ]
    return list(dict.fromkeys(refused))[:MOST]


def _things(scenes, shade) -> list[str]:
    """The largest still things of that shade off the face, each in some words."""
    if not scenes:
        return []
    looked_at = [scene.obstacle_mask & (scene.background > 0) for scene in scenes]
    mask = np.any(looked_at, axis=0)
    _, labels, stats, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    area = stats[:, cv2.CC_STAT_AREA].copy()
    area[0] = 0
    largest = [k for k in np.argsort(-area)[:MOST] if area[k] > LEAST_SHARE * mask.size]
    return [_thing(labels == k, stats[k], centres[k], shade) for k in largest]


def _thing(mask, stats, centre, shade) -> str:
    """One still thing: by its sides if it reaches into the picture, else by its size."""
    sides = [side for side in SIDES if border(mask, side).any()]
    if sides:
        joined = ", ".join(sides[:-1]) + " and " * (len(sides) > 1) + sides[-1]
        return f"something {shade} that reaches in from the {joined} ({_share(mask)})"
    width, height = stats[[cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    x, y = centre
    return f"a {shade} spot {width} px wide and {height} px high at ({x:.0f}, {y:.0f}) px"


def _share(mask) -> str:
    """How much of the picture a mask covers, in words."""
    percent = 100 * mask.mean()
    return f"{percent:.0f} % of the picture" if percent >= 0.5 else "less than 1 % of the picture"
