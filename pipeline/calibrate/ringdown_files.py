"""What `calibrate ringdown` writes: tables, figure, values for session.toml."""

import pandas as pd

from pipeline.calibrate.ringdown import Pooled, SlipFit, moduli_by_follicle
from pipeline.calibrate.ringdown_picture import draw_ringdown
from pipeline.session.edit import set_whisker_values
from pipeline.tables.calibration_columns import FOLLICLE_COLUMNS, RINGDOWN_COLUMNS
from pipeline.tables.files import write_csv
from pipeline.tables.own_files import new_files

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
        row |= _cells(column, unit, each)
    return row


def _cells(column, unit, estimate) -> dict:
    """An estimate and the ends of its interval, as columns with this name."""
    ends = {"": estimate.value, "_low": estimate.low, "_high": estimate.high}
    return {column + end: unit * value for end, value in ends.items()}


def write_ringdown(out, fits, together, whisker, boundary) -> None:
    """Write ringdown.csv, follicle.csv and the figure."""
    follicle = pd.DataFrame(
        {"follicle_stiffness": stiffness} | _cells("youngs_modulus_GPa", 1e-9, modulus)
        for stiffness, modulus in moduli_by_follicle(together, whisker, STIFFNESSES)
    )
    table = ringdown_table(fits, together, whisker, boundary)
    with new_files(out, {f.slip.video.whisker_made_of(f.slip.whisker) for f in fits}) as new:
        write_csv(new / "follicle.csv", follicle, FOLLICLE_COLUMNS)
        draw_ringdown(new / "ringdown.png", fits, together)
        write_csv(new / "ringdown.csv", table, RINGDOWN_COLUMNS)


def write_into(session, name, together: Pooled) -> str:
    """Write Young's modulus and damping into a whisker of session.toml; returns that, in words."""
    values = {
        "youngs_modulus_GPa": round(1e-9 * together.youngs_modulus.value, 4),
        "damping_per_s": round(together.damping.value, 2),
    }
    return set_whisker_values(session, name, values)
