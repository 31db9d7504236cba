"""How the pictures of all `calibrate` commands are lettered and written."""

from string import ascii_lowercase

from pipeline.tables.whole_files import whole_file


def save(path, figure, lettered=()) -> None:
    """Write a figure, whole or not at all; the axes `lettered` get a, b, c, …"""
    for axes, letter in zip(lettered, ascii_lowercase, strict=False):
        axes.set_title(letter, loc="left", fontweight="bold")
        axes.spines[["top", "right"]].set_visible(False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)
