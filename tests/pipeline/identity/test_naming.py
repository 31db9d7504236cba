"""Who is who over a whole video: appearance learned from all frames, names decided in the end."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from usual_limits import USUAL
from usual_parameters import options_for

from pipeline.identity import appearance, label_swaps, motion_model
from pipeline.identity.appearance import FanModel
from pipeline.identity.assign import assign_identities, name_lines, names, with_unnamed
from pipeline.identity.consensus import LEAST_SD
from pipeline.identity.features import ANGLE, BEND, Dial, line_features
from pipeline.identity.links import TAKEN, link_costs
from pipeline.identity.sides import Sides
from pipeline.identity.tracked_lines import TrackedLines
from pipeline.session.parameters import DEFAULTS
from pipeline.session.recording import Recording
from pipeline.tables.centrelines import Centrelines
from pipeline.tracking.given_lengths import GivenLengths
from pipeline.tracking.matching import Ruler

pytestmark = pytest.mark.slow

OPTIONS = options_for(Recording(500.0, 8.0, "left"))
NAMELESS = DEFAULTS.identity.nameless_confidence
RULER = Ruler.of("left", OPTIONS)
#    near bend, angle [rad], logs of thickness and length, bends [rad]
FAN = np.array(
    [
        [-0.04, -0.40, -1.8, 4.20, 0.02, 0.04],
        [-0.02, -0.25, -1.6, 4.35, -0.02, -0.03],
        [-0.01, -0.20, -1.5, 4.50, 0.01, 0.03],
        [0.02, 0.10, -1.2, 4.70, 0.00, 0.00],
        [0.04, 0.30, -1.0, 4.90, -0.01, -0.02],
    ]
)
NOISE = np.array([0.008, 0.015, 0.04, 0.03, 0.006, 0.006])
FRAMES = 300


def whisking(rng, fan=FAN, frames=FRAMES):
    """Features (frames, whiskers, 6) of a fan that whisks; angles go unlike with the phase."""
    phase = 0.4 * np.sin(np.arange(frames) / 6)
    seen = fan + NOISE * rng.normal(size=(frames, *fan.shape))
    seen[..., ANGLE] += phase[:, None] * np.linspace(0.9, 1.1, len(fan))
    return seen


def rows(seen, called):
    """Frame, track, features, true name, ordered by frame and track."""
    frame, true = np.divmod(np.arange(seen.shape[0] * seen.shape[1]), seen.shape[1])
    order = np.lexsort((called.ravel(), frame))
    return frame[order], called.ravel()[order], seen.reshape(-1, 6)[order], true[order]


def usual_fan(fan=FAN):
    """The appearance that `whisking` shows."""
    slope = np.zeros_like(fan)
    slope[:, ANGLE] = np.linspace(0.9, 1.1, len(fan))
    return FanModel(fan, slope, np.tile(NOISE, (len(fan), 1)), LEAST_SD)


def exchanged(changes):
    """Tracks (frames, whiskers), exchanged as of (one, other, first frame, last frame)."""
    called = np.tile(np.arange(len(FAN)), (FRAMES, 1))
    for one, other, first, last in changes:
        called[first:last, [one, other]] = called[first:last, [other, one]]
    return called


def test_looks_are_learned_from_the_rows_of_a_name():
    rng = np.random.default_rng(1)
    frame, _, features, true = rows(whisking(rng), exchanged([]))
    phase = 0.4 * np.sin(frame / 6)
    model = usual_fan(FAN + 0.1).fitted(features, true, phase, np.ones(len(true)))
    assert model.middle == pytest.approx(FAN, abs=0.02)  # rad, or of logarithms
    assert model.slope[:, ANGLE] == pytest.approx(np.linspace(0.9, 1.1, 5), abs=0.02)


def test_frames_at_rest_are_learned_from_as_one():
    """In 4 of 5 frames the whiskers rest, bent by 0.1: the appearance is that of the others."""
    rng = np.random.default_rng(1)
    frame, _, features, true = rows(whisking(rng), exchanged([]))
    phase, rests = 0.4 * np.sin(frame / 6), frame % 5 > 0
    features[:, BEND] += 0.1 * rests
    model = usual_fan().fitted(features, true, phase, np.where(rests, motion_model.QUIET, 1.0))
    assert model.middle[:, BEND] == pytest.approx(FAN[:, BEND], abs=0.03)


@given(st.lists(st.tuples(st.floats(-9, 9), st.integers(1, 5)), min_size=1, max_size=30))
def test_a_weight_counts_as_often(drawn):
    values, weight = np.array(drawn).T
    often = np.sort(np.repeat(values, weight.astype(int)))
    assert appearance.weighted_median(values, weight) == often[(len(often) - 1) // 2]


@pytest.mark.parametrize("wanted", [len(FAN), None])
def test_lines_that_the_tracker_exchanged_are_named_right(wanted):
    rng = np.random.default_rng(2)
    track = exchanged([(1, 2, 60, 180), (3, 4, 200, 230), (0, 1, 250, FRAMES)])
    frame, track, features, true = rows(whisking(rng), track)
    named, sure = names(frame, track, features, USUAL, wanted)
    assert np.array_equal(named, true)
    assert (sure > 0.5).mean() > 0.97  # known


def test_tracks_that_are_broken_off_are_joined():
    rng = np.random.default_rng(3)
    track = 5 * (np.arange(FRAMES)[:, None] // np.array([31, 37, 41, 43, 47])) + np.arange(5)
    frame, track, features, true = rows(whisking(rng), track)
    seen = rng.uniform(size=len(frame)) > 0.1
    frame, track, features, true = (each[seen] for each in (frame, track, features, true))
    named, _ = names(frame, track, features, USUAL)
    assert (named != true).mean() < 0.01


def test_two_whiskers_that_change_tracks_for_good_while_unseen():
    rng = np.random.default_rng(4)
    fan = FAN.copy()
    fan[2, ANGLE] = -0.235  # between neighbours, that differ in the bend of their far parts
    track = exchanged([(1, 2, 150, FRAMES)])
    frame, track, features, true = rows(whisking(rng, fan), track)
    away = (true > 0) & (true < 3) & (frame > 140) & (frame < 160)
    frame, track, features, true = (each[~away] for each in (frame, track, features, true))
    named, _ = names(frame, track, features, USUAL)
    assert np.array_equal(named, true)


@pytest.mark.parametrize(
    ("direction", "expected"), [(1, [-1, -1, 0, 1, 2]), (-1, [-1, -1, 2, 1, 0])]
)
def test_fewer_names_than_whiskers_go_to_the_strongest(direction, expected):
    rng = np.random.default_rng(8)
    frame, track, features, true = rows(whisking(rng), exchanged([(3, 4, 100, 200)]))
    named, _ = names(frame, track, features, USUAL, 3, direction)
    assert np.array_equal(named, np.array(expected)[true])


def test_a_line_that_is_no_whiskers_gets_no_name():
    rng = np.random.default_rng(5)
    seen = whisking(rng)
    frame, track, features, true = rows(seen, exchanged([]))
    hair = FAN[0] + [0.1, -0.5, -1.5, -0.8, 0.2, np.nan] + NOISE * rng.normal(size=(FRAMES, 6))
    frame = np.append(frame, np.arange(FRAMES))
    track = np.append(track, np.full(FRAMES, 7))
    named, _ = names(frame, track, np.concatenate([features, hair]), USUAL, len(FAN))
    assert np.array_equal(named[:-FRAMES], true)
    assert (named[-FRAMES:] == -1).mean() > 0.95


def test_it_does_not_know_who_is_who_after_whiskers_alike_were_one_line():
    rng = np.random.default_rng(6)
    fan = FAN.copy()
    fan[2] = fan[1] + [0, 0.004, 0, 0, 0, 0]
    frame, track, features, true = rows(whisking(rng, fan), exchanged([]))
    alike = (true == 1) | (true == 2)
    _, sure = names(frame, track, features, USUAL)
    assert (sure[alike] < 0.9).mean() > 0.9
    assert (sure[~alike] > 0.9).mean() > 0.98


def evidence(rng):
    """Evidence of the whisking fan, its tracks, and its true names."""
    frame, track, features, true = rows(whisking(rng), exchanged([(1, 2, 100, 200)]))
    model, phase = usual_fan(), 0.4 * np.sin(np.arange(FRAMES) / 6)
    return (
        motion_model.evidence_of(model, TrackedLines(features, frame, track, USUAL), phase),
        track,
        true,
    )


def test_exchanges_lead_from_any_names_to_the_likeliest():
    rng = np.random.default_rng(7)
    known, track, true = evidence(rng)
    start = true.copy()
    for first, last, turn in ((50, 120, 1), (180, 260, 2)):
        part = (known.frame >= first) & (known.frame < last)
        start[part] = (start[part] + turn) % len(FAN)
    assert np.array_equal(label_swaps.improved(known, start, track), true)


@pytest.mark.parametrize("seed", range(5))
def test_no_exchange_makes_names_dearer_where_whiskers_are_often_not_seen(seed):
    rng = np.random.default_rng(seed)
    frame, track, features, true = rows(whisking(rng), exchanged([(1, 2, 100, 200)]))
    seen = rng.random(len(frame)) < 0.4
    lines = TrackedLines(features[seen], frame[seen], track[seen], USUAL)
    known = motion_model.evidence_of(usual_fan(), lines, 0.4 * np.sin(np.arange(FRAMES) / 6))
    named = (true[seen] + frame[seen] // 40) % len(FAN)
    table = label_swaps._table(known, named)
    for a, b in [(1, 0), (2, 1), (3, 2), (4, 0), (4, 3)]:
        before = cost_of(known, label_swaps._names(table, len(named)))
        cache, changed = label_swaps._empty_cache(1, table.shape[1]), np.zeros(table.shape, bool)
        pair = np.array([(a, b)])
        label_swaps._exchange_all(known, table, pair, cache, ~changed, changed)
        took = changed.any()
        after = cost_of(known, label_swaps._names(table, len(named)))
        assert after < before if took else after == before


@pytest.mark.parametrize("seed", range(5))
def test_steps_in_the_cache_are_those_of_the_rows_as_they_are_now(seed):
    rng = np.random.default_rng(seed)
    known, _, true = evidence(rng)
    table = label_swaps._table(known, true)
    (steps,), ((mine, theirs),) = label_swaps._empty_cache(1, table.shape[1])
    for _ in range(20):
        first = rng.integers(FRAMES)
        part = slice(first, first + rng.integers(1, 30))
        if rng.random() < 0.5:
            table[[0, 1], part] = table[[1, 0], part]
        else:
            table[rng.integers(2), part] = -1
        label_swaps._renew(known, 1, 0, table[1], table[0], steps, mine, theirs)
        rows = table[1], table[0]
        last = [label_swaps._seen_before(each, -1) for each in rows]
        afresh = label_swaps._step_costs(known, 1, 0, rows, tuple(last))
        assert np.array_equal(steps, afresh)


def improved_afresh(known, named, track):
    """As `label_swaps.improved`, but every pair and every claim is looked at in every round."""
    table = label_swaps._table(known, named)
    pairs, every = label_swaps._alike(known, table), np.ones(table.shape, bool)
    for _ in range(label_swaps.MOST_ROUNDS):
        cache, changed = label_swaps._empty_cache(len(pairs), table.shape[1]), ~every
        label_swaps._exchange_all(known, table, pairs, cache, every, changed)
        untried = np.ones(len(named), bool)
        label_swaps._claims(known, table, track, every, changed, untried)
    return label_swaps._names(table, len(named))


@pytest.mark.parametrize("seed", range(8))
def test_what_has_not_changed_need_not_be_looked_at_again(seed):
    rng = np.random.default_rng(seed)
    seen = whisking(rng)
    seen += 2 * NOISE * rng.normal(size=seen.shape)
    broken_off = exchanged([]) + 5 * (np.arange(FRAMES)[:, None] // 12)
    frame, track, features, true = rows(seen, broken_off)
    there = rng.random(len(frame)) < 0.7
    lines, true = TrackedLines(features[there], frame[there], track[there], USUAL), true[there]
    known = motion_model.evidence_of(usual_fan(), lines, 0.4 * np.sin(np.arange(FRAMES) / 6))
    named = np.where(rng.random(len(true)) < 0.5, -1, true)
    for first in rng.integers(FRAMES - 40, size=6):
        part = (lines.frame >= first) & (lines.frame < first + 40) & (named >= 0)
        named[part] = (named[part] + 1) % len(FAN)
    afresh = improved_afresh(known, named, lines.track)
    assert np.array_equal(label_swaps.improved(known, named, lines.track), afresh)
    assert (afresh == named).mean() < 0.5


def test_a_line_that_is_seen_to_go_on_keeps_its_name():
    known, track, true = evidence(np.random.default_rng(9))
    alike = (known.frame >= 120) & (known.frame < 130)  # for so long, two look like each other
    for row in np.flatnonzero(alike & (true > 2)):
        known.appearance[row, [3, 4]] = known.appearance[row, [4, 3]]
    free = known._replace(rename_cost=0 * known.rename_cost)
    assert np.array_equal(label_swaps.improved(known, true, track), true)
    assert not np.array_equal(label_swaps.improved(free, true, track), true)


def test_a_whisker_that_had_no_line_pays_for_one_that_was_anothers():
    known, _, true = evidence(np.random.default_rng(13))
    row = {k: np.flatnonzero(true == k) for k in range(3)}  # a row per frame
    now = 60
    taken = known._replace(rename_cost=np.full(len(true), TAKEN))
    free = known._replace(rename_cost=np.zeros(len(true)))

    def extra(before, lasting):
        each = taken._replace(lasting=np.full(len(true), lasting)), free
        costs = [link_costs(e, 1, row[1][[before]], row[2][[now]])[0] for e in each]
        return costs[0] - costs[1]

    assert taken.before[row[2][now]] == row[2][now - 1]
    assert extra(now - 6, True) == pytest.approx(TAKEN)  # not seen for five frames
    assert extra(now - 1, True) == 0  # both are seen: they may have changed places
    brief = np.ones(len(true), bool)
    brief[row[1]] = False
    assert extra(now - 1, brief) == pytest.approx(TAKEN)


def test_lines_far_from_others_that_move_evenly_are_seen_to_go_on():
    rng = np.random.default_rng(10)
    known, _, true = evidence(rng)
    priced = known.rename_cost >= motion_model.RENAMED
    jumped = np.isin(known.frame, [100, 200])  # there, tracks 1 and 2 change whiskers
    assert priced[(true > 2) & (known.frame > 0)].mean() > 0.85
    assert not priced[jumped & np.isin(true, [1, 2])].any()
    assert not priced[known.frame == 0].any()
    apart = np.abs(known.features[:, None, :] - known.features[None, :, :])
    far = apart[..., ANGLE]
    bent = known.features[:, ANGLE] + known.features[:, BEND]
    far = np.minimum(far, np.abs(bent[:, None] - bent[None, :]))
    far[known.frame[:, None] != known.frame[None, :]] = np.inf
    np.fill_diagonal(far, np.inf)
    assert not priced[far.min(axis=1) < USUAL.alone].any()


def test_looks_of_resting_whiskers_count_less():
    rng = np.random.default_rng(11)
    moving = whisking(rng)
    still = moving[[0] * 50] + 0.02 * NOISE * rng.normal(size=(50, *FAN.shape))
    frame, track, features, _ = rows(
        np.concatenate([still, moving]), np.tile(np.arange(len(FAN)), (350, 1))
    )
    phase = np.zeros(350)
    known = motion_model.evidence_of(
        usual_fan(), TrackedLines(features, frame, track, USUAL), phase
    )
    cost = usual_fan().costs(features, phase[frame])
    share = (known.appearance / cost).max(axis=1)
    assert share[(frame > 0) & (frame < 50)] == pytest.approx(
        motion_model.WEIGHT * motion_model.QUIET, rel=0.6
    )
    assert share[frame > 50].max() == pytest.approx(motion_model.WEIGHT)


def cost_of(known, named):
    """Cost of all appearances and motions, whisker by whisker."""
    total = known.appearance[np.arange(len(named)), named].sum()
    for name in np.unique(named):
        rows = np.flatnonzero(named == name)
        total += link_costs(known, name, np.append(-1, rows[:-1]), rows).sum()
    return total


def centrelines(frame, track, lines):
    x, y = np.concatenate(lines).T.astype(np.float32, order="C")
    n = len(x)
    return Centrelines(
        names=("a", "b", "c"),
        frame=np.asarray(frame, np.int32),
        whisker=np.asarray(track, np.int32),
        offsets=np.append(0, np.cumsum([len(line) for line in lines])),
        x_px=x,
        y_px=y,
        se_px=np.full(n, 0.1, np.float32),
        confidence=np.full(len(frame), 0.9, np.float32),
        thickness_px=np.full(n, 0.3, np.float32),
    )


def straight(angle, length, centre=(0.0, 100.0)):
    """Nodes of a line that points away from `centre`, from 26 px off it on."""
    s = 26 + np.arange(length)
    return np.column_stack([centre[0] + s * np.cos(angle), centre[1] + s * np.sin(angle)])


def test_features_of_straight_lines_and_arcs():
    radius = 200.0  # px
    t = np.arange(120) / radius  # from the centre on: the chord's direction is half the arc's
    arc = np.column_stack([radius * np.sin(t), 100 + radius * (1 - np.cos(t))])
    dial = Dial.of([[24.0, 100.0]], RULER.along, RULER.outward, 8e3, DEFAULTS.identity)
    assert dial.centre == pytest.approx([0, 100])
    lines = centrelines([0, 0], [0, 1], [straight(0.3, 80), arc])
    near, angle, thickness, length, bend, far = line_features(lines, dial).T
    assert angle[0] == pytest.approx(0.3, abs=1e-5)
    assert [near[0], bend[0], far[0]] == pytest.approx([0, 0, 0], abs=1e-5)
    assert thickness == pytest.approx(np.log(0.3))
    assert np.exp(length) == pytest.approx([80, 120])
    chords = np.arcsin(dial.distances / 2 / radius)
    expected = [chords[0] - chords[1], chords[1], chords[2] - chords[1], chords[3] - chords[2]]
    assert [near[1], angle[1], bend[1], far[1]] == pytest.approx(expected, abs=1e-3)


def test_a_line_that_begins_and_ends_between_the_distances_is_carried_on():
    dial = Dial.of([[24.0, 100.0]], RULER.along, RULER.outward, 8e3, DEFAULTS.identity)
    whole, part = straight(0.2, 80), straight(0.2, 80)[22:50]  # from 48 px on: 44 is the second
    (one, two) = line_features(centrelines([0, 0], [0, 1], [whole, part]), dial)
    assert two[:2] == pytest.approx(one[:2], abs=1e-5)
    assert np.isnan(two[-1])


class WhiskerTemplate:
    """A template's whisker, seen in one sample frame as a straight line."""

    def __init__(self, name, angle, length):
        points = straight(angle, length)
        self.name, self.base_xy, self.longest_px = name, points[0], np.inf
        self.samples = (Drawn(points),)


