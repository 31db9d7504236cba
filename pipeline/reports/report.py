"""report.html: one page on a session, for a screen and for paper; a page more for every video."""

import functools
import re
from collections import defaultdict
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pandas as pd

from pipeline.contacts.corrections import decisions_in_words
from pipeline.errors import counted, some_of
from pipeline.reports import plot_style
from pipeline.reports.error_budget import session_budget
from pipeline.reports.examples import Effort, choose_examples, choose_flagged
from pipeline.reports.session_numbers import (
    damaged_videos,
    fig3_numbers,
    read_contacts,
    read_truth,
)
from pipeline.reports.stills import contact_stills, video_stills, with_peaks
from pipeline.reports.time_courses import Courses, read_courses, time_courses
from pipeline.reports.trials import OnsetAverage, raster
from pipeline.reports.vibration_map import vibration
from pipeline.reports.whisker_styles import whisker_styles
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_FLAGS, VIDEO_COLUMNS, split_flags
from pipeline.tables.known_names import nameless_in
from pipeline.tables.own_files import replace_own
from pipeline.tables.result_exchange import overlays_in
from pipeline.tables.run_record import read_run
from pipeline.tables.video_messages import missing_pole, sentences_of

PICTURES = 6  # examples of contacts
STILLS = 12  # of flagged contacts, over all flags
DOUBTS = 3  # videos whose main doubt is at the head
NAMED = 5  # contacts named for every flag
STACKS = 6  # videos whose time courses are on the page itself
COURSES_FOLDER = Path("figures", "courses")
PANELS = {
    "a": "the whisker around one contact; dots are the follicle and, in colour, the pole",
    "b": "the force of that contact",
    "c": "diameters of the whiskers, as the settings have them",
    "d": "peak forces of all contacts",
    "e": "durations of all contacts",
    "f": "one against the other",
}
COMMON_NAMES = {"videos", "video", "movies", "films", "raw", "data", "results", "out", "output"}
TABLES = ("contacts.csv", "videos.csv", "session.toml", "run.json", "run.log")


def write_report(results, damaged=None) -> list[str]:
    """Write report.html into a results folder, from its tables and figures.

    The time courses of each video are in figures/courses/<video>.html. `damaged` are the
    `damaged_videos`, where they are known. Returns a sentence on each page that a person had
    changed, and which is kept.
    """
    results = Path(results)
    damaged = damaged_videos(results) if damaged is None else damaged
    contacts = with_peaks(results, read_contacts(results, damaged))
    record = read_run(results)
    videos = _as_failed(files.read_csv(results / "videos.csv", VIDEO_COLUMNS), damaged)
    truth = read_truth(results)
    whiskers = _whiskers(results, contacts)
    seen, styles = _look_through(results, videos, contacts)
    page = _template("report.html").render(
        **_head(results, record, videos, contacts),
        **_pictures(results, videos, contacts, record),
        **seen,
        numbers=fig3_numbers(contacts, truth).to_dict("records"),
        has_truth=truth is not None,
        trials=raster(videos.loc[videos["frames"] > 0, "video"], contacts, styles),
        vibration=vibration(contacts, whiskers),
        budget=session_budget(contacts, whiskers),
        has_contacts=len(contacts) > 0,
        **_making(results, record),
    )
    return [*seen["kept"], *_write_page(results / "report.html", page)]


def _as_failed(videos, damaged) -> pd.DataFrame:
    """The table of videos in which those that are damaged have failed, as they do when run."""
    for i in videos.index[videos["video"].isin(damaged)]:
        said = f"its results are damaged ({damaged[videos.at[i, 'video']]}): run the video again"
        videos.loc[i, ["status", "frames", "message"]] = "failed", 0, said
    return videos


def _write_page(path, page) -> list[str]:
    """Write a page; one that a person has changed is kept, and said."""
    return replace_own(path, lambda new: new.write_text(page, encoding="utf-8"))


@functools.cache
def _template(name):
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline.reports"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    environment.filters["counted"] = counted
    environment.filters["percent"] = lambda v: "" if pd.isna(v) else f"{100 * v:.1f} %"
    return environment.get_template(name)


def _number(value) -> str:
    """Three digits, or all before the point; nothing for a missing value."""
    if pd.isna(value):
        return ""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


# --- the head -----------------------------------------------------------------------------


def _head(results, record, videos, contacts) -> dict:
    """Title, paths of the files, and numbers of the session."""
    return {
        "title": session_name(results, record),
        "version": record.get("version", ""),
        "finished": record.get("finished", "").replace("T", " ").replace("+00:00", " UTC"),
        "folder": str(results.resolve()),
        "tables": [name for name in TABLES if (results / name).is_file()],
        "tiles": list(_tiles(videos, contacts, record)),
        "decisions": decisions_in_words(results),
        **_doubts(videos),
    }


