"""Values of session.toml that are possible, but not those of any animal or camera in use.

Typical mistakes are a length in a wrong unit, and the rate at which a file is played back.
"""

from pipeline.errors import some_of
from pipeline.session.schema import Settings

# base radius over length: 37.3 µm over 18.3 mm of the mouse's C2 (Hires, Efros & Svoboda, J.
# Neurosci. 33:9576, 2013); from 61 µm over 37 mm of A1 to 43 µm over 6 mm of E6 of the rat, by the
# equations of Belli et al., J. Neurophysiol. 117:1807 (2017)
THINNEST, THICKEST = 1 / 610, 1 / 150
SHORTEST_MM, LONGEST_MM = 6, 44  # whole ones of the rat, E6 and E1 (Belli et al. 2017)
BEYOND = 2.0  # times these, for other species and for what is left of a worn or cut whisker
USUAL_CONTACT_MS = 16.0  # median of 12,417 contacts (Hires, Efros & Svoboda, 2013, Fig. 3e)
MOST_MM = BEYOND * LONGEST_MM  # of a whisker, given or seen in a picture
MOST_NAMED = 3  # whiskers in a sentence


def doubtful_values(settings: Settings):
    """Yield a sentence about each kind of value that is hardly true, and what to do.

    The frame rate: at less than one frame in the usual time of a contact (16 ms, Hires, Efros &
    Svoboda 2013) most contacts are never seen; 24 to 60 frames/s are rates of playback. The base
    radius: whiskers of mice and rats are 150 to 610 times as long as it (Hires et al. 2013; Belli
    et al. 2017); half as much and twice as much are believed. To be too thick is judged by the
    whole cone, of which a cut whisker is a part; too thin, by the whisker. Where both are in
    proportion, they may be measured at another picture's scale: then the length is too large.
    """
    rate = settings.recording.frames_per_second
    if rate * 1e-3 * USUAL_CONTACT_MS < 1:
        yield (
            f"[recording] frames_per_second = {rate:g}: a contact usually lasts "
            f"{USUAL_CONTACT_MS:g} ms, less than one frame; if that is the rate at which the file "
            "is played back, write the camera's, on which times, vibrations and contacts depend"
        )
    odd = [whisker for whisker in settings.whisker if _is_odd(whisker)]
    if odd:
        yield _of_radius(odd)
    long = [w for w in settings.whisker if (w.length_mm or 0) > MOST_MM]
    if long and not odd:
        yield (
            f"[[whisker]] length_mm = {_listed(long, 'length_mm')}: those of mice and rats are "
            f"{SHORTEST_MM} to {LONGEST_MM} mm long; is it in another unit, or was it measured at "
            "another picture's pixels per mm?"
        )


def _is_odd(whisker) -> bool:
    """Whether a whisker is thicker or thinner than any that is published."""
    if whisker.missing_dimensions:
        return False
    radius_mm, cone_mm = 1e-3 * whisker.base_radius_um, 1e3 * whisker.cone_length
    too_thick = radius_mm > BEYOND * THICKEST * cone_mm
    return too_thick or radius_mm < THINNEST / BEYOND * whisker.length_mm


def _listed(whiskers, key) -> str:
    """Values of a key, with the whiskers' names."""
    return some_of([f"{getattr(w, key):g} ({w.name})" for w in whiskers], MOST_NAMED)


def _of_radius(odd) -> str:
    first = odd[0]
    usual = [f"{1e3 * first.length_mm * ratio:.0f}" for ratio in (THINNEST, THICKEST)]
    return (
        f"[[whisker]] base_radius_um = {_listed(odd, 'base_radius_um')}: whiskers of mice and "
        f"rats that are {first.length_mm:.3g} mm long have {' to '.join(usual)} µm; is it in "
        "another unit, or are length_mm and cone_length_mm? Forces scale with the radius' fourth "
        "power"
    )
