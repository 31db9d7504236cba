"""Tables that pandas wrote as HDF5, read without running anything that is in the file.

pandas and PyTables keep the names of columns as pickles, and load whatever these hold. Here they
are read by their opcodes, as lists, texts and numbers only.
"""

import pickletools

import pandas as pd

from pipeline.convert.hdf5 import texts_in
from pipeline.convert.optional import library


def read_table(path) -> pd.DataFrame:
    """The one table of a file; KeyError, OSError, TypeError or ValueError where it is another."""
    with library("h5py", "formats").File(path) as file:
        (group,) = file.values()
        read = {b"frame_table": _of_rows, b"frame": _of_blocks}[group.attrs["pandas_type"]]
        return read(group)


def _of_rows(group):
    """A table written with `format="table"`: rows with the values of every block of columns."""
    names = plain(group.attrs["info"])[1]["names"]
    rows, attributes = group["table"][()], group["table"].attrs
    parts = []
    for block in plain(group.attrs["values_cols"]):
        columns = pd.MultiIndex.from_tuples(plain(attributes[f"{block}_kind"]), names=names)
        parts.append(pd.DataFrame(rows[block], columns=columns))
    ((_, order),) = plain(group.attrs["non_index_axes"])
    return pd.concat(parts, axis=1)[order].set_axis(rows["index"])


def _of_blocks(group):
    """A table written with `format="fixed"`: an array for every block of columns."""
    parts = [
        pd.DataFrame(group[f"block{k}_values"][()], columns=_levels(group, f"block{k}_items"))
        for k in range(int(group.attrs["nblocks"]))
    ]
    return pd.concat(parts, axis=1)[list(_levels(group, "axis0"))].set_axis(group["axis1"][()])


def _levels(group, name) -> pd.MultiIndex:
    """Columns by their levels."""
    numbers = range(int(group.attrs[f"{name}_nlevels"]))
    levels = [group[f"{name}_level{k}"] for k in numbers]
    codes = [group[f"{name}_label{k}"][()] for k in numbers]
    names = [level.attrs["name"].decode() for level in levels]
    return pd.MultiIndex([texts_in(level) for level in levels], codes, names=names)


def plain(pickled):
    """Lists, tuples, dictionaries, texts and numbers of a pickle; ValueError for all else.

    >>> import pickle
    >>> plain(pickle.dumps([(1, "a"), None], 0))
    [(1, 'a'), None]
    """
    stack, memo, mark = [], {}, object()
    collections = {"LIST": list, "TUPLE": tuple, "DICT": dict}  # of what follows on a mark
    for code, argument, _ in pickletools.genops(bytes(pickled)):
        if code.name in ("UNICODE", "STRING", "INT", "LONG", "FLOAT", "NONE"):
            stack.append(argument)  # None where there is none
        elif code.name == "MARK":
            stack.append(mark)
        elif code.name in collections:
            start = len(stack) - 1 - stack[::-1].index(mark)
            stack[start:] = [collections[code.name](stack[start + 1 :])]
        elif code.name == "PUT":
            memo[argument] = stack[-1]
        elif code.name == "GET":
            stack.append(memo[argument])
        elif code.name == "APPEND":
            value = stack.pop()
            stack[-1].append(value)
        elif code.name == "SETITEM":
            value, key = stack.pop(), stack.pop()
            stack[-1][key] = value
        elif code.name != "STOP":
            raise ValueError(f"it holds a pickle with {code.name}, which could run code")
    return stack.pop()
