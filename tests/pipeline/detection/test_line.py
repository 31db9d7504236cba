"""A line's arrays, and those of the room to work in, each in one array."""

import numpy as np

from pipeline.detection.line import Line, Nodes, Scratch, Workspace, nodes_of, scratch_of


def test_arrays_of_a_line_are_those_that_compiled_code_sees():
    line = Line.empty(30)
    for k, name in enumerate(Nodes._fields):
        getattr(line, name)[:] = k
    for k, name in enumerate(Nodes._fields):
        assert np.all(getattr(nodes_of(line.values), name) == k)


def test_a_copy_changes_by_itself():
    line = Line.empty(30)
    copy = line.copy()
    copy.x[:], copy.n = 1.0, 3
    assert line.n == 0
    assert not line.values[0].any()
    assert copy.values[0].all()


def test_no_arrays_of_the_room_to_work_in_overlap():
    workspace = Workspace(30, 10.0)
    scratch = scratch_of(workspace.room)
    for k, name in enumerate(Scratch._fields):
        getattr(scratch, name)[:] = k + 1
    sizes = [array.size for array in scratch]
    assert sum(sizes) == workspace.room.size
    for k, array in enumerate(scratch):
        assert np.all(array == k + 1)
