"""Reports as files: complete, the same each time, small, and sound HTML."""

import os
import re
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import ReportError
from uqpen.report import SECTIONS
from uqpen.report.page import page_heading, report_page, write_report

pytestmark = pytest.mark.slow

VENDORED = Path(uqpen.__file__).parent / "report" / "vendored"

NAMES = ["beam", "lost", "schema_1", "schema_1_several"]


class Outline(HTMLParser):
    """What stands in a page, and what is wrong with how its parts are nested."""

    EMPTY = ("meta", "link", "input", "br", "rect", "line", "path")
    # What ends a paragraph that is open.
    BLOCKS = ("p", "ul", "ol", "div", "table", "figure", "details", "section", "form")
    HEADINGS = ("h1", "h2", "h3", "h4")

    def __init__(self, text):
        super().__init__()
        self.faults = []
        self.ids = []
        self.links = []
        self.labels = []
        self.levels = []
        self.counts = Counter()
        self._open = []
        self.feed(text)
        self.close()
        self.faults += [f"<{tag}> is not closed" for tag in self._open]

    def handle_starttag(self, tag, attrs):
        reported = dict(attrs)
        if len(reported) < len(attrs):
            self.faults.append(f"<{tag}> has an attribute twice")
        if "p" in self._open and tag in (*self.BLOCKS, *self.HEADINGS):
            self.faults.append(f"<{tag}> in a paragraph")
        self.counts[tag] += 1
        self.levels += [int(tag[1])] if tag in self.HEADINGS else []
        self.ids += filter(None, [reported.get("id")])
        self.links += [target for target in [reported.get("href")] if target and target != "data:,"]
        if reported.get("role") == "img":
            self.labels.append(reported.get("aria-label") or "")
        if tag not in self.EMPTY:
            self._open.append(tag)

    def handle_startendtag(self, tag, attrs):
        if tag not in self.EMPTY:
            self.faults.append(f"<{tag}/> is closed at once")

    def handle_endtag(self, tag):
        if not self._open or self._open.pop() != tag:
            self.faults.append(f"</{tag}> at line {self.getpos()[0]} ends something else")


@pytest.mark.parametrize("name", NAMES)
def test_it_is_sound(page_of, name):
    text = page_of(name)
    outline = Outline(text)
    assert outline.faults == []
    assert [each for each, count in Counter(outline.ids).items() if count > 1] == []
    assert {link.removeprefix("#") for link in outline.links} <= set(outline.ids)
    assert outline.counts["caption"] == outline.counts["table"] > 0
    assert outline.counts["h1"] == 1
    steps = zip(outline.levels, outline.levels[1:], strict=False)
    assert [step for step in steps if step[1] - step[0] > 1] == []
    assert all(re.fullmatch(r"\S.+\. \S.+", label, re.DOTALL) for label in outline.labels)
    assert len(text.encode()) < 2_000_000, "to be sent"


def test_texts_that_mean_harm_leave_it_sound(hostile):
    text = report_page(hostile)
    outline = Outline(text)
    assert outline.faults == []
    assert outline.counts["script"] == 3
    assert outline.counts["img"] == 0
    assert re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\ud800-\udfff]", _own(text)) is None


