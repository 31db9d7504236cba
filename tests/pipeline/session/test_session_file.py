"""session.toml: what it says, what is wrong with it, and the way to SI and back."""

import re
import tomllib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.session.session_file import SettingsError, read_session, session_text, settings_from
from pipeline.session.session_file import write_session as write

EXAMPLE = """
[recording]
frames_per_second = 1000.0   # of the camera, not the file's playback rate
pixels_per_mm = 25.0
face = "left"                # side of the image: left, right, top, bottom

[[whisker]]                  # one table per tracked whisker, anterior to posterior
name = "C2"
length_mm = 18.0             # follicle to (cut) tip
cone_length_mm = 18.947      # follicle to the extrapolated apex
base_radius_um = 37.0
youngs_modulus_GPa = 3.0
density_kg_per_m3 = 1000.0
damping_per_s = 215.0
hidden_length_mm = 1.4       # between follicle and first visible point, in the fur

[pole]
diameter_mm = 0.5            # x_px, y_px may be given; found by itself otherwise

[analysis]
curvature_at_mm = 5.5
"""
LEAST = {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "face": "left"}}


def document(**tables):
    return {**LEAST, **tables}


def problems_of(tables) -> str:
    with pytest.raises(SettingsError) as caught:
        settings_from(tables)
    return str(caught.value)


def test_example_of_the_interface(tmp_path):
    (tmp_path / "session.toml").write_text(EXAMPLE)
    settings = read_session(tmp_path / "session.toml")
    recording, whisker = settings.recording.si(), settings.whisker[0].si()
    assert (recording.frames_per_second, recording.pixels_per_m) == (1000, 25e3)
    assert recording.face == "left"
    assert whisker.name == "C2"
    assert whisker.length == pytest.approx(18e-3)
    assert whisker.cone_length == pytest.approx(18.947e-3)
    assert whisker.base_radius == pytest.approx(37e-6)
    assert whisker.youngs_modulus == pytest.approx(3e9)
    assert (whisker.density, whisker.damping_rate) == (1000, 215)
    assert settings.whisker[0].hidden_length == pytest.approx(1.4e-3)
    assert settings.pole.diameter == pytest.approx(0.5e-3)
    assert settings.pole.position_px is None
    assert settings.analysis.curvature_at == pytest.approx(5.5e-3)


def test_only_recording_is_required():
    settings = settings_from(LEAST)
    assert settings.whisker == ()
    assert settings.pole.diameter_mm == 0.5
    assert settings.analysis.curvature_at_mm == 5.5
    assert settings.analysis.friction == 0.0


def test_whisker_without_dimensions_has_no_si_form():
    settings = settings_from(document(whisker=[{}, {"name": "C2", "length_mm": 18}]))
    assert [w.name for w in settings.whisker] == ["w1", "C2"]
    assert settings.whisker[1].missing_dimensions == ("cone_length_mm", "base_radius_um")
    assert settings.whisker[1].si() is None


@pytest.mark.parametrize(("tip", "cone"), [(1.85, 18 / 0.95), (0, 18.0), (37, 10_000.0)])
def test_tip_radius_in_place_of_the_cone_length(tip, cone):
    dimensions = {"length_mm": 18, "base_radius_um": 37, "tip_radius_um": tip}
    (whisker,) = settings_from(document(whisker=[dimensions])).whisker
    assert whisker.missing_dimensions == ()
    assert 1e3 * whisker.si().cone_length == pytest.approx(cone)
    assert 1e6 * whisker.si().radius(18e-3) == pytest.approx(tip, abs=0.1)


def test_tip_radius_needs_the_other_dimensions():
    (whisker,) = settings_from(document(whisker=[{"tip_radius_um": 2}])).whisker
    assert whisker.missing_dimensions == ("length_mm", "base_radius_um")
    assert whisker.cone_length is None


def test_pole_position():
    settings = settings_from(document(pole={"x_px": 3, "y_px": 4.5}))
    assert settings.pole.position_px == (3, 4.5)


