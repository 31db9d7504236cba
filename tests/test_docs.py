"""The documentation site builds without a warning; its tutorial works as it stands."""

import contextlib
import io
import re
import shlex
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from tutorial import blocks

import pipeline
import synthetic
import whiskermodel
from pipeline.app import cli, terminal

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
SHOWN = re.compile(r"^```text\n(.*?)^```", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"\d+(?:\.\d+)?")
ALIKE = 0.15  # relative, or in the unit shown: other machines and versions may give other digits


def follow(page) -> str:
    """Do what a page says, in the current folder, as a reader would; what that printed."""
    names, said = {}, io.StringIO()
    with contextlib.redirect_stdout(said), mpl.rc_context({"backend": "agg"}):
        for language, code in blocks(DOCS / page):
            if language == "python":
                exec(compile(code, page, "exec"), names)
                continue
            for line in code.splitlines():
                program, *arguments = shlex.split(line)
                assert program == "whiskerforce"
                with pytest.raises(SystemExit) as ended:
                    cli.main(arguments)
                assert not ended.value.code, line
    return said.getvalue()


def printed_as_shown(page, said):
    """Assert that the lines that a page shows were printed, with numbers like these."""
    lines = [(_words(line), _numbers(line)) for line in said.splitlines()]
    for block in SHOWN.findall((DOCS / page).read_text("utf-8")):
        for line in block.splitlines():
            alike = [numbers for words, numbers in lines if words == _words(line)]
            assert any(
                np.allclose(numbers, _numbers(line), rtol=ALIKE, atol=ALIKE) for numbers in alike
            ), line


def _words(line):
    return NUMBER.sub("#", line).split()


def _numbers(line):
    return [float(number) for number in NUMBER.findall(line)]


@pytest.mark.e2e
@pytest.mark.usefixtures("lossless_is_quick")
def test_the_tutorial_works_word_for_word(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # processes of their own would load all again
    monkeypatch.setattr(terminal, "cores", lambda: 1)
    said = follow("tutorial.md")
    found, true = map(int, re.search(r"(\d+) contacts found, (\d+) true ones", said).groups())
    assert found == true >= 3
    printed_as_shown("tutorial.md", said)
    assert float(re.search(r"off by ([\d.]+) % at most", said)[1]) < 5
    assert (tmp_path / "my_figure.png").stat().st_size > 20_000
    assert (tmp_path / "my_videos" / "session_preview.png").is_file()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built in a process of its own; a warning counts as an error."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "-d"]
    command += [str(out / "doctrees"), str(DOCS), str(out / "html")]
    built = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    assert built.returncode == 0, built.stderr
    return out / "html"


@pytest.mark.slow
def test_every_page_is_on_the_site(site):
    contents = (site / "index.html").read_text(encoding="utf-8")
    for page in DOCS.glob("*.md"):
        assert f'href="{page.stem}.html"' in contents or page.stem == "index", page.name


@pytest.mark.slow
@pytest.mark.parametrize("package", [pipeline, pipeline.calibrate, whiskermodel, synthetic])
def test_every_public_name_is_explained_on_the_site(site, package):
    text = (site / "api.html").read_text(encoding="utf-8")
    for name in package.__all__:
        if not callable(getattr(package, name)):
            continue  # a module has a section of its own, and PRESETS a sentence
        assert f'id="{package.__name__}.{name}"' in text, name


@pytest.mark.slow
def test_links_of_pages_outside_lead_to_pages(site):
    for page in ("quickstart", "contributing", "changelog"):
        text = (site / f"{page}.html").read_text(encoding="utf-8")
        assert not re.findall(r'href="(?!https?:)[^"#]*\.md', text), page


@pytest.mark.slow
def test_formulas_are_set(site):
    text = (site / "forces.html").read_text(encoding="utf-8")
    assert text.count('class="math notranslate nohighlight"') > 15


def test_no_page_holds_what_a_program_says_beside_its_tables():
    for page in (*DOCS.glob("*.md"), ROOT / "README.md"):
        assert "/tmp/tmp" not in page.read_text("utf-8"), page.name


def test_no_command_on_a_page_names_a_folder_of_one_machine():
    for page in (ROOT / "README.md", *DOCS.glob("*.md")):
        assert not re.findall(r"--(?:out|write|figure) /\S*", page.read_text()), page.name


def test_commands_write_into_the_page_that_shows_them():
    for page in DOCS.glob("*.md"):
        text = page.read_text("utf-8")
        for written in re.findall(r"--write (docs/\S+)", text):
            assert (ROOT / written).resolve() == page
            assert ": begin -->" in text, written
