"""Which whiskers of session.toml the found ones are, by their order along the face and lengths.

Where fewer are found than given, the order alone does not tell which ones are missing: one hidden
whisker would shift the names, and so the dimensions, of all that follow.
"""

import numpy as np

FADED = np.linspace(-0.4, 0.05, 19)  # logarithms of seen over given lengths: tips fade
MISSED = 0.2  # cost, as of a logarithm, of a whisker of mean length: short ones are rather missed
FARTHEST = 0.5  # a logarithm that is farther off is a line cut short, and counts as no more
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


def _likest(seen_px, given_px):
    """The numbers of `numbers_in_order`, and the mean misfit of the logarithms."""
    seen, given = np.log(np.asarray(seen_px, float)), np.log(np.asarray(given_px, float))
    off = seen[:, None] - given
    known = np.isfinite(off)
    if not np.isfinite(given).all() or not known.any():
        return np.arange(len(seen)), 0.0
    missed = MISSED * np.exp(given) / np.exp(given).mean()
    found = [
        _cheapest(np.where(known, np.minimum(np.abs(off - faded), FARTHEST), 0.0), missed)
        for faded in FADED
    ]
    numbers, cost = min(found, key=lambda each: each[1])
    return numbers, cost / known.any(axis=1).sum()


def _cheapest(cost, missed):
    """Numbers (k,), ascending, of the columns that rows of a cost (k, m) go to, and the cost.

    missed : (m,) cost of a column to which none goes
    """
    k, m = cost.shape
    least = np.full((k + 1, m + 1), np.inf)
    least[0] = np.append(0.0, np.cumsum(missed))
    for i in range(1, k + 1):
        for j in range(i, m + 1):
            least[i, j] = min(
                least[i, j - 1] + missed[j - 1], least[i - 1, j - 1] + cost[i - 1, j - 1]
            )
    numbers, j = np.empty(k, int), m
    for i in range(k, 0, -1):
        while j > i and least[i, j - 1] + missed[j - 1] <= least[i, j]:
            j -= 1
        j -= 1
        numbers[i - 1] = j
    return numbers, least[k, m]
