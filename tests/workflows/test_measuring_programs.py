"""Parts of the measuring programs: the peer's files, tables, targets, and one small run."""

import importlib.util
import re
import struct
import sys
from pathlib import Path

import accuracy
import false_contacts
import measuring
import numpy as np
import pandas as pd
import pytest
import wrong_settings
from accuracy_targets import COVERAGE, TARGETS, Target, coverage_checks
from benchmark_exactness import _fitted_curvature
from over_videos import with_interval, with_range
from pages import publish, write_between
from peer_tracker import NoPeerError, find_peer, read_whiskers

from pipeline.reports.error_budget import ASSUMED
from pipeline.session.session_file import settings_from
from synthetic.presets import PRESETS

pytestmark = pytest.mark.e2e


def whiskers_bytes(*lines):
    """A binary .whiskers file of lines (number, frame, x, y)."""
    data = b"bwhiskbin1\0\0"
    for number, frame, x, y in lines:
        values = np.array([x, y, np.ones_like(x), np.full_like(x, 30)], "<f4")
        data += struct.pack("<3i", number, frame, len(x)) + values.tobytes()
    return data + struct.pack("<i", len(lines))


def test_whiskers_file_is_read_in_the_order_of_frames(tmp_path):
    x = np.arange(5.0)
    path = tmp_path / "a.whiskers"
    path.write_bytes(whiskers_bytes((0, 1, x, x + 1), (0, 0, x[:3], x[:3] + 2), (1, 1, x, x + 3)))
    lines = read_whiskers(path)
    assert lines.frame.tolist() == [0, 1, 1]
    assert [len(lines.row(k)) for k in range(3)] == [3, 5, 5]
    assert lines.row(0)[:, 1].tolist() == [2, 3, 4]
    assert lines.row(2)[-1].tolist() == [4, 7]
    path.write_bytes(whiskers_bytes())
    assert len(read_whiskers(path)) == 0
    path.write_text("whiskers as text")
    with pytest.raises(ValueError, match="binary"):
        read_whiskers(path)


def test_a_missing_peer_says_how_to_get_it():
    with pytest.raises(NoPeerError, match="whisk-janelia"):
        find_peer(sys.executable, None)


def test_curvature_of_a_quadratic_keeps_its_sign_and_direction():
    u = np.linspace(-50, 50, 101)
    line = np.column_stack([200 + u, 100 - 0.5 * 0.002 * u**2])  # bends up on the screen
    assert _fitted_curvature(line) == pytest.approx(0.002, rel=1e-6)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    assert _fitted_curvature(line @ turn) == pytest.approx(0.002, rel=1e-6)
    assert _fitted_curvature(line[::-1]) == pytest.approx(-0.002, rel=1e-6)


def test_targets_are_missed_by_what_could_not_be_measured():
    most, between = Target("error", "rms", 0.03), Target("coverage", "c", 0.97, 0.93)
    assert most.met(0.03)
    assert not most.met(0.031)
    assert not most.met(np.nan)
    assert [between.met(v) for v in (0.92, 0.95, 0.98)] == [False, True, False]
    assert [most.demand, between.demand] == ["<= 0.03", "0.93 to 0.97"]


@pytest.mark.parametrize(("with_contacts", "judged"), [(13, 5), (9, 1)])
def test_intervals_are_judged_where_half_of_the_videos_have_contacts(with_contacts, judged):
    """Of twenty videos `varied` has contacts in 13: what their intervals miss must be told."""
    share = {target.figure: 0.8 for target in COVERAGE}
    none = dict.fromkeys(share, np.nan) | {"curvature_coverage": 0.8}
    rows = coverage_checks("varied", [share] * with_contacts + [none] * (20 - with_contacts))
    assert len(rows) == judged
    assert not any(row["met"] for row in rows)


def test_a_section_is_replaced_and_the_rest_stays(tmp_path):
    path = tmp_path / "a.md"
    path.write_text("above\n<!-- x: begin -->\nold\n<!-- x: end -->\nbelow\n")
    write_between(path, "x", "new")
    write_between(path, "x", "newer")
    assert path.read_text() == "above\n<!-- x: begin -->\nnewer\n<!-- x: end -->\nbelow\n"
    with pytest.raises(ValueError, match="y: begin"):
        write_between(path, "y", "new")


def test_what_is_written_into_a_page_is_printed_too(tmp_path, capsys):
    path = tmp_path / "a.md"
    path.write_text("<!-- x: begin --><!-- x: end -->")
    publish("seen only", None, "x")
    publish("also written", path, "x")
    assert capsys.readouterr().out == "seen only\nalso written\n"
    assert path.read_text() == "<!-- x: begin -->\nalso written\n<!-- x: end -->"


def test_every_preset_with_targets_exists():
    assert set(TARGETS) <= set(PRESETS)


def test_videos_have_seeds_of_their_own_that_the_printed_one_makes_again(tmp_path):
    seeds = {}
    for name in ("noisy", "h264"):
        args = accuracy.arguments(["--presets", name, "--videos", "5", "--seed", "11"])
        seeds[name] = [task.seed for task in accuracy.tasks_of(name, tmp_path, args)]
        assert seeds[name] == [task.seed for task in accuracy.tasks_of(name, tmp_path, args)]
    assert len({*seeds["noisy"], *seeds["h264"]}) == 10
    drawn = {accuracy.arguments([]).seed for _ in range(3)}
    assert len(drawn) == 3


