"""Messages about one video: what is missing or doubtful."""

import functools
import re
from types import SimpleNamespace

import cv2
import numpy as np
import pandas as pd
import pytest
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.detection.static_scene import PoleTrack
from pipeline.messages import _seldom_tracked, face_message, line_messages, messages
from pipeline.run import analyse
from pipeline.session.recording import Recording
from pipeline.session.session_file import settings_from
from pipeline.tracking.registry import find_templates
from pipeline.tracking.seen_lengths import SeenLength
from pipeline.video.changed import Negative
from synthetic.presets import make_trial
from synthetic.render import Renderer

SCALE = 25.0  # px/mm
WHISKER = {"length_mm": 18.0, "cone_length_mm": 19.0, "base_radius_um": 37.0}
POLE = PoleTrack(np.full(1, 300.0), np.full(1, 200.0), 0.25 * SCALE)


def evidence_of(across, away, at):
    """100 frames in which C2 lies across the pole, is bent elsewhere, and is bent at the pole."""
    frame = np.arange(100)
    return pd.DataFrame(
        {
            "whisker": "C2",
            "across": frame < across,
            "shape_force_N": np.where(frame < away + at, 2e-6, 0.0),
            "shape_force_se_N": 1e-7,
            "origin_force_se_N": 0.0,
            "rest_known": True,
            "probability": np.where((frame >= away) & (frame < away + at), 1.0, 0.0),
        }
    )


def said_of(whiskers=({**WHISKER, "name": "C2"},), pole_xy=None, **changes):
    """Messages of a video of one whisker in which nothing is wrong, but for the `changes`."""
    given = {
        "n_frames": 100, "exact_count": True, "read": 100, "found": ("C2",), "pole": POLE,
        "tracked": 1.0, "known": 1.0, "across": 0, "contacts": ("C2",), "light": 200,
        "refused": (), "thing": np.s_[:0], "problems": (), "odd": None, "side": None,
        "out": np.s_[:0], "bright": False, "first_seen": None, "recording": {}, "rows": (50, 90),
        "other_pole": None,
        "region": None, "frames": None, "flags": "", "unnamed": 0, "analysis": {}, "curved": 1.0,
        "lines": False, "bent": (0, 0),
    } | changes  # fmt: skip
    settings = settings_from(
        {
            "recording": {
                "frames_per_second": 1000,
                "pixels_per_mm": SCALE,
                "face": "left",
            }
            | given["recording"],
            "whisker": list(whiskers),
            "analysis": given["analysis"],
            "pole": dict(zip(("x_px", "y_px"), pole_xy, strict=True)) if pole_xy else {},
            "image": {"region_px": given["region"]} if given["region"] else {},
        }
    )
    tracked = np.arange(100) < 100 * given["tracked"]
    frames = pd.DataFrame(
        {
            "whisker": "C2",
            "tracked": tracked,
            "confidence": np.where(np.arange(100) < 100 * given["known"], 0.9, 0.2),
            "curvature_per_m": np.where(np.arange(100) < 100 * given["curved"], 20.0, np.nan),
        }
    )
    tables = SimpleNamespace(
        frames=frames if given["frames"] is None else given["frames"],
        evidence=evidence_of(given["across"], *given["bent"]),
        contacts=pd.DataFrame({"whisker": list(given["contacts"]), "flags": given["flags"]}),
    )
    names = tuple(w.name for w in settings.whisker) or given["found"]
    templates = [
        SimpleNamespace(samples=(), base_xy=np.array([20.0, row]))
        for _, row in zip(given["found"], given["rows"], strict=False)
    ]
    whisker_set = SimpleNamespace(
        names=names, found=given["found"], templates=templates, refused=(), given=names
    )
    followed = SimpleNamespace(
        whisker_set=whisker_set, n_frames=given["read"], pole=given["pole"],
        unnamed=given["unnamed"],
    )  # fmt: skip
    video = SimpleNamespace(
        n_frames=given["n_frames"],
        exact_count=given["exact_count"],
        ended_by=None,
        width=60,
        height=40,
    )
    video.problems = lambda: iter(given["problems"])
    face, thing = np.zeros((2, 40, 60), bool)
    face[:, :12] = True
    thing[given["thing"]] = True
    background = np.full((40, 60), given["light"])
    thing[given["out"]], background[given["out"]] = True, 0
    scene = SimpleNamespace(
        background=background, likelier_side=given["side"],
        face_side="left", face_mask=face, obstacle_mask=thing, refused_poles=given["refused"],
        face_seen=True,
    )  # fmt: skip
    epochs = (SimpleNamespace(scene=scene),)
    video = Negative(video) if given["bright"] else video
    seen = SimpleNamespace(
        video=video,
        epochs=epochs,
        whisker_set=given["first_seen"] or whisker_set,
        odd=given["odd"],
        other_pole=given["other_pole"],
    )
    if given["lines"]:
        return list(line_messages(settings, tables, followed))
    return list(messages(settings, tables, seen, followed))


