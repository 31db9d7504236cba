"""Rectangles in a picture, as slices of its rows and columns."""

import numpy as np

WHOLE = np.s_[:, :]  # picture


def bounds(part, shape, beside=0):
    """First row of a part of a picture, one past its last row, and likewise columns.

    part : slices of rows and columns; shape : of the picture; beside : so many more each way

    >>> bounds(np.s_[10:20, :5], (100, 50), beside=2)
    (8, 22, 0, 7)
    """
    (top, bottom, _), (left, right, _) = map(slice.indices, part, shape)
    height, width = shape
    return (
        max(top - beside, 0), min(bottom + beside, height),
        max(left - beside, 0), min(right + beside, width),
    )  # fmt: skip