class Drawn:
    """As much of a `detection.Line` as its features are taken from."""

    def __init__(self, points):
        self.points, (self.x, self.y) = points, points.T.copy()
        self.n, self.thickness = len(points), np.full(len(points), 0.3)


def one_row(templates):
    return Sides.of(
        templates, RULER, "left", OPTIONS.pixels_per_m, may_be_two=False, params=DEFAULTS.identity
    )


@pytest.mark.parametrize("direction", [1, -1])
def test_a_few_frames_are_named_after_the_templates(direction):
    angles = [-0.3, 0.1, 0.4]
    templates = [
        WhiskerTemplate(n, a, 60 + 10 * k)
        for k, (n, a) in enumerate(zip("abc", angles, strict=True))
    ]
    templates = templates[::direction]  # thicker ones at the other end
    lines = [straight(a, 60 + 10 * k) for k, a in enumerate(angles)]
    chunks = [centrelines([f] * 3, [2, 0, 5], [lines[1], lines[0], lines[2]]) for f in range(4)]
    got = list(name_lines(iter(chunks), templates, one_row(templates), USUAL))
    assert len(got) == 4
    for before, after in zip(chunks, got, strict=True):
        assert np.array_equal(after.frame, before.frame)
        assert [after.names[k] for k in after.whisker] == ["b", "a", "c"]
        assert np.array_equal(after.y_px, before.y_px)
        assert after.information is None


