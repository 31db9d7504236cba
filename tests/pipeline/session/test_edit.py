import pytest

from pipeline.session.edit import set_whisker_values, whisker_has
from pipeline.session.session_file import SettingsError, read_session

TEXT = """# our rig
[recording]
frames_per_second = 1000.0   # camera
pixels_per_mm = 25.0
face = "left"

[[whisker]]
name = "C1"
# length_mm =   # to be measured

[[whisker]]   # the one that is left
name = "C2"
length_mm = 18.0             # by ruler
# cone_length_mm =           # follicle to the extrapolated apex
# not a key = at all
base_radius_um = 37.0

# what it touches
[pole]
diameter_mm = 0.5
# length_mm =
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "session.toml").write_text(TEXT, encoding="utf-8")
    return tmp_path / "session.toml"


def test_values_change_and_all_else_stays(path):
    set_whisker_values(
        path, "C2", {"length_mm": 17.5, "cone_length_mm": 18.2, "density_kg_per_m3": 1100}
    )
    whisker = read_session(path).whisker[1]
    assert (whisker.length_mm, whisker.cone_length_mm) == (17.5, 18.2)
    assert (whisker.base_radius_um, whisker.density_kg_per_m3) == (37.0, 1100)
    changed = path.read_text(encoding="utf-8").splitlines()
    expected = TEXT.splitlines()
    expected[12] = "length_mm = 17.5             # by ruler"
    expected[13] = "cone_length_mm = 18.2   # follicle to the extrapolated apex"
    assert [line for line in changed if not line.startswith("density")] == expected
    assert changed.index("density_kg_per_m3 = 1100.0") < changed.index("[pole]")


def test_a_file_that_several_folders_share_by_links_is_changed_for_all(path, tmp_path):
    (tmp_path / "videos").mkdir()
    link = tmp_path / "videos" / "session.toml"
    link.symlink_to(path)
    said = set_whisker_values(link, "C2", {"length_mm": 17.5})
    assert said == f"{link}, whisker C2: length_mm = 17.5"
    assert link.is_symlink()
    assert read_session(path).whisker[1].length_mm == 17.5


@pytest.mark.parametrize("line_end", ["\n", "\r\n"])
def test_line_ends_and_permissions_stay(path, line_end):
    path.write_text(TEXT, encoding="utf-8", newline=line_end)
    path.chmod(0o664)  # a group shares it
    set_whisker_values(path, "C2", {"length_mm": 17.5, "youngs_modulus_GPa": 3.2})
    lines = path.read_bytes().decode().split("\n")
    assert {line.endswith("\r") for line in lines[:-1]} == {line_end == "\r\n"}
    assert path.stat().st_mode & 0o777 == 0o664


def test_an_unnamed_whisker_is_known_by_its_place(path):
    path.write_text(TEXT.replace('name = "C1"\n', ""), encoding="utf-8")
    set_whisker_values(path, "w1", {"length_mm": 12.0})
    assert read_session(path).whisker[0].length_mm == 12.0
    assert "length_mm = 12.0   # to be measured" in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "values", "expected"),
    [
        ("D4", {"length_mm": 18.0}, ['"D4"', "C1, C2", "--whisker"]),
        ("C2", {"length_mm": 18000.0}, ["length_mm = 18000", "1 to 200 mm", "µm"]),
        ("C2", {"cone_length_mm": 17.0}, ["at least length_mm"]),
    ],
)
def test_what_cannot_be_written_leaves_the_file_as_it_was(path, name, values, expected):
    with pytest.raises(SettingsError) as caught:
        set_whisker_values(path, name, values)
    assert all(part in str(caught.value) for part in expected)
    assert path.read_text(encoding="utf-8") == TEXT


def test_which_keys_a_whisker_has(path):
    assert whisker_has(path, "C2", "length_mm")
    assert not whisker_has(path, "C2", "cone_length_mm")
