"""Choice of the finished runs that are made again before all of them are taken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from uqpen.checkpoints.identity import depends_on_batch
from uqpen.checkpoints.parts import FinishedRuns, select_results
from uqpen.checkpoints.reuse import BY_MACHINE, by_inputs
from uqpen.checkpoints.sources import RunSource
from uqpen.core.arrays import Arrays, BoolArray, FloatArray, IntArray
from uqpen.core.model import Model
from uqpen.core.status import Status
from uqpen.execution.batch import join_results
from uqpen.execution.batching import BATCH_SIZE

__all__ = ["ChosenRuns", "choose_runs", "order_runs"]

# As many as a batch has: they meet a change of 1 % of the inputs' space for sure.
_MOST = 1024

# Of very many runs, so many are sorted to bound the lowest values of all.
_SOME = 8192


class ChosenRuns(NamedTuple):
    """Finished runs that are made again, in this order.

    Attributes
    ----------
    runs : FinishedRuns
        The runs.
    status : Status
        The runs with this status are compared.
    is_batch : bool
        True if they have to be made together.
    is_whole : bool
        True if they are known to have been made as they will be now, in the same batch.
    designs : tuple of str
        The designs that they are of.
    total : int
        The number of runs from which they are chosen.
    """

    runs: FinishedRuns
    status: Status
    is_batch: bool
    is_whole: bool
    designs: tuple[str, ...]
    total: int


def choose_runs(
    model: Model, sources: Sequence[RunSource], generator: np.random.Generator
) -> ChosenRuns | None:
    """Choose up to 1 024 runs, those that are ok; where none is, one that failed.

    Of a model whose results may depend on the batch, it is a batch with many extremes. There are
    none (None) among runs that are inadmissible, or that failed as it depends on the machine.

    Parameters
    ----------
    model : Model
        The model of the runs.
    sources : sequence of RunSource
        The runs that may be taken.
    generator : numpy.random.Generator
        Draws the runs that are no extremes.
    """
    alike = by_inputs(model, sources).values()
    if not alike:
        return None
    # Models of one study may be given other inputs; most runs have the same ones.
    of_one_kind = max(alike, key=_count_ok)
    is_ok = _has_status(of_one_kind, Status.OK)
    if is_ok.any():
        status, is_wanted = Status.OK, is_ok
    else:
        status, is_wanted = _first_failure(of_one_kind)
    if not is_wanted.any():
        return None
    at = np.flatnonzero(is_wanted)
    order = at[order_runs(_columns(of_one_kind, at), generator)]
    if depends_on_batch(model):
        return _chosen_batch(of_one_kind, order, status)
    order = order if status is Status.OK else order[:1]
    return _chosen(of_one_kind, order, status, is_batch=False, is_whole=True)


def order_runs(columns: Arrays, generator: np.random.Generator) -> IntArray:
    """Return positions of runs by turns: those at the ends of each input, and random ones.

    Parameters
    ----------
    columns : mapping of str to ndarray, shape (run,)
        The inputs of runs.
    generator : numpy.random.Generator
        Draws the random ones.

    Returns
    -------
    ndarray of int
        At most 1 024, each once. The first few of them are a choice of fewer runs.
    """
    size = len(next(iter(columns.values())))
    varied = [values for values in columns.values() if (values != values[0]).any()]
    each = -(-_MOST // (4 * max(len(varied), 1)))
    ends = [_lowest(sign * values, each) for values in varied for sign in (1.0, -1.0)]
    drawn = generator.choice(size, min(_MOST, size), replace=False)
    extremes = np.stack(ends, axis=1).ravel()[: len(drawn)] if ends else drawn
    turns = np.concatenate(
        [np.stack([extremes, drawn[: len(extremes)]], axis=1).ravel(), drawn[len(extremes) :]]
    )
    _, first = np.unique(turns, return_index=True)
    return np.asarray(turns[np.sort(first)][:_MOST], dtype=np.int64)


def _lowest(values: FloatArray, number: int) -> IntArray:
    """Return the positions of the lowest values, in ascending order."""
    number = min(number, len(values))
    # A value of some of them bounds the lowest of all, which are then a few.
    some = np.sort(values[:: len(values) // _SOME + 1])
    at = np.flatnonzero(values <= some[min(number, len(some) - 1)])
    return np.asarray(at[np.argsort(values[at], kind="stable")][:number], dtype=np.int64)


def _count_ok(sources: Sequence[RunSource]) -> int:
    return int(_has_status(sources, Status.OK).sum())


def _has_status(sources: Sequence[RunSource], status: Status) -> BoolArray:
    return np.concatenate([each.runs.results.status for each in sources]) == status


def _first_failure(sources: Sequence[RunSource]) -> tuple[Status, BoolArray]:
    """Return the status of a failed run that has to fail again, and a mask of all runs with it."""
    for status in (Status.FAILED, Status.NOT_FINITE):
        if (mask := _has_status(sources, status)).any():
            return status, mask
    return Status.FAILED, mask


def _columns(sources: Sequence[RunSource], at: IntArray) -> Arrays:
    parts = [each.runs.inputs for each in sources]
    columns = {
        name: np.concatenate([part[name] for part in parts]) if len(parts) > 1 else values
        for name, values in parts[0].items()
    }
    size = sum(len(each.runs.runs) for each in sources)
    return columns if len(at) == size else {name: columns[name][at] for name in columns}


def _chosen(
    sources: Sequence[RunSource],
    at: IntArray,
    status: Status,
    *,
    is_batch: bool,
    is_whole: bool,
) -> ChosenRuns:
    """Return the runs at positions among those of all sources, in this order."""
    starts = np.cumsum([0, *(len(each.runs.runs) for each in sources)])
    numbers = np.searchsorted(starts, at, side="right") - 1
    by_source = np.argsort(numbers, kind="stable")
    used = np.unique(numbers).tolist()
    own = {each: at[by_source][numbers[by_source] == each] - starts[each] for each in used}
    back = np.argsort(by_source)
    inputs = {
        name: np.concatenate([sources[each].runs.inputs[name][own[each]] for each in used])[back]
        for name in sources[0].runs.inputs
    }
    results = join_results([select_results(sources[each].runs.results, own[each]) for each in used])
    runs = np.concatenate([sources[each].runs.runs[own[each]] for each in used])[back]
    return ChosenRuns(
        FinishedRuns(runs, inputs, select_results(results, back)),
        status,
        is_batch,
        is_whole,
        tuple(dict.fromkeys(sources[each].design for each in used)),
        int(starts[-1]),
    )


def _chosen_batch(
    sources: Sequence[RunSource], order: IntArray, status: Status
) -> ChosenRuns | None:
    """Return the batch that has most of some runs, whole ones first."""
    statuses = np.concatenate([each.runs.results.status for each in sources])
    marks = np.zeros(len(statuses), dtype=np.int64)
    marks[order] = 1
    starts = np.cumsum([0, *(len(each.runs.runs) for each in sources)])
    batches = [
        (is_whole, int(marks[start + batch].sum()), start + batch)
        for start, source in zip(starts, sources, strict=False)
        for batch, is_whole in _batches(source)
    ]
    for is_whole, number, at in sorted(batches, key=lambda each: each[:2], reverse=True):
        if number and not np.isin(statuses[at], BY_MACHINE).any():
            # A model does not get the inadmissible points of a batch.
            admissible = at[statuses[at] != Status.INADMISSIBLE]
            return _chosen(sources, admissible, status, is_batch=True, is_whole=is_whole)
    return None


def _batches(source: RunSource) -> Iterator[tuple[IntArray, bool]]:
    """Yield the positions of the runs of each batch, and whether it is known to be whole."""
    whole = [*source.whole_batches()]
    yield from ((batch, True) for batch in whole)
    if not whole:
        # The last batch of a round may have fewer, and so has one whose runs were discarded.
        numbers = source.runs.runs // BATCH_SIZE
        yield np.flatnonzero(numbers == numbers[-1]), False
