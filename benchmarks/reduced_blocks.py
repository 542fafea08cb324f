"""Blocks of a Monte Carlo design that are drawn, run and reduced in one place.

A point depends on the seed and its number alone, so any process can draw a block. It sends back
power sums and counts between splitters in place of runs, which are the accumulators of the
analysis by blocks (`uqpen.statistics.by_blocks`). A module, as the workers of a cluster import it.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import STATUS
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import DrawnPoints
from uqpen.designs.rounds import first_round
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics.by_blocks.blocked_sample import PowerSums
from uqpen.statistics.by_blocks.cells import CellCounts, Splitters
from uqpen.study.load import load_study
from uqpen.study.study import ONLY_MODEL

__all__ = ["DESIGN", "Reduction", "collect", "reduce", "some_values"]

DESIGN = "monte_carlo"


@dataclass(frozen=True, eq=False)
class Reduction:
    """The runs of some blocks in short, for one output.

    Parameters
    ----------
    powers : PowerSums
        Of one group.
    counts : ndarray of int, shape (cell,)
    missing : ndarray of int, shape (1,)
        Number of failed runs, but for those at inadmissible points.
    """

    powers: PowerSums
    counts: IntArray
    missing: IntArray

    def merge(self, other: Reduction) -> Reduction:
        """Return the runs of both; sums follow the order of merging, counts do not."""
        return Reduction(
            self.powers.merge(other.powers),
            self.counts + other.counts,
            self.missing + other.missing,
        )


def reduce(study: Path, blocks: range, splitters: Mapping[str, Splitters]) -> dict[str, Reduction]:
    """Return the runs of blocks in short, by output; each block alone, then merged in order."""
    found: dict[str, Reduction] = {}
    for columns, missing in _completed(study, blocks):
        for name, own in splitters.items():
            cells = CellCounts.empty(own, 1)
            cells.add(0, own.locate(columns[name]))
            powers = PowerSums.of_values(columns[name])
            reduction = Reduction(powers, cells.counts[0], np.array([missing]))
            found[name] = found[name].merge(reduction) if name in found else reduction
    return found


def collect(
    study: Path, blocks: range, splitters: Mapping[str, Splitters], asked: Mapping[str, set[int]]
) -> dict[str, FloatArray]:
    """Return the values of blocks that lie in the cells asked for, by output."""
    found: dict[str, list[FloatArray]] = {name: [] for name in asked}
    for columns, _ in _completed(study, blocks):
        for name, cells in asked.items():
            is_asked = np.isin(splitters[name].locate(columns[name]), [*cells])
            found[name].append(columns[name][is_asked])
    return {name: np.concatenate(values) for name, values in found.items()}


def some_values(study: Path, splitters: int) -> dict[str, Splitters]:
    """Return splitters of each output, from the first block."""
    columns, _ = next(_completed(study, range(1)))
    return {name: Splitters.from_values(values, splitters) for name, values in columns.items()}


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