def test_written_file_reads_back_the_same_and_explains_itself(tmp_path):
    whiskers = [{"name": 'C"2\\', "length_mm": 18, "base_radius_um": 37.123456}, {"name": "δ"}]
    settings = settings_from(document(whisker=whiskers, pole={"x_px": 1, "y_px": 2}))
    write(tmp_path / "session.toml", settings, {"recording.face": "found in the picture"})
    assert read_session(tmp_path / "session.toml") == settings
    text = (tmp_path / "session.toml").read_text("utf-8")
    assert "# of the camera, not the file's playback rate" in text
    assert "found in the picture" in text
    assert "# cone_length_mm =" in text
    assert [p.name for p in tmp_path.iterdir()] == ["session.toml"]


@given(
    fps=st.floats(10, 2e5), scale=st.floats(1, 1000), length=st.floats(6, 200),
    hidden=st.floats(0, 5), radius=st.floats(2, 500),
)  # fmt: skip
def test_any_settings_survive_the_way_to_the_file_and_back(fps, scale, length, hidden, radius):
    settings = settings_from(
        {
            "recording": {"frames_per_second": fps, "pixels_per_mm": scale, "face": "top"},
            "whisker": [
                {
                    "name": "C2",
                    "length_mm": length,
                    "cone_length_mm": length * 1.05,
                    "base_radius_um": radius,
                    "hidden_length_mm": hidden,
                }
            ],
        }
    )
    assert settings_from(tomllib.loads(session_text(settings))) == settings


