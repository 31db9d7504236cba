"""README.md: what it shows can be used as it stands, and its numbers are those of the docs."""

import re
import shutil
import tomllib
from pathlib import Path

from typer.main import get_command

from pipeline.app import cli
from pipeline.session.session_file import settings_from

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language):
    """The one code block of a language."""
    (found,) = re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    return found


def row(page, name):
    """Cells of the table row of that name."""
    (found,) = re.findall(rf"^\| {re.escape(name)} +\|(.*)\|$", page, re.MULTILINE)
    return [cell.strip() for cell in found.split("|")]


def test_settings_shown_can_be_read():
    settings = settings_from(tomllib.loads(block("toml")), "README.md")
    assert [w.name for w in settings.whisker] == ["C2"]
    assert settings.whisker[0].si() is not None  # enough for forces


def test_python_shown_runs(rendered, video, tmp_path, monkeypatch):
    shutil.copy(video, tmp_path / "trial.avi")
    shutil.copy(rendered / "session.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(block("python"), names)
    assert names["analysis"].contacts["peak_force_uN"].gt(0).any()


def test_every_command_is_named_and_no_other():
    commands = get_command(cli.app).commands
    assert set(re.findall(r"^\| `whiskerforce (\w+)", TEXT, re.MULTILINE)) == set(commands)
    options = {o for command in commands.values() for p in command.params for o in p.opts}
    assert set(re.findall(r"`?(--[a-z]+)", TEXT)) - {"--dist"} <= options | {"--help"}


def test_links_lead_somewhere():
    for link in re.findall(r"\]\(([^)]+)\)", TEXT):
        assert (ROOT / link).exists(), link


def test_numbers_are_those_of_fig3():
    page = (ROOT / "docs" / "fig3.md").read_text(encoding="utf-8")
    contacts, found, invented = re.search(
        r"^(\d+) contacts: (\d+) found, .* (\d+) invented", page, re.MULTILINE
    ).groups()
    text = " ".join(TEXT.split()).replace(",", "")
    assert f"{contacts} contacts {found} were found and {invented} invented" in text
    within = float(row(page, "peak force [%]")[3])
    claimed = float(re.search(r"90 % of the peak forces are within ([\d.]+) %", text)[1])
    assert claimed - 0.1 < within <= claimed


def test_speeds_are_those_of_the_benchmark():
    """Some hundred to more than a thousand frames per second, on one core."""
    page = (ROOT / "docs" / "accuracy.md").read_text(encoding="utf-8")
    page = page[page.index("### Frames per second, one core") :].split("###")[1]
    speeds = [float(line.split("|")[6]) for line in page.splitlines() if "| cpu " in line]
    assert "One core does some hundred to more than a thousand frames per second" in " ".join(
        TEXT.split()
    )
    assert 100 < min(speeds) < 1000 < max(speeds)
