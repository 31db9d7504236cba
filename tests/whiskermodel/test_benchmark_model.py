"""The benchmark's other ways compute the same moments, and it says why PyElastica is not there."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from whiskermodel import Response, half_gaussian_moments, mouse_c2

SCRIPT = Path(__file__).parents[2] / "workflows" / "benchmark_model.py"
SAMPLED = 1e-3  # of the peak steady moment: differences of F at 10 µs


@pytest.fixture(scope="module")
def benchmark():
    spec = importlib.util.spec_from_file_location("benchmark_model", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("way", ["direct", "fft", "best_fft"])
def test_every_way_gives_the_same_moments(benchmark, way):
    response = Response(mouse_c2())
    c, peak, duration = 11e-3, 5e-6, 12.34e-3
    time = np.arange(benchmark.SAMPLES) * benchmark.DT
    steady, vibrational = half_gaussian_moments(response, c, peak, duration, time)
    theirs = getattr(benchmark.PapersIntegrals(response), way)(c, peak, duration)
    assert np.abs(theirs[0] - steady[0]).max() < 1e-9 * c * peak
    assert np.abs(theirs[1] - vibrational[0]).max() < SAMPLED * c * peak


def test_a_missing_or_broken_pyelastica_is_explained(benchmark, tmp_path):
    stub = tmp_path / "python"
    stub.write_text("#!/bin/sh\necho \"No module named 'elastica'\" >&2\nexit 1\n")
    stub.chmod(0o755)
    result, why = benchmark.elastica(str(stub), 0.1)
    assert result is None
    assert "pip install pyelastica" in why
    result, why = benchmark.elastica(str(tmp_path / "nowhere"), 0.1)
    assert result is None
    assert "nowhere" in why


def test_contacts_lie_in_the_published_ranges(benchmark):
    c, peak, duration = benchmark.contacts(1000)
    assert 6e-3 <= c.min() < c.max() <= 15e-3
    assert peak.max() <= 44.4e-6
    assert 5e-3 <= duration.min() < duration.max() <= 55e-3
