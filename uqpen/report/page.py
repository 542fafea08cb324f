"""Sections put together into one self-contained page."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import xarray as xr

from uqpen.archive.read import is_benchmark, model_trees
from uqpen.charts.chart import Block
from uqpen.core.errors import ReportError
from uqpen.core.files import replace_file
from uqpen.core.lookup import resolve
from uqpen.figures.page import check_archive
from uqpen.report import SECTIONS, ReportSection
from uqpen.report.anchors import block_anchors
from uqpen.report.blocks import Fold, Heading, find_charts, find_explorers
from uqpen.report.masthead import page_facts, page_heading, page_reference
from uqpen.report.page_assets import (
    OUTLINES,
    STROKES,
    colour_name,
    page_library,
    page_script,
    page_style,
    script_hash,
)
from uqpen.report.plotly import charts_json
from uqpen.report.user_defined_sections import SectionFunction, UserDefinedSection, find_sections
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text
from uqpen.results.texts import plain_text

__all__ = ["FilledSection", "PageHead", "render_page", "report_page", "write_page", "write_report"]

# Required, so that a mistyped name does not overwrite a study or an archive.
_ENDINGS = (".html", ".htm")

# Control characters, marks of text direction, lone surrogates, and noncharacters.
_UNFIT = re.compile(
    "[\\x00-\\x08\\x0b-\\x1f\\x7f-\\x9f\\u061c\\u200e\\u200f\\u202a-\\u202e\\u2066-\\u2069"
    "\\ud800-\\udfff\\ufdd0-\\ufdef\\ufffe\\uffff]"
)


class FilledSection(NamedTuple):
    """A section of a page with its name in links, and its blocks for an archive."""

    name: str
    section: ReportSection
    blocks: tuple[Block, ...]


def write_report(
    tree: xr.DataTree,
    path: str | Path,
    *,
    sections: Sequence[str | SectionFunction] = (),
    full: bool = False,
) -> None:
    """Write the report of an archive to a file, which a browser opens without a network.

    An existing file is replaced in one step.

    Parameters
    ----------
    tree : DataTree
        As `run` returns it, or `open_archive` reads it.
    path : str or Path
        A file that ends in .html or .htm.
    sections : sequence of str or callable
        Sections of one's own. Each is a function that takes an `ArchiveView` and yields blocks, or
        a reference to it such as ``"my_section.py:my_section"``. No archive names one.
    full : bool
        Whether all parts are open, so that they are printed; otherwise those for a statistician are
        folded.

    Raises
    ------
    ReportError
        If the name has another ending than .html or .htm, or the file cannot be written; or if a
        section of one's own fails.
    ArchiveError
        If the archive lacks what the report goes by.
    """
    write_page(path, lambda: report_page(tree, sections, full=full))


def write_page(path: str | Path, make: Callable[[], str]) -> None:
    """Make a page and write it to a file, which is replaced in one step.

    Raises
    ------
    ReportError
        If the name has another ending than .html or .htm, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in _ENDINGS:
        found = f"found the ending {path.suffix or 'none'}"
        raise ReportError(f"{path}: {found}; expected {' or '.join(_ENDINGS)}")
    content = make().encode("utf-8")
    try:
        replace_file(path, content)
    except OSError as error:
        raise ReportError(f"{path}: cannot be written: {error.strerror}") from None


def report_page(
    tree: xr.DataTree, sections: Sequence[str | SectionFunction] = (), *, full: bool = False
) -> str:
    """The report of an archive as HTML; the same text each time.

    Raises
    ------
    ReportError
        If a section of one's own fails; see `write_report`.
    ArchiveError
        If the archive lacks what the report goes by.
    """
    every = list(_sections(tree, find_sections(sections)))
    notes = (filled.section.absence_note for filled in every if not filled.blocks)
    shown = [filled for filled in every if filled.blocks]
    return _render(tree, shown, list(filter(None, notes)), full=full)


def _render(
    tree: xr.DataTree, sections: Sequence[FilledSection], lacks: Sequence[str], *, full: bool
) -> str:
    return render_page(PageHead.of_archive(tree), sections, lacks, full=full)


