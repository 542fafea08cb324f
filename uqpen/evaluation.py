"""A model over points: every run ends with a status, and none ends the study."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.inputs.constraints import Constraint
from uqpen.labels import LOST, REASON, REPLICATE, ROLE, ROUND, RUN, STATUS, Status
from uqpen.model import Category, Model, Output, Results, inadmissible
from uqpen.streams import BLOCK

__all__ = ["Evaluator", "Map", "evaluate", "join", "status_counts", "worst"]

FloatArray = npt.NDArray[np.float64]

# Into how many batches runs are divided, and how small and large these may be. It must not depend
# on where they are made: a function of the user's own may give other last bits in another batch.
_VECTORIZED = (16, 1024, BLOCK)
# Progress is told after each; none may be so small that sending it takes longer than making it.
_ONE_BY_ONE = (512, 1, 256)


@dataclass(frozen=True)
class Evaluator:
    """A model with the domain of its inputs, as one call over a batch.

    Parameters
    ----------
    model : Model
        What is run.
    constraints : sequence of Constraint
        Where the input law ends; points outside are inadmissible and not run.
    """

    model: Model
    constraints: Sequence[Constraint] = ()

    def __call__(self, inputs: dict[str, FloatArray]) -> Results:
        """Results of a batch of points, given in SI units."""
        runs = len(next(iter(inputs.values())))
        status = np.full(runs, Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        for violated, reason in self._violations(inputs):
            for run in np.flatnonzero(violated & (status == Status.OK)).tolist():
                reasons[run] = reason
            status[violated] = Status.INADMISSIBLE
        outputs = {output.name: np.full(runs, np.nan) for output in self.model.outputs}
        files: frozenset[str] = frozenset()
        admissible = np.flatnonzero(status == Status.OK)
        if admissible.size:
            # A constraint may be on an input that this model of several does not take.
            taken = [variable.name for variable in self.model.inputs if variable.name in inputs]
            some = {name: inputs[name][admissible] for name in taken}
            results = self.model.evaluate(some)
            self._fill(admissible, results, outputs, status, reasons)
            files = results.files
        return Results(outputs, status, reasons, files)

    def lost(self, runs: int, status: Status, reason: str) -> Results:
        """Results of so many runs that were all lost to the same."""
        outputs = {output.name: np.full(runs, np.nan) for output in self.model.outputs}
        statuses = np.full(runs, status, dtype=np.int8)
        return Results(outputs, statuses, dict.fromkeys(range(runs), reason))

    def _violations(self, inputs: dict[str, FloatArray]) -> Iterator[tuple[Any, str]]:
        yield from inadmissible(self.model, inputs)
        for constraint in self.constraints:
            yield ~constraint.holds(inputs), constraint.text

    def _fill(
        self,
        runs: npt.NDArray[np.int64],
        results: Results,
        outputs: dict[str, FloatArray],
        status: npt.NDArray[np.int8],
        reasons: dict[int, str],
    ) -> None:
        """Put a model's results where they belong, and look for what is not finite."""
        status[runs] = results.status
        reasons.update({int(runs[run]): reason for run, reason in results.reasons.items()})
        for name, values in results.outputs.items():
            outputs[name][runs] = values
            broken = runs[~np.isfinite(values) & (status[runs] == Status.OK)]
            status[broken] = Status.NOT_FINITE
            for run in broken.tolist():
                reasons[run] = f"{name} is {outputs[name][run]}"
        for values in outputs.values():
            values[status != Status.OK] = np.nan


# Anything with the signature of the built-in `map`: what runs the batches, here or elsewhere.
Map = Callable[[Evaluator, Iterable[Any]], Iterable[Results]]


def evaluate(
    evaluator: Evaluator,
    points: xr.Dataset,
    display_units: Mapping[str, str],
    *,
    map: Map = map,
    advance: Callable[[int], None] = lambda runs: None,
) -> xr.Dataset:
    """Run a model over points.

    Parameters
    ----------
    evaluator : Evaluator
        The model with its constraints.
    points : Dataset
        A variable for each input, along ``run`` or a scalar.
    display_units : mapping of str to str
        The unit to show an input or output in, where it is not the model's own.
    map : callable
        Like the built-in: applies the evaluator to batches of points, in their order.
    advance : callable
        Told how many runs more are done.

    Returns
    -------
    Dataset
        The points with an output variable each along ``run``, ``status(run)``, and the reasons of
        lost runs along their own dimension.
    """
    names = list(points.data_vars)
    total = points.sizes[RUN]
    columns = {str(name): np.broadcast_to(points[name].values, total) for name in names}
    batches = (
        {name: column[batch] for name, column in columns.items()}
        for batch in _batches(total, vectorized=evaluator.model.vectorized)
    )
    collected = []
    for results in map(evaluator, batches):
        collected.append(results)
        evaluator.model.consists_of(results.files)
        advance(len(results.status))
    runs = points.assign(_variables(evaluator.model.outputs, collected))
    _describe(runs, evaluator.model, display_units)
    return runs


