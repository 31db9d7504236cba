"""report.html: one self-contained page on a session, for a screen and for paper."""

import base64
import io
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.contacts.base_moments import RINGING_S
from pipeline.errors import VideoError
from pipeline.reports import figures
from pipeline.reports.error_budget import session_budget
from pipeline.reports.examples import Effort, choose_examples, choose_flagged
from pipeline.session.session_file import read_session
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_FLAGS, VIDEO_COLUMNS, split_flags

PICTURES = 6  # example overlays
STILLS = 12  # of flagged contacts, over all flags
NAMED = 5  # contacts named for every flag, and of those that ring
RINGS = 1.0  # vibrational over steady moment
NOTICEABLE = 0.1
LEAST = 0.01  # that is told apart
MAP_STEP = 2e-5  # s: a tenth of the highest mode's period, enough for a map's colours
TICKS_MS = (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)
JPEG_QUALITY = 80


def write_report(results) -> Path:
    """Write report.html into a results folder, from its tables and figures; return its path."""
    results = Path(results)
    contacts = figures.read_contacts(results)
    record = files.read_json(results / "run.json", {})
    videos = files.read_csv(results / "videos.csv", VIDEO_COLUMNS)
    truth = figures.read_truth(results)
    settings = results / "session.toml"
    contacts = with_peaks(results, contacts)
    flags = _by_flag(contacts)
    effort = Effort(contacts, record.get("inputs", {}))
    flagged = choose_flagged(flags.values(), STILLS, NAMED, effort)
    examples = choose_examples(contacts, PICTURES, effort, flagged)
    flagged = [index for index in flagged if index not in examples]
    drawn = _stills(results, contacts, record, [*examples, *flagged])
    page = _template().render(
        title=results.resolve().name,
        version=record.get("version", ""),
        finished=record.get("finished", "").replace("T", " ").replace("+00:00", " UTC"),
        tiles=_tiles(videos, contacts, record),
        pictures=[drawn[index] for index in examples if index in drawn],
        fig3=_data_uri(results / "figures" / "fig3.svg", "image/svg+xml"),
        numbers=figures.fig3_numbers(contacts, truth).to_dict("records"),
        has_truth=truth is not None,
        per_trial=_per_trial(videos, contacts),
        vibration=_vibration(results, contacts),
        budget=session_budget(contacts, _whiskers(results, contacts)),
        has_contacts=len(contacts) > 0,
        videos=list(_video_rows(results, videos, contacts)),
        flags=[_flag_row(*item, contacts, drawn) for item in flags.items()],
        stills=[drawn[index] for index in flagged if index in drawn],
        shown=set(drawn),
        stages=_stages(record),
        settings=settings.read_text("utf-8") if settings.exists() else "",
        command=" ".join(["whiskerforce", *record["command"]]) if "command" in record else "",
        python=record.get("python", ""),
        platform=record.get("platform", ""),
    )
    files.write_text(results / "report.html", page)
    return results / "report.html"


def _template():
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline.reports"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = _number
    environment.filters["percent"] = lambda v: "" if pd.isna(v) else f"{100 * v:.1f} %"
    return environment.get_template("report.html")


def _number(value) -> str:
    """Three digits, or all before the point; nothing for a missing value."""
    if pd.isna(value):
        return ""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _data_uri(source, kind) -> str:
    """A file (or bytes) as a data URI; empty where there is no such file."""
    if isinstance(source, Path):
        if not source.is_file():
            return ""
        source = source.read_bytes()
    return f"data:{kind};base64,{base64.b64encode(source).decode()}"


def _tiles(videos, contacts, record):
    """(number, what) for the head of the page."""
    failed = int((videos["status"] == "failed").sum())
    seconds = sum(sum(each["stages"].values()) for each in record.get("inputs", {}).values())
    frames = int(videos["frames"].sum())
    made = len(videos) - failed
    yield (
        f"{made}",
        ("video" if made == 1 else "videos") + (f", {failed} failed" if failed else ""),
    )
    yield f"{frames:,}", "frames"
    yield f"{len(contacts):,}", "contacts"
    if contacts["peak_force_uN"].notna().any():
        yield f"{contacts['peak_force_uN'].median():.1f} µN", "median peak force"
    if len(contacts):
        yield f"{contacts['duration_ms'].median():.0f} ms", "median duration"
    if seconds:
        yield f"{frames / seconds:.0f}", "frames/s on one core"


def _video_rows(results, videos, contacts):
    """Rows of videos.csv with frames lost, the share tracked and the number of contacts."""
    counts = contacts["video"].value_counts()
    for row in videos.to_dict("records"):
        frames = results / row["video"] / "frames.parquet"
        tracked = lost = np.nan
        if row["frames"] and frames.exists():
            found = files.read_frames(frames, ["tracked"])["tracked"]
            tracked, lost = found.mean(), int((~found).sum())
        yield {**row, "tracked": tracked, "lost": lost, "contacts": counts.get(row["video"], 0)}


