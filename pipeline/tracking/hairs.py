"""Hairs that grow apart from the row of whiskers: before an ear or an eye, or on the cheek.

Whiskers of one side stand close together. What stands apart from all of them and is thin, short
or seldom seen is a hair of the fur, however much it looks like a whisker.

The first look, which knows no whisker yet, compares a line with all others together: thus it keeps
a short whisker beside a single long one. Once whiskers are known, a line is compared with a
typical one of them.
"""

import cv2
import numpy as np

APART = 0.25  # of the usual length: bases farther than this from all others stand apart
LEAST_SHARE = 0.03  # of length × absorbance of all: with less, what stands apart is hair
LEAST = 1 / 3  # of a known whisker's: weaker lines that stand apart from all of these are hairs


def are_hairs(bases, strength, usual_px) -> np.ndarray:
    """Which of some lines, or of their tracks, are hairs apart from the row, bool (n,).

    Parameters
    ----------
    bases : (n, 2) where they leave the face [px]
    strength : (n,) length × absorbance [px], times how often each is seen; NaN: not known
    usual_px : usual length of the lines [px]
    """
    strength = np.nan_to_num(strength)
    if not strength.any():
        return np.zeros(len(strength), bool)
    group = _close_together(bases, APART * usual_px)
    return np.bincount(group, strength)[group] < LEAST_SHARE * strength.sum()


def are_hairs_beside(bases, strength, seen, usual_px, whiskers) -> np.ndarray:
    """Which of some lines, or of their tracks, are hairs apart from known whiskers, bool (n,).

    Several hairs are no likelier to be whiskers than one: how strong they are together does not
    count.

    Parameters
    ----------
    bases, usual_px : as for `are_hairs`
    strength : (n,) length × absorbance [px]; NaN: not known
    seen : (n,) the part of the frames in which each is seen
    whiskers : (k, 2) where the known ones leave the face [px]
    """
    strength, row = np.nan_to_num(strength), np.zeros(len(bases), bool)
    if strength.any():
        group = _close_together(np.concatenate([bases, whiskers]), APART * usual_px)
        own, row = group[: len(bases)], np.isin(group, group[len(bases) :])[: len(bases)]
    if not strength[row].any():
        return np.zeros(len(bases), bool)
    usual = np.bincount(own, strength * seen) / np.maximum(np.bincount(own, seen), 1.0)
    return ~row & (usual[own] < LEAST * np.average(strength[row], weights=seen[row]))


def _close_together(places, reach_px) -> np.ndarray:
    """Number (n,) of the group of every place (n, 2): one less than `reach_px` away is in it.

    A picture of them keeps time and memory small, however many there are.
    """
    margin = int(reach_px) + 1
    x, y = np.rint(places - np.min(places, axis=0)).astype(int).T + margin
    elsewhere = np.ones((y.max() + margin, x.max() + margin), np.uint8)
    elsewhere[y, x] = 0
    off = cv2.distanceTransform(elsewhere, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return cv2.connectedComponents((off < reach_px / 2).astype(np.uint8))[1][y, x]
