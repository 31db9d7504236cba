"""Which whisker of session.toml each found one is, from their lengths and order along the face.

Where fewer are found than given, their order alone does not tell which ones are missing: one
hidden whisker would shift the names, and so the dimensions, of all that follow. And the order is
not certain where whiskers of two rows stand one behind the other.
"""

import re
from functools import reduce
from typing import NamedTuple

import numpy as np

NAME = re.compile(r"(?:.*_)?[A-Fa-f](\d)")  # row and arc; arc 1 is posterior (Brecht et al. 1997)
FADED = np.linspace(-0.4, 0.05, 19)  # logarithms of seen over given lengths: tips fade
FADING = 0.5  # cost of so much fading, per logarithm: 0.03 to 0.15 are usual
ANY_SCALE = np.linspace(-1.2, 1.2, 97)  # the same where the scale may be wrong by a factor of 3
EXCHANGED = 0.15  # cost of two neighbours in the opposite order
MISSED = 0.2  # cost, as of a logarithm, of a whisker of mean length: short ones are rather missed
FARTHEST = 0.5  # a logarithm that is farther off is a line cut short, and counts as no more
USUAL = 0.04  # mean misfit of a logarithm: by so much more, a choice is e times less likely
SURE = 0.03  # mean logarithm by which lengths fit better in one order than in the other


class GivenLengths(NamedTuple):
    """Name → largest visible length [px], in the order of session.toml.

    `tips_seen` : pixels where a line's end is the whisker's tip (`line_ends.tips_seen`); None: all
    """

    longest_px: dict[str, float]
    tips_seen: np.ndarray | None = None

    @classmethod
    def of(cls, templates) -> "GivenLengths":
        """Those of some `WhiskerTemplate`s."""
        return cls({template.name: template.longest_px for template in templates})


def numbers_in_order(seen_px, given_px) -> np.ndarray:
    """Number (k,) of the given whisker that each of k seen ones is, in ascending order.

    Of all choices in this order, the one whose lengths agree best; two neighbours are exchanged
    where their lengths say so. If all choices agree as well, the first k.

    Parameters
    ----------
    seen_px : (k,) lengths seen, in order along the face; NaN where not known
    given_px : (m,) lengths that should be seen, m ≥ k; infinite or empty: not known
    """
    return _likest(seen_px, given_px)[0]


def runs_backwards(seen_px, given_px) -> bool | None:
    """Whether the seen whiskers are in the reverse order of the given ones; None: not sure.

    Only the ratios of their lengths count, not the scale.
    """
    forwards, backwards = (
        _likest(seen, given_px, ANY_SCALE, 0.0)[1] for seen in (seen_px, seen_px[::-1])
    )
    return bool(backwards < forwards) if abs(forwards - backwards) > SURE else None


def posterior_first(names) -> bool:
    """Whether names such as C1, C2, C3 run posterior → anterior, as their arcs are counted."""
    arcs = [int(found[1]) for found in map(NAME.fullmatch, names) if found]
    return len(set(arcs)) > 1 and bool(np.polyfit(np.arange(len(arcs)), arcs, 1)[0] > 0)


def probabilities(seen_px, given_px, numbers) -> np.ndarray:
    """Probability (k,) that each of k seen whiskers is the given one of its number.

    All choices are weighted by their likelihoods (forward and backward sums). 1 where lengths are
    not known.

    Parameters
    ----------
    seen_px, given_px : as for `numbers_in_order`
    numbers : (k,) as in `numbers_in_order`
    """
    costs, missed, fading = _costs(seen_px, given_px)
    k, m = costs.shape[1:]
    before = _up_to(costs, missed, _of_either) + fading[:, None, None]
    after = _up_to(costs[:, ::-1, ::-1], missed[::-1], _of_either)[:, ::-1, ::-1]
    pairs = _exchanged(costs)
    with_it = np.full((len(costs), k), np.inf)
    for i, j in enumerate(numbers):
        ways = [before[:, i, j] + costs[:, i, j] + after[:, i + 1, j + 1]]
        if i + 1 < k and j:  # exchanged with the one after it
            ways.append(before[:, i, j - 1] + pairs[:, i, j - 1] + after[:, i + 2, j + 1])
        if i and j + 1 < m:  # with the one before it
            ways.append(before[:, i - 1, j] + pairs[:, i - 1, j] + after[:, i + 1, j + 2])
        with_it[:, i] = reduce(_of_either, ways)
    every = before[:, k, m, None]
    least = every.min()
    return np.exp((least - with_it) / USUAL).sum(axis=0) / np.exp((least - every) / USUAL).sum()


