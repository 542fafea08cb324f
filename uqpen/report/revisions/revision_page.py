"""The page of two archives side by side: what changed in the study, and how its answers moved."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import unified_diff
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.provenance import provenance_differences
from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.charts.axes import ValueAxis
from uqpen.charts.chart import Block
from uqpen.charts.distributions import Curve, overlaid_chart
from uqpen.charts.source_comparison import compared_statistics
from uqpen.core.catalogue import MEASURES
from uqpen.core.errors import ReportError, StudyError, toml_text
from uqpen.core.labels import INPUT, RUNS
from uqpen.core.lookup import resolve
from uqpen.core.status import STATUS_TEXT
from uqpen.execution import run_count, status_counts
from uqpen.figures.page import check_archive
from uqpen.report.blocks import Heading, Listing, Remarks, Table, Text
from uqpen.report.page import FilledSection, PageHead, render_page, write_page
from uqpen.report.revisions import REVISION_SECTIONS
from uqpen.results.archive_view import ArchiveView, output_heading
from uqpen.results.digits import estimate_texts, grouped_number
from uqpen.results.table import NOTHING, Conversion, OutputTable, identity, label_with_unit
from uqpen.results.texts import plain_text
from uqpen.study.document import parse_document


@dataclass(frozen=True)
class ModelPair:
    """The parts of two archives on a model of the same name."""

    first: ArchiveView  # of archive A
    second: ArchiveView  # of archive B

    @property
    def outputs(self) -> list[str]:
        """The scalar outputs of both that have the same unit in SI, in the order of A."""
        others = set(self.second.outputs).difference(self.first.fields, self.second.fields)
        return [name for name in self.first.outputs if name in others and self.has_same_unit(name)]

    @property
    def sources(self) -> list[str]:
        """The designs and surrogates of both; first that of A's main results."""
        first, second = self.first.statistics, self.second.statistics
        published = {*first.publications, *second.publications}
        common = [name for name in first.sources if name in second.sources]
        leading = self.first.leading_design
        return sorted((n for n in common if n not in published), key=lambda name: name != leading)

    def has_same_unit(self, output: str) -> bool:
        """Return whether an output of both has the same unit in SI."""
        units = {str(view.attributes(output).get("units")) for view in (self.first, self.second)}
        return len(units) == 1


@dataclass(frozen=True)
class ArchivePair:
    """Two archives of studies."""

    first: xr.DataTree  # archive A
    second: xr.DataTree  # archive B

    @cached_property
    def models(self) -> dict[str, ModelPair]:
        """The models of both, by their names; the only model of a study has none."""
        others = model_trees(self.second)
        return {
            name: ModelPair(ArchiveView(self.first, name), ArchiveView(self.second, name))
            for name in model_trees(self.first)
            if name in others
        }


def write_revision_report(
    first: xr.DataTree,
    second: xr.DataTree,
    path: str | Path,
    *,
    names: tuple[str, str] = ("", ""),
) -> None:
    """Write the page of two archives side by side to a file, which a browser opens offline.

    An existing file is replaced in one step.

    Parameters
    ----------
    first, second : DataTree
        Archives of studies, as `run` returns them, or `open_archive` reads them. The page calls
        them A and B.
    path : str or Path
        A file that ends in .html or .htm.
    names : tuple of str
        Names of the two, such as those of their files, for the head of the page.

    Raises
    ------
    ReportError
        If the name has another ending than .html or .htm, or the file cannot be written; or if
        one of them is the archive of a benchmark of methods.
    ArchiveError
        If an archive lacks what the report goes by.
    """
    write_page(path, lambda: revision_page(first, second, names=names))


def revision_page(
    first: xr.DataTree, second: xr.DataTree, *, names: tuple[str, str] = ("", "")
) -> str:
    """Return the page of two archives as HTML; see `write_revision_report`."""
    for tree in (first, second):
        if is_benchmark(tree):
            raise ReportError("only archives of studies are shown side by side, no benchmarks")
        check_archive(tree)
    pair = ArchivePair(first, second)
    every = [
        FilledSection(name, section, tuple(resolve(section.function)(pair)))
        for name, section in REVISION_SECTIONS.items()
    ]
    lacks = [filled.section.absence_note for filled in every if not filled.blocks]
    filled = [each for each in every if each.blocks]
    return render_page(_head(pair, names), filled, list(filter(None, lacks)))