def _doubts(videos) -> dict:
    """The main doubts of some videos, failed ones first, and how many more have one.

    Videos in which no pole was found, as in no-go trials, are named together.
    """
    doubtful = videos[videos["message"].fillna("") != ""]
    doubtful = doubtful.sort_values("status", key=lambda status: status != "failed", kind="stable")
    groups = {}
    for row in doubtful.itertuples():
        doubt = main_doubt(row.message)
        key = doubt if missing_pole(doubt) else len(groups)
        groups.setdefault(key, (doubt, []))[1].append(row.video)
    first = list(groups.values())[:DOUBTS]
    shown = sum(len(names) for _, names in first)
    return {
        "doubts": [(some_of(names), doubt) for doubt, names in first],
        "more_doubts": len(doubtful) - shown,
    }


def main_doubt(message: str) -> str:
    """The first of the sentences in a video's message, as far as its first semicolon.

    >>> main_doubt("for 30 % it is not known (most of all w1; w2); use others | no pole found")
    'for 30 % it is not known (most of all w1; w2)'
    """
    return re.match(r"(\([^)]*\)|[^;])*", sentences_of(message)[0])[0]


def session_name(results, record) -> str:
    """Name of the session: of the folder that its videos lie in.

    Folders called "videos" or the like are passed over; the results folder's name where there
    is no other.
    """
    paths = [each["path"] for each in record["inputs"].values() if each.get("path")]
    own = Path(results).resolve()
    above = [Path(path).absolute().parents for path in paths]
    shared = set.intersection(*map(set, above)) if above else set()  # none: on several drives
    common = sorted(shared, key=lambda place: -len(place.parts))
    names = (place.name for place in (*common, own, *own.parents))
    return next((n for n in names if n and n.casefold() not in COMMON_NAMES), own.name)


def _tiles(videos, contacts, record):
    """(number, what) for the head of the page."""
    failed = int((videos["status"] == "failed").sum())
    seconds = sum(sum(each["stages"].values()) for each in record["inputs"].values())
    frames = int(videos["frames"].sum())
    made, word = _counted(len(videos) - failed, "video")
    yield made, word + (f"; {failed} more failed" if failed else "")
    yield _counted(frames, "frame")
    yield _counted(len(contacts), "contact")
    if contacts["peak_force_uN"].notna().any():
        yield f"{_number(contacts['peak_force_uN'].median())} µN", "median peak force"
    if len(contacts):
        yield f"{_number(contacts['duration_ms'].median())} ms", "median duration"
    if seconds:
        yield f"{frames / seconds:.0f}", "frames/s on one core"


def _counted(number, thing) -> tuple[str, str]:
    """A number, and what it counts."""
    return f"{number:,}", counted(number, thing).split(" ", 1)[1]


def _whiskers(results, contacts) -> dict:
    """(video, whisker) → Whisker, or None where its dimensions are not given."""
    out = {}
    for video in contacts["video"].unique():
        path = Path(results) / video / "session.toml"
        if path.is_file():
            out |= {(video, given.name): given.si() for given in read_session(path).whisker}
    return out


# --- video after video --------------------------------------------------------------------


def _look_through(results, videos, contacts) -> tuple[dict, dict]:
    """Read the frames of each video once: its row of the table, time courses, mean force.

    `kept` are sentences on pages of time courses that a person had changed. Last, the `Style` of
    each of the session's whiskers, as the time courses have it where all videos show the same.
    """
    average, stacks, rows, kept, names = OnsetAverage(), [], [], [], []
    groups = dict(list(contacts.groupby("video")))
    for row in videos.to_dict("records"):
        own = groups.get(row["video"], contacts.iloc[:0])
        frames = read_courses(results, row["video"]) if row["frames"] else pd.DataFrame()
        shown = len(frames) > 0
        rows.append(_video_row(results, row, frames, own))
        if shown:
            average.add(frames, own)
            stack, said = _write_courses(results, row["video"], frames, own)
            stacks += [stack] if len(stacks) < STACKS else []
            kept += said
            names += [name for name, _ in stack.whiskers]
    styles = whisker_styles([*names, *contacts["whisker"]])
    figure = average.draw(styles)
    seen = {
        "videos": rows,
        "stacks": stacks,
        "stacked_of": sum(bool(row["courses"]) for row in rows),
        "onset_average": None if figure is None else plot_style.svg(figure),
        "kept": kept,
    }
    return seen, styles


