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

LISTS = "Parameters", "Attributes"  # sections of docstrings
ITEM = re.compile(r"([\w*]+(?:, [\w*]+)*) ?: (.+)")

project = "whiskerforce"
author = "The whiskerforce developers"
copyright = author
release = version = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"]
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
html_static_path = ["site.css"]
html_css_files = ["site.css"]


def take_text(app, page, source):
    """Put in the text of pages that lie outside, pages that the index leaves out, and links."""
    if page in OUTSIDE:
        source[0] = (ROOT / OUTSIDE[page]).read_text(encoding="utf-8")
        source[0] = source[0].replace("](docs/", "](").replace("](CITATION", "](path:../CITATION")
    if page == "index":
        listed = {"index", *re.findall(r"^(?:.*<)?(\w+)>?$", source[0], re.MULTILINE)}
        more = sorted({p.stem for p in (ROOT / "docs").glob("*.md")} - listed)
        source[0] = source[0].replace("changelog\n", "\n".join(["changelog", *more, ""]))
    for name, file in OUTSIDE.items():
        source[0] = re.sub(rf"\]\((\.\./)?{re.escape(file)}", f"]({name}.md", source[0])
    source[0] = re.sub(r"\[(docs/)?\w+\.md\]\((\w+\.md\))", r"[](\2", source[0])  # by its title


def keep_signs(app, what, name, thing, options, lines):
    """Docstrings are plain text: a star or a bar outside of code is no markup.

    In sections, "names : what they are" becomes an item of a list.
    """
    if what == "property" and lines:
        lines[0] = lines[0].replace(": ", " – ", 1)  # before a colon a type is expected
    lines[:] = _with_lists(lines)
    for i, line in enumerate(lines):
        if not line.lstrip().startswith(">>>"):
            parts = line.split("`")
            parts[::2] = [re.sub(r"([*|])", r"\\\1", part) for part in parts[::2]]
            lines[i] = "`".join(parts)


def _with_lists(lines):
    """Docstring lines whose sections on parameters and attributes are lists."""
    out, listing = [], False
    for i, line in enumerate(lines):
        rule = lines[i + 1] if i + 1 < len(lines) else ""
        if line in LISTS and set(rule) == {"-"}:
            listing = True
            out += [f".. rubric:: {line}", ""]
        elif set(line) == {"-"} and i and lines[i - 1] in LISTS:
            continue
        elif set(rule) == {"-"}:  # another section
            listing = False
            out.append(line)
        elif listing and (item := ITEM.match(line)):
            names = ", ".join(f"`{name}`" for name in item[1].split(", "))
            out.append(f"- {names}: {item[2]}")
        elif listing and line.startswith("    "):
            out.append(f"  {line.strip()}")
        else:
            listing = listing and not line
            out.append(line)
    return out


def setup(app):
    """Sphinx calls this."""
    app.connect("source-read", take_text)
    app.connect("autodoc-process-docstring", keep_signs, priority=100)