def _head(pair: ArchivePair, names: tuple[str, str]) -> PageHead:
    heads = [PageHead.of_archive(each) for each in (pair.first, pair.second)]
    facts = [
        f"{label}: {', '.join(filter(None, [name, *head.facts]))}"
        for label, name, head in zip("AB", names, heads, strict=True)
    ]
    return PageHead(
        f"{' and '.join(dict.fromkeys(head.title for head in heads))}: A and B",
        facts,
        "_".join(dict.fromkeys(head.study for head in heads)),
        "; ".join(f"{label}: {head.reference}" for label, head in zip("AB", heads, strict=True)),
    )


# How the estimates moved.

_COLUMNS = ["A", "B", "B minus A", "intervals"]
_APART, _OVERLAP = "apart", "overlap"
_NOTE = (
    "Where the true values are the same, two 95 % intervals are apart in fewer than 1 of 10 cases, "
    "and in about 1 of 180 where they are equally wide and of independent runs. Intervals that "
    "overlap do not show that the true values are the same. If both studies drew the same points, "
    "smaller differences can be real: run both models in one study, which compares them run by run."
)


class _PairedEstimate(NamedTuple):
    """An estimate of both archives, of an output by a source."""

    label: str
    first: xr.DataArray
    second: xr.DataArray
    convert: Conversion

    @property
    def bounds(self) -> tuple[list[float], list[float]]:
        """Estimate, lower and upper of A and of B, in the unit that A shows."""
        pair = (self.convert(each.values) for each in (self.first, self.second))
        first, second = (np.asarray(each, dtype=np.float64).tolist() for each in pair)
        return first, second

    @property
    def difference(self) -> str:
        """The difference of the estimates, in the digits of the less certain one."""
        first, second = self.bounds
        value = second[0] - first[0]
        halves = [(each[2] - each[1]) / 2 for each in (first, second)]
        if not math.isfinite(value):
            return NOTHING
        half = max(halves) if all(map(math.isfinite, halves)) else math.nan
        text = estimate_texts(value, value - half, value + half)[0]
        return f"+{text}" if value > 0 else text

    @property
    def verdict(self) -> str:
        """Verdict on the intervals, apart or overlapping; nothing where one estimate has none."""
        (_, *one), (_, *other) = self.bounds
        if not all(map(math.isfinite, (*one, *other))):
            return NOTHING
        return _APART if one[1] < other[0] or other[1] < one[0] else _OVERLAP


def estimate_changes(pair: ArchivePair) -> Iterator[Block]:
    """Estimates of two archives side by side, by output and source."""
    tables: list[Block] = []
    moved: list[str] = []
    verdicts: list[str] = []
    for model, each in pair.models.items():
        for output in each.outputs:
            found = list(_tables(each, output))
            if found:
                tables.append(Heading(_heading(each, model, output)))
            for is_leading, source, pairs, table in found:
                tables.append(Table(table, is_folded=not is_leading))
                if is_leading:
                    verdicts += [estimate.verdict for estimate in pairs]
                    if apart := [both.label for both in pairs if both.verdict == _APART]:
                        heading = _heading(each, model, output)
                        moved.append(f"{heading}, by {source}: {', '.join(apart)}")
    if not tables:
        return
    count = len(verdicts) - verdicts.count(NOTHING)
    if moved:
        head = f"The intervals of {verdicts.count(_APART)} of {count} estimates are apart:"
        yield Remarks(head, tuple(moved))
    elif count:
        yield Text(f"The intervals of all {count} estimates overlap.")
    yield Text(_NOTE)
    yield from tables


def _heading(pair: ModelPair, model: str, output: str) -> str:
    return f"{model}: " * bool(model) + output_heading(pair.first, output)


