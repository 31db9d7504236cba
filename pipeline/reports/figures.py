"""The paper's Fig. 3 a–f from a results folder, with the numbers behind it as CSV."""

import warnings
from pathlib import Path

from pipeline.reports import fig3_panels
from pipeline.reports.fig3_tables import chosen, panel_tables, typical_contact
from pipeline.reports.plot_style import NO_DATE, SVG_IDS
from pipeline.reports.session_numbers import fig3_numbers, read_contacts, read_truth
from pipeline.tables import whole_files
from pipeline.tables.files import write_csv
from pipeline.tables.own_files import write_new


def write_fig3(
    results, truth=None, video=None, whisker=None, contact=None, damaged=None
) -> list[Path]:
    """Write figures/fig3.png, .svg, fig3.csv, and an SVG and CSV per panel into a results folder.

    Parameters
    ----------
    results : folder of `whiskerforce run`
    truth : folder of truth tables of `whiskerforce synth`; None: the `truth` folder beside the
        videos, if there is one
    video, whisker, contact : which contact panels a and b show: name of a video, of a whisker,
        number of the contact; None: any, the one that is nearest to the medians
    damaged : as of `damaged_videos`, where they are known

    Returns
    -------
    The files written.

    Raises
    ------
    ValueError
        If `results` is no results folder, or there is no such contact.
    """
    results = Path(results)
    contacts = read_contacts(results, damaged)
    true_contacts = read_truth(results, truth)
    typical = typical_contact(results, chosen(contacts, video, whisker, contact))
    panels = panel_tables(results, contacts, typical)
    content = fig3_panels.Content(panels, fig3_numbers(contacts, true_contacts), typical)
    return write_new(results / "figures", lambda new: _write_all(new, content))


def _write_all(folder, content):
    written = []
    for letter, table in content.panels.items():
        written.append(folder / f"fig3{letter}.csv")
        write_csv(written[-1], table)
    written += _save(fig3_panels.draw(content), folder, "fig3", ("png", "svg"))
    for letter in content.panels:
        written += _save(fig3_panels.draw_one(content, letter), folder, f"fig3{letter}", ("svg",))
    write_csv(folder / "fig3.csv", content.numbers)
    return [*written, folder / "fig3.csv"]


def _save(figure, folder, name, kinds) -> list[Path]:
    """Save a figure as "png" or "svg", its text as text.

    The canvases draw themselves: `savefig` draws everything once more beforehand.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    for kind in kinds:
        with (
            whole_files.whole_file(folder / f"{name}.{kind}") as temporary,
            mpl.rc_context({"svg.fonttype": "none", **SVG_IDS}),
            warnings.catch_warnings(),
        ):
            warnings.filterwarnings("ignore", "Glyph .* missing")  # in a video's name
            if kind == "png":
                FigureCanvasAgg(figure).print_png(temporary)
            else:
                FigureCanvasSVG(figure).print_svg(temporary, metadata=NO_DATE)
    return [folder / f"{name}.{kind}" for kind in kinds]
