"""The documentation site: what it loads, what is found by a search, and its reference.

These need some of its pages; ``.ci/run`` builds all of them, without a warning.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

sphinx_english = pytest.importorskip("sphinx.search.en", reason="needs the extra `docs`")

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    line = [sys.executable, "-m", "sphinx", "-q", "-b", "html", "-d", f"{folder}/trees"]
    some = "index.md,figures.md,glossary.md,reference/api/MonteCarlo.rst"
    done = subprocess.run(
        [*line, "-D", f"include_patterns={some}", "docs", f"{folder}/html"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder / "html"


def test_pages_load_nothing_from_another_host(site: Path) -> None:
    loaded = re.compile(
        r'<(?:script|img|iframe)[^>]*src="(?:https?:)?//|<link[^>]*href="(?:https?:)?//|!\[.*\]\(https?:'
    )
    pages = list(site.rglob("*.html"))
    assert len(pages) > 4
    pages += (ROOT / "docs").rglob("*.md")
    assert [page.name for page in pages if loaded.search(page.read_text(encoding="utf-8"))] == []


def test_search_finds_the_terms_of_the_glossary(site: Path) -> None:
    written = (site / "searchindex.js").read_text(encoding="utf-8")
    index = json.loads(written.removeprefix("Search.setIndex(").removesuffix(")"))
    found = {*index["terms"], *index["titleterms"]}
    language = sphinx_english.SearchEnglish({})
    glossary = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^\| ([^|]+) \|", glossary, re.MULTILINE)
    words = {word for term in terms for word in language.split(term)}
    asked = {language.stem(word.lower()) for word in words if language.word_filter(word.lower())}
    assert len(terms) > 100
    assert asked - found == set()


def test_each_public_name_has_a_page_with_its_parameters(site: Path) -> None:
    import uqpen

    names = {name for name in dir(uqpen) if not name.startswith("_")}
    assert {page.stem for page in (ROOT / "docs" / "reference" / "api").iterdir()} == names
    page = (site / "reference" / "api" / "MonteCarlo.html").read_text(encoding="utf-8")
    assert "uqpen." in page
    assert "at_most" in page