def test_lengths_tell_which_given_whiskers_were_seen():
    angles, lengths = [-0.3, 0.1, 0.4], [58, 71, 80]
    templates = [WhiskerTemplate(*each) for each in zip("abc", angles, lengths, strict=True)]
    lines = [straight(*each) for each in zip(angles, lengths, strict=True)]
    chunks = [centrelines([f] * 3, range(3), lines) for f in range(4)]

    def named(given_px):
        return list(
            name_lines(
                iter(chunks), templates, one_row(templates), USUAL, given=GivenLengths(given_px)
            )
        )

    clear = {"a": 40.0, "b": 62.0, "c": 75.0, "d": 85.0}
    for one, other in zip(named(clear), named(clear | {"a": 62.0}), strict=True):
        assert [one.names[k] for k in one.whisker] == ["b", "c", "d"]
        share = other.confidence / one.confidence  # the first may be a as well as b
        assert share == pytest.approx([0.5, 1.0, 1.0], abs=0.05)


def test_a_given_whisker_that_the_first_look_missed_is_named_all_the_same():
    angles, names_given = [-0.3, 0.1, 0.4], "abc"
    given = GivenLengths(dict.fromkeys(names_given, np.inf))
    templates = [
        WhiskerTemplate(*each) for each in zip(names_given, angles, [60, 70, 80], strict=True)
    ]
    del templates[1]
    lines = [straight(*each) for each in zip(angles, [60, 70, 80], strict=True)]
    chunks = [centrelines([f] * 3, range(3), lines) for f in range(4)]
    for got in name_lines(iter(chunks), templates, one_row(templates), USUAL, given=given):
        assert [got.names[k] for k in got.whisker] == ["a", "b", "c"]