class PageHead(NamedTuple):
    """Title of a page, the facts below it, and the reference that copied texts carry."""

    title: str
    facts: Sequence[str]
    study: str  # begins the names of files
    reference: str

    @classmethod
    def of_archive(cls, tree: xr.DataTree) -> PageHead:
        """Return the head of an archive's page."""
        study = str(tree.attrs.get("study_name", ""))
        return cls(page_heading(tree), list(page_facts(tree)), study, page_reference(tree))


def render_page(
    head: PageHead,
    sections: Sequence[FilledSection],
    lacks: Sequence[str],
    *,
    full: bool = False,
) -> str:
    """Return a page as HTML.

    `lacks` names what it has no sections for.
    """
    charts = [chart for filled in sections for chart in find_charts(filled.blocks)]
    explorers = [each for filled in sections for each in find_explorers(filled.blocks)]
    # By identity, as the content of a chart has no hash.
    numbers = {
        id(each): number for blocks in (charts, explorers) for number, each in enumerate(blocks)
    }
    anchors = block_anchors((filled.name, filled.blocks) for filled in sections)
    library, script = page_library(), page_script()
    return (
        _environment()
        .get_template("page.html")
        .render(
            title=head.title,
            facts=head.facts,
            sections=sections,
            lacks=lacks,
            is_full=full,
            number_of=lambda chart: numbers[id(chart)],
            anchor_of=lambda block: anchors[id(block)],
            study=head.study,
            reference=head.reference,
            data=charts_json(charts, explorers),
            style=page_style(),
            library=library,
            script=script,
            hashes=[script_hash(text) for text in (library, script)],
        )
    )


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("uqpen.report", "assets"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        finalize=_legible_text,
    )
    environment.globals |= {"level": percent_text, "colour": colour_name}
    environment.globals |= {"strokes": STROKES, "outlines": OUTLINES}
    return environment


def _sections(tree: xr.DataTree, own: Sequence[UserDefinedSection]) -> Iterator[FilledSection]:
    """Yield all sections for an archive of its kind; some may be empty.

    User-defined ones stand before the last, which states how the archive was made.
    """
    kind = "benchmark" if is_benchmark(tree) else "study"
    if own and kind == "benchmark":
        raise ReportError("the report of a benchmark of methods has no further sections")
    check_archive(tree)
    # Shared by the sections, so that each statistic is taken out of its group once.
    views = [ArchiveView(tree, model) for model in model_trees(tree)]
    for name, section in SECTIONS.items():
        if section.of not in (kind, "any"):
            continue
        if name == next(reversed(SECTIONS)):
            yield from (_user_defined_section(tree, views, each) for each in own)
        blocks = _model_blocks(views, section, resolve(section.function))
        yield FilledSection(name, section, tuple(blocks))


def _user_defined_section(
    tree: xr.DataTree, views: Sequence[ArchiveView], own: UserDefinedSection
) -> FilledSection:
    """Return a user-defined section, which can be put on a page."""
    filled = FilledSection(
        own.name, own.section, tuple(_model_blocks(views, own.section, own.blocks))
    )
    with own.function.in_context():  # the content of a block can be anything
        _render(tree, [filled], [], full=False)
    return filled


def _model_blocks(
    views: Sequence[ArchiveView], section: ReportSection, make: SectionFunction
) -> Iterator[Block]:
    for view in views[:1] if section.is_common else views:
        blocks = list(make(view))
        if blocks and view.model and not section.is_common:
            blocks = [Fold(view.model, tuple(map(_below_model, blocks)), level=3)]
        yield from blocks


def _below_model(block: Block) -> Block:
    """Return a block with its headings, if it has any, below that of a model."""
    if isinstance(block, Heading):
        return replace(block, level=4)
    if isinstance(block, Fold):
        level = 4 if block.level else 0
        return replace(block, level=level, blocks=tuple(map(_below_model, block.blocks)))
    return block


def _legible_text(value: Any) -> Any:
    """Return a text with characters that a page can show; others are spelled out."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return _UNFIT.sub(lambda found: plain_text(found[0]), value.replace("\r\n", "\n"))
