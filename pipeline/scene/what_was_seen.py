"""What a video shows that is no whisker and no pole, in words, where one of them is not found."""

import cv2
import numpy as np

MOST = 2  # things that are named
LEAST_SHARE = 0.0005  # of the picture: smaller things are not worth a word


def seen_instead_of_pole(scenes) -> str:
    """What was seen where no pole is found, to follow "what was seen is "."""
    return "; ".join(_refused(scenes)) or " and ".join(_things(scenes)) or "nothing dark and round"


def seen_instead_of_whiskers(scenes) -> str:
    """What was seen where no whisker is found, to follow "what was seen is "."""
    scene = max(scenes, key=lambda each: each.face_mask.mean(), default=None)
    if scene is None:
        return "a picture in which everything moves"
    face = (
        f"something dark at the {scene.face_side} ({100 * scene.face_mask.mean():.0f} % of the "
        "picture), with nothing thin moving out of it"
        if scene.face_mask.any()
        else f"nothing dark at the {scene.face_side}, where the face should be"
    )
    return " and ".join([face, *_refused(scenes), *_things(scenes)])


def _refused(scenes) -> list[str]:
    """What looked like a pole, and why it is none, each in some words."""
    refused = [
        f"{why} (at {x:.0f}, {y:.0f} px)" for each in scenes for x, y, why in each.refused_poles
    ]
    return list(dict.fromkeys(refused))[:MOST]


def _things(scenes) -> list[str]:
    """The largest dark still things off the face, each in some words."""
    if not scenes:
        return []
    mask = np.any([scene.obstacle_mask for scene in scenes], axis=0)
    _, _, stats, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    area = stats[:, cv2.CC_STAT_AREA].copy()
    area[0] = 0
    largest = [k for k in np.argsort(-area)[:MOST] if area[k] > LEAST_SHARE * mask.size]
    return [
        f"a dark thing of {stats[k, cv2.CC_STAT_WIDTH]} × {stats[k, cv2.CC_STAT_HEIGHT]} px about "
        f"({centres[k, 0]:.0f}, {centres[k, 1]:.0f}) px"
        for k in largest
    ]
