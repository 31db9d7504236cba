"""The tables of session.toml as types: what each key may hold, and the same in SI units."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from pipeline.session.image import ImageSettings
from pipeline.session.parameters import Parameters
from pipeline.session.quantities import quantity
from pipeline.session.recording import Recording
from whiskermodel.whisker import Whisker

LONGEST_CONE_MM = 10_000  # all but a cylinder
FORMULA = ("=", "+", "-", "@")  # spreadsheets compute what begins so
SIDES, UPRIGHT = ("left", "right"), ("upper", "lower")  # of a face, in names of whiskers
DIMENSIONS = ("length_mm", "cone_length_mm", "base_radius_um")


def plain_name(name: str) -> str:
    """Return a name that tables can hold; PydanticCustomError where it is none."""
    if name.isprintable() and name.strip() == name and not name.startswith(FORMULA):
        return name
    advice = (
        "expected a name without spaces around it that does not begin with = + - @, which "
        "spreadsheets compute; choose another"
    )
    raise PydanticCustomError("implausible", "{advice}", {"advice": advice})


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class RecordingSettings(_Table):
    """[recording]: what the camera saw."""

    frames_per_second: quantity(10, 200_000, "frames/s", {"kHz": 1e3}) = Field(
        description="of the camera, not the file's playback rate"
    )
    pixels_per_mm: quantity(
        1, 1000, "pixels/mm", {"pixels per m": 1e-3, "pixels per µm": 1e3}, "mm per pixel"
    ) = Field(description="scale of the image")
    face: Literal["left", "right", "top", "bottom"] = Field(
        description="side of the image: left, right, top, bottom"
    )
    snout: Literal["left", "right", "top", "bottom"] | None = Field(
        None,
        description="side of the image nearest to the snout; only if one side of the face is seen",
    )

    def si(self) -> Recording:
        """Return it as the `Recording` that travels through the pipeline."""
        return Recording(self.frames_per_second, self.pixels_per_mm, self.face, self.snout)


class WhiskerSettings(_Table):
    """One [[whisker]] table; the forces need length, base radius, cone length or tip radius."""

    name: Annotated[str, Field(strict=True, min_length=1), AfterValidator(plain_name)] = Field(
        description="the lab's name for it"
    )
    length_mm: quantity(1, 200, "mm", {"m": 1e3, "µm": 1e-3}) | None = Field(
        None, description="follicle to (cut) tip"
    )
    cone_length_mm: quantity(1, LONGEST_CONE_MM, "mm", {"m": 1e3, "µm": 1e-3}) | None = Field(
        None, description="follicle to the extrapolated apex"
    )
    tip_radius_um: quantity(0, 500, "µm") | None = Field(
        None, description="at the (cut) tip; in place of cone_length_mm"
    )
    base_radius_um: quantity(2, 500, "µm", {"mm": 1e3, "m": 1e6, "nm": 1e-3}) | None = Field(
        None, description="half the diameter at the follicle; force scales with its fourth power"
    )
    youngs_modulus_GPa: quantity(0.05, 50, "GPa", {"MPa": 1e-3, "Pa": 1e-9}) = Field(
        3.0, description="the paper's mouse whiskers: 3"
    )
    density_kg_per_m3: quantity(300, 3000, "kg/m³", {"g/cm³": 1e3}) = Field(
        1000.0, description="the paper's mouse whiskers: 1000"
    )
    damping_per_s: quantity(0, 10_000, "1/s") = Field(
        215.0, description="decay rate of the ring-down, d = γ/2"
    )
    hidden_length_mm: quantity(0, 20, "mm", {"µm": 1e-3}) = Field(
        1.4, description="between follicle and first visible point, in the fur"
    )

    @property
    def missing_dimensions(self) -> tuple[str, ...]:
        """Keys without which no force can be computed and that are not given."""
        missing = [key for key in DIMENSIONS if getattr(self, key) is None]
        if self.tip_radius_um is not None:
            missing = [key for key in missing if key != "cone_length_mm"]
        return tuple(missing)

    @property
    def cone_length(self) -> float | None:
        """Follicle to the extrapolated apex [m], from the tip's radius where that is given."""
        if self.cone_length_mm is not None:
            return 1e-3 * self.cone_length_mm
        if self.missing_dimensions:
            return None
        lost = max(1 - self.tip_radius_um / self.base_radius_um, self.length_mm / LONGEST_CONE_MM)
        return 1e-3 * self.length_mm / lost

    @property
    def hidden_length(self) -> float:
        """Follicle to first visible point [m]."""
        return 1e-3 * self.hidden_length_mm

    def si(self) -> Whisker | None:
        """Return it as a `Whisker` in SI units; None while a dimension is missing."""
        if self.missing_dimensions:
            return None
        return Whisker(
            length=1e-3 * self.length_mm,
            cone_length=self.cone_length,
            base_radius=1e-6 * self.base_radius_um,
            youngs_modulus=1e9 * self.youngs_modulus_GPa,
            density=self.density_kg_per_m3,
            damping_rate=self.damping_per_s,
            name=self.name,
        )


