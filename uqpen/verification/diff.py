"""Diff of two archives: their differences, and which of them matter."""

from __future__ import annotations

import difflib
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import coordinate_text, place_text
from uqpen.archive.files import FILES, archived_files, find_file_faults
from uqpen.archive.hashes import group_hashes
from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import read_group
from uqpen.core.labels import BOUND, CONTENT, FAILED_RUN, FAILURE_REASON, ROLE, RUN, STATUS
from uqpen.execution import run_count
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.digits import estimate_text
from uqpen.verification.check_result import (
    find_attribute_differences,
    find_differences,
    first_lines,
)
from uqpen.workflow.repetition import TOLERANCE, first_difference

# Lines of the study's text that are listed.
_MOST_LINES = 24

_FILES = f"/{FILES}"


class DiffSection(NamedTuple):
    """Differences of one kind, a text for each; verbatim if they are lines of the study files."""

    name: str
    lines: tuple[str, ...]
    verbatim: bool = False


class RunsDiff(NamedTuple):
    """Differences of runs, a line each: of inputs and number, and of outputs of shared runs."""

    points: list[str]
    outputs: list[str]


def diff_archives(first: xr.DataTree, second: xr.DataTree) -> Iterator[DiffSection]:
    """Yield the differences of two archives, intact or damaged; none where they are equal."""
    yield from _root_differences(first.attrs, second.attrs)
    known = group_hashes(first), group_hashes(second)
    lines = [
        *(f"{path} is in the first only" for path in known[0] if path not in known[1]),
        *(f"{path} is in the second only" for path in known[1] if path not in known[0]),
    ]
    if lines:
        yield DiffSection("groups", first_lines(lines))
    files = list(_file_differences(first, second))
    if files:
        yield DiffSection("files", first_lines(files))
    groups = []
    for path, digest in known[0].items():
        if known[1].get(path, digest) != digest and not (path == "/" or (files and path == _FILES)):
            parts = path.strip("/").split("/")
            groups.append((path, read_group(first, *parts), read_group(second, *parts)))
    yield from _group_differences(groups)
    made_elsewhere = next(provenance_differences(first.attrs, second.attrs), None) is not None
    if groups and made_elsewhere and not lines:
        differences = (each for _, *pair in groups for each in find_differences(*pair))
        if all(each.relative <= TOLERANCE for each in differences):
            numbers = f"all numbers, within {TOLERANCE:g} of the largest of their variable and unit"
            text = f"{numbers}: as far as other versions or processors agree"
            yield DiffSection("equal", (text,))


def _root_differences(first: Mapping[Any, Any], second: Mapping[Any, Any]) -> Iterator[DiffSection]:
    """Yield the differences of study, seed, software and other attributes of the root."""
    one, other = (str(each.get("study_text", "")).split("\n") for each in (first, second))
    # Without the two lines that would name the files.
    lines = list(islice(difflib.unified_diff(one, other, lineterm="", n=1), 2, None))
    if lines:
        yield DiffSection("study", first_lines(lines, _MOST_LINES, "more lines"), verbatim=True)
    besides = (CONTENT, "study_text", *provenance(), *of_python_functions())
    differing = {}
    for name in {**first, **second}:
        pair = [{name: each[name]} if name in each else {} for each in (first, second)]
        if name not in besides and any(find_attribute_differences(*pair)):
            texts = [textwrap.shorten(str(each.get(name, "none")), 80) for each in pair]
            differing[name] = " and ".join(texts)
    if "seed" in differing:
        yield DiffSection("seed", (differing.pop("seed"),))
    versions = [
        f"{name}: {textwrap.shorten(one, 80)} and {textwrap.shorten(other, 80)}"
        for name, one, other in provenance_differences(first, second)
    ]
    if versions:
        yield DiffSection("made with", tuple(versions))
    is_other_hash = bool(differing.pop("study_sha256", ""))
    others = [f"{name}: {texts}" for name, texts in differing.items()]
    if is_other_hash and not lines:
        others.append("study_sha256 differs, though the text does not")
    if others:
        yield DiffSection("root", first_lines(others))


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
        found = [difference.what for difference in find_differences(one, other)]
        # The second archive is no repetition of the first.
        text = found[0] if found else "what is a coordinate in it"
        text = text.replace("is missing in the repetition", "is in the first only")
        text = text.replace("is missing", "is in the second only")
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        others.append(f"{path}: {text}{more}")
    for name, texts in (("points", points), ("outputs", outputs)):
        if texts:
            yield DiffSection(name, first_lines(texts))
    if lines:
        description = f"{len(lines)} outside each other's intervals"
        yield DiffSection("statistics", (description, *first_lines(lines)))
    if others:
        yield DiffSection("other groups", first_lines(others))


