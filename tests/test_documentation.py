"""Every block of Python, TOML or uqpen's commands in the documentation runs, or parses.

A block that cannot run has a comment before it, `<!-- not run: reason -->`, and is parsed only.
"""

import ast
import functools
import linecache
import re
import shlex
import tomllib
from pathlib import Path

import click
import pytest
from page_blocks import blocks_of

import uqpen
from uqpen.cli.main import COMMANDS
from uqpen.core.lookup import resolve
from uqpen.study.load import parse_study

ROOT = Path(__file__).parents[1]
# Without the pages that the build of the site writes.
WRITTEN = sorted({*(ROOT / "docs").rglob("*.md")} - {*(ROOT / "docs" / "reference").rglob("*.md")})
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *WRITTEN]


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def _of(language):
    return [block for block in BLOCKS if block.language == language]


def _commands():
    """The calls of uqpen in blocks of a shell, and those shown with their output."""
    for block in [*_of("sh"), *_of("text")]:
        for line in block.text.splitlines():
            if block.language == "text" and not line.startswith("$ "):
                continue
            for call in line.removeprefix("$ ").split("&&"):
                if re.match(r"\s*(\S*/)?uqpen\s", call):
                    words = shlex.split(call, comments=True)[1:]
                    yield f"{block} {' '.join(words)}", words


@pytest.fixture(scope="module")
def folder(tmp_path_factory, concrete_text):
    """A folder with what the pages name; they show how to call a study, not what it finds."""
    folder = tmp_path_factory.mktemp("documentation")
    for name in ("studies", "archives", "docs"):
        (folder / name).mkdir()
    without_surrogates = concrete_text.partition("[surrogates")[0]
    (folder / "studies" / "concrete.toml").write_text(without_surrogates, encoding="utf-8")
    return folder


def _without_code(page):
    text = re.sub(r"^(```|~~~).*?^\1$", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    return re.sub(r"`[^`\n]*`", lambda code: code[0].strip("`").translate(BRACKETS), text)


# Brackets in code are part of a heading's text and no link.
BRACKETS = str.maketrans(dict.fromkeys("[]()<>", "."))


@functools.cache
def _anchors(page):
    """The names that GitHub gives to the headings of a page."""
    anchors = []
    for heading in re.findall(r"^#{1,6} +(.*?)$", _without_code(page), re.MULTILINE):
        shown = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)
        name = re.sub(r"[^\w -]", "", shown.lower()).replace(" ", "-")
        repeated = sum(
            re.fullmatch(rf"{re.escape(name)}(-\d+)?", each) is not None for each in anchors
        )
        anchors.append(f"{name}-{repeated}" if repeated else name)
    return set(anchors)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: page.name)
def test_its_links_lead_to_files_and_headings(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", _without_code(page)):
        if not re.match(r"[a-z]+:", link):
            name, _, anchor = link.partition("#")
            target = (page.parent / name).resolve() if name else page
            assert target.exists(), link
            assert not anchor or anchor in _anchors(target), link


def test_a_decision_is_linked_by_its_own_number():
    for page in [*PAGES, ROOT / "CHANGELOG.md"]:
        for number, link in re.findall(r"\[(\d{3})\]\((\S+?)\)", page.read_text(encoding="utf-8")):
            assert Path(link).name.startswith(f"{number}-"), link


def test_a_block_that_is_not_run_says_why():
    marks = sum(page.read_text(encoding="utf-8").count("<!-- not run:") for page in PAGES)
    assert marks == sum(bool(block.reason) for block in BLOCKS)


# The runs of studies that pages have run several times, and as many as their lines need.
FEWER = {
    "MonteCarlo(runs=2000)": "MonteCarlo(runs=400)",
    "LatinHypercube(runs=200)": "LatinHypercube(runs=50)",
    "SobolSequence(runs=512)": "SobolSequence(runs=64)",
}


def test_no_study_with_fewer_runs_is_out_of_date():
    assert all(any(many in block.text for block in _of("python")) for many in FEWER)


# Tutorials run as a whole, with the programs that they need, in a test of their own.
NO_TUTORIALS = [page for page in PAGES if page.parent.name != "tutorials"]


@pytest.mark.slow
@pytest.mark.parametrize("page", NO_TUTORIALS, ids=lambda page: page.name)
def test_its_python_runs(page, folder, concrete, monkeypatch):
    """The blocks of a page in their order; those with prompts have a test of their own."""
    blocks = [block for block in _of("python") if block.page == page and ">>>" not in block.text]
    if not any(not block.reason for block in blocks):
        return
    monkeypatch.chdir(folder)
    archive = folder / "archives" / "concrete.nc"
    if not archive.exists():
        uqpen.write(concrete, archive)
    names = {}
    for block in blocks:
        text = block.text
        for many, few in FEWER.items():
            text = text.replace(many, few)
        tree = compile(text, str(block), "exec")
        linecache.cache[str(block)] = len(text), None, text.splitlines(keepends=True), str(block)
        if not block.reason:
            exec(tree, names)


def test_python_that_is_not_run_parses():
    for block in _of("python"):
        if ">>>" not in block.text:
            ast.parse(block.text, str(block))


@pytest.mark.parametrize("block", _of("toml"), ids=str)
def test_its_toml_parses_and_a_whole_study_is_one(block, tmp_path):
    content = tomllib.loads(block.text)
    if {"seed", "model", "inputs", "designs"} <= content.keys() and not (
        block.reason or block.page not in NO_TUTORIALS
    ):
        for other in BLOCKS:
            if other.page == block.page and other.file:
                (tmp_path / other.file).write_text(other.text, encoding="utf-8")
                (tmp_path / other.file).chmod(0o755)
        parse_study(block.text, folder=tmp_path)


@pytest.mark.parametrize(
    "words", [words for _, words in _commands()], ids=[name for name, _ in _commands()]
)
def test_its_commands_parse(words, folder, monkeypatch):
    monkeypatch.chdir(folder)
    if words == ["--version"]:
        return
    command = resolve(COMMANDS[words[0]])
    for word in words[1:]:
        if word.endswith((".toml", ".nc", ".json")) and not Path(word).exists():
            Path(word).parent.mkdir(parents=True, exist_ok=True)
            Path(word).touch()
    assert isinstance(command, click.Command)
    command.make_context(words[0], words[1:])
