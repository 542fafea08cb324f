"""Runs as datasets: made from results, compared, counted."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import BlockedRuns, LoadedDataset, block_ranges
from uqpen.core.labels import (
    ABSENT,
    CURVE_MAY_END,
    DERIVED_FROM,
    FAILED_RUN,
    FAILURE_REASON,
    POINT,
    REPEAT,
    REPLICATE,
    REPLICATES_MADE,
    ROLE,
    ROUND,
    RUN,
    RUNS_MADE,
    SEED,
    STATUS,
    STATUS_COUNTS,
    WEIGHT,
)
from uqpen.core.model import Category, Input, Model, Output
from uqpen.core.status import Status
from uqpen.core.variables import field_coordinates, label_attributes

if TYPE_CHECKING:
    import xarray as xr


def worst_status_runs(runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return the runs of the first of several models, failed where the run of any model failed.

    All models have runs at the same points. A run that is inadmissible to one model is
    inadmissible; others have the highest status.
    """
    first, *others = runs
    if not others:
        return first
    statuses = np.stack([each[STATUS].values for each in runs])
    worst = statuses.max(axis=0)
    worst[(statuses == Status.INADMISSIBLE).any(axis=0)] = Status.INADMISSIBLE
    return first.assign({STATUS: first[STATUS].copy(data=worst)})


