"""The room's parameters in the units of its arrays: frames and radians."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.session.parameters import IdentityParams
from pipeline.session.quantities import frames_in


@dataclass(frozen=True)
class Limits:
    """`IdentityParams` for one frame rate [1/s]; times are in frames, angles in radians."""

    params: IdentityParams
    frames_per_second: float

    @cached_property
    def lasting(self) -> int:
        """Frames after which a line that moves steadily is one whisker's."""
        return self._frames(self.params.lasting_s)

    @cached_property
    def long_track(self) -> int:
        """Frames after which a line that matches no whisker is another whisker."""
        return self._frames(self.params.long_track_s)

    @cached_property
    def same_mean(self) -> int:
        """Frames over which whiskers whisk about the same mean angle; an odd number."""
        return 2 * (self._frames(self.params.same_mean_s) // 2) + 1

    @cached_property
    def along_track(self) -> int:
        """Frames before, and after, over which a track's likeness to whiskers is averaged."""
        return max(self._frames(self.params.along_track_s) // 2, 1)

    @cached_property
    def moving(self) -> float:
        """Turn [rad] from which every frame is new evidence."""
        return float(np.radians(self.params.moving_deg))

    @cached_property
    def own_turn(self) -> float:
        """Turn [rad] relative to the others from which a line may be another whisker."""
        return float(np.radians(self.params.own_turn_deg))

    @cached_property
    def alone(self) -> float:
        """Angle [rad] to the nearest line from which a line keeps its whisker."""
        return float(np.radians(self.params.alone_deg))

    def _frames(self, seconds) -> int:
        return max(frames_in(seconds, self.frames_per_second), 1)
