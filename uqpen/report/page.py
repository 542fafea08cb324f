"""Sections put together into one self-contained page."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import xarray as xr

from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.charts.chart import Block, Chart
from uqpen.charts.marks import CROSS, END
from uqpen.core.errors import ReportError
from uqpen.core.files import replace_file
from uqpen.core.labels import CONTENT, RUNS
from uqpen.core.lookup import resolve
from uqpen.execution import run_count
from uqpen.figures.page import check_archive
from uqpen.models.user_module import FunctionFamily, UserDefinedFunction
from uqpen.report import SECTIONS, ReportSection
from uqpen.report.blocks import Fold, Heading, RunExplorer, find_charts, find_explorers, flattened
from uqpen.report.plotly import charts_json
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import count_text, percent_text
from uqpen.results.method_comparison import MethodComparison
from uqpen.results.texts import plain_text
from uqpen.study import SECTIONS as STUDY_SECTIONS

# Head of a page: its title, the facts below it, and the reference that copied texts carry.

# Most characters of a title, or of another text at the head.
_LONGEST = 1000


def page_heading(tree: xr.DataTree) -> str:
    """The title of an archive's page."""
    title = _cut_text(str(tree.attrs.get("title", "")).strip()) or "A study without a title"
    return f"{title}: benchmark of methods" if is_benchmark(tree) else title


def _all_facts(tree: xr.DataTree) -> Iterator[str]:
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    yield from _methods(tree) if is_benchmark(tree) else _runs(tree)
    for section in STUDY_SECTIONS.values():
        if section.fact and (value := str(tree.attrs.get(section.attribute, ""))):
            yield section.fact.replace("{value}", value)
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"


def _runs(tree: xr.DataTree) -> Iterator[str]:
    models = model_trees(tree)
    if len(models) > 1:
        yield f"models {', '.join(models)}"
    elif name := str(tree.attrs.get("model_name", "")):
        yield f"model {name}"
    first = next(iter(models.values()))
    designs = group_names(first, RUNS)
    runs = sum(run_count(read_group(first, RUNS, design)) for design in designs)
    each = " of each" * (len(models) > 1)
    yield f"{count_text(runs, 'run')}{each} by {count_text(len(designs), 'design')}"


def _methods(tree: xr.DataTree) -> Iterator[str]:
    comparison = MethodComparison.of(tree)
    sources = count_text(len({method.source for method in comparison.methods}), "method")
    budgets = count_text(len(comparison.budgets), "budget")
    yield f"{sources} at {budgets}, {comparison.repeats} times each"


