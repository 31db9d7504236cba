"""Functions take few arguments: what belongs together is handed on together, by name."""

import ast
import importlib
from pathlib import Path

import pytest
from draw_house import ORDER as ROOMS

ROOT = Path(__file__).parents[1]
MOST, MOST_COMPILED = 8, 12


def functions(package, kind=ast.FunctionDef):
    """File and syntax tree of every function of a package."""
    for file in sorted((ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, kind):
                yield f"{file.relative_to(ROOT).as_posix()}:{node.name}", node


def classes(package):
    """The same of every class."""
    return functions(package, ast.ClassDef)


def count(function):
    """How many arguments a function takes, beside the object that it belongs to."""
    arguments = function.args
    names = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def is_compiled(function):
    return any("njit" in ast.unparse(each) for each in function.decorator_list)


@pytest.mark.parametrize("package", ["pipeline", "whiskermodel", "synthetic", "workflows"])
def test_functions_take_few_arguments(package):
    for name, function in functions(package):
        most = MOST_COMPILED if is_compiled(function) else MOST
        assert count(function) <= most, f"{name} takes {count(function)} arguments"


@pytest.mark.parametrize("room", ROOMS)
def test_parameters_are_those_of_the_caller(room):
    """Only what a room offers has defaults: inside, those of session.toml could be forgotten."""
    offered = dir(importlib.import_module(f"pipeline.{room}"))
    for name, function in functions(f"pipeline/{room}"):
        defaults = [d for d in (*function.args.defaults, *function.args.kw_defaults) if d]
        if any("DEFAULTS" in ast.unparse(default) for default in defaults):
            assert function.name in offered, f"{name} has defaults of the parameters"
    for name, kind in classes(f"pipeline/{room}"):
        values = [each.value for each in kind.body if isinstance(each, ast.AnnAssign)]
        if any("DEFAULTS" in ast.unparse(value) for value in values if value):
            assert kind.name in offered, f"{name} has defaults of the parameters"
