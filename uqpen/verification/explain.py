"""What two archives do not share, and what of it matters."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import xarray as xr

from uqpen.archive.content import hashes
from uqpen.archive.files import FILES, faults_of_files, kept_files
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import group
from uqpen.labels import COMPARISON, CONTENT, STATUS
from uqpen.verification.agreement import TOLERANCE, disagreements, of_attributes
from uqpen.verification.figures import apart
from uqpen.verification.runs_apart import runs_apart

__all__ = ["Section", "explain"]

# Of one kind of difference; who wants to see all of them has the archives.
_MOST_TOLD = 8
_MOST_LINES = 24

_FILES = f"/{FILES}"
_OF_THE_STUDY = ("study_text", "study_sha256", "seed")


class Section(NamedTuple):
    """The differences of one kind.

    Attributes
    ----------
    name : str
        What differs.
    lines : tuple of str
        How.
    verbatim : bool
        Whether they are lines of the study files.
    """

    name: str
    lines: tuple[str, ...]
    verbatim: bool = False


def explain(first: xr.DataTree, second: xr.DataTree) -> Iterator[Section]:
    """The differences of two archives, whole or damaged; none where they are the same.

    Parameters
    ----------
    first, second : DataTree
        Any two.
    """
    yield from _of_roots(first.attrs, second.attrs)
    known = hashes(first), hashes(second)
    lines = [
        *(f"{path} is in the first only" for path in known[0] if path not in known[1]),
        *(f"{path} is in the second only" for path in known[1] if path not in known[0]),
    ]
    if lines:
        yield Section("groups", _few(lines))
    files = list(_of_files(first, second))
    if files:
        yield Section("files", _few(files))
    changed = [
        path.strip("/").split("/")
        for path, digest in known[0].items()
        if known[1].get(path, digest) != digest and not (path == "/" or (files and path == _FILES))
    ]
    groups = [
        (f"/{'/'.join(parts)}", group(first, *parts), group(second, *parts)) for parts in changed
    ]
    yield from _of_groups(groups)
    made_elsewhere = next(provenance_differences(first.attrs, second.attrs), None) is not None
    if groups and made_elsewhere and not lines and _is_close(groups):
        told = f"all numbers, within {TOLERANCE:g} of the largest of their variable and unit"
        yield Section("equal", (f"{told}: as far as other versions or processors agree",))


def _of_files(first: xr.DataTree, second: xr.DataTree) -> Iterator[str]:
    """The files that differ, of two archives that both keep files."""
    both = [tree.children for tree in (first, second)]
    if any(FILES not in each or next(faults_of_files(each), None) for each in both):
        return
    one, other = (
        {file.name: file for file in kept_files(group(t, FILES))} for t in (first, second)
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
        each.gap <= TOLERANCE for _, one, other in groups for each in disagreements(one, other)
    )


def _of_groups(changed: Iterable[tuple[str, xr.Dataset, xr.Dataset]]) -> Iterator[Section]:
    """What differs in the groups that differ: of runs, of statistics, of anything."""
    points: list[str] = []
    outputs: list[str] = []
    figures: list[str] = []
    others: list[str] = []
    for path, one, other in changed:
        if STATUS in one and STATUS in other:
            told = runs_apart(one, other)
            points += [f"{path}: {line}" for line in told.points]
            outputs += [f"{path}: {line}" for line in told.outputs]
            if told.points or told.outputs:
                continue
        # The comparison holds the figures of all other groups once more.
        elif path.rpartition("/")[2] != COMPARISON:
            figures += [f"{path}: {line}" for line in apart(one, other)]
        others.append(_first_of(path, one, other))
    for name, found in (("points", points), ("outputs", outputs)):
        if found:
            yield Section(name, _few(found))
    if figures:
        told_of = "outside each other's intervals"
        yield Section("statistics", (f"{len(figures)} {told_of}", *_few(figures)))
    if others:
        yield Section("other groups", _few(others))


def _of_roots(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> Iterator[Section]:
    """The study, the seed, what the archives were made with, and what else stands at the root."""
    one, other = (str(each.get("study_text", "")).split("\n") for each in (first, second))
    # Without the two lines that would name the files.
    lines = list(islice(difflib.unified_diff(one, other, lineterm="", n=1), 2, None))
    if lines:
        left = len(lines) - _MOST_LINES
        more = (f"and {left} more lines",) if left > 0 else ()
        yield Section("study", (*lines[:_MOST_LINES], *more), verbatim=True)
    if _differ(first, second, "seed"):
        yield Section("seed", (_both(first, second, "seed"),))
    versions = [
        f"{name}: {textwrap.shorten(one, 80)} and {textwrap.shorten(other, 80)}"
        for name, one, other in provenance_differences(first, second)
    ]
    if versions:
        yield Section("made with", tuple(versions))
    made_with = [*provenance(), *of_python_functions()]
    besides = (CONTENT, *_OF_THE_STUDY, *made_with)
    names = [name for name in {**first, **second} if name not in besides]
    others = [
        f"{name}: {_both(first, second, name)}" for name in names if _differ(first, second, name)
    ]
    if not lines and _differ(first, second, "study_sha256"):
        others.append("study_sha256 differs, though the text does not")
    if others:
        yield Section("root", _few(others))


def _both(first: Mapping[Any, Any], second: Mapping[Any, Any], name: str) -> str:
    one, other = (textwrap.shorten(str(each.get(name, "none")), 80) for each in (first, second))
    return f"{one} and {other}"


def _differ(first: Mapping[Any, Any], second: Mapping[Any, Any], name: str) -> bool:
    """Whether an attribute, of whatever type, is not the same."""
    one, other = ({name: each[name]} if name in each else {} for each in (first, second))
    return next(of_attributes(one, other), None) is not None


def _first_of(path: str, one: xr.Dataset, other: xr.Dataset) -> str:
    """The first thing that differs in a group."""
    found = _of_two([told.what for told in disagreements(one, other)])
    if not found:
        return f"{path}: what is a coordinate in it"
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    return f"{path}: {found[0]}{more}"


def _of_two(found: list[str]) -> list[str]:
    """What is told of an archive and a repetition, as told of two archives."""
    words = {"is not found again": "is in the first only", "is missing": "is in the second only"}
    for text, instead in words.items():
        found = [line.replace(text, instead) for line in found]
    return found


def _few(lines: list[str]) -> tuple[str, ...]:
    left = len(lines) - _MOST_TOLD
    return (*lines[:_MOST_TOLD], *((f"and {left} more",) if left > 0 else ()))
