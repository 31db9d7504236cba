"""docs/code.md: every file of the code has its place on the map."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "code.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("folder", ["pipeline", "whiskermodel", "synthetic", "workflows"])
def test_every_file_is_on_the_map(folder):
    """Whoever adds a file says in docs/code.md which step it belongs to."""
    sections = re.split(r"^## ", PAGE, flags=re.MULTILINE)
    (section,) = [each for each in sections if each.startswith(f"`{folder}`")]
    named = set(re.findall(r"`(\w+)`", section.split("\n", 1)[1]))
    files = {f.stem for f in (ROOT / folder).glob("*.py")} - {"__init__"}
    assert files - named == set(), "not on the map"
    others = {"demo", "synth"} if folder == "pipeline" else set()  # commands
    assert named - files - others == set(), "on the map, but gone"
