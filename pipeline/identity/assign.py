"""Names for the lines of a whole video, given when all of it has been tracked.

The tracker follows lines without names (`tracking.tracker`). Here they are stored in a
file until the video has ended; only a few numbers per line stay in memory. The appearance of every
whisker is learnt from all frames. The names are those that appearance and motion together make
most likely, as several namings agree on them (`consensus`).
"""

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace

import numpy as np

from pipeline.identity.appearance import medians
from pipeline.identity.consensus import best_names
from pipeline.identity.features import ANGLE, LENGTH, NEAR_BEND, THICKNESS
from pipeline.identity.limits import Limits
from pipeline.identity.sides import Sides
from pipeline.identity.tracked_lines import TrackedLines
from pipeline.identity.unnamed import Unnamed
from pipeline.tables.centrelines import Centrelines
from pipeline.tables.whole_files import temporary_room
from pipeline.tracking import hairs, line_ends
from pipeline.tracking.given_lengths import GivenLengths, numbers_in_order, probabilities
from pipeline.tracking.matching import Ruler
from pipeline.tracking.two_sides import names_by_side

MEASURED = "se_px", "offset_px", "information", "thickness_px"  # stored with three digits …
MOST_STORED = float(np.finfo(np.float16).max)  # … and at most so large
FEWEST_FRAMES = 2  # shorter tracks that belong to no named whisker are dropped


def assign_identities(
    chunks: Iterable[Centrelines],
    templates,
    options,
    face_side,
    open_ended=False,
    other_side=(),
    given: GivenLengths | None = None,
    unnamed: Unnamed | None = None,
) -> Iterator[Centrelines]:
    """Yield the chunks of a video with a name for every line.

    They get the names that suit the whole video best (`name_lines`).

    Parameters
    ----------
    chunks : as traced, in order; `whisker` numbers the tracks
    templates : the `WhiskerTemplate`s that they are named after
    options : the tracker's lengths, and the `Parameters` (`TracingOptions`)
    face_side : side of the picture with the face
    open_ended : name all whiskers that the video shows, w1, w2, …; else only as many as there
        are templates
    other_side : `WhiskerTemplate`s of a side of the face without names: its lines get none
    given : lengths of all whiskers in session.toml, by which those that are seen are recognised;
        None: those of the templates
    unnamed : in the end, it counts the lines that get no name
    """
    ruler, params = Ruler.of(face_side, options), options.params.identity
    named = [template.name for template in templates]
    may_be_two = open_ended or names_by_side(named, face_side) is not None
    sides = Sides.of(
        [*templates, *other_side], ruler, face_side, options.pixels_per_m, may_be_two, params
    )
    limits = Limits(params, options.frames_per_second)
    return name_lines(chunks, templates, sides, limits, open_ended, given, unnamed)


def name_lines(
    chunks, templates, sides, limits: Limits, open_ended=False, given=None, unnamed=None
) -> Iterator[Centrelines]:
    """Yield the chunks of a video with the names that suit the whole of it best.

    Lines that belong to no named whisker are left out. The confidence is that of the line times
    how sure its name is; where lengths tell which of the given whiskers are seen, also
    times the probability that this choice is right.

    Parameters
    ----------
    chunks, templates, open_ended, given, unnamed : as for `assign_identities`
    sides : the rows in which they stand (`Sides`)
    limits : the room's parameters
    """
    given = given or GivenLengths.of(templates)
    with tempfile.TemporaryFile() as file:
        found, count = [], 0
        for chunk in chunks:
            _store(chunk, file)
            side, features = sides.features(chunk)
            length = _whole_lengths(chunk, features[:, LENGTH], given.tips_seen)
            base = np.column_stack([each[chunk.offsets[:-1]] for each in (chunk.x_px, chunk.y_px)])
            found.append((chunk.frame, chunk.whisker, side, features, length, base))
            count += 1
        if not found:
            return
        lines = [np.concatenate(each) for each in zip(*found, strict=True)]
        whisker, sure, all_names = _all_rows(
            lines, templates, given, sides, open_ended, limits, unnamed
        )
        file.seek(0)
        first = 0
        for _ in range(count):
            chunk = _load(file)
            own = slice(first, first + len(chunk))
            first += len(chunk)
            yield _named(chunk, all_names, whisker[own], sure[own], given.longest_px)


