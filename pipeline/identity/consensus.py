"""Names of a video's lines: the consensus of several namings, of which better ones weigh more.

A whisker keeps its length, however it turns. If after a fast whisk the whole row is named one
whisker too far along, angles and bends still fit the phase, but lengths do not: so such a naming
weighs little. Some namings are of lines with small random errors added: names that change with
these are not sure.
"""

import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.identity import label_swaps, motion_model, seeds
from pipeline.identity.features import ANGLE, LENGTH, NEAR_BEND, THICKNESS
from pipeline.identity.ordered_assignment import (
    along_tracks,
    appearance_and_phases,
    named_in_order,
)
from pipeline.identity.tracklets import named_by_tracklets, often_seen

LEAST_SD = np.array([0.01, np.radians(1.5), 0.05, 0.03, 0.007, 0.005])  # of the features
ROUNDS = 2  # of naming all lines and learning the appearance from them
LESS_OF_APPEARANCE = 0.2  # its weight beside motion where a naming starts from another one
SHARES = 0.15, 0.3  # of the frames, in which whiskers that tracklets lead to are seen
LENGTH_SD = 0.08  # of the logarithm of a whisker's length
NO_NAME = 4.5  # cost of a line without a name, as of a length 3 SD off
NO_LINE = 2.0  # cost of a whisker without a line in a frame
MAY_MISLEAD = THICKNESS, LENGTH  # names are found once more without each of these
SURE = 4  # a naming weighs this power of the best one's cost over its own
LEAST_COST = 0.02  # per line, up to which namings are as good
NAMELESS = 0.5  # part of the weight of no name that counts: a line is seldom no whisker's
GOES_ON = 0.5  # of the weight that stays: with less, a track goes on with another whisker
ALIKE = 1.5  # power of a name's share: namings of the same lines share errors, too


def best_names(lines) -> tuple[np.ndarray, np.ndarray]:
    """Names (rows,), as whiskers were found, −1 for none, and how sure they are (rows,).

    That is the share of the namings that agree on it, by weight, to the power of ALIKE.
    """
    whisker = _side_by_side(lines)
    if whisker is not None:
        return whisker, np.ones(len(whisker))
    namings = list(_namings(lines))
    costs = np.array([_length_cost(lines, names) for names in namings])
    best = namings[int(np.argmin(costs))]
    weight = ((costs.min() + LEAST_COST) / (costs + LEAST_COST)) ** SURE
    named, share = _agreed(lines, [_renamed(names, best) for names in namings], weight)
    return named, share**ALIKE


def _side_by_side(lines):
    """Names (rows,) of tracks that are all seen at once; None where there are others.

    Each is a whisker by itself: in all frames that show them all, they stand in the same order.
    """
    count, (tracks, whisker) = np.diff(lines.starts), np.unique(lines.track, return_inverse=True)
    near = lines.features[:, ANGLE] + lines.features[:, NEAR_BEND]
    if len(tracks) > count.max() or np.isnan(near).any():
        return None
    every = np.flatnonzero(np.repeat(count, count) == len(tracks))
    along = every[np.lexsort((near[every], lines.frame[every]))]
    order = whisker[along].reshape(-1, len(tracks))
    return whisker if (order == order[0]).all() else None


def _agreed(lines, namings, weight):
    """Names (rows,) that most namings give, one line to each in a frame, and shares (rows,).

    A line's shares are averaged along its track: a name does not change for one frame.

    namings : (namings, rows) of the same names; below 0: none
    weight : (namings,)
    """
    namings = np.array(namings)
    rows, count = np.arange(namings.shape[1]), namings.max(initial=-1) + 1
    share = np.zeros((len(rows), count + 1))  # the last one: of no name
    for names, each in zip(namings, weight / weight.sum(), strict=True):
        share[rows, np.where(names < 0, count, names)] += each
    share = _along_whiskers(share, lines)
    named = np.full(len(rows), count)
    for first, last in itertools.pairwise(lines.starts):
        # every line may be the one without a name
        none = np.diag(NAMELESS * share[first:last, count])
        choices = np.hstack([share[first:last, :count], none])
        line, choice = linear_sum_assignment(choices, maximize=True)
        named[first + line] = np.minimum(choice, count)
    return np.where(named < count, named, -1), share[rows, named]