def test_no_line_is_longer_than_the_whisker_whose_name_it_gets():
    angles, longest = [-0.3, 0.1, 0.4], {"a": 51.0, "b": 200.0, "c": np.inf}
    templates = [WhiskerTemplate(*each) for each in zip("abc", angles, [60] * 3, strict=True)]
    lines = [straight(angle, 60) for angle in angles]
    chunk = centrelines([0] * 3, range(3), lines)
    given = GivenLengths(longest)
    (got,) = name_lines(iter([chunk]), templates, one_row(templates), USUAL, given=given)
    assert [got.names[k] for k in got.whisker] == ["a", "b", "c"]
    for row, count in enumerate([51, len(chunk.row(1)), len(chunk.row(2))]):
        np.testing.assert_array_equal(got.row(row), chunk.row(row)[:count])


def test_names_follow_the_parameters_of_the_options():
    own = replace(DEFAULTS.identity, seldom=0.9, nameless_confidence=0.2)
    options = replace(OPTIONS, params=replace(DEFAULTS, identity=own))
    angles = [-0.6, -0.1, 0.4, 0.9]  # the third is seen in half of the frames
    templates = [WhiskerTemplate(n, a, 60) for n, a in zip("abc", angles, strict=False)]
    lines = [straight(a, 60) for a in angles]
    all_of_them, others = [0, 1, 2, 3], [0, 1, 3]
    chunks = [
        centrelines([f] * len(seen), seen, [lines[k] for k in seen])
        for f, seen in enumerate([all_of_them] * 2 + [others] * 2)
    ]
    first, *_ = assign_identities(iter(chunks), templates, options, "left", open_ended=True)
    assert np.isclose(first.confidence, 0.9 * 0.2).sum() == 1


