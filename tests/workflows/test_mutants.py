"""Changes of one line: found where they are, and written as code that still parses."""

import ast

import mutants
import numpy as np
import pytest

CODE = '''"""Some code."""
import numpy as np


def f(a, b):
    total = a + b
    if a < 2.5:
        return np.minimum(a, b)
    if b == 0:
        raise ValueError(f"b must not be 0, got {2.0 * b}")
    return max(total, 1)
'''


def test_every_kind_of_change_is_found():
    changes = mutants.changes_of("f.py", CODE)
    assert {c.line: c.after.strip() for c in changes} == {
        5: "total = a - b",
        6: "if a < 5.0:",
        7: "return np.maximum(a, b)",
        10: "return min(total, 1)",
    }
    for change in changes:
        lines = CODE.splitlines()
        assert lines[change.line] == change.before
        lines[change.line] = change.after
        ast.parse("\n".join(lines))


@pytest.mark.slow
def test_random_changes_of_the_code_parse_and_change_something():
    drawn = mutants.random_mutants(200, np.random.default_rng(0))
    assert len(set(drawn)) == 200
    for mutant in drawn:
        lines = (mutants.ROOT / mutant.path).read_text("utf-8").splitlines()
        assert lines[mutant.line] == mutant.before != mutant.after
        lines[mutant.line] = mutant.after
        ast.parse("\n".join(lines))


def test_named_changes_are_lines_of_the_code():
    assert len(mutants.named_mutants()) == len(mutants.NAMED)


@pytest.mark.parametrize(
    ("path", "first"),
    [
        ("pipeline/forces/rod_outputs.py", "test_rod_outputs.py"),
        ("pipeline/forces/normal_equations.py", "test_rod_fit.py"),
        ("pipeline/forces/forces.py", "test_forces.py"),
        ("pipeline/contacts/intervals.py", "test_intervals.py"),
        ("whiskermodel/supported.py", "test_supported.py"),
    ],
)
def test_the_tests_that_know_a_file_best_come_first(path, first):
    files = mutants.tests_of(path, mutants.ROOT)
    assert files[0].name == first
    assert len(files) > 4