@pytest.mark.parametrize(
    ("tables", "expected"),
    [
        ({}, ["[recording]", "missing", "frames_per_second"]),
        (
            {"recording": {"frames_per_second": 1000, "face": "left"}},
            ["[recording] pixels_per_mm", "missing", "1 to 1000"],
        ),
        (document(pole={"diamter_mm": 1}), ["[pole] diamter_mm", "unknown", "diameter_mm?"]),
        (document(poles={}), ["[poles]", "unknown", "did you mean pole?"]),
        (document(pole={"x": 3}), ["[pole] x: unknown key; did you mean x_px?"]),
        (
            document(pole={"radius_mm": 0.25}),
            [
                "[pole] radius_mm: unknown",
                "did you mean diameter_mm? write twice the radius there",
            ],
        ),
        (
            document(whisker=[{"base_diameter_um": 74}]),
            ["did you mean base_radius_um? write half of the diameter there"],
        ),
        (document(analysis={"friction": 2.1}), ["[analysis] friction", "2.1", "0 to 2"]),
        (document(analysis={"friction": -0.1}), ["[analysis] friction", "-0.1", "0 to 2"]),
        (document(analysis={"curvature_at_mm": 0.0055}), ["curvature_at_mm", "in m?", "5.5"]),
        (document(whisker=[{"colour": 1}]), ["[[whisker]] 1", "colour", "unknown", "length_mm"]),
        (
            document(whisker=[{}, {"name": "D1", "base_radius_um": 0.037}]),
            ['[[whisker]] 2 ("D1") base_radius_um', "0.037", "2 to 500 µm", "in mm", "37"],
        ),
        (document(whisker=[{"length_mm": 0.018}]), ["length_mm", "is it in m", "write 18"]),
        (
            document(recording=LEAST["recording"] | {"pixels_per_mm": 0.025}),
            ["per µm?", "write 25"],
        ),
        (
            document(recording=LEAST["recording"] | {"pixels_per_mm": 0.04}),
            ["in mm per pixel? then write 25; or in pixels per µm? then write 40"],
        ),
        (document(whisker=[{"length_mm": -3}]), ["length_mm = -3", "expected 1 to 200 mm"]),
        (document(whisker=[{"youngs_modulus_GPa": 3e9}]), ["is it in Pa", "write 3"]),
        (document(whisker=[{"density_kg_per_m3": 1.0}]), ["is it in g/cm³", "write 1000"]),
        (document(whisker=[{"damping_per_s": float("nan")}]), ["damping_per_s = nan"]),
        (
            document(whisker=[{"cone_length_mm": float("inf")}]),
            ["cone_length_mm = inf", "1 to 1000"],
        ),
        (document(whisker=[{"cone_length_mm": 1e308}]), ["1e+308", "1 to 10000 mm"]),
        (
            document(whisker=[{"length_mm": "18"}]),
            ["length_mm = '18'", "a number", "not text; correct it"],
        ),
        (document(whisker=[{"length_mm": True}]), ["length_mm", "not true/false"]),
        (document(analysis={"friction": True}), ["expected a number (0 to 2), not true"]),
        (document(whisker=[{"name": "=1+1"}]), ["name = '=1+1'", "spreadsheets compute"]),
        (document(whisker=[{"name": "C2\t"}]), ["name = 'C2\\t'", "without spaces around"]),
        (document(whisker=[{"name": ""}]), ["name = '':", "non-empty text; correct"]),
        (document(whisker={"name": "C2"}), ["[[whisker]]", "double brackets"]),
        (document(whisker=[3]), ["[[whisker]] 1 = 3", "expected a table"]),
        (
            document(whisker=[{"name": "a"}, {"name": "a"}]),
            ['"a"', "2 times", "distinct", "rename all but one"],
        ),
        (
            document(whisker=[{"length_mm": 18, "cone_length_mm": 17}]),
            ["cone_length_mm = 17", "at least length_mm = 18"],
        ),
        (
            document(whisker=[{"length_mm": 18, "cone_length_mm": 19, "tip_radius_um": 2}]),
            ["cone_length_mm and tip_radius_um", "remove one"],
        ),
        (
            document(whisker=[{"base_radius_um": 37, "tip_radius_um": 74}]),
            ["tip_radius_um = 74", "at most base_radius_um = 37"],
        ),
        (
            document(whisker=[{"length_mm": 8, "hidden_length_mm": 9}]),
            ["hidden_length_mm = 9", "less than length_mm = 8"],
        ),
        (
            document(whisker=[{"length_mm": 5}]),
            ["curvature_at_mm = 5.5", "length_mm = 5", "visible place"],
        ),
        (
            document(advanced={"scene": {"cel_mm": 0.3}}),
            ["[advanced.scene] cel_mm: unknown key; did you mean cell_mm?"],
        ),
        (
            document(advanced={"scene": {"cell_mm": 300}}),
            ["[advanced.scene] cell_mm = 300: expected 0.05 to 5 mm"],
        ),
        (
            document(advanced={"scene": {"cell_mm": "0.3"}}),
            ["[advanced.scene] cell_mm = '0.3'", "(0.05 to 5 mm)", "not text"],
        ),
        (document(advanced={"scenes": {}}), ["[advanced] scenes: unknown", "mean scene?"]),
        (document(advanced={"scene": 3}), ["[advanced] scene = 3: expected a table with"]),
        (
            document(image={"region_px": [0, 0, 640]}),
            ["[image] region_px = [0, 0, 640]", "x0 < x1"],
        ),
        (document(image={"region_px": [9, 0, 3, 5]}), ["[image] region_px", "x0 < x1"]),
        (document(image={"polarity": "pale"}), ["[image] polarity = 'pale'", "dark, bright"]),
        (document(recording=[LEAST["recording"]]), ["only one such table", "[recording] once"]),
        (document(pixels_per_mm=25), ["pixels_per_mm = 25 belongs below [recording]; move it"]),
        (document(pole={"length_mm": 18}), ["length_mm = 18 belongs below [[whisker]]"]),
        (document(image={"mask": 3}), ["[image] mask = 3", "expected a non-empty text"]),
        (document(analysis={"follow": "C2"}), ["[analysis] follow = 'C2'", 'as ["C1", "C2"]']),
        (
            document(analysis={"follow": ["C9"]}, whisker=[{"name": "C1"}, {"name": "C2"}]),
            ["[analysis] follow", "'C9' has no [[whisker]] table", "known are C1, C2"],
        ),
        (document(pole={"x_px": 3}), ["[pole] y_px is missing", "neither"]),
        (document(pole={"diameter_mm": 500}), ["is it in µm", "write 0.5"]),
        (document(analysis=3), ["[analysis] = 3", "expected a table"]),
        (
            {"recording": {**LEAST["recording"], "pixels_per_mm": 25000}},
            ["pixels_per_mm = 25000", "pixels per m", "write 25"],
        ),
        (
            {"recording": {**LEAST["recording"], "frames_per_second": 1.0}},
            ["frames_per_second = 1.0", "kHz", "write 1000"],
        ),
        (
            {"recording": {**LEAST["recording"], "face": "Left"}},
            ["face = 'Left'", "left, right, top, bottom"],
        ),
        (
            {"recording": {**LEAST["recording"], "face": "top", "snout": "bottom"}},
            ['[recording] snout = "bottom"', "left or right, as the face is at the top"],
        ),
    ],
)
def test_every_mistake_is_named_with_what_to_do(tables, expected):
    message = problems_of(tables)
    assert "1 problem\n" in message
    for part in expected:
        assert part in message