# --- what the tables hold of each contact ---------------------------------------------------


def with_peaks(results, contacts: pd.DataFrame) -> pd.DataFrame:
    """The table of contacts with `peak_frame`, that of largest force in the table of frames.

    The contact's middle where no force is known.
    """
    onset, offset = (contacts[c].to_numpy() for c in ("onset_frame", "offset_frame"))
    peak = (onset + offset) // 2
    for (video, whisker), places in contacts.groupby(["video", "whisker"]).indices.items():
        path = Path(results) / video / "frames.parquet"
        if not path.is_file():
            continue
        wanted, inside = ["frame", "contact_force_uN"], [("whisker", "==", whisker)]
        frame, force = files.read_frames(path, wanted, inside).to_numpy(float).T
        for i in places:
            first, last = np.searchsorted(frame, [onset[i], offset[i]])
            if np.isfinite(force[first:last]).any():
                peak[i] = frame[first + np.nanargmax(force[first:last])]
    return contacts.assign(peak_frame=peak)


def _whiskers(results, contacts) -> dict:
    """(video, whisker) → Whisker, or None where its dimensions are not given."""
    out = {}
    for video in contacts["video"].unique():
        path = Path(results) / video / "session.toml"
        if path.is_file():
            out |= {(video, given.name): given.si() for given in read_session(path).whisker}
    return out


# --- pictures -----------------------------------------------------------------------------


def _stills(results, contacts, record, indices) -> dict:
    """Contact → picture of its peak, with a caption, of those whose videos can be read."""
    pictures = {}
    for video, rows in contacts.loc[indices].groupby("video"):
        state = record.get("inputs", {}).get(video)
        if state:
            frames = rows["peak_frame"].astype(int)
            pictures |= _drawn(results / video, state["path"], frames)
    return {
        index: {"data": data, "caption": _caption(contacts.loc[index]), "index": index}
        for index, data in pictures.items()
    }


def _drawn(folder, path, frames) -> dict:
    """Contact → its frame with the findings as a data URI, of those that can be read."""
    import cv2

    from pipeline.reports.overlay import pictures_of

    try:
        pictures = pictures_of(folder, path, frames, read_session(folder / "session.toml"))
    except (VideoError, OSError):
        return {}
    jpeg = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    return {
        index: _data_uri(cv2.imencode(".jpg", picture, jpeg)[1].tobytes(), "image/jpeg")
        for index, picture in zip(frames.index, pictures, strict=True)
        if picture is not None
    }


def _caption(row) -> str:
    caption = f"{row['video']}, frame {row['peak_frame']:.0f}: {row['whisker']}, contact "
    caption += f"{row['contact']}, "
    if np.isfinite(row["peak_force_uN"]):
        caption += f"peak {row['peak_force_uN']:.1f} µN, "
    caption += f"{row['duration_ms']:.0f} ms"
    if row["flags"]:
        caption += f"; {', '.join(split_flags(row['flags']))}"
    return caption


# --- plots --------------------------------------------------------------------------------


