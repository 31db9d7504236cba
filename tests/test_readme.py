"""README.md: the settings, code, commands and links in it work."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from typer.main import get_command

from pipeline.app import cli
from pipeline.session.session_file import settings_from

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def block(language):
    """The one code block of a language."""
    (found,) = re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    return found


def test_settings_shown_can_be_read():
    settings = settings_from(tomllib.loads(block("toml")), "README.md")
    assert [w.name for w in settings.whisker] == ["C2"]
    assert settings.whisker[0].si() is not None  # enough for forces


@pytest.mark.e2e
def test_python_shown_runs(rendered, video, tmp_path, monkeypatch):
    shutil.copy(video, tmp_path / "trial.avi")
    shutil.copy(rendered / "session.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(block("python"), names)
    assert names["analysis"].contacts["peak_force_uN"].gt(0).any()


def options_of(command) -> set:
    """Options of a command, and of the commands in it."""
    own = {option for each in command.params for option in each.opts}
    return own.union(*(options_of(each) for each in getattr(command, "commands", {}).values()))


def test_every_command_is_named_and_no_other():
    app = get_command(cli.app)
    assert set(re.findall(r"^\| `whiskerforce (\w+)", TEXT, re.MULTILINE)) == set(app.commands)
    named = set(re.findall(r"`?(--[a-z][a-z-]*)", TEXT)) - {"--dist"}  # which is pytest's
    assert named <= options_of(app) | {"--help"}


def test_links_lead_somewhere():
    for link in re.findall(r"\]\(([^)]+)\)", TEXT):
        assert (ROOT / link).exists(), link