def _all_rows(lines, templates, given, sides, open_ended, limits, unnamed):
    """Whisker of every line, the probability of that, and the names; row by row of the face.

    lines : frame, track, side, features, `_whole_lengths` and base of every line
    """
    longest = given.longest_px
    frame, track, side, features, length, base = lines
    whisker, sure, all_names = np.full(len(frame), -1), np.ones(len(frame)), ()
    for number, side_name in enumerate(sides.names):
        own = np.flatnonzero(side == number)
        own = own[~_are_hairs(frame, track[own], base[own], features[own], templates)]
        row = [template for template in templates if template.name.startswith(side_name)]
        both = open_ended and len(sides.names) > 1
        direction = 1 if both else _runs_along(row, sides.dials[number])
        here = {name: px for name, px in longest.items() if name.startswith(side_name)}
        # a whisker that the first look missed may be seen later: it has a name, too
        wanted = None if open_ended else max(len(row), len(here))
        meant = _place_of(row[0], base[own]) if len(row) == wanted == 1 else None
        lines_here = frame[own], track[own], features[own]
        named, sure[own] = names(*lines_here, limits, wanted, direction, meant)
        if open_ended:
            low = limits.params.nameless_confidence
            lines_here = frame[own], track[own], base[own]
            named, sure[own] = with_unnamed(*lines_here, named, sure[own], low)
            names_here = tuple(f"{side_name}w{k + 1}" for k in range(named.max(initial=-1) + 1))
        else:
            if unnamed is not None:
                unnamed.add(frame[own], named, features[own])
            found = [template.name for template in row]
            named, names_here, chosen = _as_given(named, length[own], here, found)
            sure[own] *= chosen
        whisker[own] = np.where(named < 0, -1, named + len(all_names))
        all_names += names_here
    return whisker, sure, all_names


def _place_of(template, base) -> np.ndarray:
    """How likely lines begin where a template's do, (rows,): 1 at its place, less beside it."""
    known = np.array([line.points[0] for line in template.samples]) - template.base_xy
    usual = max(np.median(np.hypot(*known.T)), 1.0)
    return 1 / (1 + np.hypot(*(base - template.base_xy).T) / usual)


def _are_hairs(frame, track, base, features, templates):
    """Rows (rows,) of tracks that are hairs apart from the whiskers of all `templates`, bool.

    frame : of all lines, of this row of the face or not
    """
    _, of = np.unique(track, return_inverse=True)
    count = np.bincount(of)
    places = np.column_stack([_medians(values, of, count) for values in base.T])
    strength = np.nan_to_num(np.exp(features[:, LENGTH] + features[:, THICKNESS]))
    strength, seen = np.bincount(of, strength) / count, count / len(np.unique(frame))
    usual = np.exp(medians(features[:, LENGTH], np.array([0, len(track)])))[0]
    known = np.array([template.base_xy for template in templates]).reshape(-1, 2)
    return hairs.are_hairs_beside(places, strength, seen, usual, known)[of]


def _as_given(named, length, given, found):
    """Number (rows,) of every line's whisker, the names that are numbered, and how sure each is.

    The last, (rows,), is the probability that the whisker is really the given one of that name.

    named : (rows,) numbers in order along the face, −1 for none
    length : (rows,) logarithms of the whiskers' lengths [px], NaN where a line is cut short
    given : name → largest visible length [px], in the same order
    found : names that are kept in any case
    """
    count = np.bincount(named[named >= 0])
    seen_px = np.exp(_medians(length, named, count))
    given_px = list(given.values())
    numbers = numbers_in_order(seen_px, given_px)
    sure = np.append(probabilities(seen_px, given_px, numbers), 1.0)
    kept = [k for k, name in enumerate(given) if name in found or k in numbers]
    place = np.append(np.searchsorted(kept, numbers), -1)
    return place[named], tuple(list(given)[k] for k in kept), sure[named]


def _whole_lengths(chunk, length, tips_seen):
    """Logarithms of the lines' lengths (lines,), NaN where a line is cut short."""
    end = chunk.offsets[1:] - 1
    whole = line_ends.whole(chunk.x_px[end], chunk.y_px[end], tips_seen)
    return np.where(whole, length, np.nan)


def names(frame, track, features, limits: Limits, wanted=None, direction=1, meant=None):
    """Whisker of every line (rows,), −1 for none, and how sure it is (rows,), 0 to 1.

    Whiskers are numbered along the face.

    Parameters
    ----------
    frame, track : (rows,)
    features : (rows, 6) of `line_features`
    limits : the room's parameters
    wanted : how many whiskers to name: those seen in most frames, and best; None: all but those
        that are seldom seen
    direction : 1: in ascending order of their directions; −1: descending
    meant : (rows,) how likely each line is one of those to name; None: all alike
    """
    named, sure = np.full(len(frame), -1), np.ones(len(frame))
    usable = np.flatnonzero(np.isfinite(features[:, ANGLE]))
    if not len(usable):
        return named, sure
    order = usable[np.lexsort((track[usable], frame[usable]))]
    lines = TrackedLines(
        features[order], frame[order].astype(int), track[order].astype(int), limits
    )
    whisker, sure[order] = best_names(lines)
    meant = np.ones(len(order)) if meant is None else meant[order]
    named[order] = _in_order(whisker, lines, wanted, direction, meant)
    return named, sure