def test_where_nothing_is_wrong_nothing_is_said():
    assert said_of() == []


def test_a_pole_that_a_whisker_touches_is_no_dust_though_another_passes_over_it():
    assert said_of(across=40, contacts=("D2",)) == []


@pytest.mark.parametrize("bent", [(0, 60), (4, 0), (20, 21)])
def test_a_whisker_that_is_mostly_bent_by_the_pole_or_hardly_ever_is_no_fault(bent):
    assert said_of(bent=bent) == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"read": 60}, "only 60 of 100 frames could be read"),
        ({"read": 1, "n_frames": 1}, "only one frame"),
        ({"found": ()}, "no whiskers found; what was seen is something dark at the left (20 % of"),
        ({"found": (), "out": np.s_[:, 20:]},  # not looked at
         "no whiskers found; what was seen is something dark at the left (20 % of the picture), "
         "with nothing thin moving out of it; if"),
        ({"found": (), "region": [20, 0, 60, 40]},
         "no whiskers found; what was seen is something dark at the left (20 % of the picture), "
         "with nothing thin moving out of it; if there are whiskers, check that [recording] face "
         '= "left" is the side that they come from, and that [image] region_px leaves their'),
        ({"found": (), "light": 5}, "no whiskers found: the picture is black "
         "throughout (no pixel is brighter than 20 of 255); was the light on"),
        ({"found": (), "light": 250}, "no whiskers found: the picture is white throughout (no "
         "pixel is darker than 235 of 255); is it overexposed"),
        ({"found": (), "light": 250, "bright": True}, "no whiskers found: the picture is black"),
        ({"found": (), "light": 40}, "no whiskers found; the picture is mostly dark, and whiskers "
                                     "were taken to be darker"),
        ({"found": (), "light": 55, "bright": True},
         "no whiskers found; the picture is mostly light, and whiskers were taken to be brighter "
         'than what is behind them: if they are dark, write [image] polarity = "dark"'),
        ({"found": (), "light": 200, "bright": True},
         "no whiskers found; what was seen is something bright at the left (20 % of"),
        ({"pole": None}, "no pole of 0.5 mm (12 px) found, so no contacts; what was seen is "
                         "nothing dark and round; if there is one"),
        ({"pole": None, "thing": np.s_[10:20, 40:44]},
         "no pole of 0.5 mm (12 px) found, so no contacts; what was seen is a dark spot 4 px wide "
         "and 10 px high at (42, 14) px; if there is one"),
        ({"pole": None, "thing": np.s_[30:, 20:]},
         "no pole of 0.5 mm (12 px) found, so no contacts; what was seen is something dark that "
         "reaches in from the right and bottom (17 % of the picture); if there is one"),
        ({"pole": None, "thing": np.s_[38:, 58:]},
         "no pole of 0.5 mm (12 px) found, so no contacts; what was seen is something dark that "
         "reaches in from the right and bottom (less than 1 % of the picture); if there is one"),
        ({"pole": None, "refused": ((3.0, 4.0, "a tuft"),)},
         "no pole of 0.5 mm (12 px) found, so no contacts; what was seen is a tuft (at 3, 4 px)"),
        ({"pole": None, "other_pole": PoleTrack(POLE.x_px, POLE.y_px, SCALE)},
         "no pole of 0.5 mm (12 px) found, so no contacts; what may be one looks 2 mm thick "
         "(50 px, at 300, 200 px), but [pole] diameter_mm = 0.5: correct it or [recording] "
         "pixels_per_mm = "),
        ({"region": [10, 0, 90, 40]},
         "[image] region_px = [10, 0, 90, 40] reaches beyond the picture, which is 60×40 px: what "
         "is inside is looked at; if that is not what was meant, give x from 0 to 60 and"),
        ({"recording": {"frames_per_second": 30}}, "[recording] frames_per_second = 30: a con"),
        ({"whiskers": ({**WHISKER, "name": "C2", "base_radius_um": 370.0},)},
         "[[whisker]] base_radius_um = 370 (C2): "),
        ({"pole": None, "pole_xy": (300, 200)},
         "no pole of 0.5 mm (12 px) found at [pole] x_px, y_px = 300, 200, so no contacts; what "
         "was seen is nothing dark and round; correct them, or leave them out"),
        ({"pole_xy": (300, 200)}, "no disc is seen at [pole] x_px, y_px = 300, 200"),
        ({"known": 0.23}, "for 77 % of the traced lines it is not known which whisker they are"),
        ({"pole": PoleTrack(POLE.x_px, POLE.y_px, 0.3 * SCALE)}, "the pole looks 0.6 mm thick"),
        ({"across": 2, "contacts": ()}, "C2 passes over the pole at (300, 200) px in 2 frames"),
        ({"bent": (7, 6)},
         "C2 is bent in 7 frames as if it touched something, but not the pole at (300, 200) px"),
        ({"contacts": ("C2",) * 3, "flags": ["x;base_contradicted", "base_contradicted", ""]},
         "in 2 of 3 contacts C2 bends as if hidden_length_mm = 1.4 were wrong by over 0.3 mm"),
        ({"contacts": ("C2",) * 2, "flags": "starts_before;no_rest_curvature"},
         "no forces for C2: too few frames without a touch to know the shape at rest"),
        ({"contacts": ("C2",), "flags": "no_rest_curvature", "whiskers": ({"name": "C2"},)},
         "no forces for C2: no length_mm"),
        ({"curved": 0.4},
         "curvature_per_m is mostly empty for C2: traced lines end before [analysis] "
         "curvature_at_mm = 5.5; "),
        ({"tracked": 0.5},
         "tracked in only part of the frames: C2 in 50 % (expected: at least 80 %); see in the "
         "overlay where they are lost (`run --overlay` draws it)"),
        ({"tracked": 0.5, "lines": True},
         "tracked in only part of the frames: C2 in 50 % (expected: at least 80 %); where they "
         "are in view, trace them in the other program"),
        ({"whiskers": ()},
         "no forces: there is no [[whisker]] table with dimensions in session.toml; measure "
         "length_mm, cone_length_mm, base_radius_um and add them"),
        ({"whiskers": ({"name": "C2"},)},
         "no forces for C2: no length_mm, cone_length_mm, base_radius_um in session.toml; measure "
         "what is missing"),
        ({"whiskers": ({**WHISKER, "name": "C2"}, {**WHISKER, "name": "D2"})},
         "not found in any frame: D2 (expected: 2 whiskers, found: 1); if they are in the pic"),
        ({"whiskers": ({**WHISKER, "name": "C2"}, {**WHISKER, "name": "D2"}), "lines": True},
         "not found in any frame: D2 (expected: 2 whiskers, found: 1); if they were traced, name"),
    ],
)  # fmt: skip
def test_each_fault_is_reported_alone(changes, said):
    (message,) = said_of(**changes)
    assert message.startswith(said)


