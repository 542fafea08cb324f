"""A large Monte Carlo study whose runs are drawn and reduced on two Dask workers, beside today's.

    python benchmarks/reduced_on_workers.py                   # 64 blocks, 4.2 million runs
    python benchmarks/reduced_on_workers.py --blocks 256

`plain.toml` is studied twice on the same workers. Once tasks of some blocks are drawn, run and
reduced where they are, and again for the values that order statistics ask for
(`reduced_blocks.py`). Once `uqpen.make_archive` draws, writes and analyses in this process, as it
is. Processor times of this process and of the scheduler, which limit a large cluster, are printed.
Then moments, quantiles and probabilities of both are compared: the analyses are the same functions.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from distributed import Client
from reduced_blocks import DESIGN, Reduction, collect, merge, reduce, some_values
from two_workers import processor_time, two_workers

import uqpen
from uqpen.core.arrays import FloatArray
from uqpen.core.lookup import resolve
from uqpen.core.sampling import Sampling
from uqpen.core.streams import BLOCK
from uqpen.execution.cluster import cluster
from uqpen.statistics import ANALYSES
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.load import load_study
from uqpen.study.study import ONLY_MODEL

_STUDY = Path(__file__).with_name("plain.toml")
_SPLITTERS = 32_768
# Analyses of distributions alone.
_ANALYSES = ("moments", "quantiles", "percentiles", "holds", "exceedance", "cdfs", "shares")

_Statistics = dict[str, dict[str, xr.DataArray]]


class Spent(NamedTuple):
    """Seconds by the clock, and of processor time of this process and of the scheduler."""

    clock: float
    ours: float
    scheduler: float


class Reducer:
    """Statistics of a study whose blocks are drawn, run and reduced on the workers of a cluster.

    Parameters
    ----------
    study : Path
        The study file, which the workers read as well.
    tasks : sequence of range
        The blocks of each task.
    """

    def __init__(self, study: Path, client: Client, tasks: Sequence[range]) -> None:
        self._study, self._client, self._tasks = study, client, tasks
        self.passes = 0

    def statistics(self) -> _Statistics:
        """Return arrays by output and name; values that they ask for are collected in passes."""
        analyses = [resolve(each) for name in _ANALYSES for each in ANALYSES[name]]
        while True:
            found: _Statistics = {
                quantity.output.name: {
                    name: array
                    for analysis in analyses
                    for name, array in analysis(self._sample(quantity), quantity)
                }
                for quantity in self._quantities
            }
            if not any(each.asked for each in self._columns.values()):
                return found
            self._collect()

    @cached_property
    def _quantities(self) -> tuple[QuantityOfInterest, ...]:
        study = load_study(self._study)
        return study.model_quantities(study.models[ONLY_MODEL].model)

    @cached_property
    def _splitters(self) -> dict[str, FloatArray]:
        return some_values(self._study, _SPLITTERS)

    @cached_property
    def _columns(self) -> Reduction:
        """All runs in short, by output; tasks are merged in their order."""
        first, *others = self._on_workers(reduce)
        for other in others:
            first = {name: merge(own, other[name]) for name, own in first.items()}
        return first

    def _sample(self, quantity: QuantityOfInterest) -> BlockedSample:
        return BlockedSample.of_first(
            1,
            self._columns[quantity.output.name],
            Sampling.INDEPENDENT,
            is_replicated=False,
            level=quantity.confidence_level,
        )

    def _collect(self) -> None:
        """Make the values known that were asked for: workers draw and run all blocks again."""
        asked = {name: set(each.asked) for name, each in self._columns.items() if each.asked}
        parts = list(self._on_workers(collect, asked))
        for name in asked:
            self._columns[name].learn((0, part[name]) for part in parts)

    def _on_workers(self, work: Callable[..., Any], *further: Any) -> Iterator[Any]:
        """Yield the results of all tasks in their order."""
        self.passes += 1
        splitters = self._client.scatter(self._splitters, broadcast=True)
        futures = [
            self._client.submit(work, self._study, task, splitters, *further, pure=False)
            for task in self._tasks
        ]
        for future in futures:
            yield future.result()
            future.release()


def main() -> None:
    """Study the same runs twice, and compare costs and statistics."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blocks", type=int, default=64, help="of 65 536 runs")
    parser.add_argument("--task", type=int, default=8, help="blocks of a task")
    options = parser.parse_args()
    runs = options.blocks * BLOCK
    tasks = [
        range(first, min(first + options.task, options.blocks))
        for first in range(0, options.blocks, options.task)
    ]
    with tempfile.TemporaryDirectory() as place, two_workers() as (address, scheduler):
        path = Path(place) / "study.toml"
        path.write_text(_STUDY.read_text().replace("10_000", str(runs)))
        with Client(address, set_as_default=False) as client:
            reducer = Reducer(path, client, tasks)
            Reducer(path, client, tasks[:1]).statistics()  # the first time, workers load the model
            with _timed("drawn and reduced by workers", runs, scheduler):
                reduced = reducer.statistics()
        print(f"{'':32}{len(tasks)} tasks of {options.task} blocks, {reducer.passes} passes")
        with cluster(address) as spread, _timed("as it is", runs, scheduler):
            archive = uqpen.make_archive(load_study(path), Path(place) / "study.nc", map=spread)
        _compare(reduced, archive)


@contextmanager
def _timed(name: str, runs: int, scheduler: int) -> Iterator[None]:
    """Print the processor times of a study: the limit is the larger of the two."""
    clock, ours, its = time.perf_counter(), time.process_time(), processor_time(scheduler)
    yield
    spent = {
        "this process": time.process_time() - ours,
        "the scheduler": processor_time(scheduler) - its,
        "by the clock": time.perf_counter() - clock,
    }
    told = ", ".join(f"{key} {each:.2f} s" for key, each in spent.items())
    print(f"{name:32}{told}; this process {1e6 * spent['this process'] / runs:.3f} µs a run")


def _compare(reduced: _Statistics, archive: Any) -> None:
    """Print the largest relative difference of each statistic, and whether all bits are equal."""
    largest: dict[str, float] = {}
    for output, statistics in reduced.items():
        archived = archive[f"statistics/{DESIGN}/{output}"].dataset
        for name, array in statistics.items():
            own, other = array.values, archived[name].values
            scale = np.abs(other) + (other == 0)
            difference = float(np.nanmax(np.abs(own - other) / scale, initial=0.0))
            assert (np.isnan(own) == np.isnan(other)).all()
            largest[name] = max(largest.get(name, 0.0), difference)
    for name, difference in largest.items():
        print(f"{name:32}{f'differs by {difference:.1g}' if difference else 'the same bits'}")


if __name__ == "__main__":
    main()