def _likest(seen_px, given_px, faded=FADED, fading=FADING):
    """The numbers of `numbers_in_order`, and the mean misfit of the logarithms."""
    costs, missed, fading = _costs(seen_px, given_px, faded, fading)
    k, m = costs.shape[1:]
    least = _up_to(costs, missed, np.minimum)
    best = int(np.argmin(least[:, k, m] + fading))
    numbers = _way_back(least[best], costs[best], missed)
    return numbers, least[best, k, m] / max(np.isfinite(seen_px).sum(), 1)


def _way_back(least, costs, missed):
    """Numbers (k,) that lead to the least cost, from the table `least` (k + 1, m + 1)."""
    k, m = costs.shape
    numbers, i, j = np.empty(k, int), k, m
    while i:
        if j > i and least[i, j - 1] + missed[j - 1] <= least[i, j]:
            j -= 1
        elif least[i - 1, j - 1] + costs[i - 1, j - 1] <= least[i, j]:
            numbers[i - 1] = j - 1
            i, j = i - 1, j - 1
        else:  # two neighbours, exchanged
            numbers[i - 2 : i] = j - 1, j - 2
            i, j = i - 2, j - 2
    return numbers


def _costs(seen_px, given_px, faded=FADED, fading=FADING):
    """Costs (fades, k, m) of each seen whisker as each given one, and (m,) of missing a given one.

    The last, (fades,), is the cost of so much fading. Where lengths are not known, the costs
    choose the first k whiskers.
    """
    seen, given = np.log(np.asarray(seen_px, float)), np.log(np.asarray(given_px, float))
    off = seen[:, None] - given - faded[:, None, None]
    if not np.isfinite(given).all() or not np.isfinite(off).any():
        first = np.where(np.eye(len(seen), max(len(given), len(seen))) > 0, 0.0, np.inf)
        return first[None], np.zeros(first.shape[1]), np.zeros(1)
    costs = np.where(np.isfinite(off), np.minimum(np.abs(off), FARTHEST), 0.0)
    return costs, MISSED * np.exp(given) / np.exp(given).mean(), fading * np.abs(faded)


def _up_to(costs, missed, either):
    """Cost (fades, k + 1, m + 1) of the first seen whiskers as some of the first given ones.

    either : cost of two choices, of which each is possible
    """
    fades, k, m = costs.shape
    out, pairs = np.full((fades, k + 1, m + 1), np.inf), _exchanged(costs)
    out[:, 0] = np.append(0.0, np.cumsum(missed))
    for i in range(1, k + 1):
        for j in range(i, m + 1):
            one_more = out[:, i - 1, j - 1] + costs[:, i - 1, j - 1]
            out[:, i, j] = either(out[:, i, j - 1] + missed[j - 1], one_more)
            if i > 1:
                two_more = out[:, i - 2, j - 2] + pairs[:, i - 2, j - 2]
                out[:, i, j] = either(out[:, i, j], two_more)
    return out


def _exchanged(costs):
    """Cost (fades, k − 1, m − 1) of a seen whisker as the next given one, and the next as this."""
    return costs[:, :-1, 1:] + costs[:, 1:, :-1] + EXCHANGED


def _of_either(one, other):
    """Cost of either of two choices by the sum of their likelihoods."""
    return -USUAL * np.logaddexp(-one / USUAL, -other / USUAL)