@pytest.mark.parametrize(
    ("changes", "advice"),
    [
        ({"read": 60}, "then copy it again from the recording computer"),
        ({"read": 1, "n_frames": 1}, "give the whole video, or the folder of its images"),
    ],
)
def test_of_a_video_that_is_not_whole_it_is_said_what_to_do(changes, advice):
    (message,) = said_of(**changes)
    assert message.endswith(advice)


def test_where_no_line_is_a_whiskers_it_is_said_what_to_do():
    settings = settings_from(
        {"recording": {"frames_per_second": 1000, "pixels_per_mm": SCALE, "face": "left"}}
    )
    followed = SimpleNamespace(whisker_set=SimpleNamespace(templates=()))
    (message,) = line_messages(settings, None, followed)
    assert message.endswith("name the whiskers in the program that traced them, and import again")


def test_of_many_whiskers_that_are_seldom_tracked_the_least_are_named():
    names = [f"w{k}" for k in range(6)]  # w0 always, w5 in half of the frames, the others between
    frames = pd.DataFrame(
        [(name, i >= 10 * k) for k, name in enumerate(names) for i in range(100)],
        columns=["whisker", "tracked"],
    ).assign(confidence=0.9)
    whisker_set = SimpleNamespace(names=names, found=names)
    (some,) = _seldom_tracked(frames, whisker_set, "look")
    expected = "(expected: at least 80 %); look"
    assert some.endswith(f"frames: w5 in 50 %, w4 in 60 %, w3 in 70 % {expected}")
    frames["tracked"] &= frames.groupby("whisker").cumcount() < 60
    (many,) = _seldom_tracked(frames, whisker_set, "look")
    least = "w5 in 10 %, w4 in 20 %, w3 in 30 %"
    assert many.endswith(f"frames: 6 whiskers, least {least} {expected}")


