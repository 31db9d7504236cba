"""Results as Neurodata Without Borders, a file per video, in SI units.

Only types of the core are used. `ndx-whisk` has a table of the Janelia tracker's measures and none
for forces, and needs pynwb older than 3; `ndx-pose` wants body parts, of which a line has none
(`export movement` makes some).
"""

import os
import re
from datetime import UTC, datetime
from pathlib import Path
from uuid import uuid4

import numpy as np

from pipeline.convert.hdf5 import whole_hdf5
from pipeline.convert.optional import library
from pipeline.errors import InputError
from pipeline.session.session_file import session_text
from pipeline.tables.columns import CONTACT_COLUMNS, FRAME_COLUMNS
from pipeline.video.open import TIFF_SUFFIXES, VIDEO_SUFFIXES

SI = {  # unit of a column: of the file, factor
    "deg": ("radians", np.pi / 180),
    "1/m": ("1/meters", 1.0),
    "mm": ("meters", 1e-3),
    "µN": ("newtons", 1e-6),
    "nN m": ("newton meters", 1e-9),
    "px": ("pixels", 1.0),
    "": ("a.u.", 1.0),
}
FILMS = VIDEO_SUFFIXES | TIFF_SUFFIXES
SUFFIXES = ("_deg", "_per_m", "_mm", "_uN", "_nN_m")
DURATION = r"P(?=\d|T\d)([\d.]+[YMWD])*(T([\d.]+[HMS])+)?"
SUBJECT = {  # what a value of an animal must be: a test, and in words
    "sex": (("F", "M", "O", "U").__contains__, "F (female), M (male), O (other) or U (unknown)"),
    "age": (
        re.compile(f"{DURATION}(/({DURATION})?)?").fullmatch,
        "a duration as ISO 8601 has it, such as P90D: 90 days",
    ),
    "species": (
        re.compile(r"[A-Z][a-z]+( [a-z]+)+|https?://.*NCBITaxon_\d+").fullmatch,
        'its Latin name, such as "Mus musculus"',
    ),
}
NO_SERIES = ("frame", "time_s", "whisker")


def write_nwb(folder, video, start: str = "", moves_to=None, **subject) -> list[Path]:
    """Write NAME.nwb; return its path in a list.

    Parameters
    ----------
    folder : where to
    video : `VideoResults`
    start : date and time of the recording's first frame, as ISO 8601; empty: when the video's file
        was last written, or the results where it is gone
    moves_to : where the file will lie in the end, for its reference to the video; None: `folder`
    subject : of the animal, as `pynwb.file.Subject` has it: subject_id, species, sex, age

    Raises
    ------
    InputError
        Where pynwb is not installed, `start` is no date, the animal is not as NWB has it, or two
        whiskers' names are one there.
    """
    pynwb = library("pynwb", "nwb")
    path = Path(folder) / f"{video.name}.nwb"
    file = pynwb.NWBFile(
        session_description=f"Whiskers, contacts and forces in {Path(video.path).name}",
        identifier=str(uuid4()),
        session_start_time=_start_time(start, video),
        keywords=["whisker", "touch", "contact force"],
        subject=_subject(pynwb, subject),
        experiment_description="high-speed video of whiskers, analysed with whiskerforce",
    )
    _add_video(pynwb, file, video, Path(moves_to or folder))
    module = file.create_processing_module("behavior", "whiskers as whiskerforce measured them")
    if video.whiskers:
        _add_courses(pynwb, module, video)
    _add_pole(pynwb, module, video)
    lines = video.lines()
    if len(lines):
        module.add(_centrelines(library("hdmf.common", "nwb"), lines))
    _add_contacts(pynwb, file, video)
    file.add_scratch(
        session_text(video.settings), name="session_toml", description="settings of the analysis"
    )
    with whole_hdf5(path, "nwb") as held, pynwb.NWBHDF5IO(file=held, mode="w") as out:
        out.write(file)
    return [path]


def _subject(pynwb, known):
    """The animal; what the format requires and is not known is given as unknown."""
    known = {key: value for key, value in known.items() if value}
    for key, (is_right, expected) in SUBJECT.items():
        if key in known and not is_right(known[key]):
            raise InputError(f"--{key} {known[key]}: expected {expected}")
    return pynwb.file.Subject(**{"subject_id": "unknown", "sex": "U", **known})


