"""How many more whiskers are seen than have names."""

import numpy as np

from pipeline.identity.features import LENGTH, THICKNESS


class Unnamed:
    """Counts the lines without a name that look like whiskers, as many as are seen at a time.

    fur_share : length × absorbance, of the plainest named whisker, below which a line is fur
    first_look : the count where no row is added: whiskers that stand apart get their names in
        the first look
    """

    def __init__(self, fur_share: float, first_look: int = 0):
        self.fur_share, self.first_look, self.rows = fur_share, first_look, []

    @property
    def count(self) -> int:
        """Such lines of all rows of the face that were added, in the median over frames."""
        return sum(self.rows) if self.rows else self.first_look

    def add(self, frame, named, features) -> None:
        """Count in one row of the face.

        frame, named : (lines,) number of the frame, and of the whisker, below 0: none
        features : (lines, 6) of `line_features`
        """
        strength = np.exp(features[:, LENGTH] + features[:, THICKNESS])
        usual = [np.nanmedian(strength[named == name]) for name in np.unique(named[named >= 0])]
        if not usual:
            return
        plain = frame[strength > self.fur_share * max(usual)]
        seen = np.median(np.bincount(plain, minlength=frame.max() + 1))
        self.rows.append(max(int(seen) - len(usual), 0))