@pytest.mark.parametrize(
    "changes",
    [
        {"read": 60, "exact_count": False},  # the file's header only guesses
        {"across": 1, "contacts": ()},  # may be a mistake
        {"across": 50},  # it does touch
        {"across": 50, "contacts": (), "pole_xy": (301, 200)},  # a person says it is the pole
        {"tracked": 0.85},
        {"curved": 0.6},
        {"known": 0.85},
        {"contacts": ("C2",) * 2, "flags": ["base_contradicted", "doubtful"]},
        {"contacts": ("C2",) * 2, "flags": ["no_rest_curvature", ""]},  # others have a force
        {"region": [0, 10, 60, 40]},  # up to the border
    ],
)
def test_what_is_no_fault_is_not_said_of(changes):
    assert said_of(**changes) == []


SHORTER = {**WHISKER, "length_mm": 12.0, "name": "C1"}


@pytest.mark.parametrize(
    ("whiskers", "found", "said"),
    [
        ((), ("w1", "w2", "w3"), "w1 to w3 are numbered anew in each video"),
        (({"name": "C1"}, {**WHISKER, "name": "C2"}), ("C1", "C2"),
         "the order of C1 to C2 along the face is guessed anew in each video"),
        ((SHORTER, {**WHISKER, "name": "C2"}), ("C1", "C2"), None),  # lengths tell
        ((), ("w1",), None),  # there is no order
        ((), ("left_w1", "right_w1"), None),  # the snout is between them
    ],
)  # fmt: skip
def test_an_order_that_is_guessed_in_each_video_is_doubted(whiskers, found, said):
    first = [message for message in said_of(whiskers=whiskers, found=found) if "anew" in message]
    assert len(first) == (said is not None)
    assert all(message.startswith(said) for message in first)


@pytest.mark.parametrize(
    ("snout", "rows", "doubted"),
    [("top", (50, 90), False), ("bottom", (50, 90), True), ("bottom", (90, 50), False),
     ("top", (50, np.nan), False)],
)  # fmt: skip
def test_an_order_from_another_end_than_the_snout_is_doubted(snout, rows, doubted):
    whiskers = SHORTER | {"name": "a"}, {**WHISKER, "name": "b"}
    said = said_of(whiskers=whiskers, found=("a", "b"), recording={"snout": snout}, rows=rows)
    assert [f'[recording] snout = "{snout}"' in each for each in said].count(True) == doubted


