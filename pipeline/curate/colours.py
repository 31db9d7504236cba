"""Colours of the page's plots; page.css has the same for everything else."""

STATES = {
    "detected": "#3b82c4",
    "confirmed": "#23946a",
    "curated": "#8455c6",
    "doubtful": "#d98500",
    "possible": "#d98500",
    "dismissed": "#9aa5b1",
    "adding": "#d1345b",
}
HATCHED = "curated"  # whose colour looks like that of "detected" to red-green blind people
WHISKERS = ("#1d5fa8", "#c2571a", "#3c7d3c", "#8a3f92", "#8a6d1f", "#287f86")
LINES = ("#35c4ff", "#ffb02e", "#7be05a", "#ff7bd5", "#f4f06a", "#58e6d2")  # on the picture
CONTACT, POLE, CURSOR = "#ff4f79", "#ffd54a", "#d1345b"
INK, SOFT, GRID = "#1d2733", "#667384", "#e9edf1"


def state_of(item) -> str:
    """Name of an item's colour."""
    return "doubtful" if item.state == "detected" and item.is_doubtful else item.state
