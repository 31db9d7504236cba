"""[image] in session.toml: the part of the picture that is looked at; dark or bright whiskers."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from pipeline.video.image_file import read_image

REGION = "expected [x0, y0, x1, y1] in px, with 0 <= x0 < x1 and 0 <= y0 < y1"


def _check_region(value):
    """The region as a tuple; PydanticCustomError with advice where it is none."""
    numbers = isinstance(value, (list, tuple)) and all(
        isinstance(each, (int, float)) and not isinstance(each, bool) for each in value
    )
    if numbers and len(value) == 4:
        x0, y0, x1, y1 = value
        if 0 <= x0 < x1 and 0 <= y0 < y1:
            return tuple(map(float, value))
    advice = f"{REGION}; correct the value"
    raise PydanticCustomError("implausible", "{advice}", {"advice": advice})


class ImageSettings(BaseModel):
    """[image]: what of the picture is looked at."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    region_px: Annotated[
        tuple[float, float, float, float] | None, BeforeValidator(_check_region)
    ] = Field(None, description="[x0, y0, x1, y1]: only this part is analysed")
    mask: Annotated[str, Field(strict=True, min_length=1)] | None = Field(
        None, description="image of the video's size; its black parts are ignored"
    )
    polarity: Literal["dark", "bright"] | None = Field(
        None, description="dark or bright whiskers; found automatically if not given"
    )

    def beside(self, folder) -> "ImageSettings":
        """The same, with the mask's path relative to a folder, that of session.toml."""
        if self.mask is None:
            return self
        return self.model_copy(update={"mask": str(Path(folder).absolute() / self.mask)})

    def mask_problem(self) -> str | None:
        """What is wrong with the file of the mask, in words; None: nothing."""
        if self.mask is None:
            return None
        if not Path(self.mask).is_file():
            return f"[image] mask: there is no file {self.mask}; correct its name, or leave it out"
        if read_image(self.mask) is None:
            return f"[image] mask: {self.mask} is not a picture; save it as PNG"
        return None
