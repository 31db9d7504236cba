"""Random inputs of the whisker model show what changes its numbers, and what does not."""

import mutant_numbers
import mutants
import numpy as np
import pytest

from whiskermodel import BaseLoads, response, ringdown, rod_equilibrium, rod_shapes


@pytest.fixture(autouse=True)
def few(monkeypatch):
    for name, count in {"CONTACTS": 40, "FITS": 6, "MODES": 12, "RESPONSES": 3}.items():
        monkeypatch.setattr(mutant_numbers, name, count)


@pytest.mark.parametrize(
    ("module", "name", "value", "is_same"),
    [
        (rod_equilibrium, "_SMALLEST_STEP", 0.001, True),
        (rod_shapes, "_NODES", 41, True),
        (rod_shapes, "_PICARD_ITERATIONS", 3, False),
        (ringdown, "CONFIDENCE", 0.9501, False),
    ],
)
def test_what_alters_numbers_is_told_from_what_does_not(monkeypatch, module, name, value, is_same):
    path = f"{module.__name__.replace('.', '/')}.py"
    as_it_is = mutant_numbers.numbers(path, 3)
    monkeypatch.setattr(module, name, value)
    assert mutants.same(mutant_numbers.numbers(path, 3), as_it_is) == is_same


@pytest.mark.parametrize("stem", ["modes", "response"])
def test_inputs_differ_by_seed_only(stem):
    first, again, other = (
        mutant_numbers.numbers(f"whiskermodel/{stem}.py", seed) for seed in (1, 1, 2)
    )
    assert mutants.same(first, again)
    assert not mutants.same(first, other)
    assert np.isfinite(first).mean() > 0.9


def test_every_field_counts(monkeypatch):
    whole = mutant_numbers.numbers("whiskermodel/response.py", 3)
    monkeypatch.setattr(response, "BaseLoads", lambda time, *rest: BaseLoads(2 * time, *rest))
    assert not mutants.same(mutant_numbers.numbers("whiskermodel/response.py", 3), whole)


def test_what_has_no_numbers_is_not_the_same():
    assert mutant_numbers.numbers("pipeline/forces/forces.py", 1) is None
    assert not mutants.same(None, None)
    assert not mutants.same(np.ones(3), None)
    assert not mutants.same(np.ones(3), np.ones(4))
    assert not mutants.same(np.ones(3), np.array([1, 1, 1 + 2 * mutants.SAME]))
    assert not mutants.same(np.ones(3), np.array([1, 1, np.nan]))