def _along_whiskers(share, lines):
    """Shares (rows, names), averaged along tracks up to where most namings see another whisker."""
    order, first, _ = lines.pieces
    same = np.minimum(share[order[1:]], share[order[:-1]]).sum(axis=1)
    first = np.union1d(first, np.flatnonzero(same < GOES_ON) + 1)
    last = np.append(first[1:], len(order))
    return along_tracks(share, order, first, last, lines.limits.along_track)


def _namings(lines):
    """Yield names (rows,) from different first ones on, and again from each of these.

    The second time is reversed, with random errors added: what misleads in one direction seldom
    does in the other. And names need not keep to tracks: where a track has gone over to
    another whisker, all namings that follow it are wrong together. Thickness and length are not
    seen well where a whisker is blurred or runs into another one: two more do without them.
    """
    back, rows = lines.backwards()
    rng = np.random.default_rng(0)
    first = list(_first_names(lines))
    for model, names in first:
        names, model = _likeliest(lines, model, names)
        yield names
        again, _ = _likeliest(_measured_again(back, rng), model, names[rows], by_motion=True)
        names = np.empty_like(again)
        names[rows] = again
        yield names
    for feature in MAY_MISLEAD:
        yield _without(_measured_again(lines, rng), feature, first[0][1])


def _measured_again(lines, rng):
    """The lines with random errors added to their features, of the size LEAST_SD."""
    errors = LEAST_SD * rng.standard_normal(lines.features.shape)
    return replace(lines, features=lines.features + errors)


def _first_names(lines):
    """Appearances and names (rows,) by numbers of whiskers, and by tracklets."""
    for each in named_in_order(lines, LEAST_SD):
        yield each.model, each.names
    by_tracklets = named_by_tracklets(lines)
    for share in SHARES:
        names = often_seen(by_tracklets, lines.frame, share)
        if names.max(initial=-1) >= 0:
            yield seeds.appearance_of(lines, names, LEAST_SD), names


def _likeliest(lines, model, named, by_motion=False):
    """Names that appearance and motion make likeliest, from first ones on, and the appearance.

    by_motion : how lines move from frame to frame counts more than how they look, and names may
        leave a track that is seen to go on
    """
    for number in range(ROUNDS):
        if number:
            model, named = seeds.with_more(model, named, lines)
        if not (named >= 0).any():
            break  # lines that are all too different: there is nothing to learn from
        model, phase = appearance_and_phases(lines, model, named)
        weight = LESS_OF_APPEARANCE if by_motion else 1.0
        evidence = motion_model.evidence_of(model, lines, phase, weight)
        if by_motion:
            evidence = evidence._replace(rename_cost=np.zeros_like(evidence.rename_cost))
        named = label_swaps.improved(evidence, named, lines.track)
    return named, model


def _without(lines, feature, named):
    """Names (rows,) from first ones on, by all but one of the features."""
    features = lines.features.copy()
    features[:, feature] = np.nan
    fewer = replace(lines, features=features)
    return _likeliest(fewer, seeds.appearance_of(fewer, named, LEAST_SD), named)[0]


def _length_cost(lines, names) -> float:
    """Cost of names (rows,) per line, by how far lines are off their whisker's median length."""
    length = lines.features[:, LENGTH]
    cost = NO_NAME * np.count_nonzero(names < 0)
    for name in np.unique(names[names >= 0]):
        own = length[names == name]
        off = 0.5 * ((own - np.median(own)) / LENGTH_SD) ** 2
        cost += np.minimum(off, NO_NAME).sum() + NO_LINE * (lines.frame[-1] + 1 - len(own))
    return cost / len(names)


def _renamed(names, like):
    """Names (rows,) with those numbers that agree most with the names `like`."""
    both = (names >= 0) & (like >= 0)
    count = np.zeros((names.max(initial=0) + 1, like.max(initial=0) + 1))
    np.add.at(count, (names[both], like[both]), 1)
    number = np.full(len(count) + 1, -2)
    one, other = linear_sum_assignment(-count)
    number[one] = other
    number[-1] = -1
    return number[names]
