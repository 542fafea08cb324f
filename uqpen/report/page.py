"""Sections put together into one page, which needs nothing but itself."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import jinja2
import xarray as xr

from uqpen.archive.read import models_in
from uqpen.errors import ReportError
from uqpen.figures.page import check
from uqpen.figures.part import Part
from uqpen.files import replace_file
from uqpen.lookup import resolve
from uqpen.report import SECTIONS
from uqpen.report.blocks import Block, Chart, Charts, Heading
from uqpen.report.legend import OUTLINES, STROKES, colour
from uqpen.report.plotted import as_json
from uqpen.summary.digits import percent

__all__ = ["page", "write_report"]

_ASSETS = files("uqpen.report") / "assets"
_LIBRARY = files("uqpen.report") / "vendored" / "plotly-basic.min.js"


@dataclass(frozen=True)
class _Filled:
    """A section and what this archive has for it."""

    name: str
    title: str
    lead: str
    blocks: tuple[Block, ...]


def write_report(tree: xr.DataTree, path: str | Path) -> None:
    """Write the report of an archive to a file, which a browser opens without a network.

    What stood there is replaced in one step.

    Parameters
    ----------
    tree : DataTree
        What `run` returns, or `open_archive` reads.
    path : str or Path

    Raises
    ------
    ReportError
        If the file cannot be written.
    ArchiveError
        If the archive lacks what the report goes by.
    """
    content = page(tree).encode("utf-8", "replace")
    try:
        replace_file(Path(path), content)
    except OSError as error:
        raise ReportError(f"{path}: cannot be written: {error.strerror}") from None


def page(tree: xr.DataTree) -> str:
    """The report of an archive as HTML; the same text each time.

    Parameters
    ----------
    tree : DataTree

    Raises
    ------
    ArchiveError
        If the archive lacks what the report goes by.
    """
    check(tree)
    sections = [section for name in SECTIONS if (section := _filled(tree, name)).blocks]
    charts = [chart for section in sections for chart in _charts(section.blocks)]
    style, script = ((_ASSETS / name).read_text("utf-8") for name in ("page.css", "page.js"))
    library = _LIBRARY.read_text("utf-8")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("uqpen.report", "assets"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.globals |= {"id": id, "level": percent, "colour": colour}
    environment.globals |= {"strokes": STROKES, "outlines": OUTLINES}
    return environment.get_template("page.html").render(
        title=str(tree.attrs.get("title", "")),
        sections=sections,
        numbers={id(chart): number for number, chart in enumerate(charts)},
        data=as_json(charts),
        style=style,
        library=library,
        script=script,
        hashes=[_hash(text) for text in (library, script)],
    )


def _filled(tree: xr.DataTree, name: str) -> _Filled:
    """A section of all models of an archive."""
    section = SECTIONS[name]
    make = resolve(section.make)
    blocks: list[Block] = []
    for model in models_in(tree):
        found = list(make(Part(tree, model)))
        if found and model:
            blocks.append(Heading(model))
        blocks += found
    return _Filled(name, section.title, section.lead, tuple(blocks))


def _charts(blocks: Iterable[Block]) -> Iterator[Chart]:
    for block in blocks:
        if isinstance(block, Chart):
            yield block
        elif isinstance(block, Charts):
            yield from block.charts


def _hash(text: str) -> str:
    """What the page's policy knows a script by."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
