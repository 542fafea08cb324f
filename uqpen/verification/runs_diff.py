"""Differences between the runs of one design in two archives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import place_text
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, ROLE, RUN, STATUS
from uqpen.execution import run_count
from uqpen.execution.omitted_runs import are_omitted
from uqpen.workflow.repetition import unequal

__all__ = ["RunsDiff", "diff_runs"]


class RunsDiff(NamedTuple):
    """Differences of runs, a line each: of inputs and number, and of outputs of shared runs."""

    points: list[str]
    outputs: list[str]


def diff_runs(one: xr.Dataset, other: xr.Dataset) -> RunsDiff:
    """Compare the runs of a design with those of the same design in another archive.

    Only the first runs of the longer one are compared.
    """
    counts = [run_count(each) for each in (one, other)]
    points = [f"{counts[0]} runs and {counts[1]}"] if counts[0] != counts[1] else []
    kept = [not are_omitted(each) for each in (one, other)]
    if kept[0] != kept[1]:
        points.append(f"the runs are only in the {'first' if kept[0] else 'second'} archive")
    sizes = [each.sizes.get(RUN, 0) for each in (one, other)]
    shared = {RUN: slice(0, min(sizes))}
    one = one.isel(shared, missing_dims="ignore")
    other = other.isel(shared, missing_dims="ignore")
    names = [str(name) for name in one.variables if name not in (FAILED_RUN, FAILURE_REASON)]
    outcomes = [name for name in names if _is_outcome(one, name)]
    went_in = [name for name in names if name not in outcomes]
    points += _difference_lines(one, other, went_in)
    outputs = list(_difference_lines(one, other, outcomes))
    if not points and not outputs:
        outputs += _reason_differences(one, other)
    return RunsDiff(points, outputs)


def _is_outcome(runs: xr.Dataset, name: str) -> bool:
    return name == STATUS or runs.variables[name].attrs.get(ROLE) == "output"


def _difference_lines(one: xr.Dataset, other: xr.Dataset, names: Iterable[str]) -> Iterator[str]:
    """Yield a line for each variable that differs: its first difference, and their number."""
    for name in names:
        if name not in other.variables:
            continue
        left, right = one.variables[name], other.variables[name]
        if left.dims != right.dims or left.shape != right.shape:
            yield f"{name} is of another shape"
            continue
        place, rows = _first_difference(left, right)
        if not rows:
            continue
        first = _value_text(left[place].values[()]), _value_text(right[place].values[()])
        if left.dims[:1] == (RUN,):
            number = one[RUN][place[0]].values if RUN in one.coords else place[0]
            where = f"{number}{place_text(one[name], place)}"
            differ = "run differs" if rows == 1 else "runs differ"
            yield f"{name} of run {where}: {first[0]} and {first[1]}; {rows} {differ}"
        else:
            yield f"{name}: {first[0]} and {first[1]}"


def _first_difference(left: xr.Variable, right: xr.Variable) -> tuple[tuple[int, ...], int]:
    """Return the place of the first difference, and how many entries of the first dimension differ.

    They are compared by blocks, as many runs need not fit the memory.
    """
    if not left.dims:
        return (), int(unequal(left.values, right.values).any())
    first: tuple[int, ...] = ()
    rows = 0
    for start, stop in block_ranges(left.shape[0]):
        places = np.argwhere(unequal(left[start:stop].values, right[start:stop].values))
        if len(places) and not rows:
            first = (start + int(places[0, 0]), *map(int, places[0, 1:]))
        rows += np.unique(places[:, 0]).size
    return first, rows


def _reason_differences(one: xr.Dataset, other: xr.Dataset) -> Iterator[str]:
    """Yield a difference if the failure reasons differ, where all else is the same."""
    texts = [
        each[FAILURE_REASON].values.tolist() if FAILURE_REASON in each else []
        for each in (one, other)
    ]
    if texts[0] != texts[1]:
        yield "the reasons of failed runs differ"


def _value_text(value: Any) -> str:
    """Return a value with all of its digits."""
    return repr(float(value)) if isinstance(value, np.floating) else str(value)
