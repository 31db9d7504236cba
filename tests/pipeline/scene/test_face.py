import cv2
import numpy as np
import pytest
from contourpy import contour_generator
from still_scene import scene_from_frames
from usual_parameters import options_for

from pipeline.scene.background import estimate_background
from pipeline.scene.face import SIDES, border, darkest_sides, find_face, thickening_towards
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tracking.registry import find_templates
from synthetic.fur import distance_from_pad, pad_centre
from synthetic.presets import make_trial
from synthetic.render import Renderer

SCALE = 25.0  # px/mm
EDGE = 0.05  # mm, mean offset of the mask's edge from the fur's solid edge, per video
STRAIGHT_EDGE = 0.5  # px
STEADY = 0.1  # px, movement of the edge from one sample of a video to the next


def picture(shape=(240, 320), edge=240.3, noise=0.0):
    """Light left of a vertical edge with whiskers and a rod, as a share of the light."""
    rows, columns = np.mgrid[: shape[0], : shape[1]].astype(float)
    image = 1 / (1 + np.exp(columns - edge))
    image[:, : int(edge)] *= 1 - 0.7 * (np.abs(rows - 100)[:, : int(edge)] < 2)  # a whisker
    image[30:44, :60] = 0.02  # the end of a rod
    return (image + np.random.default_rng(0).normal(0, noise, shape)).astype(np.float32)


class TestMask:
    @pytest.mark.parametrize("turns", range(4))
    def test_dark_mass_on_its_side(self, turns):
        side = ("right", "top", "left", "bottom")[turns]
        image = np.ascontiguousarray(np.rot90(picture(noise=0.02), turns))
        assert darkest_sides(image, DEFAULTS.scene)[0] == side
        mask = np.rot90(find_face(image, side, SCALE, DEFAULTS.scene), -turns)
        edge = mask.argmax(axis=1) - 0.5  # between the last pixel outside and the first inside
        assert np.abs(edge[10:-10] - 240.3).max() < 2
        assert np.abs(edge[10:-10] - 240.3).mean() < STRAIGHT_EDGE
        assert not mask[:, :230].any()

    def test_whisker_and_hairs_are_not_face(self):
        image = picture()
        for row in range(130, 230, 9):
            cv2.line(image, (200, row), (242, row + 5), 0.2, 2, cv2.LINE_AA)
        mask = find_face(image, "right", SCALE, DEFAULTS.scene)
        assert not mask[:, :225].any()

    def test_holes_are_filled(self):
        image = picture()
        image[100:110, 280:290] = 0.9
        assert find_face(image, "right", SCALE, DEFAULTS.scene)[105, 285]

    def test_apparatus_beside_the_face_is_left_out(self):
        image = picture()
        image[:20, 150:] = 0.9  # the face does not reach the upper corner
        image[4:10, 200:] = 0.02  # a thin arm from the face's side, 0.24 mm
        assert not find_face(image, "right", SCALE, DEFAULTS.scene)[:20, :300].any()

    def test_no_face_in_view(self):
        assert not find_face(np.ones((100, 100), np.float32), "left", SCALE, DEFAULTS.scene).any()

    @pytest.mark.parametrize("side", SIDES)
    def test_border(self, side):
        image = np.arange(12).reshape(3, 4)
        expected = {
            "left": [0, 4, 8],
            "right": [3, 7, 11],
            "top": [0, 1, 2, 3],
            "bottom": [8, 9, 10, 11],
        }
        assert list(border(image, side)) == expected[side]

    def test_unknown_side(self):
        with pytest.raises(ValueError, match=r"side must be one of .* got 'front'"):
            find_face(picture(), "front", SCALE, DEFAULTS.scene)


def face_edge(mask):
    """The mask's edge inside the picture: curves (n, 2) of x, y, about 1 px spaced."""
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 3, borderType=cv2.BORDER_REPLICATE)
    return contour_generator(z=smooth).lines(0.5)


@pytest.fixture(scope="module", params=[0, 1, 2])
def rendered(request):
    trial = make_trial("noisy", seed=request.param, trial=0)
    renderer = Renderer(trial.scene, trial.motion)
    return trial.scene, np.stack([renderer.frame(i) for i in range(0, len(renderer), 25)])


@pytest.mark.slow
class TestFur:
    """Against rendered fur, whose solid edge is known."""

    def test_edge_has_no_bias_where_whiskers_come_out(self, rendered):
        scene, frames = rendered
        scale = scene.camera.pixels_per_mm
        mask = find_face(
            estimate_background(frames, scale, DEFAULTS.scene).transmission,
            scene.face.side,
            scale,
            DEFAULTS.scene,
        )
        points = np.concatenate(face_edge(mask))
        distance, along = distance_from_pad(
            scene.face, scene.camera.pixels_per_m, pad_centre(scene), *points.T
        )
        at_pad = np.abs(along) < scale
        offset = distance[at_pad] / scale - 1e3 * scene.face.hidden_length
        assert at_pad.sum() > scale
        assert abs(offset.mean()) < EDGE
        assert offset.std() < 2 * EDGE  # fur stands in tufts

    def test_edge_is_steady(self, rendered):
        scene, frames = rendered
        scale = scene.camera.pixels_per_mm
        area, length = [], []
        for some in (frames[::2], frames[1::2]):
            transmission = estimate_background(some, scale, DEFAULTS.scene).transmission
            mask = find_face(transmission, scene.face.side, scale, DEFAULTS.scene)
            area.append(mask.sum())
            length.append(sum(len(curve) for curve in face_edge(mask)))
        assert abs(area[0] - area[1]) / length[0] < STEADY


@pytest.mark.slow
def test_an_object_on_the_wrong_side_is_no_face():
    trial = make_trial("row", seed=3, trial=0)
    renderer = Renderer(trial.scene, trial.motion)
    video = np.array([renderer.frame(i) for i in range(0, len(renderer), 40)])
    video = np.ascontiguousarray(video[:, :, :320])
    video[:, :, -25:] = 10  # dark, where the whiskers reach it
    scene = scene_from_frames(video, Recording(1000.0, SCALE, "right"))
    templates = find_templates(video, scene, options_for(Recording(1000.0, SCALE, "right")))
    assert scene.likelier_side == "left"
    assert thickening_towards(templates) == "left"
