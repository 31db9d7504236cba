"""Frames counted, and time by stage."""

from pipeline.runtime.timing import Clock, Counted


def test_frames_are_counted_and_calls():
    calls = []
    counted = Counted(iter("abc"), 2, lambda *done: calls.append(done))
    assert list(counted) == ["a", "b", "c"]
    assert counted.count == 3
    assert calls == [(1, 2), (2, 2), (3, 3)]


def test_clock_counts_by_stage():
    now = iter(range(100))
    clock = Clock(lambda: next(now))
    with clock("a"):
        next(now)
    assert list(clock.each("b", [1, 2])) == [1, 2]
    assert clock.seconds == {"a": 2, "b": 3}
