"""Numbers with a unit and a plausible range, for the declaration of settings and parameters."""

from typing import Annotated, NamedTuple

from pydantic import AfterValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

TABLE = ConfigDict(extra="forbid")  # an unknown key is an error
FEWEST_PER_S = 1000.0  # frames that a time counts as, at least
FEWEST_PER_MM = 25.0  # pixels that a length counts as, at least


class Range(NamedTuple):
    """Plausible values of a quantity, and factors of units often used by mistake.

    inverse : the unit of one over the quantity, where that is often used
    """

    low: float
    high: float
    unit: str
    mistaken_units: dict[str, float]
    inverse: str = ""

    def __str__(self):
        return f"{self.low:g} to {self.high:g} {self.unit}".rstrip()

    def check(self, value: float) -> float:
        """Return the value; PydanticCustomError with advice where it is not plausible."""
        if self.low <= value <= self.high:
            return value
        raise PydanticCustomError("implausible", "{advice}", {"advice": self.advice(value)})

    def advice(self, value: float) -> str:
        """What was expected in place of `value`, and what to do."""
        text = f"expected {self}"
        meant = {mistaken: value * factor for mistaken, factor in self.mistaken_units.items()}
        if self.inverse and value:
            meant = {self.inverse: 1 / value} | meant
        hints = [
            f"in {mistaken}? then write {right:.6g}"
            for mistaken, right in meant.items()
            if self.low <= right <= self.high
        ]
        return f"{text}; " + (f"is it {'; or '.join(hints)}" if hints else "correct the value")


def quantity(low, high, unit, mistaken_units=None, inverse=""):
    """Type of a float that must lie in [low, high] `unit`."""
    limits = Range(low, high, unit, mistaken_units or {}, inverse)
    return Annotated[float, Field(strict=True), AfterValidator(limits.check)]


def parameter(default, meaning: str, source: str):
    """Declare a parameter of the analysis.

    Parameters
    ----------
    default : the value used unless session.toml gives another, in the unit of its `quantity`
    meaning : what it is, for docs/parameters.md
    source : where the default comes from: "measured …", "literature …" or "chosen …"
    """
    return Field(default, description=meaning, json_schema_extra={"source": source})


def frames_in(seconds: float, frames_per_second: float) -> int:
    """Number of frames in a time; at low frame rates as many as at FEWEST_PER_S.

    Certainty depends on the number of frames that were looked at.
    """
    return round(seconds * max(frames_per_second, FEWEST_PER_S))


def pixels_in(length_mm: float, pixels_per_m: float) -> float:
    """Number of pixels in a length; at low resolution as many as at FEWEST_PER_MM.

    Whiskers are some pixels wide at any resolution.
    """
    return length_mm * max(pixels_per_m / 1e3, FEWEST_PER_MM)


def fields_of(table) -> dict:
    """Declared fields of a table of settings or of parameters, by key."""
    fields = getattr(table, "model_fields", None)  # a pydantic model's
    return table.__pydantic_fields__ if fields is None else fields


def limits_of(field) -> Range | None:
    """Plausible range of a numeric field, also inside `… | None`."""
    parts = [*field.metadata]
    for member in getattr(field.annotation, "__args__", ()):
        parts += getattr(member, "__metadata__", ())
    for part in parts:
        owner = getattr(getattr(part, "func", None), "__self__", None)
        if isinstance(owner, Range):
            return owner
    return None