@pytest.mark.parametrize(
    ("tables", "missing"),
    [
        (
            {"recording": {"frames_per_second": 1000, "pixels_per_mm": 25, "Face": "left"}},
            "[recording] face is missing; expected one of left, right, top, bottom; rename Face\n",
        ),
        ({"Recording": LEAST["recording"]}, "; rename Recording\n"),
        (
            {"recording": {"frames_per_second": 1000, "scale": 25, "face": "left"}},
            "pixels_per_mm is missing; expected a number (1 to 1000 pixels/mm); add it\n",
        ),
    ],
)
def test_what_is_missing_may_be_there_under_another_name(tables, missing):
    message = problems_of(tables)
    assert "2 problems\n" in message
    assert missing in message


def test_all_mistakes_are_reported_at_once():
    message = problems_of(
        {
            "recording": {"frames_per_second": 1.0, "fase": "left", "pixels_per_mm": 25},
            "whisker": [{"length_mm": 18, "cone_length_mm": 17, "base_radius_um": 0.037}],
            "pole": {"x_px": 1},
        }
    )
    assert "6 problems" in message
    assert len(re.findall(r"^  - ", message, re.MULTILINE)) == 6


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"[recording\n", "not valid TOML"),
        (b"[recording]\nface = left\n", "line 2"),
        (
            b"[recording]\nframes_per_second = 1000,5\n",
            "line 2, column .*decimal points, no commas",
        ),
        (b"\xff\xfe\x00", "is saved as UTF-16; save it as UTF-8 .Notepad"),
        (b"[recording]\n# Geh\xe4use\n", "line 2: a character that is not UTF-8; write it again"),
        (None, "no such file"),
    ],
)
def test_unreadable_files(tmp_path, content, expected):
    path = tmp_path / "session.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SettingsError, match=expected) as caught:
        read_session(path)
    assert str(path) in str(caught.value)


def test_whiskers_of_which_only_the_name_is_known_take_few_lines():
    names = [f"w{k}" for k in range(1, 31)]
    tables = [{"name": name} for name in names]
    tables[9]["hidden_length_mm"] = 2.0
    settings = settings_from(document(whisker=tables))
    text = session_text(settings)
    assert settings_from(tomllib.loads(text)) == settings
    assert text.count("# length_mm =") == 2  # of the first, and of the one that is known
    assert text.count("youngs_modulus_GPa = 3, ") == 1
    assert len(text.split("\n")) < 160


