"""The part of the animal from which whiskers grow: the face. The rest of it is body.

In many pictures, face and body are one dark mass. A long posterior whisker leaves the face and
ends in front of the body, so that both of its ends are at the edge of the mass. Whiskers are
darker at the base than at the tip: their dark ends show which part of the edge is face.
"""

from itertools import pairwise

import cv2
import numpy as np
from scipy.spatial import cKDTree

from pipeline.detection import ridges
from pipeline.detection.curves import length
from pipeline.detection.image_model import ImageModel, absorbance_image
from pipeline.detection.static_scene import OUTWARD, StaticScene
from pipeline.numerics.runs import runs_of_true
from pipeline.scene.background import median_over_time
from pipeline.scene.face import SIDES
from pipeline.scene.virtual_face import values_along

LOOKED_AT, FIRST_LOOK = 10, 4  # frames: where a face begins, and whether it is one
FEWEST_FRAMES = 8  # fewer do not show well what moves
DEEP = 0.15  # of the picture's size: shallower hollows of the edge hold no whisker's tip
SHORTEST = 0.07  # of the picture's size; shorter lines are fur
REACH = 0.04  # of the picture's size, between a line's end and the edge it belongs to
CONTINUED = 0.25  # of its length: so much of a line may drown in noise at its base
DARKER = 1.2  # a line's third at the base over that at the tip, absorbance
STILL = 0.5  # of a line's absorbance: what stays as dark in the usual frame does not move
RESTING = 0.25  # of its length counts where all of an animal's whiskers may rest
SWITCH = 3.0  # of the shortest whiskers must support a change from face to body on the edge
SWITCH_SHARE = 0.04  # the same, as a share of all whiskers seen
FEWEST_BASES = 0.1  # of the best part's: a part of the mass with fewer is no face


def face_of(mask, frames, scene: StaticScene, params) -> tuple[np.ndarray, str | None]:
    """Return the part of the animal's `mask` that bears whiskers, and the side that it is on.

    Parameters
    ----------
    mask : bool (height, width), the animal as one dark mass
    frames : uint8 (k, height, width)
    scene : what does not move, with `mask` as its face
    params : those of the room `detection`

    Returns
    -------
    face : bool (height, width); the whole mask where its edge has no hollow in which a whisker
        could end or is not in the picture, and where no whisker is seen
    side : side of the picture that lies behind the whiskers' bases; None where that is not looked
        at
    """
    size = float(np.sqrt(mask.size))
    edges = _edges(mask)
    if not edges or not _may_hold_tips(mask, DEEP * size):
        return mask, None
    whiskers = _whiskers(frames, scene, params, SHORTEST * size, RESTING)
    scores = _scores(edges, whiskers, REACH * size)
    if not any(np.any(score > 0) for _, score in scores):
        return mask, None
    labels = _labels(edges, scores, SWITCH * SHORTEST * size)
    side = _side(mask, edges, labels, scores, REACH * size)
    return mask & _nearest_label(edges, labels, mask.shape), side


