"""What 1e10 runs on a hundred Dask workers would cost, from costs measured on two workers here.

    python benchmarks/cluster_costs.py --markdown docs/clusters.md

Batches of the Ishigami function go to two workers over loopback: some of one run, and some of a
block of 65 536 runs. The first have the cost of a task; what the second take more is that of their
bytes. Processor time of this process and of the scheduler is measured apart. Each of them is one
process, however many workers there are, so that the dearer one limits a study.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from seed_table import fill, lines

from uqpen.core.streams import BLOCK
from uqpen.execution import Evaluator
from uqpen.execution.batch import Batch
from uqpen.execution.cluster import Cluster, cluster
from uqpen.execution.evaluator import EvaluatorWork
from uqpen.models.known_functions import Ishigami

WORKERS, RUNS = 100, 1e10
# Three inputs, an output and the status of a run of the Ishigami function; those of a rod.
BYTES_A_RUN, BYTES_A_ROD = 3 * 8 + 8 + 1, 66
SINGLES, BLOCKS = 400, 24
# Seconds a run of the rod (`limit`), of its drawings, and of all statistics by blocks
# (`large_samples.py`); bytes of what a block would be reduced to: counts between 32 768 splitters
# and 2 048 bins for each of four inputs, and sums, for three outputs.
ROD, DRAWINGS, STATISTICS = 2.4e-6, 0.3e-6, 1.3e-6
REDUCED = 3 * 8 * (32_768 + 4 * 2_048)


class Costs(NamedTuple):
    """Processor seconds of a task and of a byte, at this process and at the scheduler."""

    ours_task: float
    ours_byte: float
    scheduler_task: float
    scheduler_byte: float


class Plan(NamedTuple):
    """A study on a cluster: its tasks, their bytes, what else a run costs, and where."""

    name: str
    tasks: float
    bytes_a_task: float
    work_a_run: float
    ours_a_run: float

    def seconds(self, costs: Costs) -> dict[str, float]:
        """Return seconds of each worker, of this process and of the scheduler."""
        sent = self.bytes_a_task
        ours = self.tasks * (costs.ours_task + sent * costs.ours_byte) + RUNS * self.ours_a_run
        return {
            "each worker": RUNS * self.work_a_run / WORKERS,
            "this process": ours,
            "the scheduler": self.tasks * (costs.scheduler_task + sent * costs.scheduler_byte),
        }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
    options = parser.parse_args()
    with two_workers() as (address, scheduler), cluster(address) as spread:
        _measure(spread, scheduler)  # the first time, workers load the model
        found = [_measure(spread, scheduler) for _ in range(options.repeats)]
    text = "\n".join(_lines(found))
    print(text)
    if options.markdown:
        fill(options.markdown, "costs of a cluster", text)


def _measure(spread: Cluster, scheduler: int) -> Costs:
    one = _seconds(spread, scheduler, SINGLES, 1)
    block = _seconds(spread, scheduler, BLOCKS, BLOCK)
    ours, its = ((b - a) / (BLOCK * BYTES_A_RUN) for a, b in zip(one, block, strict=True))
    return Costs(one[0], max(ours, 0.0), one[1], max(its, 0.0))


def _seconds(spread: Cluster, scheduler: int, tasks: int, runs: int) -> tuple[float, float]:
    """Processor seconds a task of this process and of the scheduler."""
    inputs = {name: np.full(runs, 0.5) for name in ("x1", "x2", "x3")}
    batches = [Batch(number * runs, inputs) for number in range(tasks)]
    began, before = time.process_time(), processor_time(scheduler)
    made = sum(map(len, spread(EvaluatorWork(Evaluator(Ishigami())), batches)))
    assert made == tasks * runs
    return ((time.process_time() - began) / tasks, (processor_time(scheduler) - before) / tasks)


@contextmanager
def two_workers() -> Iterator[tuple[str, int]]:
    """Start them; yield the address of the scheduler and the id of its process."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there,))
    process.start()
    try:
        address = here.recv()
        assert process.pid is not None
        yield address, process.pid
    finally:
        here.send("end")
        process.join()


def processor_time(process: int) -> float:
    """Seconds of processor time that a process has taken so far."""
    import psutil

    return float(sum(psutil.Process(process).cpu_times()[:2]))


def _serve(pipe: Connection) -> None:
    """Run a scheduler until it is told to end; its workers are processes of their own."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as local:
        pipe.send(local.scheduler_address)
        pipe.recv()


def _plans() -> tuple[Plan, ...]:
    blocks = RUNS / BLOCK
    rod = ROD + DRAWINGS
    return (
        Plan("rods, as it is", blocks, BLOCK * BYTES_A_ROD, ROD, DRAWINGS + STATISTICS),
        Plan("rods, drawn and reduced by workers", blocks, REDUCED, rod + STATISTICS, 0.0),
        Plan("these, 64 blocks a task", blocks / 64, REDUCED, rod + STATISTICS, 0.0),
        Plan(
            "1 ms a run, 200 runs a task",
            RUNS / 200,
            200 * BYTES_A_ROD,
            1e-3,
            DRAWINGS + STATISTICS,
        ),
        Plan(
            "these, 2 000 runs a task",
            RUNS / 2_000,
            2_000 * BYTES_A_ROD,
            1e-3,
            DRAWINGS + STATISTICS,
        ),
    )


def _lines(found: list[Costs]) -> Iterator[str]:
    costs = Costs(*map(median, zip(*found, strict=True)))
    rows = [
        [f"{name} [ms]", *(_spread([each[field] * scale for each in found]) for field in fields)]
        for name, fields, scale in (("a task", (0, 2), 1e3), ("a megabyte", (1, 3), 1e9))
    ]
    yield from lines(["measured, processor time", "this process", "the scheduler"], rows)
    yield ""
    heads = ["tasks", "each worker", "this process", "scheduler", "limit"]
    rows = []
    for plan in _plans():
        seconds = plan.seconds(costs)
        most = max(seconds, key=lambda name: seconds[name])
        rows.append([plan.name, f"{plan.tasks:.2g}", *map(_duration, seconds.values()), most])
    yield from lines([f"1e10 runs, {WORKERS} workers", *heads], rows)


def _spread(values: list[float]) -> str:
    return f"{median(values):.2g} ({min(values):.2g} to {max(values):.2g})"


def _duration(seconds: float) -> str:
    for unit, size in (("d", 86_400), ("h", 3_600), ("min", 60)):
        if seconds >= size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


if __name__ == "__main__":
    main()
