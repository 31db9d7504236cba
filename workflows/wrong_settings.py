"""Settings with errors like a lab's: a rendered whisker is known exactly, a plucked one is not."""

import numpy as np

from pipeline.reports.error_budget import ASSUMED, taper_share
from pipeline.session.parameters import DEFAULTS
from synthetic.scoring.table_scoring import Z95

DIMENSIONS = {  # of session.toml: the quantity of the report's error budget that it errs by
    "base_radius_um": "base radius",
    "cone_length_mm": "cone length (taper)",
    "youngs_modulus_GPa": "Young's modulus",
}
SHORTEST_HIDDEN_MM = 0.1
SIZES = {each.source: each.size for each in ASSUMED}


def with_wrong_lengths(settings, rng):
    """The settings with hidden lengths and lengths off by what the standard errors assume."""

    def changed(whisker):
        given = whisker.hidden_length_mm, whisker.length_mm
        hidden, length = wrong_lengths_mm(*given, whisker.cone_length_mm, rng)
        return {"hidden_length_mm": hidden, "length_mm": length}

    return _with_whiskers(settings, changed)


def wrong_lengths_mm(hidden, length, cone, rng) -> tuple[float, float]:
    """A hidden length and a length off by what the standard errors assume; all in mm."""
    assumed = DEFAULTS.forces
    hidden += assumed.hidden_length_sd_mm * rng.standard_normal()
    length += assumed.tip_sd_mm * rng.standard_normal()
    return max(hidden, SHORTEST_HIDDEN_MM), min(length, cone)


def with_wrong_dimensions(settings, rng):
    """The settings with dimensions, modulus and scale off by what the error budget assumes."""

    def changed(whisker):
        new = {
            key: getattr(whisker, key) * (1 + SIZES[source] * rng.standard_normal())
            for key, source in DIMENSIONS.items()
        }
        # a cone that ends before the whisker does is refused
        new["cone_length_mm"] = max(new["cone_length_mm"], whisker.length_mm)
        return new

    recording = settings.recording
    scale = recording.pixels_per_mm * (1 + SIZES["scale of the image"] * rng.standard_normal())
    wrong = _with_whiskers(settings, changed)
    recording = recording.model_copy(update={"pixels_per_mm": scale})
    return wrong.model_copy(update={"recording": recording})


def _with_whiskers(settings, changed):
    whiskers = tuple(w.model_copy(update=changed(w)) for w in settings.whisker)
    return settings.model_copy(update={"whisker": whiskers})


def budget_covers(pairs, cone_lengths_mm: dict) -> np.ndarray:
    """Whether peak forces lie within 1.96 of their whole error budget, bool (contacts,).

    `pairs` as of `match_contacts`; `cone_lengths_mm` by whisker.
    """
    cone = pairs["whisker"].map(cone_lengths_mm).astype(float)  # of no contacts, too
    place = pairs["contact_arc_length_mm"]
    by_taper = 0.01 * pairs["peak_force_uN"] * taper_share(cone, place)
    parts = [pairs["peak_force_se_uN"]]
    for each in ASSUMED:
        per_percent = pairs[each.column] if each.column else by_taper
        parts.append(100 * each.size * per_percent)
    total = np.sqrt(np.sum(np.square(np.asarray(parts, float)), axis=0))
    error = (pairs["peak_force_uN"] - pairs["true_peak_force_uN"]).to_numpy(float)
    return np.abs(error) <= Z95 * total
