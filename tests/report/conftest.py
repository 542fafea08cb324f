"""Archives that only reports are tried on, and a browser that shows their pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from browsers import IDLE, chromium, wait_for_charts
from playwright.sync_api import Browser, Page

import uqpen
from uqpen.report.page import report_page, write_report


@pytest.fixture(scope="session")
def page_of(archives: Mapping[str, xr.DataTree]) -> Callable[[str], str]:
    """The page of an archive, made when it is first asked for."""
    return cache(lambda name: report_page(archives[name]))


@pytest.fixture(scope="session")
def wide(
    tmp_path_factory: pytest.TempPathFactory, made_once: Callable[..., xr.DataTree]
) -> xr.DataTree:
    """A study of 24 inputs, each with a name of 24 characters."""
    return made_once("wide", lambda: _wide(tmp_path_factory.mktemp("wide")))


def _wide(folder: Path) -> xr.DataTree:
    names = [f"heat_transfer_in_layer_{letter}" for letter in "abcdefghijklmnopqrstuvwx"]
    body = " + ".join(f"{place} * {name}" for place, name in enumerate(names, 1))
    source = f"def warm({', '.join(names)}):\n    return {{'temperature_of_outer_wall': {body}}}\n"
    (folder / "wall.py").write_text(source)
    units = [f'{name} = "W m-2 K-1"' for name in names]
    distributions = [f'{name} = "(1 ± 0.1) W m-2 K-1"' for name in names]
    text = [
        "seed = 1",
        '[model]\npython = "wall.py:warm"\nvectorized = true',
        *("[model.inputs]", *units),
        '[model.outputs]\ntemperature_of_outer_wall = "K"',
        *("[inputs]", *distributions),
        '[designs.monte_carlo]\nkind = "monte-carlo"\nruns = 300',
        '[designs.trajectories]\nkind = "morris"\ntrajectories = 4',
    ]
    return uqpen.run(uqpen.parse_study("\n".join(text), folder=folder))


# What a page must show as it stands, by the names that it takes the place of; a name of a variable
# or a group holds no slash.
DESIGN = "<u onclick=hacked=1>%{z}"
NAMES = {"load": "<img src=x onerror=hacked=1>", "deflection": "<b>%{x}&amp;<i>"}
TEXT = (
    "</script><script>hacked=1</script><img src=x onerror=hacked=1>"
    '<a href="javascript:hacked=1">a</a> %{y} &lt; $\\frac{1}{0}$ \x00\x1b\u202e'
)


@pytest.fixture(scope="session")
def hostile(archives: Mapping[str, xr.DataTree]) -> xr.DataTree:
    """The beam, every text and name of which means harm."""
    nodes = {
        "/".join(map(_renamed, node.path.split("/"))): _harming(node.to_dataset(inherit=False))
        for node in archives["beam"].subtree
    }
    tree = xr.DataTree.from_dict(nodes)
    for name in ("title", "study_text", "study_name", "model_name", "platform"):
        tree.attrs[name] += TEXT
    return tree


def _harming(reported: xr.Dataset) -> xr.Dataset:
    """A group with all its names and texts replaced."""
    names = [str(name) for name in {*reported.variables, *reported.dims}]
    reported = reported.rename({name: _renamed(name) for name in names if _renamed(name) != name})
    for name, variable in reported.variables.items():
        for key, text in variable.attrs.items():
            if isinstance(text, str):
                variable.attrs[key] = _renamed(text) + TEXT * (key in ("long_name", "note"))
        if variable.dtype.kind in "OU":
            texts = [_renamed(text) for text in variable.values.ravel().tolist()]
            if name in ("lost_reason", "content"):
                texts = [text + TEXT for text in texts]
            filled = np.array(texts, dtype=object).reshape(variable.shape)
            reported[name] = variable.copy(data=filled)
    return reported


def _renamed(text: str) -> str:
    if text == "only":
        return DESIGN
    for name, other in NAMES.items():
        text = text.replace(name, other)
    return text


WIDE = 1200


# A browser runs a loop of events, which other tests must not meet: it is closed behind these.
_browser: list[Browser] = []
_closing = ExitStack()


@pytest.fixture(scope="module")
def browser() -> Browser:
    """The browser of all reports."""
    if not _browser:
        _browser.append(_closing.enter_context(chromium()))
    return _browser[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Iterator[None]:
    """Close the browser where the next test is of another folder."""
    yield
    if nextitem is None or Path(__file__).parent not in nextitem.path.parents:
        _closing.close()
        _browser.clear()


class Shown(NamedTuple):
    """A page in the browser, and what it said or asked for that it should not have."""

    page: Page
    said: list[str]


Show = Callable[..., Page]


class Reports:
    """Reports of archives, each opened when it is asked for, and then kept open."""

    def __init__(self, browser: Browser, folder: Path, tree_of: Callable[[str], Any]) -> None:
        self._browser = browser
        self._folder = folder
        self._tree_of = tree_of
        self._shown: dict[tuple[str, bool], Shown] = {}

    def opened(self, name: str, *, charts: bool = True) -> Shown:
        if (name, charts) not in self._shown:
            self._shown[name, charts] = self._open(self.path(name).as_uri(), charts=charts)
        return self._shown[name, charts]

    def close(self) -> None:
        for shown in self._shown.values():
            shown.page.close()

    def path(self, name: str) -> Path:
        path = self._folder / f"{name}.html"
        if not path.exists():
            write_report(self._tree_of(name), path)
        return path

    def _open(self, address: str, *, charts: bool) -> Shown:
        page = self._browser.new_page(viewport={"width": WIDE, "height": 900})
        page.set_default_timeout(110_000)  # of a busy machine
        said: list[str] = []
        page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda asked: said.append(asked.url) if asked.url != address else None)
        if not charts:
            page.add_init_script(IDLE)
        page.goto(address)
        return Shown(page, said)


@pytest.fixture(scope="module")
def reports(
    browser: Browser,
    archives: Mapping[str, xr.DataTree],
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Reports]:
    """Of the archives of all tests, and of those of fixtures."""

    def tree_of(name: str) -> Any:
        return archives[name] if name in archives else request.getfixturevalue(name)

    opened = Reports(browser, tmp_path_factory.mktemp("reports"), tree_of)
    yield opened
    opened.close()


@pytest.fixture
def show(reports: Reports) -> Iterator[Show]:
    """The report of an archive as if it were just opened; in the end it has said nothing."""
    seen: list[Shown] = []

    def show(name: str, *, charts: bool = True) -> Page:
        seen.append(reports.opened(name, charts=charts))
        page = seen[-1].page
        page.set_viewport_size({"width": WIDE, "height": 900})
        page.emulate_media(media="screen", color_scheme="light")
        page.mouse.move(0, 0)
        page.evaluate("delete document.documentElement.dataset.theme, scrollTo(0, 0)")
        if charts:
            wait_for_charts(page)
        return page

    yield show
    assert [line for shown in seen for line in shown.said] == []
