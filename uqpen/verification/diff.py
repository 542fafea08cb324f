"""Diff of two archives: their differences, and which of them matter."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.files import FILES, archived_files, find_file_faults
from uqpen.archive.hashes import group_hashes
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import read_group
from uqpen.core.labels import CONTENT, STATUS
from uqpen.verification.differences import find_attribute_differences, find_differences
from uqpen.verification.disjoint_intervals import disjoint_intervals
from uqpen.verification.runs_diff import diff_runs
from uqpen.workflow.repetition import TOLERANCE

__all__ = ["DiffSection", "diff_archives"]

# Of one kind of difference; who wants to see all of them has the archives.
_MOST_LISTED = 8
_MOST_LINES = 24

_FILES = f"/{FILES}"
_STUDY_ATTRIBUTES = ("study_text", "study_sha256", "seed")


class DiffSection(NamedTuple):
    """Differences of one kind, a text for each; verbatim if they are lines of the study files."""

    name: str
    lines: tuple[str, ...]
    verbatim: bool = False


def diff_archives(first: xr.DataTree, second: xr.DataTree) -> Iterator[DiffSection]:
    """Yield the differences of two archives, intact or damaged; none where they are equal."""
    yield from _root_differences(first.attrs, second.attrs)
    known = group_hashes(first), group_hashes(second)
    lines = [
        *(f"{path} is in the first only" for path in known[0] if path not in known[1]),
        *(f"{path} is in the second only" for path in known[1] if path not in known[0]),
    ]
    if lines:
        yield DiffSection("groups", _first_lines(lines))
    files = list(_file_differences(first, second))
    if files:
        yield DiffSection("files", _first_lines(files))
    groups = []
    for path, digest in known[0].items():
        if known[1].get(path, digest) != digest and not (path == "/" or (files and path == _FILES)):
            parts = path.strip("/").split("/")
            groups.append((path, read_group(first, *parts), read_group(second, *parts)))
    yield from _group_differences(groups)
    made_elsewhere = next(provenance_differences(first.attrs, second.attrs), None) is not None
    if groups and made_elsewhere and not lines and _is_close(groups):
        difference = f"all numbers, within {TOLERANCE:g} of the largest of their variable and unit"
        yield DiffSection("equal", (f"{difference}: as far as other versions or processors agree",))


def _file_differences(first: xr.DataTree, second: xr.DataTree) -> Iterator[str]:
    """Yield the files that differ between two archives that both contain files."""
    both = [tree.children for tree in (first, second)]
    if any(FILES not in each or next(find_file_faults(each[FILES]), None) for each in both):
        return
    one, other = (
        {file.name: file for file in archived_files(read_group(t, FILES))} for t in (first, second)
    )
    for name in sorted({*one, *other}):
        if name not in other:
            yield f"{name} is in the first only"
        elif name not in one:
            yield f"{name} is in the second only"
        elif one[name] != other[name]:
            same = one[name].sha256 == other[name].sha256
            yield f"{name} differs{', though its hash does not' if same else ''}"


def _is_close(groups: Iterable[tuple[str, xr.Dataset, xr.Dataset]]) -> bool:
    """Return whether groups differ by no more than other versions or processors may change."""
    return all(
        each.relative <= TOLERANCE
        for _, one, other in groups
        for each in find_differences(one, other)
    )


def _group_differences(
    changed: Iterable[tuple[str, xr.Dataset, xr.Dataset]],
) -> Iterator[DiffSection]:
    """Yield the differences of changed groups: of runs, of statistics, of anything else."""
    points: list[str] = []
    outputs: list[str] = []
    lines: list[str] = []
    others: list[str] = []
    for path, one, other in changed:
        # Failures lie along statuses; runs have one each.
        if STATUS in one.data_vars and STATUS in other.data_vars:
            differences = diff_runs(one, other)
            points += [f"{path}: {line}" for line in differences.points]
            outputs += [f"{path}: {line}" for line in differences.outputs]
            if differences.points or differences.outputs:
                continue
        else:
            lines += [f"{path}: {line}" for line in disjoint_intervals(one, other)]
        others.append(_first_difference(path, one, other))
    for name, found in (("points", points), ("outputs", outputs)):
        if found:
            yield DiffSection(name, _first_lines(found))
    if lines:
        description = "outside each other's intervals"
        yield DiffSection("statistics", (f"{len(lines)} {description}", *_first_lines(lines)))
    if others:
        yield DiffSection("other groups", _first_lines(others))


def _root_differences(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> Iterator[DiffSection]:
    """Yield the differences of study, seed, software and other attributes of the root."""
    one, other = (str(each.get("study_text", "")).split("\n") for each in (first, second))
    # Without the two lines that would name the files.
    lines = list(islice(difflib.unified_diff(one, other, lineterm="", n=1), 2, None))
    if lines:
        left = len(lines) - _MOST_LINES
        more = (f"and {left} more lines",) if left > 0 else ()
        yield DiffSection("study", (*lines[:_MOST_LINES], *more), verbatim=True)
    if _differ(first, second, "seed"):
        yield DiffSection("seed", (_both_values(first, second, "seed"),))
    versions = [
        f"{name}: {textwrap.shorten(one, 80)} and {textwrap.shorten(other, 80)}"
        for name, one, other in provenance_differences(first, second)
    ]
    if versions:
        yield DiffSection("made with", tuple(versions))
    version_keys = [*provenance(), *of_python_functions()]
    besides = (CONTENT, *_STUDY_ATTRIBUTES, *version_keys)
    names = [name for name in {**first, **second} if name not in besides]
    others = [
        f"{name}: {_both_values(first, second, name)}"
        for name in names
        if _differ(first, second, name)
    ]
    if not lines and _differ(first, second, "study_sha256"):
        others.append("study_sha256 differs, though the text does not")
    if others:
        yield DiffSection("root", _first_lines(others))


def _both_values(first: Mapping[Any, Any], second: Mapping[Any, Any], name: str) -> str:
    one, other = (textwrap.shorten(str(each.get(name, "none")), 80) for each in (first, second))
    return f"{one} and {other}"


def _differ(first: Mapping[Any, Any], second: Mapping[Any, Any], name: str) -> bool:
    """Return True if an attribute, of any type, differs."""
    one, other = ({name: each[name]} if name in each else {} for each in (first, second))
    return next(find_attribute_differences(one, other), None) is not None


def _first_difference(path: str, one: xr.Dataset, other: xr.Dataset) -> str:
    """Return the first difference in a group."""
    found = _for_two_archives([difference.what for difference in find_differences(one, other)])
    if not found:
        return f"{path}: what is a coordinate in it"
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{path}: {found[0]}{more}"


def _for_two_archives(found: list[str]) -> list[str]:
    """Reword differences of an archive from a repetition as differences of two archives."""
    words = {
        "is missing in the repetition": "is in the first only",
        "is missing": "is in the second only",
    }
    for text, instead in words.items():
        found = [line.replace(text, instead) for line in found]
    return found


def _first_lines(lines: list[str]) -> tuple[str, ...]:
    left = len(lines) - _MOST_LISTED
    return (*lines[:_MOST_LISTED], *((f"and {left} more",) if left > 0 else ()))
