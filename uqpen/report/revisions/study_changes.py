"""Differences between the studies of two archives: settings, models, versions, files, runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import unified_diff
from typing import Any

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.provenance import provenance_differences
from uqpen.archive.read import group_names, read_group
from uqpen.charts.chart import Block
from uqpen.core.errors import StudyError, toml_text
from uqpen.core.labels import RUNS
from uqpen.core.status import STATUS_TEXT
from uqpen.execution import run_count, status_counts
from uqpen.report.blocks import Listing, Table, Text
from uqpen.report.revisions.pair import ArchivePair
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.table import NOTHING, OutputTable
from uqpen.results.texts import plain_text
from uqpen.study.document import parse_document

__all__ = ["study_changes"]

_COLUMNS = ["A", "B"]
# Characters of a value, and of a hash, that are shown; and lines of texts that are no studies.
_LONGEST, _HASH, _MOST_LINES = 100, 12, 200

Row = tuple[str, list[str]]


def study_changes(pair: ArchivePair) -> Iterator[Block]:
    """Tables of what differs; a sentence where nothing does."""
    tables = {
        "Settings of the study": list(_settings(pair)),
        "Models": list(_models(pair)),
        "Files of the study": list(_files(pair)),
        "Runs": list(_runs(pair)),
        "Versions and platform": list(_versions(pair)),
    }
    for title, rows in tables.items():
        if rows:
            yield Table(OutputTable(title, list(_COLUMNS), rows))
    listing = _text_lines(pair)
    if listing:
        yield Listing("Lines of the study's text that differ", "\n".join(listing), is_folded=True)
    if not listing and not any(tables.values()):
        yield Text("The studies, their models, their files and the versions are the same.")


def _settings(pair: ArchivePair) -> Iterator[Row]:
    """Yield the keys of the study with other values."""
    contents = [_content(each.attrs) for each in (pair.first, pair.second)]
    if None not in contents:
        first, second = (dict(_entries(each or {})) for each in contents)
        yield from _different(first, second)


def _content(attributes: Mapping[Any, Any]) -> dict[str, Any] | None:
    """Return the content of a study's text; None for a text that cannot be parsed."""
    try:
        return parse_document(str(attributes.get("study_text", "")), "study").content
    except StudyError:
        return None


def _entries(content: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the path and the text of each value within tables."""
    for key, value in content.items():
        name = f"{path}.{key}" if path else str(key)
        if isinstance(value, Mapping) and value:
            yield from _entries(value, name)
        else:
            yield name, toml_text(value)


def _models(pair: ArchivePair) -> Iterator[Row]:
    """Yield what identifies the models of both, where it differs."""
    for model, each in pair.models.items():
        first, second = (
            {
                plain_text(str(name).removeprefix("model_").replace("_", " ")): str(value)
                for name, value in view.tree.attrs.items()
                if str(name).startswith("model_")
            }
            for view in (each.first, each.second)
        )
        yield from _different(first, second, f"{model}: " * bool(model))


def _files(pair: ArchivePair) -> Iterator[Row]:
    """Yield the archived files with other content, by the start of their hashes."""
    first, second = (
        {
            str(file.name): str(file.sha256)[:_HASH]
            for file in archived_files(read_group(tree, FILES))
        }
        if FILES in tree.children
        else {}
        for tree in (pair.first, pair.second)
    )
    yield from _different(first, second)


def _runs(pair: ArchivePair) -> Iterator[Row]:
    """Yield the designs with another number of runs, or of failed ones."""
    for model, each in pair.models.items():
        first, second = (
            {name: _run_text(view, name) for name in group_names(view.tree, RUNS)}
            for view in (each.first, each.second)
        )
        yield from _different(first, second, f"{model}: " * bool(model))


def _run_text(view: ArchiveView, design: str) -> str:
    runs = read_group(view.tree, RUNS, design)
    failed = [
        f"{n} {STATUS_TEXT[status]}" for status, n in status_counts(runs).items() if n and status
    ]
    return ", ".join([f"{grouped_number(run_count(runs))} runs", *failed])


def _versions(pair: ArchivePair) -> Iterator[Row]:
    for name, one, other in provenance_differences(pair.first.attrs, pair.second.attrs):
        yield plain_text(name), [plain_text(one, _LONGEST), plain_text(other, _LONGEST)]


def _different(
    first: Mapping[str, str], second: Mapping[str, str], head: str = ""
) -> Iterator[Row]:
    """Yield a row for each entry that differs or that only one of them has."""
    for name in dict.fromkeys([*first, *second]):
        if first.get(name) != second.get(name):
            cells = [plain_text(each.get(name, NOTHING), _LONGEST) for each in (first, second)]
            yield plain_text(f"{head}{name}"), cells


def _text_lines(pair: ArchivePair) -> list[str]:
    """Return the lines of two study texts that differ, as `diff -u` does."""
    one, other = (str(each.attrs.get("study_text", "")) for each in (pair.first, pair.second))
    lines = unified_diff(one.splitlines(), other.splitlines(), "A", "B", lineterm="", n=1)
    found = list(lines)
    left = len(found) - _MOST_LINES
    return [*found[:_MOST_LINES], *([f"and {left} more lines"] if left > 0 else [])]
