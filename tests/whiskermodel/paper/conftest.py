"""All that `whiskerforce paper` makes, made once."""

import pytest

from whiskermodel.paper import figures
from whiskermodel.paper.files import write_paper


@pytest.fixture(scope="package")
def made(tmp_path_factory):
    """What `write_paper` wrote (folder, paths, lines said), and the figures by name."""
    out, said, drawn = tmp_path_factory.mktemp("paper") / "new" / "folder", [], {}
    save = figures.save

    def keep(path, figure, kind):
        drawn[path.name.split(".")[1]] = figure
        save(path, figure, kind)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "save", keep)
        paths = write_paper(out, progress=said.append, grid=(7, 6))
    return (out, paths, said), drawn


@pytest.fixture
def written(made):
    return made[0]


@pytest.fixture
def drawn(made):
    return made[1]
