"""What the framework costs per run, with models that do next to nothing.

By turns: the model called in a plain loop (or once, over arrays), and a study's runs of it made in
the process, on two processes and on a Dask cluster of two workers on this machine. The difference,
divided by the runs, is the overhead; its median and range over the repeats are printed.

    python benchmarks/overhead.py
"""

from __future__ import annotations

import argparse
import functools
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np
import xarray as xr

import uqpen
from uqpen.core.model import Model
from uqpen.execution import EvaluationOptions, Evaluator, Map, evaluate
from uqpen.execution.batch import Batch, BatchResult
from uqpen.execution.cluster import Cluster, cluster
from uqpen.execution.evaluator import EvaluatorWork
from uqpen.execution.processes import processes

SOURCE = "def simulate(x, y):\n    return {'z': x + y}\n"
STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
inputs = {{ x = "1", y = "1" }}
outputs = {{ z = "1" }}
vectorized = {vectorized}
[inputs]
x = "0 ± 1"
y = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = 10
"""


# Batches of a single run that tell what one costs.
_BATCHES = 500


def main() -> None:
    """Measure all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    repeats = parser.parse_args().repeats
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "model.py").write_text(SOURCE)
        for name, runs, vectorized, where in (
            ("in the process, vectorized", 1_000_000, True, nullcontext(map)),
            ("in the process, one by one", 100_000, False, nullcontext(map)),
            ("two processes, vectorized", 1_000_000, True, processes(2)),
            ("two processes, one by one", 100_000, False, processes(2)),
            ("Dask, two workers, one by one", 100_000, False, _dask()),
        ):
            text = STUDY.format(vectorized=str(vectorized).lower())
            model = uqpen.parse_study(text, folder=folder).model
            with where as spread:
                overheads = [
                    _overhead(model, runs, spread, vectorized=vectorized)
                    for _ in range(repeats + 1)
                ]
            # The first time, workers load the model.
            told = [f"{1e6 * each:.3g}" for each in _spread(overheads[1:])]
            print(f"{name}: {told[1]} µs a run ({told[0]} to {told[2]})", flush=True)
        _print_dask_chunks(folder, repeats)


def _spread(values: list[float]) -> tuple[float, float, float]:
    return min(values), statistics.median(values), max(values)


def _overhead(model: Model, runs: int, spread: Map, *, vectorized: bool) -> float:
    """Seconds a run more than the model alone."""
    rng = np.random.default_rng(1)
    x, y = rng.random(runs), rng.random(runs)
    points = xr.Dataset({"x": ("run", x), "y": ("run", y)}, {"run": np.arange(runs)})
    function = _plain
    bare = _seconds(
        (lambda: function(x, y))
        if vectorized
        else (lambda: [function(a, b) for a, b in zip(x.tolist(), y.tolist(), strict=True)])
    )
    whole = _seconds(lambda: evaluate(Evaluator(model), points, {}, EvaluationOptions(map=spread)))
    return (whole - bare) / runs


def _plain(x: float, y: float) -> dict[str, float]:
    return {"z": x + y}


def _seconds(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def _print_dask_chunks(folder: Path, repeats: int) -> None:
    """What a batch costs on Dask, whatever its runs cost, beside what Dask costs alone."""
    model = uqpen.parse_study(STUDY.format(vectorized="true"), folder=folder).model
    work = EvaluatorWork(Evaluator(model))
    one = {"x": np.ones(1), "y": np.ones(1)}
    ours, alone = [], []
    with _dask() as spread:
        for _ in range(repeats + 1):
            batches = [Batch(number, one) for number in range(_BATCHES)]
            ours.append(_seconds(functools.partial(_through, spread, work, batches)) / _BATCHES)
            alone.append(_seconds(functools.partial(_through_dask, spread, one)) / _BATCHES)
    ratios = [mine / its for mine, its in zip(ours, alone, strict=True)]
    for name, values in (("ours", ours), ("Dask alone", alone)):
        told = [f"{1e3 * each:.3g}" for each in _spread(values[1:])]
        print(f"a batch on Dask, {name}: {told[1]} ms ({told[0]} to {told[2]})")
    told = [f"{each:.3g}" for each in _spread(ratios[1:])]
    print(f"their ratio, by turns: {told[1]} ({told[0]} to {told[2]})")


def _through(spread: Map, work: EvaluatorWork, batches: list[Batch]) -> list[BatchResult]:
    return list(spread(work, batches))


def _through_dask(spread: Cluster, one: dict[str, np.ndarray]) -> None:
    """As many tasks that give back what they are given, a few at a time."""
    from distributed import as_completed

    client = spread._client
    left, under_way = _BATCHES, 0
    coming = as_completed(loop=client.loop, with_results=True)
    while left or under_way:
        more = min(left, 32 - under_way)
        if more:
            coming.update(client.map(_given_back, [one] * more, pure=False))
        left, under_way = left - more, under_way + more
        under_way -= sum(1 for _ in coming.next_batch(block=True))


def _given_back(value: object) -> object:
    return value


@contextmanager
def _dask() -> Iterator[Cluster]:
    """A cluster of two workers on this machine."""
    from distributed import LocalCluster

    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
        ) as local,
        cluster(local.scheduler_address) as spread,
    ):
        yield spread


if __name__ == "__main__":
    main()
