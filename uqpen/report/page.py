"""Sections put together into one page, which needs nothing but itself."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

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
from uqpen.report import SECTIONS, SECTIONS_OF_COMPARISON, Section
from uqpen.report.blocks import Block, Heading, charts_in
from uqpen.report.head_to_head.contest import check_comparison
from uqpen.report.legend import OUTLINES, STROKES, colour
from uqpen.report.masthead import facts, heading
from uqpen.report.plotted import as_json
from uqpen.summary.digits import percent

__all__ = ["page", "write_report"]

_ASSETS = files("uqpen.report") / "assets"
# So that no study or archive is overwritten by a slip.
_ENDINGS = (".html", ".htm")
_LIBRARY = files("uqpen.report") / "vendored" / "plotly-basic.min.js"

# Control characters, what turns texts around, halves of pairs, and what is no character.
_UNFIT = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u202a-\\u202e\\u2066-\\u2069"
    "\\ud800-\\udfff\\ufdd0-\\ufdef\\ufffe\\uffff]"
)


class _Filled(NamedTuple):
    """A section, by the name that links have, and what an archive has for it."""

    name: str
    section: Section
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
        If the name has another ending than .html or .htm, or the file cannot be written.
    ArchiveError
        If the archive lacks what the report goes by.
    """
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        found = f"found the ending {path.suffix or 'none'}"
        raise ReportError(f"{path}: {found}; expected {' or '.join(_ENDINGS)}")
    content = page(tree).encode("utf-8")
    try:
        replace_file(path, content)
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
    sections = [filled for filled in every if filled.blocks]
    charts = [chart for filled in sections for chart in charts_in(filled.blocks)]
    # By identity, as what a chart holds has no hash.
    numbers = {id(chart): number for number, chart in enumerate(charts)}
    style, script = ((_ASSETS / name).read_text("utf-8") for name in ("page.css", "page.js"))
    library = _LIBRARY.read_text("utf-8")
    return (
        _environment()
        .get_template("page.html")
        .render(
            title=heading(tree),
            facts=facts(tree),
            sections=sections,
            lacks=[each.section.lacks for each in every if each.section.lacks and not each.blocks],
            number_of=lambda chart: numbers[id(chart)],
            data=as_json(charts),
            style=style,
            library=library,
            script=script,
            hashes=[_hash(text) for text in (library, script)],
        )
    )


def _environment() -> jinja2.Environment:
    """What sets the template, with escaping on."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("uqpen.report", "assets"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_legible,
    )
    environment.globals |= {"level": percent, "colour": colour}
    environment.globals |= {"strokes": STROKES, "outlines": OUTLINES}
    return environment


def _sections(tree: xr.DataTree) -> Iterator[_Filled]:
    """All sections for an archive of its kind, some of which may be empty."""
    if tree.attrs.get(KIND) != HEAD_TO_HEAD:
        check(tree)
        for name, section in SECTIONS.items():
            yield _Filled(name, section, tuple(_of_models(tree, section)))
        return
    check_comparison(tree)
    for name, section in SECTIONS_OF_COMPARISON.items():
        yield _Filled(name, section, tuple(resolve(section.make)(tree)))


def _of_models(tree: xr.DataTree, section: Section) -> Iterator[Block]:
    """What a section tells of each model of an archive, or of all of them together."""
    make = resolve(section.make)
    models = list(models_in(tree))
    for model in models[:1] if section.is_common else models:
        blocks = list(make(Part(tree, model)))
        if blocks and model and not section.is_common:
            yield Heading(model)
            blocks = [_below(block) for block in blocks]
        yield from blocks


def _below(block: Block) -> Block:
    """A block below the heading of a model."""
    return replace(block, level=4) if isinstance(block, Heading) else block


def _legible(value: Any) -> Any:
    """A text of which a page can show each character; others are spelled out."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return _UNFIT.sub(lambda found: plain(found[0]), value.replace("\r\n", "\n"))


def _hash(text: str) -> str:
    """What the page's policy knows a script by."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"
