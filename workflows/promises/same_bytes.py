"""Same input and settings, same bytes: with one process or two, and again."""

from promises import real_session, stand_in
from promises.trial import Effort, Tried

JOBS = (1, 2, 2, 1)


def try_same(folder, effort: Effort) -> Tried:
    """Run the same videos into the same place, with one process and with two."""
    tried, work = Tried(), folder / "work"
    expected = None
    for jobs in JOBS:
        stand_in.copy_of(real_session.videos(folder), work / "videos")
        real_session.finish(real_session.begin(work, jobs, "--overwrite"))
        found = stand_in.tables(work / "results")
        expected = expected or found
        tried.cases += 1
        tried.broken += [f"{name} differs" for name in found if found[name] != expected.get(name)]
        tried.check(set(found) == set(expected), "there are other files")
    figures = sum(name.startswith("figures/") for name in expected)
    tried.said = f"runs with {', '.join(map(str, JOBS))} jobs; {len(expected)} tables each"
    tried.check(figures, "there are no tables of figures")
    return tried