@pytest.mark.parametrize(
    ("analysis", "listed"),
    [({}, '["a", "b", "c", …]'), ({"follow": ["b", "d"]}, '["b", "d"]')],
)
def test_tables_of_some_whiskers_only_are_doubted(analysis, listed):
    names = "a", "b", "c", "d"
    whiskers = [{**WHISKER, "name": name} for name in names]
    said = said_of(whiskers=whiskers, found=names, unnamed=9, analysis=analysis)
    (some,) = [message for message in said if "[[whisker]]" in message]
    assert some.startswith(
        "about 13 whiskers are seen at a time, but only 4 have a [[whisker]] table: which ones "
        "are a to d is a guess"
    )
    assert f"[analysis] follow = {listed}" in some


def test_one_table_for_many_whiskers_is_doubted():
    (some,) = [message for message in said_of(unnamed=9) if "[[whisker]]" in message]
    assert some.startswith(
        "about 10 whiskers are seen at a time, but only one has a [[whisker]] table: which one is "
        "C2 is a guess"
    )


def test_without_a_pole_the_one_that_is_named_may_be_another():
    by_pole, by_sight = (
        next(message for message in said_of(unnamed=9, **pole) if "[[whisker]]" in message)
        for pole in ({}, {"pole": None})
    )
    assert "how near each comes to the pole and how well it is seen, and may be wrong" in by_pole
    assert "how well each is seen, and may be wrong, or another one than where a pole" in by_sight


def test_arcs_that_run_from_the_other_end_are_not_doubted():
    whiskers = {**WHISKER, "name": "C1"}, {**SHORTER, "name": "C2"}
    found = "C1", "C2"  # posterior to anterior
    assert not [m for m in said_of(whiskers=whiskers, found=found, recording={"snout": "bottom"})
                if "snout" in m]  # fmt: skip


def test_numbers_of_lines_that_are_no_whiskers_are_said_and_no_more_of_them():
    numbers = [f"w{k}" for k in range(1, 8)]  # w3 to w7: in few frames, and never known
    frames = pd.DataFrame(
        [(name, i % 10 < 9 if k < 2 else i < 9, 0.9 if k < 2 else 0.4)
         for k, name in enumerate(numbers) for i in range(100)],
        columns=["whisker", "tracked", "confidence"],
    ).assign(curvature_per_m=20.0)  # fmt: skip
    *rest, order, last = said_of(whiskers=(), found=numbers, frames=frames)
    assert last == (
        "w3 to w7: not whiskers, but lines that could not be identified (confidence below 0.5); "
        'leave them out with frames[frames["confidence"] >= 0.5]'
    )
    assert order.startswith("w1 to w2 are numbered anew in each video")
    assert not any("only part of the frames" in each for each in rest)


def test_of_many_numbers_the_first_and_the_last_are_said():
    numbers = [f"w{k}" for k in range(1, 8)]
    said = said_of(whiskers=[{"name": name} for name in numbers], found=numbers[:-1])
    lost = "not found in any frame: w7 (expected: 7 whiskers, found: 6); "
    assert any(each.startswith(lost) for each in said)
    assert any(each.startswith("no forces for w1 to w6: no length_mm") for each in said)


def test_the_main_doubt_comes_first():
    first, *rest = said_of(known=0.2, tracked=0.7, pole=None, whiskers=())
    assert "not known which whisker they are" in first
    assert len(rest) == 3


def test_why_there_is_no_contact_comes_before_what_is_usual_without_settings():
    first, *rest = said_of(tracked=0.7, pole=None, whiskers=(), found=("w1", "w2"))
    assert first.startswith("no pole of 0.5 mm")
    assert "numbered anew in each video" in rest[-1]


def test_a_length_that_contradicts_the_settings_is_doubted_in_place_of_the_face():
    (doubt,) = said_of(side="right", odd=SeenLength(420.0, "C2"))
    assert doubt == (
        "C2 looks 17 mm long (420 px), but [[whisker]] length_mm = 18: correct it or "
        "[recording] pixels_per_mm = 25, on which lengths and forces depend"
    )
    (doubt,) = said_of(side="right")
    assert 'write face = "right"' in doubt


def test_that_no_whisker_is_found_comes_before_a_doubt_about_the_face():
    (doubt,) = said_of(side="right", found=())
    assert doubt.startswith("no whiskers found; ")
    assert "but lines are thicker towards the right" in doubt
    assert "forces" not in doubt


