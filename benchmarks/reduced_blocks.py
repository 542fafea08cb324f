"""Blocks of a Monte Carlo design that are drawn, run and reduced in one place.

A point depends on the seed and its number alone, so any process can draw a block. It sends back
sums of powers and counts between splitters in place of runs, which are the accumulators of the
analysis by blocks (`uqpen.statistics.by_blocks`). A module, as the workers of a cluster import it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.rounds import first_round
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics.by_blocks.blocked_sample import ColumnCounts
from uqpen.study.load import load_study
from uqpen.study.study import ONLY_MODEL

__all__ = ["DESIGN", "Reduction", "collect", "merge", "reduce", "some_values"]

DESIGN = "monte_carlo"

# Runs in short, by output.
Reduction = dict[str, ColumnCounts]


def reduce(study: Path, blocks: range, splitters: Mapping[str, FloatArray]) -> Reduction:
    """Return the runs of blocks in short, by output."""
    found = {name: ColumnCounts.empty(own, own.size, 1) for name, own in splitters.items()}
    for columns, missing in _completed(study, blocks):
        for name, counts in found.items():
            counts.add(0, columns[name])
            counts.missing[0] += missing
    return found


def merge(one: ColumnCounts, other: ColumnCounts) -> ColumnCounts:
    """Return the runs of both; sums follow the order of merging, counts do not."""
    (lowest, highest), (other_lowest, other_highest) = one.ends, other.ends
    ends = np.minimum(lowest, other_lowest), np.maximum(highest, other_highest)
    return replace(
        one,
        counts=one.counts + other.counts,
        powers=one.powers + other.powers,
        ends=np.array(ends),
        missing=one.missing + other.missing,
    )


def collect(
    study: Path, blocks: range, splitters: Mapping[str, FloatArray], asked: Mapping[str, set[int]]
) -> dict[str, FloatArray]:
    """Return the values of blocks that lie in the cells asked for, by output."""
    counts = {name: ColumnCounts.empty(own, own.size, 1) for name, own in splitters.items()}
    found: dict[str, list[FloatArray]] = {name: [] for name in asked}
    for name, cells in asked.items():
        counts[name].asked.update(cells)
    for columns, _ in _completed(study, blocks):
        for name, values in found.items():
            values.append(counts[name].values_asked(columns[name]))
    return {name: np.concatenate(values) for name, values in found.items()}


def some_values(study: Path, splitters: int) -> dict[str, FloatArray]:
    """Return splitters of each output, from the first block."""
    columns, _ = next(_completed(study, range(1)))
    return {
        name: ColumnCounts.empty(values, splitters, 1).splitters for name, values in columns.items()
    }


def _completed(study: Path, blocks: range) -> Iterator[tuple[dict[str, FloatArray], int]]:
    """Draw and run blocks, and yield the outputs of completed runs, and the number of missing."""
    points, evaluator, units = _loaded(study)
    ranges = [*block_ranges(points.size)]
    for block in blocks:
        runs = evaluate(evaluator, points.read(*ranges[block]), units)
        status = runs[STATUS].values
        is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
        columns = {
            output.name: runs[output.name].values[status == Status.OK].astype(np.float64)
            for output in evaluator.model.outputs
        }
        yield columns, int(is_missing.sum())


@functools.lru_cache(maxsize=1)
def _loaded(path: Path) -> tuple[DrawnPoints, Evaluator, dict[str, str]]:
    study = load_study(path)
    stream = Stream(study.seed, "designs", DESIGN)
    points = first_round(study.designs[DESIGN], study.joint, stream)
    variant = study.models[ONLY_MODEL]
    assert isinstance(points, DrawnPoints)
    evaluator = Evaluator(variant.model, study.constraints)
    return points.assign(variant.given), evaluator, study.display_units()
