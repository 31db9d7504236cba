"""Argument checks that name the argument, its value and what is allowed."""

import numpy as np


def finite_array(argument, value):
    """`value` as a float array; ValueError where an element is NaN or infinite."""
    array = np.asarray(value, dtype=float)
    bad = ~np.isfinite(array)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ValueError(
            f"{argument} must be finite everywhere, got {array[where]!r} at index {where} "
            f"({int(bad.sum())} such values)"
        )
    return array


def positive(argument, value):
    """`value` [s] as a finite float array with every element > 0."""
    array = finite_array(argument, value)
    if not (array > 0).all():
        raise ValueError(f"{argument} must be > 0 s, got {float(array.min())!r} s")
    return array


def on_whisker(whisker, contact_arc_length):
    """Contact points as a float array, all with 0 < c < L."""
    c = finite_array("contact_arc_length", contact_arc_length)
    outside = (c <= 0) | (c >= whisker.length)
    if outside.any():
        raise ValueError(
            f"contact_arc_length must lie between 0 and the whisker's length "
            f"{whisker.length!r} m, got {float(c[outside].flat[0])!r} m"
        )
    return c


def whole_number(argument, value, at_least):
    """`value` as an int ≥ `at_least`."""
    if isinstance(value, bool) or int(value) != value or value < at_least:
        raise ValueError(f"{argument} must be a whole number >= {at_least}, got {value!r}")
    return int(value)


def one_of(argument, value, allowed):
    """`value`, if it is one of the `allowed` words."""
    if value not in allowed:
        raise ValueError(f"{argument} must be one of {', '.join(allowed)}, got {value!r}")
    return value