def _video_row(results, row, frames, contacts) -> dict:
    """A row of videos.csv with frames lost, the share tracked, contacts and where all lies."""
    tracked = lost = np.nan
    folder = results / row["video"]
    if len(frames):
        is_whisker = ~frames["whisker"].isin(nameless_in(frames))
        found = frames["tracked"].astype(bool)[is_whisker if is_whisker.any() else slice(None)]
        tracked, lost = found.mean(), int((~found).sum())
    links = [name for name in ("contacts.csv", "frames.parquet") if (folder / name).is_file()]
    return {
        **row,
        "tracked": tracked,
        "lost": lost,
        "contacts": len(contacts),
        "sentences": sentences_of(row.get("message") or ""),
        "links": [(name, f"{quote(row['video'])}/{name}") for name in links],
        "overlay": _overlay(results, row["video"]),
        "courses": f"figures/courses/{quote(row['video'])}.html" if len(frames) else "",
    }


def _overlay(results, video) -> str:
    """The overlay of a video, seen from the results folder; "" where there is none."""
    found = overlays_in(results / video)
    return f"{video}/{found[0].name}" if found else ""


def _write_courses(results, video, frames, contacts) -> tuple[Courses, list[str]]:
    """Write the page of a video's time courses; return what the report shows of them.

    And sentences, as of `_write_page`.
    """
    overlay = _overlay(results, video)
    (results / COURSES_FOLDER).mkdir(parents=True, exist_ok=True)
    there = time_courses(frames, contacts, video, overlay and f"../../{overlay}")
    page = _template("courses.html").render(courses=there, contacts=contacts.to_dict("records"))
    kept = _write_page(results / COURSES_FOLDER / f"{video}.html", page)
    return time_courses(frames, contacts, video, overlay), kept


# --- pictures and flags --------------------------------------------------------------------


def _pictures(results, videos, contacts, record) -> dict:
    """Examples of contacts, Fig. 3, and flags with stills; whole frames if there is no contact."""
    flags = _by_flag(contacts)
    effort = Effort(contacts, record["inputs"])
    flagged = choose_flagged(flags.values(), STILLS, NAMED, effort)
    examples = choose_examples(contacts, PICTURES, effort, flagged)
    flagged = [index for index in flagged if index not in examples]
    drawn = contact_stills(results, contacts, record, [*examples, *flagged])
    pictures = [drawn[index] for index in examples if index in drawn]
    if contacts.empty:
        traced = [name for name in videos.loc[videos["frames"] > 0, "video"]
                  if (results / name / "frames.parquet").is_file()]  # fmt: skip
        pictures = video_stills(results, traced[:PICTURES], record)
    return {
        "pictures": pictures,
        "panels": list(_panels(results)),
        "flags": [_flag_row(*item, contacts, drawn) for item in flags.items()],
        "stills": [drawn[index] for index in flagged if index in drawn],
        "shown": set(drawn),
    }


def _panels(results):
    """The panels of Fig. 3 that there are, with captions."""
    for letter, caption in PANELS.items():
        path = results / "figures" / f"fig3{letter}.svg"
        if path.is_file():
            picture = plot_style.data_uri(path.read_bytes(), "image/svg+xml")
            yield {"letter": letter, "picture": picture, "caption": caption}


def _by_flag(contacts) -> dict:
    """Flag → contacts that have it, the commonest flag first."""
    labels = defaultdict(list)
    for index, flags in contacts["flags"].items():
        for flag in split_flags(flags):
            labels[flag].append(index)
    return dict(sorted(labels.items(), key=lambda item: -len(item[1])))


def _flag_row(flag, labels, contacts, shown):
    """A flag, its number of contacts and where some of them are: those first that are shown."""
    named = sorted(labels, key=lambda index: index not in shown)[:NAMED]
    places = [
        {"where": f"{row['video']} frame {row['peak_frame']:.0f}", "index": index}
        for index, row in contacts.loc[contacts.index.isin(named)].iterrows()
    ]
    meaning = CONTACT_FLAGS.get(flag, "")
    return {"flag": flag, "meaning": meaning, "count": len(labels), "places": places}


# --- how it was made ----------------------------------------------------------------------


def _making(results, record) -> dict:
    """Command, machine, times and settings."""
    settings = results / "session.toml"
    return {
        "stages": _stages(record),
        "settings": settings.read_text("utf-8") if settings.exists() else "",
        "command": _command(record),
        "python": record.get("python", ""),
        "platform": record.get("platform", ""),
    }


def _command(record) -> str:
    """The command line that made the results; "" where it is not known."""
    return " ".join(["whiskerforce", *map(str, record["command"])]) if "command" in record else ""


def _stages(record):
    """Time by stage over all videos."""
    total, frames = defaultdict(float), 0
    for each in record["inputs"].values():
        frames += each["frames"]
        for stage, seconds in each["stages"].items():
            total[stage] += seconds
    return [
        {"stage": stage, "seconds": s, "per_thousand": 1000 * s / max(frames, 1)}
        for stage, s in total.items()
    ]
