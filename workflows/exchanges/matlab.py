"""The MAT file: GNU Octave finds the numbers of our tables in it."""

import numpy as np

from exchanges.others import largest, octave
from pipeline.convert.matlab import write_matlab

READ = """
w = load(argument{1}).w;
row = @(x) reshape(x, 1, []);
lengths = cellfun(@numel, w.centrelines.x);
printed = struct('M0', row(w.M0{1}), 'theta', row(w.thetaAtBase{1}), ...
    'inds', row(w.contactInds{1}), 'peak', row(w.contacts.peak_force_uN), ...
    'whisker', w.whiskerNames{1}, 'points', row(lengths), 'x', row(w.centrelines.x{end}));
disp(jsonencode(printed, 'ConvertInfAndNaN', true));
"""


def rows(video, folder, others):
    """Moments, angles, contacts and lines of the first whisker."""
    (path,) = write_matlab(folder, video)
    printed = octave(others.octave, READ, path)
    name, lines = video.whiskers[0], video.lines()
    table = video.of(name)
    table = table[table["tracked"]]
    off = largest(printed["M0"], 1e-9 * table["base_moment_nN_m"])
    angle = largest(printed["theta"], table["base_angle_deg"])  # of a face at the left: the same
    touching = 1 + np.flatnonzero(table["in_contact"])
    same = (
        printed["whisker"] == name
        and list(printed["inds"]) == list(touching)
        and largest(printed["peak"], video.contacts["peak_force_uN"]) == 0
        and list(printed["points"]) == list(np.diff(lines.offsets))
        and largest(printed["x"], lines.row(len(lines) - 1)[:, 0]) < 1e-3
    )
    yield "MAT", "out", "GNU Octave", (
        f"{len(table)} frames; M0 differs by {off:.2g} N m, thetaAtBase by {angle:.2g}° at most; "
        f"contacts and {len(lines)} centrelines {'the same' if same else 'DIFFER'}"
    )  # fmt: skip
