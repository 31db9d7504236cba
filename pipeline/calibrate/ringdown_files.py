"""What `calibrate ringdown` writes: tables, figure, values for session.toml."""

import pandas as pd

from pipeline.calibrate.ringdown import Pooled, SlipFit, moduli_by_follicle
from pipeline.calibrate.ringdown_picture import draw_ringdown
from pipeline.session.edit import set_whisker_values
from pipeline.tables.calibration_columns import RINGDOWN_COLUMNS
from pipeline.tables.files import write_csv
from pipeline.tables.own_files import new_files
from pipeline.tables.whole_files import write_text

STIFFNESSES = (float("inf"), 100.0, 30.0, 10.0, 5.0, 0.0)  # of the follicle, E I0/L


def ringdown_table(fits: list[SlipFit], together: Pooled, whisker, boundary) -> pd.DataFrame:
    """Rows of ringdown.csv: a slip each, then all pooled."""
    rows = [
        _row(
            (each.slip.video.name, each.slip.whisker, each.slip.first),
            (each.angular_frequency, each.damping, each.youngs_modulus(whisker, boundary)),
        )
        for each in fits
    ]
    pooled = together.angular_frequency, together.damping, together.youngs_modulus
    rows.append(_row(("pooled", fits[0].slip.whisker, together.n), pooled))
    return pd.DataFrame(rows)


def _row(names, estimates):
    row = dict(zip(("video", "whisker", "frame"), names, strict=True))
    columns = "angular_frequency_rad_per_s", "damping_per_s", "youngs_modulus_GPa"
    for column, unit, each in zip(columns, (1, 1, 1e-9), estimates, strict=True):
        row |= {
            column: unit * each.value,
            f"{column}_low": unit * each.low,
            f"{column}_high": unit * each.high,
        }
    return row


def write_ringdown(out, fits, together, whisker, boundary) -> None:
    """Write ringdown.csv, follicle.csv and the figure."""
    follicle = list(moduli_by_follicle(together, whisker, STIFFNESSES))
    lines = [
        f"{stiffness:g},{1e-9 * e.value:.6g},{1e-9 * e.low:.6g},{1e-9 * e.high:.6g}"
        for stiffness, e in follicle
    ]
    header = "follicle_stiffness,youngs_modulus_GPa,youngs_modulus_GPa_low,youngs_modulus_GPa_high"
    table = ringdown_table(fits, together, whisker, boundary)
    with new_files(out, {f.slip.video.whisker_made_of(f.slip.whisker) for f in fits}) as new:
        write_text(new / "follicle.csv", "\n".join([header, *lines, ""]))
        draw_ringdown(new / "ringdown.png", fits, together)
        write_csv(new / "ringdown.csv", table, RINGDOWN_COLUMNS)


def write_into(session, name, together: Pooled) -> str:
    """Write Young's modulus and damping into a whisker of session.toml; returns that, in words."""
    values = {
        "youngs_modulus_GPa": round(1e-9 * together.youngs_modulus.value, 4),
        "damping_per_s": round(together.damping.value, 2),
    }
    return set_whisker_values(session, name, values)
