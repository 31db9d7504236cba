"""An `Analysis` as a notebook shows it: what was found in words, a plot, the contacts."""

from html import escape

from pipeline.errors import counted
from pipeline.reports.notebook_plots import plot_course
from pipeline.reports.plot_style import axes, svg

COLUMNS = [
    "whisker", "contact", "onset_s", "duration_ms", "peak_force_uN", "peak_force_se_uN",
    "peak_base_moment_nN_m", "vibration_ratio", "flags",
]  # fmt: skip
ROWS = 10
PLOT_HEIGHT = 1.9  # inches


def notebook_view(analysis) -> str:
    """HTML of an `Analysis`."""
    contacts = analysis.contacts
    words = f"{counted(analysis.n_frames, 'frame')}, {counted(len(contacts), 'contact')}"
    names = escape(", ".join(analysis.whiskers)) or "no whisker"
    parts = [f"<p><b>{names}</b>: {words}</p>"]
    parts += [f"<p>⚠ {escape(message)}</p>" for message in analysis.messages]
    if analysis.frames["contact_force_uN"].notna().any():
        parts.append(f'<img alt="contact force over time" src="{_plot(analysis)}"/>')
    elif analysis.whiskers:
        parts.append(f'<img alt="angle over time" src="{_plot(analysis, "base_angle_deg")}"/>')
    if len(contacts):
        shown = contacts[COLUMNS].head(ROWS)
        parts.append(shown.to_html(index=False, float_format="{:.4g}".format, border=0))
    if len(contacts) > ROWS:
        parts.append(f"<p>… and {len(contacts) - ROWS} more</p>")
    return "\n".join(parts)


def _plot(analysis, column="contact_force_uN") -> str:
    figure, ax = axes(PLOT_HEIGHT)
    plot_course(analysis.frames, column, ax=ax)
    return svg(figure)