def with_unnamed(frame, track, base, whisker, sure, unnamed_confidence):
    """Give lines that belong to no named whisker numbers after those of the named ones.

    Their confidence is `unnamed_confidence`. A track goes on under the number, of those that are
    not seen any more, whose line was nearest to it; tracks of a few frames only are left out.
    Returns new `whisker` and `sure`.

    base : (rows, 2) of the lines [px]
    """
    whisker, sure = whisker.copy(), sure.copy()
    first = whisker.max(initial=-1) + 1
    last = []  # row of each of the new numbers
    unnamed = np.flatnonzero(whisker < 0)
    unnamed = unnamed[np.lexsort((frame[unnamed], track[unnamed]))]
    parts = np.split(unnamed, np.unique(track[unnamed], return_index=True)[1])[1:]
    least = min(FEWEST_FRAMES, len(np.unique(frame)))
    for rows in sorted((p for p in parts if len(p) >= least), key=lambda p: frame[p[0]]):
        free = [k for k, end in enumerate(last) if frame[end] < frame[rows[0]]]
        away = [np.linalg.norm(base[last[k]] - base[rows[0]]) for k in free]
        number = free[np.argmin(away)] if free else len(last)
        last[number : number + 1] = [rows[-1]]
        whisker[rows], sure[rows] = first + number, unnamed_confidence
    return whisker, sure


def _in_order(whisker, lines, wanted, direction, meant):
    """The same names numbered along the face, −1 for those of whiskers that are left out."""
    features = lines.features
    count = np.bincount(whisker[whisker >= 0], minlength=1)
    if wanted is None:
        seldom = lines.limits.params.seldom
        chosen = np.flatnonzero(count >= max(seldom * len(np.unique(lines.frame)), 1))
    else:
        strength = np.exp(_medians(features[:, LENGTH] + features[:, THICKNESS], whisker, count))
        merit = count * np.sqrt(np.nan_to_num(strength)) * _medians(meant, whisker, count)
        chosen = np.argsort(-merit)[:wanted]
        chosen = chosen[count[chosen] > 0]
    near = _medians(features[:, ANGLE] + features[:, NEAR_BEND], whisker, count)
    number = np.full(len(count) + 1, -1)
    number[chosen[np.argsort(direction * near[chosen])]] = np.arange(len(chosen))
    return number[whisker]


def _medians(values, whisker, count):
    """Median of each whisker's rows, NaN if it has none; `whisker` is −1 for rows without one."""
    order = np.argsort(whisker, kind="stable")
    unnamed = len(whisker) - count.sum()
    return medians(values[order], np.append(unnamed, unnamed + np.cumsum(count)))


def _runs_along(templates, dial) -> int:
    """1 if the templates stand in ascending order along the face, −1 if in descending order."""
    places = [
        np.dot(np.subtract(template.base_xy, dial.centre), dial.along) for template in templates
    ]
    return -1 if len(places) > 1 and np.polyfit(np.arange(len(places)), places, 1)[0] < 0 else 1


def _named(chunk: Centrelines, all_names, whisker, sure, longest_px) -> Centrelines:
    """The chunk's lines that have a name, with their names, none longer than its whisker."""
    kept = np.flatnonzero(whisker >= 0)
    confidence = (chunk.confidence * sure)[kept].astype(np.float32)
    most = np.array([longest_px.get(name, np.inf) for name in all_names])[whisker[kept]]
    return replace(
        chunk.rows(kept, most),
        names=all_names,
        whisker=whisker[kept].astype(np.int32),
        confidence=confidence,
    )


@temporary_room()
def _store(chunk: Centrelines, file) -> None:
    for each in fields(Centrelines):
        value = getattr(chunk, each.name)
        if each.name in MEASURED and value is not None:
            value = np.minimum(value, MOST_STORED).astype(np.float16)
        np.save(file, np.array(np.nan if value is None else value), allow_pickle=False)
    file.flush()


def _load(file) -> Centrelines:
    stored = {each.name: np.load(file) for each in fields(Centrelines)}
    values = {name: value if value.ndim else None for name, value in stored.items()}
    for name in MEASURED:
        values[name] = None if values[name] is None else values[name].astype(np.float32)
    values["names"] = tuple(str(name) for name in values["names"])
    return Centrelines(**values)