def join(rounds: Sequence[xr.Dataset]) -> xr.Dataset:
    """The runs of several rounds as those of one design, numbered through.

    Parameters
    ----------
    rounds : sequence of Dataset
        What `evaluate` returned, at least one.

    Returns
    -------
    Dataset
        With the number of each run's round as a coordinate, where there is more than one.
    """
    if len(rounds) == 1:
        return rounds[0]
    sizes = [runs.sizes[RUN] for runs in rounds]
    starts = np.cumsum([0, *sizes[:-1]])
    along_run = [runs.drop_vars([LOST, REASON], errors="ignore") for runs in rounds]
    joined = xr.concat(along_run, RUN, data_vars="minimal", coords="minimal", compat="equals")
    joined = joined.assign_coords({RUN: np.arange(sum(sizes))})
    joined[RUN].attrs = rounds[0][RUN].attrs
    joined = joined.assign_coords({ROUND: (RUN, np.repeat(np.arange(len(rounds)), sizes))})
    joined[ROUND].attrs = {"units": "1", "long_name": "round that the run was made in"}
    lost = [
        runs[[REASON]].assign_coords({LOST: runs[LOST] + start})
        for runs, start in zip(rounds, starts, strict=True)
        if REASON in runs
    ]
    return joined.merge(xr.concat(lost, LOST)) if lost else joined


def worst(runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """The runs of the first of several models, lost where any of them lost its run.

    Parameters
    ----------
    runs : sequence of Dataset
        Of several models at the same points, at least one.

    Returns
    -------
    Dataset
        Where a point is inadmissible to one model, it is so; else with the gravest status.
    """
    first, *others = runs
    if not others:
        return first
    statuses = np.stack([each[STATUS].values for each in runs])
    gravest = statuses.max(axis=0)
    gravest[(statuses == Status.INADMISSIBLE).any(axis=0)] = Status.INADMISSIBLE
    return first.assign({STATUS: first[STATUS].copy(data=gravest)})


def status_counts(runs: xr.Dataset) -> dict[Status, int]:
    """How many runs ended with each status."""
    counts = np.bincount(runs[STATUS].values.astype(np.int64), minlength=len(Status))
    return {status: int(counts[status]) for status in Status}


def _batches(runs: int, *, vectorized: bool) -> Iterator[slice]:
    """Slices of the runs, all of a size that follows from how many there are."""
    parts, smallest, largest = _VECTORIZED if vectorized else _ONE_BY_ONE
    size = min(max(-(-runs // parts), smallest), largest)
    for start in range(0, runs, size):
        yield slice(start, min(start + size, runs))


def _variables(outputs: Sequence[Output], batches: Sequence[Results]) -> dict[str, Any]:
    variables: dict[str, Any] = {}
    for output in outputs:
        values = np.concatenate([batch.outputs[output.name] for batch in batches])
        if output.categories:
            # A lost run is of no kind, which is a kind of its own in an array of whole numbers.
            values = np.where(np.isnan(values), -1, values).astype(np.int8)
        variables[output.name] = (RUN, values)
    variables[STATUS] = (RUN, np.concatenate([batch.status for batch in batches]))
    reasons: dict[int, str] = {}
    start = 0
    for batch in batches:
        reasons.update({start + run: reason for run, reason in batch.reasons.items()})
        start += len(batch.status)
    lost = sorted(reasons)
    if not lost:
        return variables
    variables[LOST] = (LOST, np.array(lost, dtype=np.int64))
    variables[REASON] = (LOST, np.array([reasons[run] for run in lost], dtype=object))
    return variables


def _describe(runs: xr.Dataset, model: Model, display_units: Mapping[str, str]) -> None:
    """Say of every variable what it is, as the CF conventions do."""
    for role, variables in (("input", model.inputs), ("output", model.outputs)):
        for variable in variables:
            if variable.name in runs:
                shown = display_units.get(variable.name, variable.shown_unit)
                measure = {"units": variable.unit, "display_units": shown}
                kinds = variable.categories if isinstance(variable, Output) else ()
                runs[variable.name].attrs = {
                    **runs[variable.name].attrs,
                    "long_name": variable.title,
                    ROLE: role,
                    **(_kinds(kinds) if kinds else measure),
                }
    runs[STATUS].attrs = {"long_name": "what became of the run"}
    runs[STATUS].attrs |= _flags(list(Status), [status.meaning for status in Status])
    runs[RUN].attrs = {
        "standard_name": "realization",
        "units": "1",
        "long_name": "number of the run",
    }
    if REPLICATE in runs:
        runs[REPLICATE].attrs = {"units": "1", "long_name": "number of the run's replicate"}
    if LOST in runs:
        runs[LOST].attrs = {"long_name": "number of a lost run"}
        runs[REASON].attrs = {"long_name": "why the run was lost"}


def _kinds(categories: Sequence[Category]) -> dict[str, Any]:
    """Attributes of an output with kinds; those of no kind are the lost runs."""
    flags = _flags(range(-1, len(categories)), ["lost", *(kind.flag for kind in categories)])
    return {**flags, "flag_labels": ["lost", *(kind.label for kind in categories)]}


def _flags(values: Sequence[int], meanings: Sequence[str]) -> dict[str, Any]:
    return {"flag_values": np.array(values, dtype=np.int8), "flag_meanings": " ".join(meanings)}
