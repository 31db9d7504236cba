"""Parameters of the rooms: declared with unit and source, set in session.toml, documented."""

import subprocess
import sys
import tomllib
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import pytest
from pydantic import ValidationError

import pipeline
from pipeline.session.parameters import DEFAULTS, Parameters, SceneParams
from pipeline.session.quantities import fields_of, limits_of
from pipeline.session.session_file import session_text, settings_from

RECORDING = {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}
ROOMS = fields_of(Parameters)
EVERY = [(room, key) for room, each in ROOMS.items() for key in fields_of(each.annotation)]


def settings_with(**advanced):
    return settings_from({"recording": RECORDING, "advanced": advanced})


@pytest.mark.parametrize(("room", "key"), EVERY)
def test_default_is_plausible_and_has_a_source(room, key):
    field = fields_of(ROOMS[room].annotation)[key]
    limits = limits_of(field)
    assert limits.low <= field.default <= limits.high
    assert limits.unit
    assert field.description
    origin = field.json_schema_extra["source"]
    assert origin.startswith(("literature", "measured", "chosen"))


def test_session_toml_sets_a_parameter_and_keeps_it():
    settings = settings_with(scene={"opaque": 0.6})
    assert settings.advanced == replace(DEFAULTS, scene=SceneParams(opaque=0.6))
    text = session_text(settings)
    assert "[advanced.scene]" in text
    assert "cell_mm" not in text  # as it is by default
    assert settings_from(tomllib.loads(text)) == settings
    assert "[advanced" not in session_text(settings_with())


def test_parameters_stay_as_they_are():
    with pytest.raises(FrozenInstanceError):
        DEFAULTS.scene.opaque = 0.5
    with pytest.raises(ValidationError):
        replace(DEFAULTS.scene, opaque=3.0)


def test_page_of_the_docs_is_up_to_date():
    command = [sys.executable, "-m", "pipeline.session.parameters"]
    folder = Path(pipeline.__file__).parents[1]
    printed = subprocess.run(command, capture_output=True, check=True, cwd=folder).stdout
    page = (folder / "docs" / "parameters.md").read_text("utf-8")
    assert page.splitlines() == printed.decode("utf-8").splitlines(), (
        "run `python -m pipeline.session.parameters > docs/parameters.md`"
    )
