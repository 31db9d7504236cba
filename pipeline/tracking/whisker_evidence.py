"""Whether the lines of the templates are whiskers': they taper towards a free end, and they turn.

A wall, a table's edge and a scratch on the floor come out of something dark, too. They stand
still, and they get no thinner towards their ends, or have none in the picture. A texture holds
some lines that taper, too, and a cable sways; so the lines are also judged together, as a row.
"""

import numpy as np
from scipy.special import betaln

from pipeline.detection import line_choice
from pipeline.scene.face import THICKER, far_over_near
from pipeline.tracking import hairs
from pipeline.tracking.line_ends import BORDER_PX

# a whisker's far third is thinner than its near one by more than this if it rests or is seldom
# seen; of 48 whiskers on three recordings 46 have 0.1 to 0.7, two that a body cuts short up to 1.1
THINNER = 0.6
MOVES_PX = 1.5  # off the line where it lay before: compression shakes still things by less
MOVED_LINES = 0.1  # part of the lines
OFTEN = 0.5  # part of the frames
ROW_THINNER = 0.9  # so much thinner gets even a cone that is cut to a seventh of its length
# log of the far third's thickness over the near one's: of whiskers, on three recordings also in
# still and noisy pieces, and of the streaks of a texture; mean, SD
WHISKERS, STREAKS = (-1.0, 0.5), (0.0, 0.8)
FOUND_RIGHT = 0.7  # of a row of whiskers so many lines are traced well enough to show it
STREAKS_MOVE = 0.14  # of a texture's lines seem to
MOST_FOR_MOTION = 5.0  # log odds: a cable moves, too
ROW_ODDS = 0.7  # log odds from which on lines are a row of whiskers
# where no face is seen: part of the picture behind the lines' first points, from which on they
# begin far inside, and the log odds of a clear row: of lines on people, birds and trees up to 6.9,
# of a mouse's and a rat's whiskers whose faces were cut away 8.3 to 19
DEEP, DEEP_ODDS = 0.125, 8.0
FEW_FRAMES = 2  # do not show what moves


def whisker_like(templates, n_frames: int, shape, given: bool = False, unseen_face: float = 0.0):
    """The templates that may be whiskers, and those refused.

    Parameters
    ----------
    templates : `WhiskerTemplate`s, with the lines that they were seen as
    n_frames : frames in which they were looked for
    shape : of the picture, (height, width)
    given : a person says that there are whiskers. Else all are refused where together they are no
        row of whiskers: where none tapers, or too few move or taper well
    unseen_face : as of `StaticScene`. Whiskers of a face beyond the border begin near it; lines
        that begin far inside are believed only as a clear row
    """
    row = [template.samples for template in templates]
    moving = [moves(lines) and (given or _turns(lines)) for lines in row]
    no_row = len(row) == 1 or n_frames <= FEW_FRAMES  # then each is judged by itself
    least = DEEP_ODDS if unseen_face > DEEP else -np.inf if no_row else ROW_ODDS
    may_be = given or (_tapers(row, shape) and _log_odds(row, sum(moving)) > least)
    likely = [
        may_be and _may_be_whisker(lines, each, n_frames, shape)
        for lines, each in zip(row, moving, strict=True)
    ]
    if any(likely) and not given:
        likely &= ~still_hairs(templates, np.array(moving), n_frames)
    pairs = list(zip(templates, likely, strict=True))
    return [s for s, good in pairs if good], [s for s, good in pairs if not good]


def still_hairs(templates, moving, n_frames) -> np.ndarray:
    """Which are still hairs apart from those that move, or else from the strongest, bool (n,).

    moving : bool (n,), of `moves`
    """
    bases = np.array([template.base_xy for template in templates])
    strength = np.array([line_choice.usual_strength(template.samples) for template in templates])
    seen = np.array([len(template.samples) for template in templates]) / n_frames
    usual = np.median([line.n for template in templates for line in template.samples])
    known = bases[moving] if moving.any() else bases[[np.argmax(strength)]]
    return hairs.are_hairs_beside(bases, strength, seen, usual, known) & ~moving


def _end_inside(lines, shape) -> np.ndarray:
    """Whether each line's far end lies inside the picture, (height, width)."""
    ends = np.array([line.points[-1] for line in lines])
    return np.all((ends > BORDER_PX) & (ends < np.array(shape[::-1]) - 1 - BORDER_PX), axis=1)


def _tapers(row, shape) -> bool:
    """Whether any of the lines gets thinner: of those with a free end, or else of all."""
    ratios = [_thinner(lines, _end_inside(lines, shape)) for lines in row]
    if np.isnan(ratios).all():
        ratios = [_thinner(lines, np.ones(len(lines), bool)) for lines in row]
    return bool(np.isnan(ratios).all() or np.nanmin(ratios) < ROW_THINNER)


def _log_odds(row, moving) -> float:
    """Log odds that lines are a row of whiskers, not of streaks, from their taper and motion.

    moving : how many of them move
    """
    taper = np.log([_thinner(lines, np.ones(len(lines), bool)) for lines in row])
    taper = taper[np.isfinite(taper)]
    odds = FOUND_RIGHT * _density(taper, *WHISKERS) / _density(taper, *STREAKS) + 1 - FOUND_RIGHT
    resting = len(row) - moving
    by_motion = betaln(moving + 1, resting + 1)  # of whiskers, any share may move
    by_motion -= moving * np.log(STREAKS_MOVE) + resting * np.log1p(-STREAKS_MOVE)
    return float(np.log(odds).sum() + min(by_motion, MOST_FOR_MOTION))


def _density(values, mean, sd):
    """Gaussian density, up to a factor that all have."""
    return np.exp(-0.5 * ((values - mean) / sd) ** 2) / sd


def _may_be_whisker(lines, moves, n_frames, shape) -> bool:
    ratio = _thinner(lines, _end_inside(lines, shape))
    if np.isnan(ratio):
        if moves:
            return True
        ratio = _thinner(lines, np.ones(len(lines), bool))  # of what the border leaves
    often = len(lines) >= OFTEN * n_frames
    if not (moves or often):
        return False  # a still line is there all the time
    lacking = not (moves and often)
    return bool(ratio < THICKER * THINNER**lacking)


def _thinner(lines, chosen) -> float:
    """Median thickness of the chosen lines' far third over the near one's; NaN where unknown."""
    pairs = zip(lines, chosen, strict=True)
    ratios = [far_over_near(line.thickness[: line.n]) for line, good in pairs if good]
    return np.nan if np.isnan(ratios).all() else float(np.nanmedian(ratios))


def moves(lines) -> bool:
    """Whether some of the lines lie mostly beside the longest one."""
    longest = max(lines, key=lambda line: line.n)
    beside = [line_choice.shared_fraction(line, longest, MOVES_PX) < 0.5 for line in lines]
    return bool(np.mean(beside) >= MOVED_LINES)


def _turns(lines) -> bool:
    """Whether their ends move more than their bases; those of a dragged tail do not."""
    return len(lines) > FEW_FRAMES and _usual_way(lines, 0) < _usual_way(lines, -1)


def _usual_way(lines, point) -> float:
    """How far one point of the lines, 0 or −1, usually lies from its median place [px]."""
    places = np.array([line.points[point] for line in lines])
    return float(np.median(np.hypot(*(places - np.median(places, axis=0)).T)))
