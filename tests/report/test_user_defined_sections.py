"""A section of the report from a file of the user's own, and what goes wrong in it."""

import re
from pathlib import Path

import pytest

import uqpen
from uqpen.core.errors import ReportError, UnknownNameError
from uqpen.core.labels import BENCHMARK, KIND
from uqpen.report.blocks import Heading, Remarks, Text
from uqpen.report.page import report_page
from uqpen.testing import check_section

PAGE = (Path(__file__).parents[2] / "docs" / "extending" / "chart.md").read_text(encoding="utf-8")
SECTION = re.findall(r"```python\n(# my_section.py.*?)```", PAGE, re.DOTALL)[0]
HARM = "<img src=x onerror=hacked=1></script>"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with the file of the page."""
    (tmp_path / "my_section.py").write_text(SECTION)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def tree(folder, study_of):
    """An archive of a study."""
    return uqpen.run(study_of("a + b", a=(0, 1), b=(0, 1)))


def _function():
    names = {}
    exec(SECTION, names)
    return names["extremes"]


def test_the_command_adds_it_before_the_last_section(tree, command_line):
    Path("archives").mkdir()
    uqpen.write(tree, "archives/a.nc")
    done = command_line("report", "archives/a.nc", "--section", "my_section.py:extremes")
    assert (done.code, done.out) == (0, "report: archives/a.html\n"), done.err
    page = Path("archives/a.html").read_text()
    names = re.findall(r'<section id="([\w-]+)"', page)
    assert names[-2:] == ["own-1", "archive"]
    assert '<h2 id="own-1-title">Most extreme runs</h2>' in page
    assert "The smallest and the largest values of each output, and all runs" in page
    assert page == report_page(uqpen.open_archive("archives/a.nc"), [_function()])


def test_without_it_the_page_is_as_before(tree):
    assert "own-1" not in report_page(tree)


def test_its_contract_is_kept(tree):
    check_section(_function(), tree)

    def nothing(view):
        yield from ()

    assert "own-1" not in report_page(tree, [nothing])
    with pytest.raises(AssertionError, match="has something for this archive"):
        check_section(nothing, tree)


def test_texts_are_escaped(tree):
    def hostile(view):
        yield Heading(HARM)
        yield Text(f"{HARM}\x1b\u202e")
        yield Remarks(HARM, (HARM,))

    hostile.__doc__ = f"{HARM}\n\n{HARM}"
    page = report_page(tree, [hostile])
    assert HARM not in page
    assert page.count("&lt;img src=x onerror=hacked=1&gt;&lt;/script&gt;") == 7
    assert "\x1b" not in page


@pytest.mark.parametrize(
    ("reference", "body", "message"),
    [
        ("no.py:own", "", 'there is no file "no.py"; expected a reference like "my_section.py:my_'),
        ("own.py:other", "yield", '"own.py" has no function "other"; it defines own'),
        ("own.py:own", "return 1 / 0", "own.py:own: ZeroDivisionError: division by zero (line 4)"),
        ("own.py:own", "yield 'text'", "own.py:own: it yields an object of class str, not a Block"),
        ("own.py:own", "yield Table(None)", "own.py:own: UndefinedError: "),
        (
            "own.py:own",
            "yield Chart('t', 's', Axis('x'), Axis('y'), ({'y': [1.0]},))",
            "own.py:own: TypeError: a mark of a chart is of class dict",
        ),
        ("own.py:own", "import sys; sys.exit(3)", "own.py:own: SystemExit: 3 (line 4)"),
        ("answer", "", 'the section "answer" is on every page already'),
    ],
)
def test_a_mistake_is_one_sentence(tree, command_line, reference, body, message):
    uqpen.write(tree, "a.nc")
    Path("own.py").write_text(
        "from uqpen.charts.chart import Axis, Chart\n"
        f"from uqpen.report.blocks import Table\ndef own(view):\n    {body}\n"
    )
    done = command_line("report", "a.nc", "--section", reference)
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert not Path("a.html").exists()


def test_an_archive_of_a_benchmark_takes_none(tree):
    tree.attrs[KIND] = BENCHMARK
    with pytest.raises(ReportError, match="a benchmark of methods has no further sections"):
        report_page(tree, [_function()])


def test_an_installed_package_adds_sections(tree, install):
    install("charts", SECTION, "[uqpen.sections]\nextremes = uqpen_test_charts:extremes\n")
    assert report_page(tree, ["extremes"]) == report_page(tree, [_function()])
    with pytest.raises(UnknownNameError, match='no section "extreme"; did you mean "extremes"'):
        report_page(tree, ["extreme"])
    install("charts", "import numpi\n", "[uqpen.sections]\nextremes = uqpen_test_charts:extremes\n")
    with pytest.raises(ReportError, match='package "uqpen-test-charts", which provides "extremes"'):
        report_page(tree, ["extremes"])