def _cut_text(text: str) -> str:
    """Shorten a text; a browser would need minutes for a megabyte."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


# Reference to an archive, which goes along with what is copied from its page.

# Digits of a hash: enough to tell archives apart.
_DIGITS = 16


def page_reference(tree: xr.DataTree) -> str:
    """Title, study, hash of the archive, and version of uqpen.

    The hash is the SHA-256 of the record ``content_sha256``, which has the hash of every group.
    """
    return plain_text("; ".join(_parts(tree)), 400)


def _parts(tree: xr.DataTree) -> Iterator[str]:
    yield page_heading(tree)
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    if record := tree.attrs.get(CONTENT):
        yield f"archive sha256 {hashlib.sha256(str(record).encode()).hexdigest()[:_DIGITS]}"
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"


# Names of the headings and charts of a page, for links to them.

_LONGEST_NAME = 60


def block_anchors(sections: Iterable[tuple[str, Iterable[Block]]]) -> dict[int, str]:
    """Return a name for each heading and chart, by the identity of its block.

    A name is made of the section, the headings above, and the title, so it stays the same while the
    page around it changes.
    """
    found: dict[int, str] = {}
    taken: set[str] = set()
    for section, blocks in sections:
        # Also the name of the section's own heading.
        taken |= {section, f"{section}-title"}
        for block, path in _titled_blocks(blocks):
            name = _unused_name("-".join(filter(None, map(_slug, (section, *path)))), taken)
            taken |= {name, f"{name}-pair"}
            found[id(block)] = name
    return found


def _titled_blocks(blocks: Iterable[Block]) -> Iterator[tuple[Block, tuple[str, ...]]]:
    """Yield headings and charts, each with the headings that it stands below and its own title."""
    above: dict[int, str] = {}
    for block in flattened(blocks):
        if heading := _heading(block):
            level, text = heading
            above = {higher: each for higher, each in above.items() if higher < level}
            above[level] = text
            yield block, tuple(above.values())
        elif isinstance(block, Chart | RunExplorer):
            yield block, (*above.values(), block.title)


def _heading(block: Block) -> tuple[int, str] | None:
    """Return the level and the text of a heading; None of another block."""
    if isinstance(block, Heading):
        return block.level, block.text
    return (block.level, block.title) if isinstance(block, Fold) and block.level else None


def _unused_name(name: str, taken: set[str]) -> str:
    number, found = 1, name
    while found in taken:
        number += 1
        found = f"{name}-{number}"
    return found


def _slug(text: str) -> str:
    """Return a text in lower case with hyphens, which needs no escape in an address."""
    return "-".join(re.findall(r"[a-z0-9]+", text.lower()))[:_LONGEST_NAME].strip("-")


# Assets of a page: its style and scripts, and the symbols of its legends.

_ASSETS = files("uqpen.report") / "assets"
_LIBRARY = files("uqpen.report") / "vendored" / "plotly-basic.min.js"
_STYLES = ("page.css", "controls.css")
# In the order in which they need each other; together they are one function, which shares its names
# with nothing else.
_SCRIPTS = (
    "charts.js",
    "selection.js",
    "runs.js",
    "thresholds.js",
    "places.js",
    "address.js",
    "contents.js",
    "tables.js",
    "parallel.js",
    "explorer.js",
    "images.js",
    "page.js",
)


# Legend symbols of marks, as Plotly draws them.

# SVG paths of markers and dashes of lines, by Plotly's names.
OUTLINES = {
    "circle": "M-5,0a5,5 0 1,0 10,0a5,5 0 1,0 -10,0z",
    "square": "M-4.5,-4.5h9v9h-9z",
    "triangle-up": "M0,-5.5L5,4H-5z",
    "diamond": "M0,-6L6,0L0,6L-6,0z",
    "triangle-down": "M0,5.5L5,-4H-5z",
    "pentagon": "M0,-5.5L5.2,-1.7L3.2,4.5H-3.2L-5.2,-1.7z",
    "cross": "M-1.8,-5.4h3.6v3.6h3.6v3.6h-3.6v3.6h-3.6v-3.6h-3.6v-3.6h3.6z",
    "star-diamond": "M0,-6L1.8,-1.8L6,0L1.8,1.8L0,6L-1.8,1.8L-6,0L-1.8,-1.8z",
    "triangle-left": "M-5.5,0L4,-5V5z",
    "triangle-right": "M5.5,0L-4,-5V5z",
    CROSS: "M-4,-6L0,-2L4,-6L6,-4L2,0L6,4L4,6L0,2L-4,6L-6,4L-2,0L-6,-4z",
    END: "M-1,-6h2v12h-2z",
}
STROKES = {
    "solid": "none",
    "dash": "8 5",
    "dot": "2 3",
    "dashdot": "8 3 2 3",
    "6px,3px": "6 3",
    "longdashdot": "11 3 2 3",
    "4px,4px": "4 4",
    "longdash": "11 4",
    "2px,5px": "2 5",
    "8px,2px,2px,2px": "8 2 2 2",
}


def colour_name(series: int | str) -> str:
    """The name of a colour in the style sheet."""
    return f"s{series % 10}" if isinstance(series, int) else series


# User-defined sections: functions that yield blocks, beside those of the package.

SectionFunction = Callable[[ArchiveView], Iterable[Block]]

_SECTION = FunctionFamily(
    {name: section.function for name, section in SECTIONS.items()},
    "uqpen.sections",
    "section",
    "my_section.py:my_section",
    ReportError,
)


class UserDefinedSection(NamedTuple):
    """User-defined section."""

    name: str  # the name that links have
    function: UserDefinedFunction  # takes an `ArchiveView`, and yields blocks

    @property
    def section(self) -> ReportSection:
        """Entry of the page's contents, from the function's docstring."""
        function = self.function
        title = function.title.removesuffix(".")
        return ReportSection(title, function.introduction, function.reference)

    def blocks(self, view: ArchiveView) -> list[Block]:
        """Return its blocks for an archive; a ReportError if it fails, or yields something else."""
        with self.function.in_context():
            found = list(self.function.function(view))
        for block in found:
            if not isinstance(block, Block):
                text = f"it yields an object of class {type(block).__name__}, not a Block"
                raise self.function.failure(text)
        return found


def find_sections(named: Sequence[str | SectionFunction]) -> list[UserDefinedSection]:
    """Return the sections with names or references, in their order.

    Each is the name of an installed section; or a reference to a function, relative to the current
    folder; or the function itself.

    Raises
    ------
    UnknownNameError
        If there is no such section.
    ReportError
        If a function cannot be loaded, or a section of the page is asked for again.
    """
    for each in named:
        if isinstance(each, str) and each in SECTIONS:
            raise ReportError(f'the section "{each}" is on every page already')
    functions = [_SECTION.find(each, Path.cwd()) for each in named]
    return [
        UserDefinedSection(f"own-{number}", function)
        for number, function in enumerate(functions, 1)
    ]


# The page.

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

    A ReportError is raised as by `write_report`.
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
    """The report of an archive as HTML; the same text each time. It raises as `write_report`."""
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
        facts = [_cut_text(text) for text in _all_facts(tree) if text.strip()]
        return cls(page_heading(tree), facts, study, page_reference(tree))


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
    style = "".join((_ASSETS / name).read_text("utf-8") for name in _STYLES)
    parts = "\n".join((_ASSETS / name).read_text("utf-8") for name in _SCRIPTS)
    script = f'"use strict";\n(() => {{\n{parts}}})();\n'
    library = _LIBRARY.read_text("utf-8")
    digests = (hashlib.sha256(text.encode("utf-8")).digest() for text in (library, script))
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
    return environment.get_template("page.html").render(
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
        style=style,
        library=library,
        script=script,
        # For the page's policy.
        hashes=[f"sha256-{base64.b64encode(each).decode('ascii')}" for each in digests],
    )


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
