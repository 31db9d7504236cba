"""What the camera saw."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Recording:
    """What the camera saw: frame rate [1/s], scale [px/mm], the image's side with the face.

    `snout` is the side nearest to the snout, one of the two next to the face's side; None: not
    known. It is not needed where both sides of the face are seen.
    """

    frames_per_second: float
    pixels_per_mm: float
    face: str
    snout: str | None = None

    @property
    def pixels_per_m(self) -> float:
        """Scale in pixels per metre."""
        return 1e3 * self.pixels_per_mm
