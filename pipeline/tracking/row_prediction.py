"""Where the lines of a face's rows are expected in the next frame: each row turns as one."""

import numpy as np

from pipeline.detection.line import Line
from pipeline.tracking import row_rotation, two_sides
from pipeline.tracking.track_state import Track, moved_on

FEWEST_IN_ROW = 5  # whiskers that turn as one: of a few, one that slips off the pole tilts all


class Rows:
    """The rows of a face, one per side: the sides turn against each other."""

    def __init__(self, templates, along, options):
        """`along` : direction along the face, (x, y)."""
        self.along = np.asarray(along, float)
        self.cuts = two_sides.cuts_between(templates, self.along, options.params.identity)
        self.pivot = options.px(options.params.tracking.crowd_pivot_mm)

    def predict(self, tracks: list[Track], picture) -> None:
        """Set what tracks turn by as the turn of their row, surer than each one's own motion.

        A few lines are no row: one that slips off the pole moves unlike the others.
        """
        for track in tracks:
            track.turn = (0.0, 0.0)
        if len(tracks) < FEWEST_IN_ROW:
            return
        for row in self._of([track.line for track in tracks]):
            if len(row) >= FEWEST_IN_ROW:
                self._predict_row([tracks[k] for k in row], picture)

    def _predict_row(self, row, picture) -> None:
        """`predict` the tracks of one row."""
        lines = [moved_on(track.line, None) for track in row]
        last = np.array([track.turned_to(track.line) for track in row])
        turn = row_rotation.even_turns(row_rotation.places(lines), last)
        for line, angle in zip(lines, turn, strict=True):
            row_rotation.turn_line(line, angle, self.pivot)
        turn += row_rotation.common_turns(picture, lines, self.pivot)
        for track, angle in zip(row, turn, strict=True):
            track.turn, track.before = (float(angle), self.pivot), None

    def even_turns(self, lines, turn) -> np.ndarray:
        """Turns of all lines as in `row_rotation.even_turns`, of each side's row by itself."""
        even = np.zeros(len(lines))
        for row in self._of(lines):
            places = row_rotation.places([lines[k] for k in row])
            even[row] = row_rotation.even_turns(places, turn[row])
        return even

    def turned_back(self, line, angle) -> Line:
        """A copy of the line, turned against the row's turn [rad]."""
        back = moved_on(line, None)
        row_rotation.turn_line(back, -angle, self.pivot)
        return back

    def _of(self, lines) -> list[np.ndarray]:
        """Indices of the lines of each row."""
        if not self.cuts:
            return [np.arange(len(lines))] if lines else []
        bases = np.array([(line.x[0], line.y[0]) for line in lines]).reshape(-1, 2)
        side = two_sides.side_of(bases @ self.along, self.cuts)
        return [own for k in range(len(self.cuts) + 1) if len(own := np.flatnonzero(side == k))]