def _tables(
    pair: ModelPair, output: str
) -> Iterator[tuple[bool, str, list[_PairedEstimate], OutputTable]]:
    """Yield for each source whether it is the first with any, its estimates, and their table."""
    is_leading = True
    for source in pair.sources:
        found = list(_paired_estimates(pair, output, source))
        if not found:
            continue
        title = label_with_unit(output, pair.first.unit(output))
        table = OutputTable(plain_text(f"{title}, by {source}"), list(_COLUMNS))
        for both in found:
            cells = [table.cell(each, both.convert) for each in (both.first, both.second)]
            table.rows.append((both.label, [*cells, both.difference, both.verdict]))
        yield is_leading, source, found, table
        is_leading = False


def _paired_estimates(pair: ModelPair, output: str, source: str) -> Iterator[_PairedEstimate]:
    """Yield the estimates that both archives have of an output by a source."""
    others = {
        (each.statistic.name, each.label): each for each in compared_statistics(pair.second, output)
    }
    for each in compared_statistics(pair.first, output):
        other = others.get((each.statistic.name, each.label))
        if other is None or source not in each.available_estimates:
            continue
        if source in other.available_estimates:
            yield _PairedEstimate(
                each.label, each.estimates[source], other.estimates[source], each.convert
            )
    for index in MEASURES["shares"]:
        first, second = (
            view.statistics.get(source, output, index.name) for view in (pair.first, pair.second)
        )
        if first is not None and second is not None:
            yield from _by_input(index.measure.label, first, second)


def _by_input(label: str, first: xr.DataArray, second: xr.DataArray) -> Iterator[_PairedEstimate]:
    """Yield a measure of the inputs' part, for each input of both."""
    if first.dims[:1] != (INPUT,) or second.dims[:1] != (INPUT,):
        return
    others = second[INPUT].values.tolist()
    for position, name in enumerate(first[INPUT].values.tolist()):
        if name in others:
            one, other = first[position], second[others.index(name)]
            if np.isfinite(one.values[0]) and np.isfinite(other.values[0]):
                yield _PairedEstimate(plain_text(f"{label}, {name}"), one, other, identity)


# What changed in the study, and what only one of two archives has.

_BOTH = ["A", "B"]
# Characters of a value, and of a hash, that are shown; and lines of texts that are no studies.
_LONGEST, _HASH, _MOST_LINES = 100, 12, 200

Row = tuple[str, list[str]]


def study_changes(pair: ArchivePair) -> Iterator[Block]:
    """Tables of what differs; a sentence where nothing does."""
    trees = pair.first, pair.second
    tables = {
        "Settings of the study": _different(*_settings(trees)),
        "Models": _different_models(pair, _identity),
        "Files of the study": _different(*map(_hashes, trees)),
        "Runs": _different_models(pair, _run_texts),
        "Versions and platform": [
            (plain_text(name), [plain_text(one, _LONGEST), plain_text(other, _LONGEST)])
            for name, one, other in provenance_differences(*(tree.attrs for tree in trees))
        ],
    }
    for title, rows in tables.items():
        if rows:
            yield Table(OutputTable(title, list(_BOTH), rows))
    one, other = (str(tree.attrs.get("study_text", "")).splitlines() for tree in trees)
    listing = list(unified_diff(one, other, "A", "B", lineterm="", n=1))
    if left := len(listing[_MOST_LINES:]):
        listing[_MOST_LINES:] = [f"and {left} more lines"]
    if listing:
        yield Listing("Lines of the study's text that differ", "\n".join(listing), is_folded=True)
    if not listing and not any(tables.values()):
        yield Text("The studies, their models, their files and the versions are the same.")


def _settings(trees: Iterable[xr.DataTree]) -> list[dict[str, str]]:
    """Return the values of each study by their keys; none where a text cannot be parsed."""
    try:
        contents = [
            parse_document(str(tree.attrs.get("study_text", "")), "study").content for tree in trees
        ]
    except StudyError:
        return [{}, {}]
    return [dict(_entries(content)) for content in contents]


