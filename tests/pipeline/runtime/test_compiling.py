"""Compiling takes no part in speeds: its time is told apart, and reported."""

import time

import pytest
from numba import njit

from pipeline.runtime.compiling import compile_times, compiling_reported, seconds_without_compiling
from pipeline.runtime.progress import COMPILING, Step


@pytest.fixture
def uncompiled():
    """A function that calls another; neither is compiled yet."""

    @njit
    def inner(x):
        return x + 1

    @njit
    def outer(x):
        return inner(x) * 2

    return outer


def test_compiling_takes_no_part_in_the_time_of_work(uncompiled):
    compile_times()
    whole, work = time.perf_counter(), seconds_without_compiling()
    uncompiled(1)
    whole, work = time.perf_counter() - whole, seconds_without_compiling() - work
    assert whole > 0.02  # s, of compiling
    assert work < 0.2 * whole


def test_the_second_call_compiles_nothing(uncompiled):
    uncompiled(1)
    before = compile_times().watch.seconds
    uncompiled(2)
    assert compile_times().watch.seconds == before


def test_compiling_is_reported_once_and_then_what_went_on_before(uncompiled):
    steps = []
    with compiling_reported(steps.append) as report:
        report(Step("following", 3, 10))
        uncompiled(1)
        report(Step("forces"))
    assert steps == [
        Step("following", 3, 10), Step(COMPILING), Step("following", 3, 10), Step("forces"),
    ]  # fmt: skip


def test_nobody_need_listen(uncompiled):
    with compiling_reported(None) as report:
        report(Step("following"))
        assert uncompiled(1) == 4
