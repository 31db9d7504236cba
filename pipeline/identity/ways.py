"""Names of a video's lines by several ways, of which the best one counts and the good ones vote.

A whisker keeps its length, however it turns. Where the whole row is named one whisker further
after a fast whisk, angles and bends still go with the phase, but lengths do not: such ways fall
through.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.identity import label_swaps, motion_model, seeds
from pipeline.identity.features import LENGTH
from pipeline.identity.ordered_assignment import looks_and_phases, named_in_order
from pipeline.identity.tracklets import named_by_tracklets, often_seen

LEAST_SD = np.array([0.01, np.radians(1.5), 0.05, 0.03, 0.007, 0.005])  # of a look
ROUNDS = 2  # of naming all lines and learning the appearance from them
OTHERS = 3  # numbers of whiskers tried besides the likeliest, at most
NEARLY = 1.05  # of its cost: numbers of whiskers that cost more are not tried
LESS_OF_APPEARANCE = 0.2  # another way to the names: how lines move counts more
# whiskers that tracklets lead to are seen in so many frames; how much appearance counts then
BY_TRACKLETS = (0.15, 1.0), (0.3, LESS_OF_APPEARANCE)
LENGTH_SD = 0.08  # of the logarithm of a whisker's length
NO_NAME = 4.5  # cost of a line without a name, as of a length 3 SD off
NO_LINE = 2.0  # cost of a whisker without a line in a frame
WORSE = 1.1, 0.02  # a way that votes costs at most so many times the best one's, and more


def best_names(lines) -> tuple[np.ndarray, np.ndarray]:
    """Names (rows,), as whiskers were found, −1 for none, and how sure they are (rows,).

    That is the probability that no two whiskers have changed names, times the square of the share
    of good ways that lead to this name: ways that share lines share errors, too.
    """
    if lines.frame[0] == lines.frame[-1]:  # in a single frame every line is a whisker by itself
        return np.arange(len(lines.frame)), np.ones(len(lines.frame))
    ways = list(_ways(lines))
    costs = np.array([_length_cost(lines, names) for names, *_ in ways])
    named, model, phase = ways[int(np.argmin(costs))]
    good = np.flatnonzero(costs <= WORSE[0] * costs.min() + WORSE[1])
    share = np.mean([_renamed(ways[k][0], named) == named for k in good], axis=0)
    evidence = motion_model.evidence_of(model, lines, phase)
    return named, label_swaps.certainty(evidence, named) * share**2


def _ways(lines):
    """Names (rows,) by numbers of whiskers, by motions and by tracklets, as of `_likeliest`."""
    first, *others = named_in_order(lines, LEAST_SD)
    yield _likeliest(lines, first.model, first.names)
    for other in others[:OTHERS]:
        if other.cost < NEARLY * first.cost:
            yield _likeliest(lines, other.model, other.names)
    yield _likeliest(lines, first.model, first.names, LESS_OF_APPEARANCE)
    by_tracklets = named_by_tracklets(lines)
    for share, appearance in BY_TRACKLETS:
        names = often_seen(by_tracklets, lines.frame, share)
        if names.max(initial=-1) >= 0:
            yield _likeliest(lines, seeds.appearance_of(lines, names, LEAST_SD), names, appearance)


def _likeliest(lines, model, named, appearance=1.0):
    """Names that appearance and motions make likeliest, from first ones on, and both models.

    appearance : how much appearance counts beside motions
    """
    for number in range(ROUNDS):
        if number:
            model, named = seeds.with_more(model, named, lines)
        model, phase = looks_and_phases(lines, model, named)
        evidence = motion_model.evidence_of(model, lines, phase, appearance)
        named = label_swaps.improved(evidence, named, lines.track)
    return named, model, phase


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
