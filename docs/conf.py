"""The documentation site: `python -m sphinx -W -b html docs build/site`."""

import re
from pathlib import Path

from pipeline import __version__

ROOT = Path(__file__).parents[1]
OUTSIDE = {  # pages whose text lies in the repository's first folder
    "quickstart": "README.md",
    "contributing": "CONTRIBUTING.md",
    "changelog": "CHANGELOG.md",
}

project = "whiskerforce"
author = "The whiskerforce developers"
copyright = author
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
]
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3

default_role = "literal"
autodoc_member_order = "groupwise"
autodoc_typehints = "none"
autodoc_class_signature = "separated"
autodoc_default_options = {"exclude-members": "model_config, __init__, __new__"}
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "furo"
html_copy_source = False
html_title = "whiskerforce"


def take_text(app, page, source):
    """Put in the text of pages that lie outside, pages that the index leaves out, and links."""
    if page in OUTSIDE:
        source[0] = (ROOT / OUTSIDE[page]).read_text(encoding="utf-8")
        source[0] = source[0].replace("](docs/", "](").replace("](CITATION", "](path:../CITATION")
    if page == "index":
        more = sorted(
            p.stem
            for p in (ROOT / "docs").glob("*.md")
            if p.stem not in ("index", *source[0].split())
        )
        source[0] = source[0].replace("changelog\n", "\n".join(["changelog", *more, ""]))
    for name, file in OUTSIDE.items():
        source[0] = re.sub(rf"\]\((\.\./)?{re.escape(file)}", f"]({name}.md", source[0])


def keep_signs(app, what, name, thing, options, lines):
    """Docstrings are plain text: a star or a bar outside of code is no markup."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith(">>>"):
            parts = line.split("`")
            parts[::2] = [re.sub(r"([*|])", r"\\\1", part) for part in parts[::2]]
            lines[i] = "`".join(parts)


def setup(app):
    """Sphinx calls this."""
    app.connect("source-read", take_text)
    app.connect("autodoc-process-docstring", keep_signs, priority=100)
