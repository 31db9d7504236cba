"""The files that `whiskerforce paper` writes: pictures and tables of the paper's model figures."""

import csv
import os
from pathlib import Path

from whiskermodel.paper import drawing, figure_data, figures, moment_figures, published
from whiskermodel.paper.figure_data import MICRO, MILLI, NANO, Table


def write_paper(out_dir, progress=None, grid=(88, 121)):
    """Write every model figure as PNG, SVG and CSV, `modes.csv` and `published.csv`.

    Parameters
    ----------
    out_dir : path
        Made if it is not there. Each file appears whole or not at all.
    progress : callable, optional
        Called with a line of text before each part.
    grid : (int, int)
        Contacts and durations of Fig. 11.

    Returns
    -------
    list of Path, in the order written
    """
    out, written = Path(out_dir), []
    out.mkdir(parents=True, exist_ok=True)
    for name, make in _PARTS.items():
        if progress is not None:
            progress(name)
        tables, figure = make(grid)
        for key, table in tables.items():
            written.append(_whole(out / f"{key}.csv", _write_csv, table))
        for kind in ("png", "svg") if figure is not None else ():
            written.append(_whole(out / f"{name}.{kind}", drawing.save, figure, kind))
    return written


# Parts: tables by the names of their files, and the drawn figure or None ------------------------


def _modes(_):
    return {"modes": figure_data.mode_table()}, None


def _figure_2(_):
    table = figure_data.figure_2()
    return {"fig2": table}, figures.draw_fig2(table)


def _figure_5(_):
    traces, fits = figure_data.figure_5()
    return {"fig5": traces, "fig5_fits": fits}, figures.draw_fig5(traces, fits)


def _figure_6(_):
    motions = [figure_data.figure_6(boundary) for boundary in ("fixed", "pinned")]
    return {"fig6": _motion_table(motions)}, figures.draw_fig6(motions)


def _figure_7(_):
    table, duration = figure_data.figure_7(), figure_data.FIGURE_7_DURATION
    cases = [
        (c, duration, figure_data.pulse_loads(c, force, duration))
        for c, force in figure_data.FIGURE_7_CONTACTS.items()
    ]
    tables = {"fig7": table, "fig7_traces": _trace_table(cases)}
    return tables, moment_figures.draw_fig7(table, cases)


def _figure_8(_):
    table, contact = figure_data.figure_8(), figure_data.FIGURE_8_CONTACT
    cases = [
        (contact, t, figure_data.pulse_loads(contact, figure_data.FIGURE_8_FORCE, t))
        for t in figure_data.FIGURE_8_DURATIONS
    ]
    tables = {"fig8": table, "fig8_traces": _trace_table(cases)}
    return tables, moment_figures.draw_fig8(table, cases)


def _figure_9(_):
    table, contact = figure_data.figure_9(), figure_data.FIGURE_9_CONTACT
    cases = [(contact, s, figure_data.slip_loads(s)) for s in figure_data.FIGURE_9_SLIPS]
    single = [
        (contact, s, figure_data.slip_loads(s, events=1)) for s in figure_data.FIGURE_9_SLIPS
    ]
    deflections = [(s, figure_data.slip_deflection(s)) for s in figure_data.FIGURE_9_SLIPS]
    tables = {
        "fig9": table,
        "fig9_traces": _trace_table(cases),
        "fig9_single_slips": _trace_table(single),
        "fig9_deflections": _deflection_table(deflections),
    }
    return tables, moment_figures.draw_fig9(table, cases, single, deflections)


def _figure_10(_):
    table = figure_data.figure_10()
    cases = [
        (figure_data.FIGURE_10_CONTACT, t, figure_data.ramp_loads(t))
        for t in figure_data.FIGURE_10_RAMPS
    ]
    tables = {"fig10": table, "fig10_traces": _trace_table(cases)}
    return tables, moment_figures.draw_fig10(cases)