class PoleSettings(_Table):
    """[pole]: the object that is touched."""

    diameter_mm: quantity(0.02, 20, "mm", {"µm": 1e-3, "m": 1e3}) = Field(
        0.5, description="diameter of the pole"
    )
    x_px: quantity(-20_000, 20_000, "px") | None = Field(
        None, description="the pole's centre; found automatically if not given"
    )
    y_px: quantity(-20_000, 20_000, "px") | None = Field(None, description="")

    @property
    def diameter(self) -> float:
        """Diameter [m]."""
        return 1e-3 * self.diameter_mm

    @property
    def position_px(self) -> tuple[float, float] | None:
        """Centre (x, y) in pixels, or None: to be found."""
        return None if self.x_px is None else (self.x_px, self.y_px)


def _check_names(value):
    """Names as a tuple; PydanticCustomError with advice where it is no list of them."""
    texts = isinstance(value, (list, tuple)) and all(isinstance(n, str) and n for n in value)
    if texts and value and len(set(value)) == len(value):
        return tuple(value)
    advice = 'expected a list of distinct names, as ["C1", "C2"]; correct it, or leave it out'
    raise PydanticCustomError("implausible", "{advice}", {"advice": advice})


class AnalysisSettings(_Table):
    """[analysis]: choices of method."""

    curvature_at_mm: quantity(0.1, 100, "mm", {"m": 1e3, "µm": 1e-3}) = Field(
        5.5, description="arc length from the follicle at which curvature is measured"
    )
    friction: quantity(0, 2, "") = Field(
        0.0, description="coefficient of friction between whisker and pole; 0: none"
    )

    follow: Annotated[tuple[str, ...] | None, BeforeValidator(_check_names)] = Field(
        None, description="tables for these whiskers only; the others are still tracked"
    )

    @property
    def curvature_at(self) -> float:
        """Arc length from the follicle at which curvature is measured [m]."""
        return 1e-3 * self.curvature_at_mm


class Settings(_Table):
    """All of session.toml. Only `recording` is required.

    `whisker` holds one table per tracked whisker, anterior to posterior, or in the other order
    where lengths or arcs (C1, C2, C3) say so; it may be empty. Where both sides of a face are in
    view, names begin with `left_` and `right_` (`upper_`, `lower_`).
    `advanced` holds the parameters of the analysis (docs/parameters.md); most need no change.
    """

    recording: RecordingSettings
    whisker: tuple[WhiskerSettings, ...] = ()
    pole: PoleSettings = PoleSettings()
    image: ImageSettings = ImageSettings()
    analysis: AnalysisSettings = AnalysisSettings()
    advanced: Parameters = Parameters()

    def without_bare_whiskers(self) -> "Settings":
        """The settings without [[whisker]] tables, if these hold nothing but names w1, w2, ….

        `init` writes such tables (left_w1, …, right_w1, … on two sides) for the whiskers that it
        saw in a few frames; there may be others.
        """
        names = [whisker.name for whisker in self.whisker]
        sides = [name.rpartition("w")[0] for name in names]
        known = {"", *(f"{side}_" for side in (*SIDES, *UPRIGHT))}
        counted = [f"{side}w{sides[: k + 1].count(side)}" for k, side in enumerate(sides)]
        bare = tuple(WhiskerSettings(name=name) for name in counted)
        is_bare = self.whisker == bare and known.issuperset(sides)
        return self.model_copy(update={"whisker": ()}) if is_bare else self