def _axes(height):
    """A plot that can be read on a telephone too."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.8, height), dpi=150)  # of what is drawn as an image
    figure.subplots_adjust(left=0.13, right=0.97, bottom=0.5 / height, top=1 - 0.1 / height)
    axis = figure.subplots()
    axis.spines[["top", "right"]].set_visible(False)
    return figure, axis


def _svg(figure) -> str:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer)  # `savefig` draws everything twice
    return _data_uri(buffer.getvalue(), "image/svg+xml")


def _per_trial(videos, contacts) -> dict | None:
    """Contacts of every video that was processed: plot and numbers; None of one alone."""
    made = videos.loc[videos["frames"] > 0, "video"]
    if len(made) < 2 or contacts.empty:
        return None
    counts = contacts["video"].value_counts().reindex(made, fill_value=0).to_numpy()
    figure, axis = _axes(2.6)
    width = 0.8 * min(1, len(counts) / 8)
    axis.bar(np.arange(1, len(counts) + 1), counts, width=width, color="#5d7f9e")
    axis.axhline(counts.mean(), color=figures.ACCENT, lw=1)
    axis.xaxis.get_major_locator().set_params(integer=True)
    axis.yaxis.get_major_locator().set_params(integer=True)
    axis.set(xlabel="video, in the order of the table below", ylabel="contacts")
    axis.set(xlim=(0.4, len(counts) + 0.6), ylim=(0, 1.1 * counts.max()))
    numbers = {"mean": counts.mean(), "least": int(counts.min()), "most": int(counts.max())}
    return {"plot": _svg(figure), "none": int((counts == 0).sum()), **numbers}


def _vibration(results, contacts) -> dict | None:
    """Which contacts ring: the map, counts, and those that ring most; None where not known."""
    known = contacts[np.isfinite(contacts["vibration_ratio"])]
    if known.empty:
        return None
    most = known.sort_values("vibration_ratio", ascending=False).head(NAMED)
    ratio = known["vibration_ratio"]
    return {
        "plot": _vibration_map(known, _usual_whisker(results, known)),
        "known": len(known),
        "ring": int((ratio > RINGS).sum()),
        "noticeable": int(((ratio > NOTICEABLE) & (ratio <= RINGS)).sum()),
        "most": [{"index": index, **row} for index, row in most.iterrows()],
    }


def _usual_whisker(results, contacts):
    """The whisker of most of these contacts, None where no dimensions are known."""
    whiskers = _whiskers(results, contacts)
    keys = zip(contacts["video"], contacts["whisker"], strict=True)
    count = Counter(whiskers.get(key) for key in keys)
    count.pop(None, None)
    return count.most_common(1)[0][0] if count else None


def ratio_grid(whisker, durations_ms, contacts_mm, dt=1e-5) -> np.ndarray:
    """Largest |vibrational| over peak |steady| base moment of half-Gaussians, as in Fig. 11.

    A pulse moves every mode in the same way wherever it acts (Eq. 49): the places differ by the
    modes' weights only (Eq. 55).

    Parameters
    ----------
    durations_ms, contacts_mm : of the pulses, and where they act
    dt : step [s] of the force, linear in between

    Returns
    -------
    (contacts, durations)
    """
    from whiskermodel.force_profiles import half_gaussian
    from whiskermodel.modal_filter import modal_filters
    from whiskermodel.response import Response

    response, places = Response(whisker), 1e-3 * np.asarray(contacts_mm, float)
    weights = response.base_moment_weights(places).T
    filters = modal_filters(response.angular_frequency, whisker.damping_rate, dt)
    ratios = np.empty((len(places), len(durations_ms)))
    for column, duration in enumerate(1e-3 * np.asarray(durations_ms, float)):
        force = half_gaussian(np.arange(0, duration + RINGING_S, dt), duration, 1.0)
        change = np.stack([force - mode(force) for mode in filters])
        ratios[:, column] = np.abs(weights @ change).max(axis=1) / places
    return ratios


def _vibration_map(contacts, whisker) -> str:
    """Contacts by duration and place on the model's map of vibrational over steady moment."""
    from matplotlib.colors import LogNorm

    figure, axis = _axes(3.4)
    norm = LogNorm(LEAST, 3)
    duration, place = contacts["duration_ms"], contacts["contact_arc_length_mm"]
    if whisker is not None:
        longest = max(120.0, 1.1 * duration.max())
        durations = np.geomspace(min(1.0, 0.9 * duration.min()), longest, 32)
        places = np.linspace(0.1, 0.97, 28) * 1e3 * whisker.length
        grid = ratio_grid(whisker, durations, places, MAP_STEP)
        axis.contourf(durations, places, grid, np.geomspace(LEAST, 3, 22), norm=norm,
                      cmap="cividis", extend="both")  # fmt: skip
        lines = axis.contour(durations, places, grid, [LEAST, NOTICEABLE, RINGS],
                             linewidths=[0.5, 0.8, 1.6],
                             colors=["white", "white", figures.ACCENT])  # fmt: skip
        axis.clabel(lines, fmt="%g", fontsize=8)  # a colour bar would take longer than all else
    axis.scatter(
        duration, place, c=contacts["vibration_ratio"], norm=norm, cmap="cividis",
        s=float(np.clip(400 / np.sqrt(len(contacts)), 5, 36)), edgecolors="white",
        linewidths=0.7 if len(contacts) < 1000 else 0.2, rasterized=len(contacts) > 2000,
    )  # fmt: skip
    axis.set(xscale="log", xlabel="contact duration (ms)", ylabel="follicle to contact (mm)")
    axis.xaxis.set_major_formatter("{x:g}")  # powers of ten take a parser of formulae: 0.3 s
    low, high = axis.get_xlim()
    axis.set_xticks([x for x in TICKS_MS if low <= x <= high])
    axis.minorticks_off()  # every tick is two lines and two texts
    return _svg(figure)


# --- flags and times ----------------------------------------------------------------------


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


def _stages(record):
    """Time by stage over all videos."""
    total, frames = defaultdict(float), 0
    for each in record.get("inputs", {}).values():
        frames += each["frames"]
        for stage, seconds in each["stages"].items():
            total[stage] += seconds
    return [
        {"stage": stage, "seconds": s, "per_thousand": 1000 * s / max(frames, 1)}
        for stage, s in total.items()
    ]