def test_intervals_resample_videos_and_not_contacts():
    """Contacts of a video err alike: 400 contacts of 10 videos hold no more than 10 numbers do."""
    rng = np.random.default_rng(4)
    of_videos = rng.normal(0.0, 1.0, 10)
    samples = [np.full(40, own) for own in of_videos]
    expected = of_videos.mean(), of_videos.min(), of_videos.max()
    assert with_range(samples, np.mean) == pytest.approx(expected)
    value, low, high = with_interval(samples, np.mean, rng)
    assert value == pytest.approx(of_videos.mean())
    half = 1.96 * of_videos.std() / np.sqrt(10)
    assert (high - low) / 2 == pytest.approx(half, rel=0.15)
    assert np.isnan(with_range([np.array([np.nan])], np.mean)).all()


def test_settings_are_as_wrong_as_is_stated():
    table = {"name": "C2", "length_mm": 18.0, "cone_length_mm": 24.0, "base_radius_um": 37.0}
    settings = settings_from(
        {
            "recording": {"frames_per_second": 1000.0, "pixels_per_mm": 25.0, "face": "left"},
            "whisker": [table | {"hidden_length_mm": 1.4}],
        },
        "here",
    )
    rng = np.random.default_rng(1)
    found = []
    for _ in range(500):
        wrong = wrong_settings.with_wrong_lengths(settings, rng)
        wrong = wrong_settings.with_wrong_dimensions(wrong, rng)
        (whisker,) = wrong.whisker
        found.append(
            (
                whisker.hidden_length_mm - 1.4,
                whisker.length_mm - settings.whisker[0].length_mm,
                whisker.base_radius_um / 37 - 1,
                whisker.cone_length_mm / 24 - 1,
                whisker.youngs_modulus_GPa / settings.whisker[0].youngs_modulus_GPa - 1,
                wrong.recording.pixels_per_mm / 25 - 1,
            )
        )
    assert np.std(found, axis=0) == pytest.approx([0.12, 0.03, 0.01, 0.02, 0.05, 0.005], rel=0.15)


@pytest.mark.slow
@pytest.mark.usefixtures("lossless_is_quick")
def test_accuracy_of_two_videos_is_printed(tmp_path, capsys):
    asked = ["--presets", "single", "--videos", "2", "--frames", "100", "--out", str(tmp_path)]
    status = accuracy.main(asked)
    said = capsys.readouterr().out
    assert status in (0, 1)
    assert ("MISSED" in said) == bool(status)
    for heading in ("Tracking", "Contacts", "Forces by `shape`", "Over videos", "Targets"):
        assert f"### {heading}" in said
    assert (tmp_path / "accuracy.csv").exists()
    assert (tmp_path / "worst.csv").exists()


def test_no_contacts_are_no_fault_of_the_error_budget():
    columns = ["peak_force_uN", "peak_force_se_uN", "true_peak_force_uN", "contact_arc_length_mm"]
    columns += [each.column for each in ASSUMED if each.column]
    none = pd.DataFrame({name: pd.Series(dtype=float) for name in columns})
    none["whisker"] = pd.Series(dtype="string")
    assert len(wrong_settings.budget_covers(none, {"C1": 20.0})) == 0


def test_free_frames_are_shared_among_presets_and_added_up():
    found = false_contacts.sessions(9001, seed=3)
    assert [seed for _, seed in found] == [3, 4, 5, 6, 7]
    assert {preset for preset, _ in found} == set(false_contacts.PRESETS)
    row = {"preset": "free", "frames": 2000, "found": 1, "touching": 4}
    text = false_contacts.table_of([row | {"rendering": 10.0, "processing": 4.0}] * 2, 28.4)
    whole = [cell.strip() for cell in text.splitlines()[-3].split("|")[1:-1]]
    assert whole == ["all", "4000", "2", "8", "200 frames/s", "500 frames/s"]


@pytest.mark.parametrize("jobs", [1, 2])
def test_several_processes_find_what_one_does_in_order(jobs):
    assert list(measuring.of_each(pow, jobs, [2, 3], [3, 2])) == [8, 9]


@pytest.mark.slow
@pytest.mark.usefixtures("lossless_is_quick")
def test_no_contact_is_found_in_free_frames(capsys, monkeypatch):
    monkeypatch.setattr(false_contacts, "FRAMES", 60)
    assert false_contacts.main(["--frames", "1"]) == 0
    assert "| free" in capsys.readouterr().out


def test_programs_that_are_handed_to_other_processes_import_what_there_is():
    root = Path(accuracy.__file__).parents[1]
    imported = re.compile(r"^ *(?:from|import) ((?:pipeline|synthetic|whiskermodel)[\w.]*)", re.M)
    for file in (root / "workflows").rglob("*.py"):
        for module in imported.findall(file.read_text(encoding="utf-8")):
            assert importlib.util.find_spec(module), f"{file.name}: {module}"
