"""What goes into the store comes out again, by whisker, and costs no memory."""

import tempfile
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.kinematics.resampled_store import BULKY, StationStore
from pipeline.kinematics.stations import N_STATIONS, SHARED, Stations

FULL = "/dev/full"  # takes nothing
NAMES = ("C1", "C2")
PER_ROW = [f.name for f in fields(Stations) if f.name not in (*SHARED, *BULKY)]


def drawn(rows, seed=0, first=0, names=NAMES) -> Stations:
    """Stations of made-up numbers, whiskers in any order, frames ascending."""
    rng = np.random.default_rng(seed)
    numbers = {name: rng.normal(size=rows) for name in PER_ROW}
    numbers["frame"] = first + np.arange(rows)
    numbers["whisker"] = rng.integers(0, len(names), rows)
    numbers["extended"] = rng.random(rows) < 0.5
    numbers |= {name: rng.normal(scale=0.02, size=(rows, N_STATIONS)) for name in BULKY}
    return Stations(
        names=names, spacing=np.full(len(names), 2e-4), pole_radius=1e-4, pixel=4e-5, **numbers
    )


@settings(max_examples=20, deadline=None)
@given(sizes=st.lists(st.integers(0, 30), min_size=1, max_size=5), seed=st.integers(0, 99))
def test_what_goes_in_comes_out_by_whisker(sizes, seed):
    starts = np.cumsum([0, *sizes])
    chunks = [drawn(n, seed + i, starts[i]) for i, n in enumerate(sizes)]
    store = StationStore()
    for chunk in chunks:
        store.add(chunk)
    for k, name in enumerate(NAMES):
        out = store.of(name)
        assert out.x is None
        loaded = out.loaded()
        assert len(out) == len(loaded) == sum(np.sum(c.whisker == k) for c in chunks)
        for column in (*PER_ROW, *BULKY):
            expected = np.concatenate([getattr(c, column)[c.whisker == k] for c in chunks])
            # places are kept to 2 nm of 20 mm
            close = {"rtol": 0, "atol": 2e-8} if column in BULKY else {"rtol": 0}
            np.testing.assert_allclose(getattr(loaded, column), expected, **close)


@pytest.mark.skipif(not Path(FULL).exists(), reason="the system has no full device")
def test_a_full_folder_for_temporary_files_is_named(monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", partial(open, FULL, "w+b"))
    store = StationStore()
    with pytest.raises(OSError, match="No space") as caught:
        store.add(drawn(1000))
    assert caught.value.filename == tempfile.gettempdir()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 99))
def test_rows_of_rows(seed):
    store = StationStore()
    store.add(drawn(60, seed))
    every = store.of("C2").loaded()
    rng = np.random.default_rng(seed)
    mask = rng.random(len(every)) < 0.6
    order = rng.permutation(mask.sum())[:7]
    part = store.of("C2").rows(mask).rows(order)
    np.testing.assert_array_equal(part.loaded().y, every.y[mask][order])
    np.testing.assert_array_equal(part.nearest, every.nearest[mask][order])


def test_chunks_of_other_whiskers_are_refused():
    store = StationStore()
    store.add(drawn(3))
    with pytest.raises(ValueError, match="same whiskers"):
        store.add(drawn(3, names=("C1", "D1")))


def test_doubted_places_are_known_less_in_the_store_as_in_memory():
    chunk = replace(drawn(20), information=np.full((20, N_STATIONS), 4e10))
    store = StationStore()
    store.add(chunk)
    variance = np.zeros(N_STATIONS)
    variance[:3] = 1e-10
    stored = store.of("C1").with_variance(variance).rows(slice(1, 5)).loaded()
    information = chunk.of("C1").with_variance(variance).rows(slice(1, 5)).information
    np.testing.assert_allclose(stored.information, information, rtol=1e-6)
    np.testing.assert_allclose(information[:, :3], 0.8e10)
    np.testing.assert_array_equal(information[:, 3:], 4e10)
