"""A figure from a file of the user's own: by reference, by function, and what goes wrong in it."""

import re
from pathlib import Path

import pytest

import uqpen
from uqpen.core.errors import FigureError, UnknownNameError
from uqpen.figures.page import available
from uqpen.figures.panel import Panel
from uqpen.testing import check_figure

PAGE = (Path(__file__).parents[2] / "docs" / "extending" / "chart.md").read_text(encoding="utf-8")
FIGURE = re.findall(r"```python\n(# my_figure.py.*?)```", PAGE, re.DOTALL)[0]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with the file of the page."""
    (tmp_path / "my_figure.py").write_text(FIGURE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def archive(folder, study_of):
    """An archive in another folder than the file."""
    (folder / "archives").mkdir()
    uqpen.write(uqpen.run(study_of("a + b", a=(0, 1), b=(0, 1))), folder / "archives" / "a.nc")
    return folder / "archives" / "a.nc"


def _write(body, imports="from uqpen.figures.panel import Panel"):
    Path("own.py").write_text(f"{imports}\ndef own(view):\n    {body}\n")


def test_the_command_draws_it_from_the_current_folder(archive, command_line):
    done = command_line("figure", str(archive), "my_figure.py:quartiles")
    assert (done.code, done.out) == (0, "figure: quartiles.svg\n")
    assert "from the lower to the upper" in Path("quartiles.svg").read_text()
    done = command_line("figure", str(archive), "cdf", "my_figure.py:quartiles", "-o", "both.svg")
    assert done.code == 0


def test_a_function_is_a_figure(archive):
    names = {}
    exec(FIGURE, names)
    tree = uqpen.open_archive(archive)
    check_figure(names["quartiles"], tree)
    (axes,) = uqpen.figure(tree, names["quartiles"]).axes
    assert axes.get_title(loc="left") == "y"
    assert [label.get_text() for label in axes.get_yticklabels()] == ["some"]


def test_texts_of_an_archive_are_plain(archive):
    def hostile(view):
        yield Panel("$\\frac{1}{0}$\x1b", lambda axes: ["$\\undefined$"])

    page = uqpen.figure(uqpen.open_archive(archive), hostile)
    assert page.axes[0].get_title(loc="left") == "$\\frac{1}{0}$\\x1b"
    check_figure(hostile, uqpen.open_archive(archive))


@pytest.mark.parametrize(
    ("reference", "body", "message"),
    [
        ("no.py:own", "", 'there is no file "no.py"; expected a reference like "my_figure.py:my_'),
        ("own.py:other", "yield", '"own.py" has no function "other"; it defines own'),
        ("own.py:", "yield", 'is not of the form "my_figure.py:my_figure"'),
        ("own.py:own", "return 1 / 0", "own.py:own: ZeroDivisionError: division by zero (line 3)"),
        (
            "own.py:own",
            "yield 1",
            "own.py:own: it yields an object of class int, not a Chart or a Panel",
        ),
        (
            "own.py:own",
            "yield Panel('title', lambda axes: axes.plots())",
            "own.py:own: AttributeError: 'Axes' object has no attribute 'plots' (line 3)",
        ),
        ("own.py:own", "yield Panel('title', lambda axes: [1])", "are not all texts"),
        ("own.py:own", "yield from ()", 'the archive has nothing for the figure "own.py:own"; it'),
        ("own.py:own", "view.unit('z')", "own.py:own: KeyError: "),
        ("own.py:Panel.title", "yield", 'has no function "Panel.title"'),
    ],
)
def test_a_mistake_is_one_sentence(archive, command_line, reference, body, message):
    _write(body)
    done = command_line("figure", str(archive), reference, "-o", "a.svg")
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert not Path("a.svg").exists()


def test_a_file_that_cannot_be_imported_is_one_sentence(archive, command_line):
    _write("yield", "import numpi")
    done = command_line("figure", str(archive), "own.py:own")
    assert (done.code, done.err) == (2, "\"own.py\": No module named 'numpi'\n")


def test_an_installed_package_adds_figures(archive, command_line, install):
    install("charts", FIGURE, "[uqpen.figures]\nquartiles = uqpen_test_charts:quartiles\n")
    tree = uqpen.open_archive(archive)
    assert available(tree)["quartiles"] == "Middle half of the runs of each design"
    done = command_line("figure", str(archive), "quartiles")
    assert done.code == 0, done.err
    assert Path("quartiles.svg").exists()
    with pytest.raises(UnknownNameError, match='no figure "quartile"; did you mean "quartiles"'):
        uqpen.figure(tree, "quartile")


def test_a_package_that_cannot_be_imported_is_named(archive, command_line, install):
    install("charts", "import numpi\n", "[uqpen.figures]\nmine = uqpen_test_charts:mine\n")
    done = command_line("figure", str(archive), "--list")
    assert done.code == 0, done.err
    message = (
        'the installed package "uqpen-test-charts", which provides "mine", cannot be loaded: '
        "ModuleNotFoundError: No module named 'numpi'"
    )
    assert message in done.out
    with pytest.raises(FigureError, match=re.escape(message)):
        uqpen.figure(uqpen.open_archive(archive), "mine")