def common_runs(runs: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return the runs of several models in the rounds of a design that all of them have run.

    Their runs are then at the same points.
    """
    if all(ROUND not in each.coords for each in runs):
        return [*runs]
    numbers = [np.unique(each[ROUND].values) for each in runs]
    common = reduce(np.intersect1d, numbers)
    return [each.isel({RUN: np.isin(each[ROUND].values, common)}) for each in runs]


def first_repeats(runs: xr.Dataset) -> xr.Dataset:
    """Return the first run at each point, as every statistic takes them that knows no repeats.

    The runs of one point are no independent runs: they have their inputs in common. They are all
    runs of a design that repeats none.
    """
    if REPEAT not in runs.coords:
        return runs
    return runs.isel({RUN: np.flatnonzero(runs[REPEAT].values == 0)})


# The fewest completed runs of a point that show its noise.
_FEWEST_REPEATS = 2


def mean_repeats(runs: xr.Dataset) -> xr.Dataset:
    """Return one run for each point, with the means of its completed runs, as surrogates take them.

    A number is the mean over the completed runs, which `repeats_of` has. A field and a category are
    those of the first of them. A point with fewer than two is missing, with the status of one that
    failed. The runs of a design that repeats none are returned as they are.
    """
    if REPEAT not in runs.coords:
        return runs
    point, repeat = runs[POINT].values, runs[REPEAT].values
    rows = np.empty((int(point.max(initial=-1)) + 1, int(repeat.max(initial=0)) + 1), dtype=np.intp)
    rows[point, repeat] = np.arange(runs.sizes[RUN])
    completed = runs[STATUS].values[rows] == Status.OK
    count = completed.sum(axis=1)
    shown = np.where(count >= _FEWEST_REPEATS, completed.argmax(axis=1), completed.argmin(axis=1))
    found = runs.isel({RUN: rows[np.arange(len(rows)), shown]}).drop_vars([POINT, REPEAT])
    columns: dict[str, Any] = {}
    for name, variable in runs.variables.items():
        is_number = variable.dims == (RUN,) and "flag_values" not in variable.attrs
        if is_number and variable.attrs.get(ROLE) == "output":
            values = variable.values.astype(np.float64)[rows]
            # Divided first, as a sum can overflow.
            parts = np.where(completed, values / np.maximum(count, 1)[:, None], 0.0)
            columns[str(name)] = found[name].copy(data=parts.sum(axis=1))
            columns[_by_repeat(str(name))] = (RUN, REPEAT), np.where(completed, values, np.nan)
    return found.assign(columns)


def repeats_of(runs: xr.Dataset, output: str) -> FloatArray | None:
    """Return the completed runs of an output at each point of `mean_repeats`, shape (run, repeat).

    They are NaN where no run completed. Without repeats there are none.
    """
    name = _by_repeat(output)
    return runs[name].values if name in runs else None


def _by_repeat(output: str) -> str:
    # The spaces keep it apart from every output, whose name has none.
    return f"{output} by {REPEAT}"


def bytes_of_a_run(runs: xr.Dataset) -> int:
    """Return how many bytes an archive needs for each run of a design that did not fail."""
    of_runs = (each for each in runs.variables.values() if RUN in each.dims)
    return sum(each.dtype.itemsize * math.prod(each.shape[1:]) for each in of_runs)


def run_count(runs: xr.Dataset) -> int:
    """Return the number of runs of a design, whether or not an archive has kept them."""
    return int(runs.attrs.get(RUNS_MADE, runs.sizes.get(RUN, 0)))


def status_counts(runs: xr.Dataset | BlockedRuns) -> dict[Status, int]:
    """Count the runs with each status."""
    if STATUS_COUNTS in runs.attrs:
        return dict(zip(Status, np.asarray(runs.attrs[STATUS_COUNTS]).tolist(), strict=True))
    handle, counts = LoadedDataset.of(runs), np.zeros(len(Status), dtype=np.int64)
    for start, stop in block_ranges(handle.size):
        found = handle.part(start, stop, [STATUS])[STATUS]
        counts += [np.count_nonzero(found == status) for status in Status]
    return dict(zip(Status, counts.tolist(), strict=True))


def replicate_count(runs: xr.Dataset) -> int:
    """Return the number of replicates of a design, 1 without any; its runs may not be kept."""
    if REPLICATES_MADE in runs.attrs:
        return int(runs.attrs[REPLICATES_MADE])
    if REPLICATE not in runs.variables:
        return 1
    column, found = runs.variables[REPLICATE], set[int]()
    for start, stop in block_ranges(runs.sizes[RUN]):
        found.update(np.unique(column[start:stop].values).tolist())
    return len(found)


# Runs as a dataset: points and results, with attributes by the CF conventions.

_END = {"comment": CURVE_MAY_END}


def runs_dataset(
    points: xr.Dataset,
    results: Mapping[str, Any],
    model: Model,
    display_units: Mapping[str, str],
) -> xr.Dataset:
    """Return points with the results of their runs.

    Parameters
    ----------
    points : Dataset
        A variable for each input.
    results : mapping of str to tuple
        Variables of the results: outputs, statuses and reasons of failed runs.
    model : Model
        The model that made the runs.
    display_units : mapping of str to str
        The unit to show an input or output in, where it is not the model's own.
    """
    dims = itertools.chain.from_iterable(output.dims for output in model.outputs)
    runs = points.assign(results).assign_coords(field_coordinates(dims))
    _add_attributes(runs, model, display_units)
    return runs


def _add_attributes(runs: xr.Dataset, model: Model, display_units: Mapping[str, str]) -> None:
    """Add attributes to every variable, following the CF conventions."""
    # As an array each would take time by the number of all variables.
    stored = runs.variables
    for role, variables in (("input", model.inputs), ("output", model.all_outputs)):
        for variable in variables:
            if variable.name in stored:
                shown = display_units.get(variable.name, variable.preferred_unit)
                measure = {"units": variable.unit, "display_units": shown}
                categories = variable.categories if isinstance(variable, Output) else ()
                stored[variable.name].attrs |= {
                    "long_name": variable.title,
                    ROLE: stored[variable.name].attrs.get(ROLE, role),
                    **(_category_attributes(categories) if categories else measure),
                    **(label_attributes(variable) if isinstance(variable, Input) else {}),
                    **(_END if isinstance(variable, Output) and variable.may_end else {}),
                    **(_absence(variable) if isinstance(variable, Output) else {}),
                }
    for derived in model.derived:
        runs[derived.output.name].attrs[DERIVED_FROM] = derived.source
    runs[STATUS].attrs = {"long_name": "what became of the run"}
    runs[STATUS].attrs |= _flag_attributes(list(Status), [status.meaning for status in Status])
    number = {"units": "1", "long_name": "number of the run"}
    runs[RUN].attrs = {"standard_name": "realization", **number}
    if WEIGHT in runs.coords:
        runs[WEIGHT].attrs = {"units": "1", "long_name": "relative weight of the run"}
    if REPLICATE in runs:
        runs[REPLICATE].attrs = {"units": "1", "long_name": "number of the run's replicate"}
    if REPEAT in runs.coords:
        runs[POINT].attrs = {"units": "1", "long_name": "number of the run's point"}
        runs[REPEAT].attrs = {"units": "1", "long_name": "number of the run at its point"}
    if (seed := model.noise.seed) in stored:
        name = {"long_name": "seed of the run's random numbers"}
        stored[seed].attrs = {"units": "1", **name, ROLE: SEED}
    if FAILED_RUN in runs:
        runs[FAILED_RUN].attrs = {"long_name": "number of a lost run"}
        runs[FAILURE_REASON].attrs = {"long_name": "why the run was lost"}


def _absence(output: Output) -> dict[str, str]:
    return {ABSENT: output.absent} if output.absent else {}


def _category_attributes(categories: Sequence[Category]) -> dict[str, Any]:
    """Return the attributes of a categorical output; failed runs have a category of their own."""
    meanings = ["lost", *(category.flag for category in categories)]
    labels = ["lost", *(category.label for category in categories)]
    return {**_flag_attributes(range(-1, len(categories)), meanings), "flag_labels": labels}


def _flag_attributes(values: Sequence[int], meanings: Sequence[str]) -> dict[str, Any]:
    return {"flag_values": np.array(values, dtype=np.int8), "flag_meanings": " ".join(meanings)}