def _start_time(start, video) -> datetime:
    if start:
        try:
            time = datetime.fromisoformat(start)
            return time if time.tzinfo else time.astimezone()
        except (ValueError, OverflowError):
            raise InputError(
                f"--start {start}: is not a date and time; expected e.g. 2024-05-31T14:30:00+02:00"
            ) from None
    source = video.source or video.folder
    return datetime.fromtimestamp(source.stat().st_mtime, UTC)


def _add_video(pynwb, file, video, folder):
    """Refer to the video, where it still is."""
    source = video.source
    if not source or not source.is_file() or source.suffix.lower() not in FILMS:
        return
    file.add_acquisition(
        pynwb.image.ImageSeries(
            name="video",
            description="high-speed video of the whiskers",
            external_file=[_from(folder, source)],
            starting_frame=[0],
            format="external",
            unit="n.a.",
            num_samples=video.n_frames,
            rate=video.settings.recording.frames_per_second,
        )
    )


def _from(folder, source) -> str:
    """The way from a folder to a file; on another drive, where there is none, the whole path."""
    try:
        return os.path.relpath(source, folder.resolve())
    except ValueError:
        return str(source)


def _add_courses(pynwb, module, video):
    """A time series per whisker and quantity, NaN where it is not known."""
    rate = video.settings.recording.frames_per_second
    courses = pynwb.behavior.BehavioralTimeSeries(name="whiskers")
    of_whom = {}
    for whisker in video.whiskers:
        table = video.of(whisker)
        for column in FRAME_COLUMNS:
            if column.name in NO_SERIES:
                continue
            unit, factor = SI[column.unit]
            name = re.sub("[/:]", "_", f"{whisker}_{_without_unit(column.name)}")
            other = of_whom.setdefault(name, whisker)
            if other != whisker:
                raise InputError(
                    f'whiskers "{other}" and "{whisker}": a time series of either would be called '
                    f"{name}, since NWB has _ for / and :; give one of them another name"
                )
            courses.add_timeseries(
                pynwb.TimeSeries(
                    name=name,
                    description=f"whisker {whisker}: {column.meaning}",
                    data=table[column.name].to_numpy(float) * factor,
                    unit=unit,
                    rate=rate,
                    starting_time=0.0,
                )
            )
    module.add(courses)


def _without_unit(name) -> str:
    """The name of a column without its unit."""
    stem, se = (name[:-3], "_se") if name.endswith("_se") else (name, "")
    unit = next((suffix for suffix in SUFFIXES if stem.endswith(suffix)), "")
    return stem.removesuffix(unit) + se


def _add_pole(pynwb, module, video):
    """The pole's place in the picture."""
    pole = video.pole()
    if pole is None:
        return
    series = pynwb.behavior.SpatialSeries(
        name="pole",
        description="centre of the pole; NaN while it is away",
        data=np.column_stack([pole.x_px, pole.y_px]),
        reference_frame="centre of the picture's top left pixel; x right, y down",
        unit="pixels",
        rate=video.settings.recording.frames_per_second,
        starting_time=0.0,
    )
    module.add(pynwb.behavior.Position(name="pole_position", spatial_series=series))


def _centrelines(common, lines):
    """The centrelines as a table with a ragged list of points per row."""
    names = np.asarray(lines.names, object)[lines.whisker]
    columns = [
        common.VectorData(name="frame", description="frame number, from 0", data=lines.frame),
        common.VectorData(name="whisker", description="name", data=[str(n) for n in names]),
    ]
    for axis in "xy":
        values = getattr(lines, f"{axis}_px")
        data = common.VectorData(
            name=f"{axis}_px", description=f"{axis} [pixels], follicle side to tip", data=values
        )
        ends = common.VectorIndex(name=f"{axis}_px_index", data=lines.offsets[1:], target=data)
        columns += [data, ends]
    return common.DynamicTable(
        name="centrelines",
        description="traced whiskers",
        columns=columns,
        colnames=["frame", "whisker", "x_px", "y_px"],
    )


def _add_contacts(pynwb, file, video):
    """The contacts as intervals of time, with all columns of contacts.csv, in its units."""
    contacts = video.contacts
    if not len(contacts):
        return
    table = pynwb.epoch.TimeIntervals(name="contacts", description="contacts with the pole")
    for column in CONTACT_COLUMNS:
        unit = f" [{column.unit}]" if column.unit else ""
        table.add_column(column.name, column.meaning + unit)
    for row in contacts[[c.name for c in CONTACT_COLUMNS]].to_dict("records"):
        start = row["onset_s"]
        table.add_row(start_time=start, stop_time=start + 1e-3 * row["duration_ms"], **row)
    file.add_time_intervals(table)