def _figure_11(grid):
    table = figure_data.figure_11(*grid)
    return {"fig11": table}, moment_figures.draw_fig11(table)


def _supported(_):
    comparisons = figure_data.figure_supported()
    table = _comparison_table(comparisons)
    return {"supported": table}, moment_figures.draw_supported(comparisons)


def _published(_):
    return {"published": published.table()}, None


_PARTS = {
    "modes": _modes,
    "fig2": _figure_2,
    "fig5": _figure_5,
    "fig6": _figure_6,
    "fig7": _figure_7,
    "fig8": _figure_8,
    "fig9": _figure_9,
    "fig10": _figure_10,
    "fig11": _figure_11,
    "supported": _supported,
    "published": _published,
}


# Tables of traces -------------------------------------------------------------------------------


def _motion_table(motions, every_ms=0.5, every_point=4):
    names = ("boundary", "time_ms", "arc_length_mm", "steady_um", "vibration_um")
    instants, rows = slice(None, None, round(every_ms * 1e-3 / figure_data.DT)), []
    for m in motions:
        time = m.time[instants] * MILLI
        for i in range(0, len(m.arc_length), every_point):
            parts = (m.steady[i, instants] * MICRO, m.vibrational[i, instants] * MICRO)
            head = (m.boundary, m.arc_length[i] * MILLI)
            rows += [(head[0], t, head[1], *y) for t, *y in zip(time, *parts, strict=True)]
    return Table.of_rows(names, rows)


def _trace_table(cases):
    """`cases`: (contact, duration, BaseLoads); every 0.1 ms."""
    rows = []
    for contact, duration, loads in cases:
        series = (loads.time * MILLI, loads.force * MICRO, loads.steady_moment * NANO,
                  loads.vibrational_moment * NANO)  # fmt: skip
        head = (contact * MILLI, duration * MILLI)
        rows += [head + row for row in zip(*(s[::10] for s in series), strict=True)]
    names = ("contact_mm", "duration_ms", "time_ms", "force_uN", "steady_nN_m", "vibration_nN_m")
    return Table.of_rows(names, rows)


def _comparison_table(comparisons):
    names = ("contact_mm", "duration_ms", "time_ms", "steady_nN_m", "vibration_paper_nN_m",
             "vibration_supported_nN_m", "force_uN", "pole_force_uN")  # fmt: skip
    rows = []
    for c in comparisons:
        series = (c.paper.time * MILLI, c.paper.steady_moment * NANO,
                  c.paper.vibrational_moment * NANO, c.held.vibrational_moment * NANO,
                  c.paper.force * MICRO, c.held.pole_force * MICRO)  # fmt: skip
        head = (c.contact * MILLI, c.duration * MILLI)
        rows += [head + row for row in zip(*(s[::10] for s in series), strict=True)]
    return Table.of_rows(names, rows)


def _deflection_table(deflections):
    """`deflections`: (slip, y at 16 mm [m]); every 0.1 ms."""
    rows = []
    for slip, y in deflections:
        every = y[::10]
        rows += [
            (slip * MILLI, 10 * i * figure_data.DT * MILLI, v * MICRO) for i, v in enumerate(every)
        ]
    return Table.of_rows(("duration_ms", "time_ms", "displacement_um"), rows)


# Files ------------------------------------------------------------------------------------------


def _whole(target, write, *content):
    """`write` the content beside the target, then move it into place; returns the target."""
    part = target.with_name(f".{target.name}.part")
    try:
        write(part, *content)
        os.replace(part, target)
    except OSError as error:
        error.filename, error.filename2 = str(target), None
        raise
    finally:
        part.unlink(missing_ok=True)
    return target


def _write_csv(path, table):
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.columns)
        writer.writerows([_text(value) for value in row] for row in table.rows())


def _text(value):
    return f"{value:.9g}" if isinstance(value, float) else str(value)
