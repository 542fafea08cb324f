"""Differences between the studies of two archives, and what only one of them has."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from difflib import unified_diff
from typing import Any

import xarray as xr

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.provenance import provenance_differences
from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.charts.chart import Block
from uqpen.core.errors import StudyError, toml_text
from uqpen.core.labels import RUNS
from uqpen.core.status import STATUS_TEXT
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Listing, Remarks, Table, Text
from uqpen.report.revisions.revision_page import ArchivePair
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text
from uqpen.study.document import parse_document

__all__ = ["study_changes", "unpaired"]

_COLUMNS = ["A", "B"]
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
            yield Table(OutputTable(title, list(_COLUMNS), rows))
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
