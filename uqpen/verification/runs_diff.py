"""Differences between the runs of one design in two archives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.fields import place_text
from uqpen.core.labels import FAILED_RUN, FAILURE_REASON, ROLE, RUN, STATUS
from uqpen.verification.differences import unequal

__all__ = ["RunsDiff", "diff_runs"]


class RunsDiff(NamedTuple):
    """Differences of runs, a line each: of inputs and number, and of outputs of shared runs."""

    points: list[str]
    outputs: list[str]


def diff_runs(one: xr.Dataset, other: xr.Dataset) -> RunsDiff:
    """Compare the runs of a design with those of the same design in another archive.

    Only the first runs of the longer one are compared.
    """
    sizes = [each.sizes.get(RUN, 0) for each in (one, other)]
    points = [f"{sizes[0]} runs and {sizes[1]}"] if sizes[0] != sizes[1] else []
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
        values = left.values, right.values
        if left.dims != right.dims or values[0].shape != values[1].shape:
            yield f"{name} is of another shape"
            continue
        places = np.argwhere(unequal(*values))
        if not len(places):
            continue
        place = tuple(places[0])
        first = _value_text(values[0][place]), _value_text(values[1][place])
        if left.dims[:1] == (RUN,):
            at = np.unique(places[:, 0])
            number = one[RUN].values[at[0]] if RUN in one.coords else at[0]
            where = f"{number}{place_text(one[name], place)}"
            differ = "run differs" if at.size == 1 else "runs differ"
            yield f"{name} of run {where}: {first[0]} and {first[1]}; {at.size} {differ}"
        else:
            yield f"{name}: {first[0]} and {first[1]}"


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
