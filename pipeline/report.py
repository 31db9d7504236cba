"""report.html: one self-contained page on a session, for a screen and for paper."""

import base64
import io
from collections import defaultdict
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import figures, tables
from pipeline.errors import VideoError
from pipeline.settings import read_session

PICTURES = 6  # example overlays
JPEG_QUALITY = 85


def write_report(results) -> Path:
    """Write report.html into a results folder, from its tables and figures; return its path."""
    results = Path(results)
    contacts = figures.read_contacts(results)
    record = tables.read_json(results / "run.json", {})
    videos = tables.read_csv(results / "videos.csv", tables.VIDEO_COLUMNS)
    truth = figures.read_truth(results)
    settings = results / "session.toml"
    page = _template().render(
        title=results.resolve().name,
        version=record.get("version", ""),
        finished=record.get("finished", "").replace("T", " ").replace("+00:00", " UTC"),
        tiles=_tiles(videos, contacts, record),
        pictures=list(_pictures(results, contacts, record)),
        fig3=_data_uri(results / "figures" / "fig3.svg", "image/svg+xml"),
        numbers=figures.fig3_numbers(contacts, truth).to_dict("records"),
        has_truth=truth is not None,
        vibration=_vibration_map(contacts),
        videos=list(_video_rows(results, videos, contacts)),
        flags=_flags(contacts),
        stages=_stages(record),
        settings=settings.read_text("utf-8") if settings.exists() else "",
    )
    tables.write_text(results / "report.html", page)
    return results / "report.html"


def _template():
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline"),
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
    if len(contacts):
        yield f"{contacts['peak_force_uN'].median():.1f} µN", "median peak force"
        yield f"{contacts['duration_ms'].median():.0f} ms", "median duration"
    if seconds:
        yield f"{frames / seconds:.0f}", "frames/s on one core"


def _video_rows(results, videos, contacts):
    """Rows of videos.csv with the share of tracked frames and the number of contacts."""
    counts = contacts["video"].value_counts()
    for row in videos.to_dict("records"):
        frames = results / row["video"] / "frames.parquet"
        tracked = np.nan
        if row["status"] != "failed" and frames.exists():
            tracked = tables.read_frames(frames, ["tracked"])["tracked"].mean()
        yield {**row, "tracked": tracked, "contacts": counts.get(row["video"], 0)}


def _pictures(results, contacts, record):
    """Overlays at the peaks of some contacts, of as many videos as possible."""
    order = contacts.groupby("video").cumcount()
    strongest = contacts.assign(order=order).sort_values("order", kind="stable")
    for row in strongest.head(PICTURES).to_dict("records"):
        state = record.get("inputs", {}).get(row["video"])
        frame = (row["onset_frame"] + row["offset_frame"]) // 2
        picture = _picture(results / row["video"], state, frame) if state else ""
        if picture:
            caption = (
                f"{row['video']}, frame {frame}: {row['whisker']}, contact {row['contact']}, "
                f"peak {row['peak_force_uN']:.1f} µN, {row['duration_ms']:.0f} ms"
            )
            anchor = f"{row['video']}-{row['whisker']}-{row['contact']}"
            yield {"data": picture, "caption": caption, "anchor": anchor}


def _picture(folder, state, frame) -> str:
    """One frame with its findings as a data URI; empty if the video is no longer there."""
    import cv2

    from pipeline.overlay import picture_of

    try:
        settings = read_session(folder / "session.toml")
        picture = picture_of(folder, state["path"], int(frame), settings)
    except (VideoError, OSError, StopIteration):
        return ""
    _, code = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    return _data_uri(code.tobytes(), "image/jpeg")


def _vibration_map(contacts) -> str:
    """Vibrational over steady moment against duration, coloured by place, as SVG data URI."""
    from matplotlib.figure import Figure

    shown = contacts[np.isfinite(contacts["vibration_ratio"])]
    if shown.empty:
        return ""
    figure = Figure(figsize=(6.4, 2.8), layout="constrained")
    axis = figure.subplots()
    dots = axis.scatter(
        shown["duration_ms"],
        shown["vibration_ratio"],
        c=shown["contact_arc_length_mm"],
        s=float(np.clip(300 / np.sqrt(len(shown)), 4, 30)),
        cmap="cividis",
        rasterized=len(shown) > 3000,
    )
    figure.colorbar(dots, label="follicle to contact (mm)")
    axis.axhline(1, color=figures.ACCENT, lw=1)
    axis.set(xscale="log", yscale="log")
    axis.set(xlabel="contact duration (ms)", ylabel="vibrational / steady moment")
    axis.spines[["top", "right"]].set_visible(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", dpi=150)
    return _data_uri(buffer.getvalue(), "image/svg+xml")


def _flags(contacts):
    """Every flag with its number of contacts and the first few places."""
    places = defaultdict(list)
    for row in contacts.to_dict("records"):
        for flag in filter(None, (part.strip() for part in row["flags"].split(";"))):
            places[flag].append(f"{row['video']} frame {row['onset_frame']}")
    return [
        {"flag": flag, "count": len(where), "where": ", ".join(where[:5])}
        for flag, where in sorted(places.items(), key=lambda item: -len(item[1]))
    ]


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