# Runs


def diff_runs(one: xr.Dataset, other: xr.Dataset) -> RunsDiff:
    """Compare the runs of a design with those of the same design in another archive.

    Only the first runs of the longer one are compared.
    """
    counts = [run_count(each) for each in (one, other)]
    points = [f"{counts[0]} runs and {counts[1]}"] if counts[0] != counts[1] else []
    kept = [not are_omitted(each) for each in (one, other)]
    if kept[0] != kept[1]:
        points.append(f"the runs are only in the {'first' if kept[0] else 'second'} archive")
    shared = {RUN: slice(0, min(each.sizes.get(RUN, 0) for each in (one, other)))}
    one, other = (each.isel(shared, missing_dims="ignore") for each in (one, other))
    outputs: list[str] = []
    for name in map(str, one.variables):
        if name not in (FAILED_RUN, FAILURE_REASON) and name in other.variables:
            is_output = name == STATUS or one.variables[name].attrs.get(ROLE) == "output"
            (outputs if is_output else points).extend(_value_differences(one, other, name))
    if not points and not outputs:
        reasons = [
            each[FAILURE_REASON].values.tolist() if FAILURE_REASON in each else []
            for each in (one, other)
        ]
        outputs += ["the reasons of failed runs differ"] if reasons[0] != reasons[1] else []
    return RunsDiff(points, outputs)


def _value_differences(one: xr.Dataset, other: xr.Dataset, name: str) -> Iterator[str]:
    """Yield a line if a variable of runs differs: its first difference, and their number."""
    left, right = one.variables[name], other.variables[name]
    if left.dims != right.dims or left.shape != right.shape:
        yield f"{name} is of another shape"
        return
    place, rows = first_difference(left, right)
    if not rows:
        return
    # With all of their digits.
    texts = [
        repr(float(each[place].values)) if each.dtype.kind == "f" else str(each[place].values[()])
        for each in (left, right)
    ]
    if left.dims[:1] == (RUN,):
        number = one[RUN][place[0]].values if RUN in one.coords else place[0]
        differ = f"{rows} run differs" if rows == 1 else f"{rows} runs differ"
        where = f"{number}{place_text(one[name], place)}"
        yield f"{name} of run {where}: {texts[0]} and {texts[1]}; {differ}"
    else:
        yield f"{name}: {texts[0]} and {texts[1]}"


# Statistics


def disjoint_intervals(one: xr.Dataset, other: xr.Dataset) -> Iterator[str]:
    """Yield the pairs of estimates of two groups that each lie outside the other's interval.

    Statistics that only one group has, and those without an interval in one of them, are left out.
    """
    for name, variable in one.data_vars.items():
        if name not in other.data_vars or variable.dims[-1:] != (BOUND,):
            continue
        pair = variable.values, other[name].values
        if pair[0].shape != pair[1].shape or pair[0].shape[-1] != 3 or pair[0].dtype.kind != "f":
            continue
        rows = [values.reshape(-1, 3) for values in pair]
        # A NaN bound excludes no estimate.
        outside = [
            (these[:, 0] < those[:, 1]) | (these[:, 0] > those[:, 2])
            for these, those in (rows, rows[::-1])
        ]
        disjoint = np.flatnonzero(outside[0] & outside[1]).tolist()
        # Neighbouring places of a field differ together: one of them speaks for all.
        is_field = any("display_units" in one[dim].attrs for dim in variable.dims[:-1])
        for position in disjoint[:1] if is_field else disjoint:
            shown = [estimate_text(*row[position].tolist()) for row in rows]
            entry = f"[{position}]" if len(rows[0]) > 1 else ""
            unit = str(variable.attrs.get("units", "1"))
            behind = "" if unit == "1" else f" {unit}"
            if is_field:
                entry = _entry_text(variable, position)
                behind += f"; {len(disjoint)} of {len(rows[0])} are apart"
            yield f"{name}{entry}: {shown[0]} and {shown[1]}{behind}"


def _entry_text(variable: xr.DataArray, position: int) -> str:
    """Return the coordinates of an entry of a field's statistic, by its position among all."""
    index = np.unravel_index(position, variable.shape[:-1])
    labels = {dim: variable[dim].values[at] for dim, at in zip(variable.dims, index, strict=False)}
    texts = [
        coordinate_text(variable[dim], label)
        if "display_units" in variable[dim].attrs
        else f"{dim} = {label}"
        for dim, label in labels.items()
    ]
    return f" at {', '.join(texts)}"