def fault_in(tmp_path, text) -> list[str]:
    """Lines of the message about a session.toml, without the first, which names the file."""
    (tmp_path / "session.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError) as caught:
        read_session(tmp_path / "session.toml")
    return str(caught.value).split("\n")[1:]


def test_a_slip_of_the_keyboard_is_shown_in_its_line(tmp_path):
    what, line, mark = fault_in(tmp_path, EXAMPLE.replace("25.0", "25,0"))
    assert what.startswith("  - line 4, column 19: not valid TOML")
    assert line.strip() == "pixels_per_mm = 25,0"
    assert line[mark.index("^")] == ","


@pytest.mark.parametrize("place", [r"masks\my.png", r"C:\Users\me\mask.png"])
def test_names_of_files_as_windows_writes_them_are_explained(tmp_path, place):
    what, line, _ = fault_in(tmp_path, EXAMPLE + f'[image]\nmask = "{place}"\n')
    assert what.endswith("in the names of files, write / in place of \\")
    assert place in line


def test_of_a_long_line_the_part_about_the_fault_is_shown(tmp_path):
    comment = f"  # {'far ' * 40}"
    _, line, mark = fault_in(tmp_path, f"[recording]\nface = left{comment}\n")
    assert line[mark.index("^") :].startswith("left")
    assert len(line) < 140


def test_a_list_without_its_end_is_shown_in_the_last_line(tmp_path):
    what, line, mark = fault_in(tmp_path, EXAMPLE + 'follow = ["C1"\n\n')
    assert what.startswith("  - line 22, column 15: not valid TOML")
    assert line.strip() == 'follow = ["C1"'
    assert mark.index("^") == len(line)


def test_a_table_that_is_there_twice_is_named(tmp_path):
    what, line, _ = fault_in(tmp_path, EXAMPLE + "[pole]\n")
    assert what.endswith("remove one of them")
    assert line.strip() == "[pole]"


def test_settings_that_are_missing_among_results_come_from_a_run(tmp_path):
    (tmp_path / "run.json").touch()
    with pytest.raises(SettingsError, match=r"is missing; `whiskerforce run` with the same"):
        read_session(tmp_path / "session.toml")


def test_a_folder_is_no_settings_file(tmp_path):
    with pytest.raises(
        SettingsError, match=r"is a folder; name the settings file in it, .*session\.toml"
    ):
        read_session(tmp_path)


def test_byte_order_mark_of_windows_editors_is_no_mistake(tmp_path):
    (tmp_path / "session.toml").write_text(EXAMPLE, encoding="utf-8-sig")
    assert read_session(tmp_path / "session.toml").recording.face == "left"


def test_the_mask_lies_beside_the_session(tmp_path):
    text = EXAMPLE + '[image]\nmask = "mask.png"\nregion_px = [10, 20, 300, 200]\n'
    (tmp_path / "session.toml").write_text(text)
    with pytest.raises(SettingsError, match=r"\[image\] mask: there is no file .*mask.png"):
        read_session(tmp_path / "session.toml")
    (tmp_path / "mask.png").write_bytes(b"no picture")
    with pytest.raises(SettingsError, match="is not a picture"):
        read_session(tmp_path / "session.toml")
    cv2.imwrite(str(tmp_path / "mask.png"), np.full((4, 4), 255, np.uint8))
    settings = read_session(tmp_path / "session.toml")
    assert settings.image.mask == str(tmp_path / "mask.png")
    other = tmp_path / "results"
    other.mkdir()
    write(other / "session.toml", settings)
    assert read_session(other / "session.toml") == settings


def test_tables_that_only_count_whiskers_name_none():
    recording = {"frames_per_second": 500.0, "pixels_per_mm": 20.0, "face": "left"}
    counted = settings_from({"recording": recording, "whisker": [{"name": "w1"}, {"name": "w2"}]})
    assert counted.without_bare_whiskers().whisker == ()
    sides = [{"name": name} for name in ("left_w1", "left_w2", "right_w1")]
    counted = settings_from({"recording": recording, "whisker": sides})
    assert counted.without_bare_whiskers().whisker == ()
    for chosen in (
        {"name": "C2"},
        {"name": "back_w1"},
        {"name": "left_w2"},
        {"name": "w2", "length_mm": 18.0},
        {"name": "w3"},
    ):
        named = settings_from({"recording": recording, "whisker": [{"name": "w1"}, chosen]})
        assert named.without_bare_whiskers() is named


def test_the_file_says_that_a_radius_is_asked_for():
    text = session_text(settings_from({**LEAST, "whisker": [{"name": "C2"}]}))
    (line,) = [line for line in text.splitlines() if "base_radius_um" in line]
    assert "half the diameter" in line
