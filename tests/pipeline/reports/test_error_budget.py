"""What moves the peak forces of a session: from the columns of its contacts."""

import numpy as np
import pandas as pd
import pytest
from results_folder import CONTACTS, SETTINGS

from pipeline.reports.error_budget import session_budget
from pipeline.tables import files
from pipeline.tables.columns import CONTACT_COLUMNS

ERRORS = {  # of a contact of 10 µN
    "peak_force_se_uN": 0.5,
    "tracking_se_uN": 0.3,
    "hidden_length_se_uN": 0.4,
    "radius_uN_per_percent": 0.4,
    "modulus_uN_per_percent": 0.1,
    "scale_uN_per_percent": 0.35,
}


def with_errors(**errors):
    """Contacts of 4, 10 and 30 µN with the same errors."""
    return [{**each, **ERRORS, **errors} for each in CONTACTS]


def budget_of(contacts):
    table = files.as_table(pd.DataFrame(contacts), CONTACT_COLUMNS)
    whisker = SETTINGS.whisker[0].si()
    rows = session_budget(table, {("one", "C2"): whisker, ("two", "C2"): whisker})
    return {row["source"]: row for row in rows}


def test_budget_from_the_table_of_contacts():
    budget = budget_of(with_errors())
    middle = 0.7 * 8.0  # mm, of the bent part
    expected = {  # of the median contact, 10 µN
        "standard error in the tables": 0.05,
        "of it: tracking noise": 0.03,
        "of it: hidden length": 0.04,
        "base radius": 4 * 0.01,
        "cone length (taper)": 4 * middle / (18.947 - middle) * 0.02,
        "Young's modulus": 0.05,
        "scale of the image": 3.5 * 0.005,
    }
    for source, size in expected.items():
        assert budget[source]["middle"] == pytest.approx(size), source
    total = np.linalg.norm([expected[s] for s in expected if not s.startswith("of it")])
    assert budget["all together"]["middle"] == pytest.approx(total)
    assert budget["base radius"]["known"] == "assumed"
    assert budget["of it: hidden length"]["known"] == "measured"
    low, high = np.percentile([0.5 / 4, 0.5 / 10, 0.5 / 30], [5, 95])
    assert budget["standard error in the tables"]["low"] == pytest.approx(low)
    assert budget["standard error in the tables"]["high"] == pytest.approx(high)


def test_an_error_that_is_not_known_adds_nothing():
    known, unknown = (budget_of(with_errors(peak_force_se_uN=se)) for se in (0.0, np.nan))
    assert known["all together"]["middle"] == unknown["all together"]["middle"] > 0
