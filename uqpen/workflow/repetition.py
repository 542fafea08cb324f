"""Runs made again, and their differences from those that are kept."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.fields import place_text
from uqpen.core.arrays import BoolArray
from uqpen.core.blocks import LoadedDataset, block_ranges
from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Model, Output
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import first_round
from uqpen.execution import EvaluationOptions, Evaluator, FailurePolicy, Map, Progress, evaluate
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.omitted_runs import batch_hashes
from uqpen.study.study import ValidatedStudy

# What other versions or another machine may change: far more than last bits that a computation
# carries along, far less than any interval; relative to the scale of a variable.
TOLERANCE = 1e-9


class NoReports(Progress):
    """Receiver of the reports on runs that are no part of the study."""

    def warn(self, text: str) -> None:
        """Ignore a warning."""


class Difference(NamedTuple):
    """Difference in a group."""

    what: str  # the variable or attribute, and its difference in words
    relative: float  # size, relative to the largest value; infinite where it has no meaning
    is_new: bool = False  # true if the archive lacks it

    def within(self, place: str) -> Difference:
        """Return the difference with the name of the place that it is in."""
        return self._replace(what=f"{place}: {self.what}")


def unequal(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> BoolArray:
    """Mask of the elements that are not equal to the bit; all NaNs are equal."""
    if one.dtype.kind == "f" and other.dtype.kind == "f":
        same = (one == other) & (np.signbit(one) == np.signbit(other))
        return ~(same | (np.isnan(one) & np.isnan(other)))
    return np.asarray(one != other, dtype=bool)


def relative_difference(
    one: npt.NDArray[Any], other: npt.NDArray[Any], scale: float = 0.0
) -> float:
    """Return the largest difference of two arrays of one shape, relative to their largest value.

    A larger scale replaces their largest value. Infinite where values differ that are not finite
    numbers.
    """
    at = unequal(one, other)
    if not at.any():
        return 0.0
    if one.dtype.kind != "f" or other.dtype.kind != "f":
        return math.inf
    if not (np.isfinite(one[at]).all() and np.isfinite(other[at]).all()):
        return math.inf
    finite = np.concatenate([each[np.isfinite(each)] for each in (one, other)])
    largest = max(float(np.abs(finite).max()), scale)
    # Halves, as the difference of the largest numbers of all is none.
    difference = float(np.abs(one[at] / 2 - other[at] / 2).max())
    return 2 * (difference / largest) if largest else 0.0


def first_difference(one: xr.Variable, other: xr.Variable) -> tuple[tuple[int, ...], int]:
    """Return the place of the first difference, and how many entries of the first dimension differ.

    They are compared by blocks, as many runs need not fit the memory.
    """
    if not one.dims:
        return (), int(unequal(one.values, other.values).any())
    first: tuple[int, ...] = ()
    rows = 0
    for start, stop in block_ranges(one.shape[0]):
        places = np.argwhere(unequal(one[start:stop].values, other[start:stop].values))
        if len(places) and not rows:
            first = (start + int(places[0, 0]), *map(int, places[0, 1:]))
        rows += np.unique(places[:, 0]).size
    return first, rows


def difference_text(difference: float) -> str:
    """Return a relative difference in words, after "differ"; empty where it is not of numbers.

    >>> difference_text(2.1e-16)
    ' by up to 2.1e-16 of the largest value'
    """
    return "" if math.isinf(difference) else f" by up to {difference:.2g} of the largest value"


def run_differences(
    runs_name: str,
    archived: xr.Dataset,
    again: xr.Dataset,
    outputs: Sequence[Output],
    scales: Mapping[str, float] = MappingProxyType({}),
    words: tuple[str, str] = ("in the archive", "now"),
) -> Iterator[Difference]:
    """Yield the variables whose values differ, each with the first run that differs.

    Parameters
    ----------
    archived, again : Dataset
        The same runs, as they are kept and as they were made again.
    outputs : sequence of Output
        The outputs that are compared.
    scales : mapping of str to float
        The largest value of an output among all runs, if these are some of them.
    words : tuple of str
        Where, or when, the two have their values.
    """
    for name in (STATUS, *(output.name for output in outputs)):
        place, rows = first_difference(archived.variables[name], again.variables[name])
        if rows:
            one, other = archived[name].values, again[name].values
            number = archived[RUN].values[place[0]]
            difference = relative_difference(one, other, scales.get(name, 0.0))
            count = f"; {rows} of its runs differ" if rows > 1 else "; it differs"
            yield Difference(
                f"{runs_name}: {name} of run {number}{place_text(archived[name], place)} is "
                f"{one[place]!s} {words[0]} and "
                f"{other[place]!s} {words[1]}{count}{difference_text(difference)}",
                difference,
            )


def hashes_again(
    study: ValidatedStudy,
    name: str,
    model: Model,
    design: str,
    size: int,
    batches: list[int],
    map: Map,
    progress: Progress,
) -> Iterator[tuple[int, str]]:
    """Make batches of a design's runs again, and yield the number and the hash of each.

    The model is the one with this name, perhaps with another folder for its runs.
    """
    drawn = first_round(study.designs[design], study.joint, Stream(study.seed, "designs", design))
    points = study.run_seeds(name).assigned(drawn.assign(study.models[name].given))
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    progress.start_design(design, len(batches) * BATCH_SIZE)
    policy = FailurePolicy(study.failures.retry)
    options = EvaluationOptions(map=map, progress=progress, failures=policy)
    for first, last in _consecutive_batches(batches):
        part = blocked.read(first * BATCH_SIZE, min((last + 1) * BATCH_SIZE, size))
        evaluator = Evaluator(model, study.constraints)
        again = evaluate(evaluator, part, study.display_units(), options)
        yield from enumerate(batch_hashes(again), first)


def _consecutive_batches(batches: list[int]) -> Iterator[tuple[int, int]]:
    """Yield the first and the last batch of each sequence without a gap in a block."""
    of_block = BLOCK // BATCH_SIZE
    first = 0
    for place, batch in enumerate(batches):
        is_last = place + 1 == len(batches) or batches[place + 1] != batch + 1
        if is_last or (batch + 1) % of_block == 0:
            yield batches[first], batch
            first = place + 1