@pytest.mark.parametrize("open_ended", [False, True])
def test_a_hair_apart_from_the_row_is_left_out_and_a_whisker_seen_as_seldom_is_not(open_ended):
    angles, frames = [-0.3, 0.1, 0.4], 40
    whiskers = [straight(a, 60) for a in angles]
    templates = [WhiskerTemplate(n, a, 60) for n, a in zip("abc", angles, strict=True)]
    beside = straight(0.7, 60)
    apart = beside + np.array([0.0, 60.0])
    for seldom, kept in ((beside, open_ended), (apart, False)):
        lines = [
            *((f, k, line) for f in range(frames) for k, line in enumerate(whiskers)),
            *((f, 3, seldom) for f in range(3)),
        ]
        lines.sort(key=lambda each: each[:2])
        chunk = centrelines(*map(list, zip(*lines, strict=True)))
        (got,) = name_lines(iter([chunk]), templates, one_row(templates), USUAL, open_ended)
        assert len(got) == 3 * frames + 3 * kept


@pytest.mark.parametrize(("thickness_px", "kept"), [(0.05, 0), (0.3, 3)])
def test_several_thin_hairs_apart_from_the_row_are_left_out(thickness_px, kept):
    angles, frames = [-0.3, 0.1, 0.4], 20
    templates = [WhiskerTemplate(n, a, 60) for n, a in zip("abc", angles, strict=True)]
    apart = [straight(0.7, 60) + np.array([0.0, down]) for down in (60.0, 66.0, 72.0)]
    lines = [*(straight(a, 60) for a in angles), *apart]
    chunk = centrelines(np.repeat(range(frames), 6), list(range(6)) * frames, lines * frames)
    chunk.thickness_px[np.repeat(chunk.whisker, np.diff(chunk.offsets)) > 2] = thickness_px
    (got,) = name_lines(iter([chunk]), templates, one_row(templates), USUAL, open_ended=True)
    assert len(got) == (3 + kept) * frames