def test_what_is_no_text_is_spelled_out(archives, tmp_path):
    tree = archives["lost"].copy()
    tree.attrs["title"] = "one\x00 two\ud83d three\x1b[31m four\u202e five\x85 six"
    tree.attrs["study_text"] = "first\r\nsecond\tthird\r"
    write_report(tree, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_bytes().decode("utf-8")
    assert "<title>one\\x00 two\\ud83d three\\x1b[31m four\\u202e five\\x85 six</title>" in text
    assert "\r" not in _own(text)


def test_a_study_without_a_title_has_a_heading(archives):
    tree = archives["lost"].copy()
    tree.attrs["title"] = " "
    assert "<h1>A study without a title</h1>" in report_page(tree)


def _own(text):
    """A page without the library."""
    return text.replace((VENDORED / "plotly-basic.min.js").read_text("utf-8"), "")


class TestSections:
    def test_those_that_an_archive_has_nothing_for_are_not_there(self, page_of):
        text = page_of("lost")
        shown = re.findall(r'<section id="(\w+)"', text)
        assert shown == re.findall(r'<li><a href="#(\w+)">', text)
        assert shown == [name for name in SECTIONS if name in shown]
        assert not {"distributions", "convergence", "course", "surrogates"} & set(shown)
        assert "losses" in shown
        assert "distributions" in re.findall(r'<section id="(\w+)"', page_of("beam"))


def test_outputs_stand_below_the_model_that_they_are_of(archives, monkeypatch):
    only = {"distributions": SECTIONS["distributions"]}
    monkeypatch.setattr("uqpen.report.page.SECTIONS", only)
    page = report_page(archives["rods"])
    section = page.split('<section id="distributions"')[1].split("</section>")[0]
    found = re.findall(r"<h([34])[^>]*>(.*?)</h", section)
    models = [text for level, text in found if level == "3"]
    assert models == ["original", "smoothed", "rigid"]
    assert len(re.findall(r"<details><summary><h3[ >]", section)) == 3
    assert found[1] == ("4", "depth of penetration (penetration_depth)")


class TestFolding:
    def test_parts_for_a_statistician_are_folded(self, page_of):
        text = page_of("schema_1")
        folded = re.findall(r'<section id="(\w+)"[^>]*>\s*<details class="part">', text)
        named = [name for name, section in SECTIONS.items() if section.is_folded]
        assert folded == [name for name in named if f'<section id="{name}"' in text]
        assert {"convergence", "surrogates", "archive"} <= {*folded}

    def test_a_full_page_has_everything_open(self, archives):
        text = _own(report_page(archives["schema_1"], full=True))
        assert re.findall(r"<details(?![^>]* open>)[^>]*>", text) == []
        assert 'class="screen"' not in text


class TestBytes:
    def test_they_are_the_same_in_another_process(self, archives, tmp_path):
        uqpen.write(archives["beam"], tmp_path / "archive.nc")
        write_report(uqpen.open_archive(tmp_path / "archive.nc"), tmp_path / "one.html")
        code = (
            "import sys, uqpen; from uqpen.report.page import write_report; "
            "write_report(uqpen.open_archive(sys.argv[1]), sys.argv[2])"
        )
        subprocess.run(
            [sys.executable, "-c", code, tmp_path / "archive.nc", tmp_path / "two.html"],
            env=os.environ | {"PYTHONHASHSEED": "7", "LC_ALL": "C", "TZ": "Asia/Tokyo"},
            check=True,
        )
        assert (tmp_path / "one.html").read_bytes() == (tmp_path / "two.html").read_bytes()

    def test_they_do_not_grow_with_the_runs(self):
        few, many = (len(report_page(_ishigami(runs)).encode()) for runs in (2_000, 20_000))
        assert abs(many - few) < 20_000


def _ishigami(runs):
    """A study of one design, and as many runs of a cheap model."""
    design = {"kind": "monte-carlo", "runs": runs}
    inputs = dict.fromkeys(("x1", "x2", "x3"), (-3, 3))
    return uqpen.run(
        uqpen.parse_study(study_text("ishigami", inputs=inputs, designs={"mc": design}))
    )


class TestFile:
    def test_folders_are_made_and_what_stood_there_is_replaced(self, archives, tmp_path):
        path = tmp_path / "new" / "page.html"
        for _ in range(2):
            write_report(archives["lost"], path)
        assert [each.name for each in path.parent.iterdir()] == ["page.html"]
        assert path.read_text("utf-8").startswith("<!DOCTYPE html>")

    def test_a_place_that_cannot_be_written(self, archives, tmp_path):
        file, folder = tmp_path / "file", tmp_path / "folder.html"
        file.write_text("mine")
        folder.mkdir()
        for path, reason in ((file / "a.html", f"{file} is no folder"), (folder, "it is a folder")):
            with pytest.raises(ReportError) as error:
                write_report(archives["lost"], path)
            assert str(error.value) == f"{path}: cannot be written: {reason}"
        assert sorted(tmp_path.rglob("*")) == [file, folder]
        assert file.read_text() == "mine"


def test_an_endless_title_is_cut(archives):
    tree = archives["lost"].copy()
    tree.attrs["title"] = "x" * 1_000_000
    assert page_heading(tree) == f"{'x' * 999}…"


def test_the_library_has_its_licence_and_its_version_beside_it():
    head = (VENDORED / "plotly-basic.min.js").read_text("utf-8")[:400]
    version = re.search(r"plotly\.js \(basic - minified\) v(\d+\.\d+\.\d+)", head)
    assert version
    licence = (VENDORED / "plotly-basic.LICENSE").read_text("utf-8")
    assert licence.startswith("MIT License")
    assert version[1] in (VENDORED / "README.md").read_text("utf-8")
