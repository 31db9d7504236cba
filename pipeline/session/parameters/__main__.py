"""Print docs/parameters.md: every parameter with unit, default, range, meaning and source."""

import inspect

from pipeline.session.parameters import Parameters
from pipeline.session.quantities import fields_of, limits_of

HEAD = """# Parameters

Written from the code by `python -m pipeline.session.parameters > docs/parameters.md`; do not edit.

The analysis works with these values. Most sessions need no change: what differs between
cameras, whiskers and poles stands in the other tables of session.toml. To change one, add a
table for its room:

```toml
[advanced.scene]
least_obstacle_mm2 = 0.1
```

A value outside its range or an unknown name is an error that names the key. *Source* says
where the default comes from: literature, measured (on real or rendered videos), or chosen."""


def page() -> str:
    """docs/parameters.md as text."""
    lines = [HEAD]
    for room, field in fields_of(Parameters).items():
        lines += ["", f"## [advanced.{room}]", "", inspect.getdoc(field.annotation), ""]
        lines += ["| parameter | default | unit | range | meaning | source |", "|---" * 6 + "|"]
        lines += [_row(key, each) for key, each in fields_of(field.annotation).items()]
    return "\n".join(lines) + "\n"


def _row(key, field) -> str:
    limits = limits_of(field)
    cells = (
        f"`{key}`", f"{field.default:g}", limits.unit, f"{limits.low:g} to {limits.high:g}",
        field.description, field.json_schema_extra["source"],
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    print(page(), end="")