@pytest.mark.parametrize("open_ended", [False, True])
def test_a_single_frame_is_named(open_ended):
    angles = [-0.3, 0.1, 0.4]
    templates = [WhiskerTemplate(n, a, 60) for n, a in zip("abc", angles, strict=True)]
    lines = centrelines([0, 0, 0], [2, 0, 1], [straight(a, 60) for a in angles])
    (got,) = name_lines(iter([lines]), templates, one_row(templates), USUAL, open_ended)
    assert got.names == (("w1", "w2", "w3") if open_ended else ("a", "b", "c"))
    assert np.array_equal(got.confidence, lines.confidence)
    assert list(got.whisker) == [0, 1, 2]


def test_costs_of_looks_are_those_of_their_formula():
    rng = np.random.default_rng(9)
    features = FAN + NOISE * rng.normal(size=(40, *FAN.shape))
    features = features.reshape(-1, 6)
    features[::7, 5] = np.nan
    phase = rng.normal(size=len(features))
    model = usual_fan()
    off = features[:, None] - model.middle - model.slope * phase[:, None, None]
    square = np.minimum((off / model.sd) ** 2, appearance.FARTHEST**2)
    each = 0.5 * square + np.log(model.sd / LEAST_SD)
    expected = np.where(np.isnan(each), appearance.UNSEEN, each).sum(axis=-1)
    assert model.costs(features, phase) == pytest.approx(expected)