def bears_whiskers(mask, frames, scene: StaticScene, params) -> bool:
    """Whether whiskers that move have their bases at the mask's edge; so, too, where few move.

    mask, frames, scene, params : as for `face_of`
    """
    size, edges = float(np.sqrt(mask.size)), _edges(mask)
    if len(frames) < FEWEST_FRAMES or not edges:
        return True
    few = frames[:: -(-len(frames) // FIRST_LOOK)]
    whiskers = _whiskers(few, scene, params, SHORTEST * size)
    if whiskers[:, 4].sum() < SWITCH * SHORTEST * size:
        return True
    gaps, _ = cKDTree(np.concatenate(edges)).query(_towards_the_face(whiskers))
    length = whiskers[:, 4]
    return length[gaps.min(axis=1) < REACH * size].sum() >= FEWEST_BASES * length.sum()


def _may_hold_tips(mask, depth_px) -> bool:
    """Whether the mask has several parts, or one with a hollow of at least `depth_px`."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return len(contours) > 1 or any(_hollow(each, mask.shape) > depth_px for each in contours)


def _hollow(contour, shape) -> float:
    """How far a contour stays inside of its convex hull at the most [px]."""
    hull = np.zeros((shape[0] + 2, shape[1] + 2), np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(contour) + 1, 1)
    x, y = contour[:, 0].T + 1
    return float(cv2.distanceTransform(hull, cv2.DIST_L2, 5)[y, x].max())


# ---- whiskers -----------------------------------------------------------------------------


def _whiskers(frames, scene, params, shortest_px, resting=0.0):
    """Of lines in some of the frames: x, y of base and of tip, length, float (n, 5).

    `resting`: what the length of a line that does not move counts; 0: it is left out
    """
    model = ImageModel.from_scene(scene, params)
    step = max(len(frames) // LOOKED_AT, 1)
    dark = np.stack([absorbance_image(each, model, model.gain(each)) for each in frames[::step]])
    usual = median_over_time(dark)
    found = []
    for image in dark:
        for curve in ridges.curves_of(image, model.noise).each():
            long = length(curve)
            if long <= shortest_px:
                continue
            now, mostly = (values_along(each, curve) for each in (image, usual))
            counts = resting if np.median(mostly) > STILL * np.median(now) else 1.0
            if counts and (ends := _base_and_tip(curve, now)):
                found.append((*ends[0], *ends[1], counts * long))
    return np.array(found, float).reshape(-1, 5)


def _towards_the_face(whiskers):
    """Places (n, k, 2) from the bases of lines, as in `_whiskers`, on straight beyond them."""
    base, tip, length = whiskers[:, None, :2], whiskers[:, None, 2:4], whiskers[:, None, 4:]
    chord = base - tip
    away = np.linspace(0, CONTINUED, 9)[:, None] * length
    return base + away * chord / np.linalg.norm(chord, axis=2, keepdims=True)


def _base_and_tip(curve, dark):
    """The dark and the pale end of a curve, of values along it; None where none is darker."""
    third = len(curve) // 3
    first, last = np.median(dark[:third]), np.median(dark[-third:])
    if max(first, last) < DARKER * min(first, last):
        return None
    return (curve[0], curve[-1]) if first > last else (curve[-1], curve[0])


# ---- the edge -----------------------------------------------------------------------------


def _edges(mask) -> list[np.ndarray]:
    """Edges of the mask's parts inside the picture, int (n, 2) of x, y each, in order."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    last = np.array(mask.shape[::-1]) - 1
    edges = []
    for contour in contours:
        points = contour[:, 0]
        inside = np.all((points > 0) & (points < last), axis=1)
        if inside.all():
            edges.append(points)
        elif inside.any():
            start = int(np.argmin(inside))  # on the border
            points, inside = np.roll(points, -start, axis=0), np.roll(inside, -start)
            edges += [points[a:b] for a, b in runs_of_true(inside) if b - a > 1]
    return edges


def _scores(edges, whiskers, reach_px):
    """For each edge, places along it, and the length of the whisker whose base is there.

    Tips count as negative lengths. Only whiskers whose base lies at an edge are taken.
    """
    owner = np.repeat(np.arange(len(edges)), [len(edge) for edge in edges])
    place = np.concatenate([np.arange(len(edge)) for edge in edges])
    tree = cKDTree(np.concatenate(edges))
    (base_gap, base), (tip_gap, tip) = (tree.query(whiskers[:, k : k + 2]) for k in (0, 2))
    rooted, length = base_gap < reach_px, whiskers[:, 4]
    ending = rooted & (tip_gap < reach_px)
    at = np.concatenate([base[rooted], tip[ending]])
    score = np.concatenate([length[rooted], -length[ending]])
    order = np.argsort(place[at], kind="stable")
    at, score = at[order], score[order]
    return [(place[at[owner[at] == k]], score[owner[at] == k]) for k in range(len(edges))]


def _labels(edges, scores, least_cost) -> list[np.ndarray]:
    """For each edge, which of its points are face, bool (n,)."""
    cost = max(least_cost, SWITCH_SHARE * sum(np.abs(score).sum() for _, score in scores))
    labels, bases = [], []
    for edge, (place, score) in zip(edges, scores, strict=True):
        face = _likeliest(score, cost)
        labels.append(_along(edge, place, score, face, least_cost))
        bases.append(np.maximum(score[face], 0).sum())
    enough = np.array(bases) >= FEWEST_BASES * max(bases)
    return [label & ok for label, ok in zip(labels, enough, strict=True)]


def _likeliest(score, cost) -> np.ndarray:
    """Face (True) or body along the scores: one stretch of an edge is face.

    It is the one that contradicts the least of the scores, with `cost` for each of its ends that
    is not the edge's.
    """
    total = np.concatenate([[0.0], np.cumsum(score)])
    at = np.arange(len(total))
    begin, end = total + cost * (at > 0), total - cost * (at < len(score))
    stop = int(np.argmax(end - np.minimum.accumulate(begin)))
    start = int(np.argmin(begin[: stop + 1]))
    return (at[:-1] >= start) & (at[:-1] < stop) & (end[stop] >= begin[start])


def _along(edge, place, score, face, slack) -> np.ndarray:
    """Carry the labels `face` of the scores along an edge to all of its points, bool (n,)."""
    out = np.zeros(len(edge), bool)
    if not len(place):
        return out
    starts = np.flatnonzero(np.diff(face)) + 1
    middles = [(a + b - 1) // 2 for a, b in pairwise([0, *starts, len(face)])]
    cuts = [
        _cut(edge, place[a : b + 1], np.where(face[a], score, -score)[a : b + 1], slack)
        for a, b in pairwise(middles)
    ]
    for state, (a, b) in zip(face[middles], pairwise([0, *cuts, len(edge)]), strict=True):
        out[a:b] = state
    return out


def _cut(edge, place, score, slack) -> int:
    """Where an edge changes its label, among scores that are positive before and negative after.

    It is in the corner between face and body, which is farthest from the straight line from the
    first to the last of these scores, but contradicts at most `slack` more than the best place.
    """
    contradicted = np.cumsum(-score[:-1])  # if it is cut after each of the scores
    allowed = np.flatnonzero(contradicted <= contradicted.min() + slack)
    points = np.concatenate([np.arange(place[k], place[k + 1] + 1) for k in allowed])
    chord, offset = edge[place[-1]] - edge[place[0]], edge[points] - edge[place[0]]
    return int(points[np.argmax(np.abs(offset[:, 0] * chord[1] - offset[:, 1] * chord[0]))])


def _side(mask, edges, labels, scores, reach_px) -> str:
    """Side of the picture behind the bases: against it, the face's edge looks into the picture."""
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), reach_px)
    outward = np.stack([-cv2.Sobel(smooth, cv2.CV_32F, *order) for order in ((1, 0), (0, 1))])
    total = np.zeros(2)
    for edge, label, (place, score) in zip(edges, labels, scores, strict=True):
        x, y = edge[place[(score > 0) & label[place]]].T
        total += (outward[:, y, x] / np.maximum(np.hypot(*outward[:, y, x]), 1e-9)).sum(axis=1)
    return max(SIDES, key=lambda side: float(np.dot(OUTWARD[side], total)))


def _nearest_label(edges, labels, shape) -> np.ndarray:
    """Label of the nearest point of an edge, for every pixel, bool (height, width)."""
    points, face = np.concatenate(edges), np.concatenate(labels)
    seeds = np.ones(shape, np.uint8)
    seeds[points[:, 1], points[:, 0]] = 0
    _, nearest = cv2.distanceTransformWithLabels(
        seeds, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    known = np.zeros(nearest.max() + 1, bool)
    known[nearest[points[:, 1], points[:, 0]]] = face
    return known[nearest]
