"""The follicle's slide along the whisker: followed, shrunk where it is noise, without jumps."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from pipeline.kinematics.follicle import _Slide

FRAMES, CHUNK = 1000, 500
LIMIT, ORDINARY = 12.5, 1.1  # px: 0.5 and 0.045 mm at 25 px/mm
HALVES = slice(0, CHUNK), slice(CHUNK, FRAMES)
slide_tolerance = 0.4  # px
jump_tolerance = 0.5  # px


def wandering(rng, sd):
    """A smooth path of SD `sd` [px] that changes over some hundred frames."""
    path = gaussian_filter1d(rng.normal(size=FRAMES + 800), 120)[400:-400]
    return path * sd / path.std()


def in_chunks(slide, sway, size=CHUNK):
    followed = _Slide(LIMIT, ORDINARY)
    parts = [
        followed.follow(slide[i : i + size], sway[i : i + size]) for i in range(0, FRAMES, size)
    ]
    return np.concatenate(parts)


def test_nothing_jumps_where_a_chunk_ends():
    """Also where only part of the slide is believed, and one chunk's own slide is small."""
    together, apart = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        slide = wandering(rng, 2.5) + rng.normal(0, 0.5, FRAMES)
        slide[CHUNK:] = slide[CHUNK] + 0.3 * (slide[CHUNK:] - slide[CHUNK])
        sway = wandering(rng, 0.5)
        together.append(np.diff(in_chunks(slide, sway))[CHUNK - 1])
        alone = [_Slide(LIMIT, ORDINARY).follow(slide[s], sway[s]) for s in HALVES]
        apart.append(np.diff(np.concatenate(alone))[CHUNK - 1])
    jump, jump_apart = (np.sqrt(np.mean(np.square(each))) for each in (together, apart))
    assert jump < jump_tolerance
    assert jump < jump_apart / 2


def test_a_slide_no_larger_than_the_sway_is_believed():
    rng = np.random.default_rng(7)
    true = wandering(rng, 1.5)
    found = in_chunks(true + rng.normal(0, 1, FRAMES), wandering(rng, 1.5))
    assert np.sqrt(np.mean((found - true) ** 2)) < slide_tolerance


def test_a_slide_far_above_the_sway_is_noise():
    rng = np.random.default_rng(8)
    found = in_chunks(wandering(rng, 6.0), wandering(rng, 0.3))
    assert np.std(found) < 1.5  # of 6 px


def test_an_unknown_slide_is_none():
    found = in_chunks(np.full(FRAMES, np.nan), np.zeros(FRAMES))
    np.testing.assert_array_equal(found, 0.0)