def test_a_length_in_doubt_does_not_hide_that_no_whisker_is_found():
    assert said_of(found=(), odd=SeenLength(420.0, "C2"))[-1] == "no whiskers found"


def _seen(*thickness):
    """Whiskers to the right, each of a line that is so much thicker at its tip."""
    points = np.column_stack([np.arange(60.0), np.zeros(60)])
    samples = [
        [SimpleNamespace(n=60, points=points, thickness=np.linspace(1, thick, 60))]
        for thick in thickness
    ]
    templates = [SimpleNamespace(samples=each) for each in samples]
    return SimpleNamespace(templates=templates, refused=())


def test_the_face_is_doubted_by_lines_that_were_seen_not_by_their_names_over_the_video():
    assert said_of(first_seen=_seen(2.0, 0.3, 0.3), found=("C2",) * 9) == []
    assert 'write face = "right"' in said_of(first_seen=_seen(2.0, 2.0, 0.3))[0]


def test_a_scale_is_doubted_without_lengths():
    doubt, *_ = said_of(odd=SeenLength(4200.0), whiskers=({"name": "C2"},))
    assert doubt == (
        "the longest whisker looks 170 mm long (4200 px): correct [recording] pixels_per_mm = "
        "25, on which lengths and forces depend"
    )


# --- length and scale, on a rendered video ----------------------------------------------------

VISIBLE_MM = 16.6  # of 18 mm, at the true scale
LENGTH_ERROR = 0.03  # of it, as printed


@pytest.fixture(scope="module")
def one_whisker():
    return frames("single")


def _first_message(video, length_mm, scale):
    whisker = {**WHISKER, "name": "C2", "length_mm": length_mm, "cone_length_mm": length_mm + 1}
    recording = {"frames_per_second": 1000, "pixels_per_mm": scale, "face": "left"}
    said = analyse(video, {"recording": recording, "whisker": [whisker]}).messages
    assert not any("face =" in message for message in said)
    return said[0] if said else ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("length_mm", "scale", "who"),
    [(18, 10 * SCALE, "the longest whisker"), (18, SCALE / 10, "C2"), (6, SCALE, "C2")],
)
def test_a_wrong_length_or_scale_is_the_main_doubt(one_whisker, length_mm, scale, who):
    said = _first_message(one_whisker, length_mm, scale)
    seen_mm = float(re.match(f"{who} looks (.*) mm long", said)[1])
    assert seen_mm == pytest.approx(VISIBLE_MM * SCALE / scale, rel=LENGTH_ERROR)
    assert f"length_mm = {length_mm}: correct it or [recording] pixels_per_mm = {scale:g}" in said


@pytest.mark.slow
@pytest.mark.parametrize("length_mm", [16, 22])
def test_a_length_as_wrong_as_people_measure_is_not_doubted(one_whisker, length_mm):
    assert "mm long" not in _first_message(one_whisker, length_mm, SCALE)


@pytest.mark.slow
def test_of_a_row_the_whisker_with_the_wrong_length_is_named():
    whiskers = [hair.whisker for hair in make_trial("row", 3, 0).scene.hairs]
    lengths = {w.name: 1e3 * w.length for w in whiskers} | {"C2": 6.0}
    tables = [
        {**WHISKER, "name": name, "length_mm": length, "cone_length_mm": 1.1 * length}
        for name, length in lengths.items()
    ]
    recording = {"frames_per_second": 1000, "pixels_per_mm": SCALE, "face": "left"}
    settings = settings_from({"recording": recording, "whisker": tables})
    assert analyse(frames("row", every=120), settings).messages[0].startswith("C2 looks ")


@pytest.fixture(scope="module")
def crowd():
    """A dense row: its scene, and rendered frames."""
    trial = make_trial("dense_row", 3, 0, 30)
    renderer = Renderer(trial.scene, trial.motion)
    return trial.scene, np.array([renderer.frame(i) for i in range(30)])