def _entries(content: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each value within tables."""
    for key, value in content.items():
        name = f"{path}.{key}" if path else str(key)
        if isinstance(value, Mapping) and value:
            yield from _entries(value, name)
        else:
            yield name, toml_text(value)


def _identity(view: ArchiveView) -> dict[str, str]:
    """Return what identifies a model."""
    return {
        plain_text(str(name).removeprefix("model_").replace("_", " ")): str(value)
        for name, value in view.tree.attrs.items()
        if str(name).startswith("model_")
    }


def _hashes(tree: xr.DataTree) -> dict[str, str]:
    """Return the start of the hash of each archived file."""
    files = archived_files(read_group(tree, FILES))
    return {str(file.name): str(file.sha256)[:_HASH] for file in files}


def _run_texts(view: ArchiveView) -> dict[str, str]:
    """Return the number of runs of each design, and that of failed ones."""
    found = {}
    for design in group_names(view.tree, RUNS):
        runs = read_group(view.tree, RUNS, design)
        counts = status_counts(runs).items()
        failed = [f"{n} {STATUS_TEXT[status]}" for status, n in counts if n and status]
        found[design] = ", ".join([f"{grouped_number(run_count(runs))} runs", *failed])
    return found


def _different_models(
    pair: ArchivePair, facts: Callable[[ArchiveView], Mapping[str, str]]
) -> list[Row]:
    """Return the rows of facts that differ between the models of both archives."""
    return [
        row
        for model, each in pair.models.items()
        for row in _different(
            *map(facts, (each.first, each.second)), head=f"{model}: " * bool(model)
        )
    ]


def _different(first: Mapping[str, str], second: Mapping[str, str], *, head: str = "") -> list[Row]:
    """Return a row for each entry that differs or that only one of them has."""
    return [
        (
            plain_text(f"{head}{name}"),
            [plain_text(each.get(name, NOTHING), _LONGEST) for each in (first, second)],
        )
        for name in dict.fromkeys([*first, *second])
        if first.get(name) != second.get(name)
    ]


def unpaired(pair: ArchivePair) -> Iterator[Block]:
    """Content that only one of two archives has, or has in another unit."""
    lines = [*_only_in_one("model", model_trees(pair.first), model_trees(pair.second))]
    for model, each in pair.models.items():
        of = f" of {model}" if model else ""
        first, second = each.first, each.second
        lines += _only_in_one(f"output{of}", first.outputs, second.outputs)
        lines += [
            f"output{of} {name}: in another unit, {first.unit(name)} and {second.unit(name)}"
            for name in first.outputs
            if name in second.outputs and not each.has_same_unit(name)
        ]
        lines += _only_in_one(f"source{of}", first.statistics.sources, second.statistics.sources)
    if lines:
        yield Remarks("Not compared:", tuple(plain_text(line, 200) for line in lines))


def _only_in_one(what: str, first: Iterable[str], second: Iterable[str]) -> Iterator[str]:
    one, other = list(first), list(second)
    for label, these, those in (("A", one, other), ("B", other, one)):
        for name in these:
            if name not in those:
                yield f"{what} {name or '(the only one)'}: in {label} only"


# Distribution functions of both.


def cdf_charts(pair: ArchivePair) -> Iterator[Block]:
    """Distribution functions of each output of both archives, by the first common source."""
    for model, each in pair.models.items():
        for output in each.outputs:
            if curves := next(_common_curves(each, output), None):
                heading = output_heading(each.first, output)
                yield Heading(f"{model}: " * bool(model) + heading)
                is_logarithmic = all(curve.view.is_logarithmic(output) for curve in curves)
                values = [curve.values for curve in curves]
                span = ValueAxis.of_values(values, is_logarithmic=is_logarithmic)
                chart = overlaid_chart(each.first, output, curves, span, each="archive")
                yield replace(chart, x=replace(chart.x, quantity=None))


def _common_curves(pair: ModelPair, output: str) -> Iterator[list[Curve]]:
    """Yield the functions of both archives by each source that has them in both."""
    measure = pair.first.scale(output)
    for source in pair.sources:
        found = [
            Curve.of_source(view, source, output, label, series, measure)
            for series, (label, view) in enumerate((("A", pair.first), ("B", pair.second)))
        ]
        curves = [curve for curve in found if curve is not None]
        if len(curves) == 2:
            yield curves
