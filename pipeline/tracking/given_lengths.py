"""Which whiskers of session.toml the found ones are, by their order along the face and lengths.

Where fewer are found than given, the order alone does not tell which ones are missing: one hidden
whisker would shift the names, and so the dimensions, of all that follow.
"""

import numpy as np

FADED = np.linspace(-0.4, 0.05, 19)  # logarithms of seen over given lengths: tips fade
MISSED = 0.2  # cost, as of a logarithm, of a whisker of mean length: short ones are rather missed
FARTHEST = 0.5  # a logarithm that is farther off is a line cut short, and counts as no more
USUAL = 0.04  # mean misfit of a logarithm: by so much more, a choice is e times less likely
SURE = 0.03  # mean logarithm by which lengths fit better in one order than in the other


def numbers_in_order(seen_px, given_px) -> np.ndarray:
    """Number (k,) of the given whisker that each of k seen ones is, ascending.

    Of all choices in order that whose lengths are most alike; the first ones where all are.

    Parameters
    ----------
    seen_px : (k,) lengths seen, in order along the face; NaN where not known
    given_px : (m,) lengths that should be seen, m ≥ k; infinite or empty: not known
    """
    return _likest(seen_px, given_px)[0]


def runs_backwards(seen_px, given_px) -> bool | None:
    """Whether the seen whiskers are in the reverse order of the given ones; None: not sure."""
    forwards, backwards = (_likest(seen, given_px)[1] for seen in (seen_px, seen_px[::-1]))
    return bool(backwards < forwards) if abs(forwards - backwards) > SURE else None


def probabilities(seen_px, given_px, numbers) -> np.ndarray:
    """Probability (k,) that each of k seen whiskers is the given one of its number.

    All choices in order count by their likelihoods (forward and backward sums); 1 where lengths
    tell nothing.

    Parameters
    ----------
    seen_px, given_px : as for `numbers_in_order`
    numbers : (k,) ascending
    """
    costs, missed = _costs(seen_px, given_px)
    k, m = costs.shape[1:]
    before = _up_to(costs, missed, _of_either)
    after = _up_to(costs[:, ::-1, ::-1], missed[::-1], _of_either)[:, ::-1, ::-1]
    seen = np.arange(k)
    with_it = before[:, seen, numbers] + costs[:, seen, numbers] + after[:, seen + 1, numbers + 1]
    every = before[:, k, m, None]
    least = every.min()
    return np.exp((least - with_it) / USUAL).sum(axis=0) / np.exp((least - every) / USUAL).sum()


def _likest(seen_px, given_px):
    """The numbers of `numbers_in_order`, and the mean misfit of the logarithms."""
    costs, missed = _costs(seen_px, given_px)
    k, m = costs.shape[1:]
    least = _up_to(costs, missed, np.minimum)
    best = int(np.argmin(least[:, k, m]))
    least, numbers, j = least[best], np.empty(k, int), m
    for i in range(k, 0, -1):
        while j > i and least[i, j - 1] + missed[j - 1] <= least[i, j]:
            j -= 1
        j -= 1
        numbers[i - 1] = j
    return numbers, least[k, m] / max(np.isfinite(seen_px).sum(), 1)


def _costs(seen_px, given_px):
    """Costs (fades, k, m) of every seen whisker as every given one, and (m,) of none as this one.

    Where lengths are not known, the first ones are there.
    """
    seen, given = np.log(np.asarray(seen_px, float)), np.log(np.asarray(given_px, float))
    off = seen[:, None] - given - FADED[:, None, None]
    if not np.isfinite(given).all() or not np.isfinite(off).any():
        first = np.where(np.eye(len(seen), max(len(given), len(seen))) > 0, 0.0, np.inf)
        return first[None], np.zeros(first.shape[1])
    costs = np.where(np.isfinite(off), np.minimum(np.abs(off), FARTHEST), 0.0)
    return costs, MISSED * np.exp(given) / np.exp(given).mean()


def _up_to(costs, missed, either):
    """Cost (fades, k + 1, m + 1) of the first seen whiskers as some of the first given ones.

    either : cost of two choices, of which each is possible
    """
    fades, k, m = costs.shape
    out = np.full((fades, k + 1, m + 1), np.inf)
    out[:, 0] = np.append(0.0, np.cumsum(missed))
    for i in range(1, k + 1):
        for j in range(i, m + 1):
            one_more = out[:, i - 1, j - 1] + costs[:, i - 1, j - 1]
            out[:, i, j] = either(out[:, i, j - 1] + missed[j - 1], one_more)
    return out


def _of_either(one, other):
    """Cost of either of two choices by the sum of their likelihoods."""
    return -USUAL * np.logaddexp(-one / USUAL, -other / USUAL)