@pytest.mark.slow
@pytest.mark.parametrize("tables", [1, 2, 4, 11])
def test_where_most_of_a_row_has_no_tables_this_is_said(crowd, tables):
    scene, images = crowd
    camera = scene.camera
    whiskers = [hair.whisker for hair in scene.hairs]
    recording = {
        "frames_per_second": camera.frames_per_second,
        "pixels_per_mm": camera.pixels_per_mm,
        "face": "left",
    }
    given = [{"name": each.name, "length_mm": 1e3 * each.length} for each in whiskers]
    settings = settings_from({"recording": recording, "whisker": given[:tables]})
    said = analyse(images, settings).messages
    assert any("whiskers are seen at a time" in each for each in said) == (tables < len(whiskers))


# --- the side of the face, on rendered videos -------------------------------------------------

SIDES = ("left", "bottom", "right", "top")  # from one to the next by a quarter turn
POLE_MM = 0.015  # tolerance of its thickness, printed to 0.01 mm
NAMES = {"single": ["C2"], "row": ["C4", "C3", "C2", "C1"]}


@functools.cache
def frames(preset, seed=3, every=40):
    """Rendered frames of whiskers with the face at the left, uint8 (k, height, width)."""
    trial = make_trial(preset, seed, 0)
    renderer = Renderer(trial.scene, trial.motion)
    return np.array([renderer.frame(i) for i in range(0, len(trial.motion), every)])


@pytest.fixture(scope="module", params=NAMES)
def seen(request):
    return request.param, frames(request.param)


def doubt(video, side, names):
    """The message about the face's side, or None."""
    scene = scene_from_frames(video, Recording(1000.0, SCALE, side))
    options = options_for(Recording(1000.0, SCALE, side), [18e-3], [1.4e-3])
    return face_message([scene], find_templates(video, scene, options, names), side)


@pytest.mark.slow
@pytest.mark.parametrize("turns", range(4))
def test_a_face_at_its_place_is_not_doubted(seen, turns):
    preset, video = seen
    turned = np.ascontiguousarray(np.rot90(video, turns, axes=(1, 2)))
    assert doubt(turned, SIDES[turns], NAMES[preset]) is None


@pytest.mark.slow
@pytest.mark.parametrize("side", ["right", "top", "bottom"])
def test_a_face_elsewhere_is_reported(seen, side):
    preset, video = seen
    message = doubt(video, side, NAMES[preset])
    assert f'[recording] face = "{side}"' in message
    assert 'write face = "left"' in message


@pytest.mark.slow
def test_whiskers_without_a_face_in_view_show_the_opposite_side():
    video = np.ascontiguousarray(frames("single")[:, :, 140:])  # without face and fur
    assert doubt(video, "left", ["C2"]) is None
    assert 'write face = "left"' in doubt(video, "right", ["C2"])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """A folder of frames of one whisker, which whisks fast."""
    folder = tmp_path_factory.mktemp("pictures")
    for i, frame in enumerate(frames("single", every=20)):
        cv2.imwrite(str(folder / f"{i:03d}.png"), frame)
    return folder


@pytest.mark.e2e
@pytest.mark.parametrize(
    ("side", "scale", "words"),
    [
        ("left", SCALE, None),
        ("right", SCALE, 'write face = "left"'),
        ("left", 0.75 * SCALE, "px), but [pole] diameter_mm = 0.5"),
        ("left", 0.5 * SCALE, "no pole of 0.5 mm (6 px) found, so no contacts; what may be one"),
        ("left", 2 * SCALE, "no pole of 0.5 mm (25 px) found, so no contacts; what may be one"),
    ],
)
def test_a_video_with_wrong_settings_says_so(pictures, side, scale, words):
    recording = {"frames_per_second": 100.0, "pixels_per_mm": scale, "face": side}
    settings = settings_from({"recording": recording, "whisker": [{"name": "C2"}]})
    messages = [m for m in analyse(pictures, settings).messages if "no forces" not in m]
    if words is None:
        assert messages == []
    else:
        assert words in messages[0]
    if scale != SCALE:
        (thick,) = re.findall(r"(?:pole|one) looks ([0-9.]+) mm", messages[0])
        assert float(thick) == pytest.approx(0.5 * SCALE / scale, abs=POLE_MM)
