"""The dictionary of tables, columns and flags: docs/tables.md."""

from pipeline.tables import calibration_columns as calibrated
from pipeline.tables import columns as declared

OF_LINES = """\
A row per whisker and frame in which it was found (`tracked` in frames.parquet).
`lines = lines.merge(known[["frame", "whisker"]])` keeps the lines whose whisker is known; for
`known`, see frames.parquet."""
OF_FRAMES = """\
A row per whisker and frame, whether it was found there or not.
`known = frames[frames["confidence"] >= 0.5]` keeps the rows of traced lines whose whisker is
known. Where session.toml has no `[[whisker]]` tables, or only those that `init` writes, without a
dimension or another name, whiskers are called w1, w2, … along the face. Numbers after that of the
last whisker stand for lines that could not be identified; they are not in `known`."""
FILES = {
    "centrelines.parquet": (OF_LINES, declared.CENTRELINE_COLUMNS),
    "frames.parquet": (OF_FRAMES, declared.FRAME_COLUMNS),
    "contacts.csv": ("A row per contact.", declared.CONTACT_COLUMNS),
    "videos.csv": ("A row per input video.", declared.VIDEO_COLUMNS),
    "corrections.csv": (
        "A person's verdicts on a video's contacts (docs/curate.md), a row per verdict.",
        declared.CORRECTION_COLUMNS,
    ),
    "decisions.csv": (
        "Of `curate`: the corrections of all videos, a row per decision.",
        declared.DECISION_COLUMNS,
    ),
    "evidence.parquet": (
        "The measurements behind a video's contacts, a row per whisker and frame, in SI units.",
        declared.EVIDENCE_COLUMNS,
    ),
    "geometry.csv": (
        "Of `calibrate geometry`, a row per micrograph; density only where a mass is given.",
        (*calibrated.GEOMETRY_COLUMNS, *calibrated.DENSITY_COLUMNS),
    ),
    "pooled.csv": (
        "Of `calibrate geometry`, a row per dimension, where several whiskers are measured.",
        calibrated.POOLED_COLUMNS,
    ),
    "<micrograph>_profile.csv": (
        "Of `calibrate geometry`, a row per cross-section of a whisker.",
        calibrated.PROFILE_COLUMNS,
    ),
    "dust.csv": ("Of `calibrate dust`, a row per frame.", calibrated.DUST_COLUMNS),
    "dust_contacts.csv": (
        "Of `calibrate dust`, a row per contact.",
        calibrated.DUST_CONTACT_COLUMNS,
    ),
    "dust_videos.csv": (
        "Of `calibrate dust`, a row per video, then one of all together.",
        calibrated.DUST_VIDEO_COLUMNS,
    ),
    "views.csv": ("Of `calibrate views`, a row per frame.", calibrated.VIEW_FRAME_COLUMNS),
    "view_contacts.csv": (
        "Of `calibrate views`, a row per contact.",
        calibrated.VIEW_CONTACT_COLUMNS,
    ),
    "calibration.csv": (
        "Of `calibrate views`: how points of one view correspond to those of the other.",
        calibrated.CALIBRATED_VIEW_COLUMNS,
    ),
    "points.csv": (
        "What `calibrate views` takes as `--points`, a row per point that both views show.",
        calibrated.POINT_COLUMNS,
    ),
    "lines_3d.parquet": (
        "Of `calibrate views`, a row per frame that both views show.",
        calibrated.SPACE_LINE_COLUMNS,
    ),
    "ringdown.csv": (
        "Of `calibrate ringdown`, a row per slip, then one of all together.",
        calibrated.RINGDOWN_COLUMNS,
    ),
    "follicle.csv": (
        "Of `calibrate ringdown`, a row per stiffness of the follicle.",
        calibrated.FOLLICLE_COLUMNS,
    ),
}


def data_dictionary() -> str:
    """Every table, column and flag with its meaning, as markdown (docs/tables.md)."""
    lines = [
        "# Tables",
        "",
        "Written from the code by `python -m pipeline.tables.dictionary`; do not edit.",
        "Missing values are NaN (parquet) or empty (CSV).",
    ]
    for name, (what, columns) in FILES.items():
        lines += ["", f"## {name}", "", what, "", "| column | type | unit | meaning |"]
        lines.append("|---|---|---|---|")
        lines += [
            f"| `{c.name}` | {c.dtype} | {c.unit} | {c.meaning.replace('|', chr(92) + '|')} |"
            for c in columns
        ]
    lines += ["", "## Flags of contacts", "", "| flag | meaning |", "|---|---|"]
    lines += [f"| `{flag}` | {meaning} |" for flag, meaning in declared.CONTACT_FLAGS.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(data_dictionary(), end="")