def test_no_look_is_so_wide_that_any_line_is_like_it():
    rng = np.random.default_rng(10)
    frame, _, features, true = rows(whisking(rng), exchanged([]))
    mixed = np.where((true == 2) & (frame % 2 == 0), 4, np.where(true == 4, 2, true))
    model = usual_fan().fitted(features, mixed, 0.4 * np.sin(frame / 6), np.ones(len(true)))
    usual = np.median(model.sd[:, ANGLE])
    assert model.sd[2, ANGLE] <= appearance.MOST_SD * usual * (1 + 1e-9)


def test_lines_without_a_name_keep_a_place_that_is_not_known():
    """Tracks that overlap get places of their own; later ones may share them."""
    frame = np.array([*range(10), *range(5, 15), *range(20, 30), 40])
    track = np.repeat([0, 1, 2, 3], [10, 10, 10, 1])
    whisker = np.where(track == 0, 0, -1)
    sure = np.ones(len(frame))
    named, sure = with_unnamed(frame, track, np.zeros((len(frame), 2)), whisker, sure, NAMELESS)
    assert (named[track == 0] == 0).all()
    assert (named[track == 1] == 1).all()
    assert (named[track == 2] == 1).all()
    assert (named[track == 3] == -1).all()  # one frame is no whisker
    assert (sure[(track == 1) | (track == 2)] == NAMELESS).all()


def test_lines_without_a_name_go_on_under_the_number_that_was_seen_at_their_place():
    """Two tracks end, and two begin at the same places, the other one first."""
    frame = np.array([*range(10), *range(1, 10), *range(20, 30), *range(21, 30)])
    track = np.repeat([0, 1, 2, 3], [10, 9, 10, 9])
    base = np.array([[10.0, 5.0], [90.0, 5.0], [92.0, 7.0], [11.0, 6.0]])[track]
    whisker, sure = np.full(len(frame), -1), np.ones(len(frame))
    named, _ = with_unnamed(frame, track, base, whisker, sure, NAMELESS)
    assert [set(named[track == k]) for k in range(4)] == [{0}, {1}, {1}, {0}]
