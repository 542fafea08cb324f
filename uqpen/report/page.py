"""Sections put together into one page, which needs nothing but itself."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import xarray as xr

from uqpen.archive.read import models_in
from uqpen.errors import ReportError
from uqpen.figures.page import check
from uqpen.figures.part import Part
from uqpen.figures.texts import plain
from uqpen.files import replace_file
from uqpen.labels import HEAD_TO_HEAD, KIND
from uqpen.lookup import resolve
from uqpen.report import SECTIONS, SECTIONS_OF_COMPARISON
from uqpen.report.blocks import Block, Chart, Charts, Heading
from uqpen.report.head_to_head.contest import check_comparison
from uqpen.report.legend import OUTLINES, STROKES, colour
from uqpen.report.masthead import facts, heading
from uqpen.report.plotted import as_json
from uqpen.summary.digits import percent

__all__ = ["page", "write_report"]

_ASSETS = files("uqpen.report") / "assets"
_LIBRARY = files("uqpen.report") / "vendored" / "plotly-basic.min.js"

# Control characters, what turns texts around, halves of pairs, and what is no character.
_UNFIT = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u202a-\\u202e\\u2066-\\u2069"
    "\\ud800-\\udfff\\ufdd0-\\ufdef\\ufffe\\uffff]"
)


@dataclass(frozen=True)
class _Filled:
    """A section and what this archive has for it."""

    name: str
    title: str
    lead: str
    blocks: tuple[Block, ...]
    lacks: str


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
    content = page(tree).encode("utf-8")
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
    every = list(_sections(tree))
    sections = [section for section in every if section.blocks]
    charts = [chart for section in sections for chart in _charts(section.blocks)]
    style, script = ((_ASSETS / name).read_text("utf-8") for name in ("page.css", "page.js"))
    library = _LIBRARY.read_text("utf-8")
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("uqpen.report", "assets"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_legible,
    )
    environment.globals |= {"id": id, "level": percent, "colour": colour}
    environment.globals |= {"strokes": STROKES, "outlines": OUTLINES}
    return environment.get_template("page.html").render(
        title=heading(tree),
        facts=facts(tree),
        sections=sections,
        lacks=[section.lacks for section in every if section.lacks and not section.blocks],
        numbers={id(chart): number for number, chart in enumerate(charts)},
        data=as_json(charts),
        style=style,
        library=library,
        script=script,
        hashes=[_hash(text) for text in (library, script)],
    )


def _sections(tree: xr.DataTree) -> Iterator[_Filled]:
    """All sections for an archive of its kind, some of which may be empty."""
    if tree.attrs.get(KIND) != HEAD_TO_HEAD:
        check(tree)
        yield from (_filled(tree, name) for name in SECTIONS)
        return
    check_comparison(tree)
    for name, section in SECTIONS_OF_COMPARISON.items():
        yield _Filled(name, *section[:2], tuple(resolve(section.make)(tree)), section.lacks)


def _filled(tree: xr.DataTree, name: str) -> _Filled:
    """A section of all models of an archive."""
    section = SECTIONS[name]
    make = resolve(section.make)
    blocks: list[Block] = []
    models = list(models_in(tree))
    for model in models[:1] if section.is_common else models:
        found = list(make(Part(tree, model)))
        if found and model and not section.is_common:
            blocks.append(Heading(model))
        blocks += found
    return _Filled(name, *section[:2], tuple(blocks), section.lacks)


def _charts(blocks: Iterable[Block]) -> Iterator[Chart]:
    for block in blocks:
        if isinstance(block, Chart):
            yield block
        elif isinstance(block, Charts):
            yield from block.charts


def _legible(value: Any) -> Any:
    """A text of which a page can show each character; others are spelled out."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return _UNFIT.sub(lambda found: plain(found[0]), value.replace("\r\n", "\n"))


def _hash(text: str) -> str:
    """What the page's policy knows a script by."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
