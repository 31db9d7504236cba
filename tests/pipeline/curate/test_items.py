"""What there is to look at, and how doubtful it is."""

import numpy as np
import pandas as pd
import pytest

from pipeline.contacts.corrections import table_of
from pipeline.curate.items import FLAGS, items_of, probabilities
from pipeline.curate.review import Review, Span
from pipeline.tables.columns import CONTACT_FLAGS


def review_with(probability, *spans, verdicts=()):
    """A review of one whisker's contacts, its contacts table and probabilities."""
    n = len(probability)
    table = pd.DataFrame({
        "whisker": ["C2"] * len(spans),
        "onset_frame": [a for a, _ in spans],
        "offset_frame": [b for _, b in spans],
        "duration_ms": [float(b - a) for a, b in spans],
        "peak_force_uN": [10.0] * len(spans),
        "flags": [""] * len(spans),
    })  # fmt: skip
    evidence = pd.DataFrame({"whisker": "C2", "frame": np.arange(n), "probability": probability})
    review = Review(table[["whisker", "onset_frame", "offset_frame"]], table_of(verdicts), n,
                    lambda corrections: None)  # fmt: skip
    return review, table, probabilities(evidence)


def course(n=200, **stretches):
    """Probability of contact that is 1 in the given stretches, or what is said third."""
    values = np.zeros(n)
    for start, stop, *level in stretches.values():
        values[start:stop] = level[0] if level else 1.0
    return values


def test_flags_that_are_weighed_are_flags_of_contacts():
    assert set(FLAGS) <= set(CONTACT_FLAGS)


def test_a_clear_contact_is_not_doubtful():
    (item,) = items_of(*review_with(course(a=(50, 80)), (50, 80)))
    assert (item.state, item.doubt, item.reasons) == ("detected", 0.0, ())


@pytest.mark.parametrize(
    ("probability", "reason"),
    [
        (course(a=(50, 80, 0.8)), "probability 0.80"),
        (course(a=(50, 80), b=(49, 50, 0.4)), "onset not sharp"),
        (course(a=(50, 80), b=(79, 80, 0.6)), "offset not sharp"),
    ],
)
def test_thin_evidence_is_doubtful(probability, reason):
    (item,) = items_of(*review_with(probability, (50, 80)))
    assert item.is_doubtful
    assert reason in item.reasons


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("duration_ms", 3.0, "short, 3 ms"),
        ("peak_force_uN", 0.4, "weak, 0.4 µN"),
        ("flags", "slip;large_deflection", "slips off: is the end right?"),
    ],
)
def test_weak_short_and_flagged_contacts_are_doubtful(column, value, reason):
    review, table, probability = review_with(course(a=(50, 80)), (50, 80))
    (item,) = items_of(review, table.assign(**{column: value}), probability)
    assert item.is_doubtful
    assert reason in item.reasons


def test_a_flag_on_the_force_alone_is_shown_but_not_doubtful():
    review, table, probability = review_with(course(a=(50, 80)), (50, 80))
    (item,) = items_of(review, table.assign(flags="large_deflection"), probability)
    assert not item.is_doubtful
    assert item.reasons == ("large deflection",)


def test_a_stretch_that_was_nearly_a_contact_is_shown_until_dismissed():
    review, *rest = review_with(course(a=(50, 80), b=(120, 130, 0.4)), (50, 80))
    possible = items_of(review, *rest)[1]
    assert (possible.span, possible.state) == (Span("C2", 120, 130), "possible")
    assert possible.is_doubtful
    review.dismiss(possible.span)
    assert items_of(review, *rest)[1].state == "dismissed"


def test_what_a_person_has_looked_at_is_not_doubtful():
    review, *rest = review_with(course(a=(50, 80, 0.6)), (50, 80))
    review.confirm(Span("C2", 50, 80))
    assert [(i.state, i.doubt) for i in items_of(review, *rest)] == [("confirmed", 0.0)]
    review.move(Span("C2", 50, 80), offset=90)
    assert [i.state for i in items_of(review, *rest)] == ["curated"]
    review.delete(Span("C2", 50, 90))
    assert [i.state for i in items_of(review, *rest)] == ["dismissed"]
