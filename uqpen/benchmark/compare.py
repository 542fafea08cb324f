"""Benchmark of methods: from a study and settings to a tree of datasets."""

from __future__ import annotations

import xarray as xr

from uqpen import execution
from uqpen.benchmark.methods import (
    BenchmarkRunner,
    BenchmarkSettings,
    benchmark_statistics,
    study_methods,
)
from uqpen.benchmark.record import EstimateRecord
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.labels import BENCHMARK, KIND
from uqpen.core.streams import Stream
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.execution import Map
from uqpen.execution.checkpoint import Checkpoint
from uqpen.study.study import ValidatedStudy
from uqpen.workflow import root_attributes

# What to put beside a design that has nothing to be compared with.
_SCALED_KINDS = ("monte-carlo", "latin-hypercube", "sobol-sequence", "halton")


class BenchmarkProgress(execution.Progress):
    """Receiver of reports on the progress of a benchmark; this one ignores them."""

    def start_benchmark(self, *, runs: int, reference: int, repeats: int, seconds: float) -> None:
        """Report the total number of runs, those of the reference, and the expected duration."""

    def finish_repeat(self, done: int) -> None:
        """Report the number of completed repeats; 0 once the reference is complete."""


def compare(
    study: ValidatedStudy,
    settings: BenchmarkSettings | None = None,
    *,
    map: Map = map,
    progress: BenchmarkProgress | None = None,
    checkpoint: Checkpoint | None = None,
) -> xr.DataTree:
    """Run the methods of a study at equal budgets and compare their estimates with a reference.

    Parameters
    ----------
    study : ValidatedStudy
        Its designs and surrogates are the methods.
    settings : BenchmarkSettings, optional
        Budgets, repeats and the size of the reference.
    map : callable
        Like the built-in; it makes the batches of runs. It cannot change a result.
    progress : BenchmarkProgress, optional
        Receives reports of progress.
    checkpoint : Checkpoint, optional
        Has the runs of one design after the other, each until it is analysed. Without it, they are
        in memory.

    Returns
    -------
    DataTree
        The reference and the methods as sources of ``/statistics``, with estimates, errors,
        coverage and slopes of each output, and the verdicts in ``/comparison/<output>``.

    Raises
    ------
    SettingsError
        If the study has nothing to compare.
    """
    settings, progress = settings or BenchmarkSettings(), progress or BenchmarkProgress()
    check_study(study, settings)
    methods = study_methods(study, settings.budgets)
    progress.start_preparation(study.model.name)
    study.model.prepare()
    runner = BenchmarkRunner(study, map, progress, checkpoint or Checkpoint())
    runs, replicates = settings.reference_design(vectorized=study.model.vectorized)
    each = sum(method.cost(budget).runs for method in methods for budget in settings.budgets)
    total = runs + each * settings.repeats
    seconds = runner.seconds_per_run() * total
    progress.start_benchmark(runs=total, reference=runs, repeats=settings.repeats, seconds=seconds)
    stream = Stream(study.seed, "head_to_head", "reference")
    reference = runner.estimates(runner.run_design(SobolSequence(runs, replicates), stream))
    progress.finish_repeat(0)
    statistics = list(benchmark_statistics(study.quantities_of_interest))
    record = EstimateRecord(methods, settings, statistics, reference)
    # Repeat by repeat: each takes as long as the one before, so the end can be predicted.
    for repeat in range(settings.repeats):
        for position, method in enumerate(methods):
            for number, budget in enumerate(settings.budgets):
                if method.cost(budget).runs:
                    stream = Stream(study.seed, "head_to_head", method.name, budget, repeat)
                    record.add(position, number, repeat, method.estimates(runner, budget, stream))
        progress.finish_repeat(repeat + 1)
    root = xr.Dataset(attrs={**root_attributes(study), KIND: BENCHMARK})
    return xr.DataTree.from_dict({"/": root, **dict(record.groups(runs))})


def check_study(study: ValidatedStudy, settings: BenchmarkSettings) -> None:
    """Raise a `SettingsError` for a study that has nothing to compare, before anything runs."""
    if study.has_several_models:
        found = f"{len(study.models)} models, {', '.join(study.models)}"
        expected = "a single [model]: methods are compared on one"
        raise SettingsError([Problem(("models",), found, expected)])
    able = sorted({method.source for method in study_methods(study, settings.budgets)})
    if len(able) < 2:
        found = f"{f'only {able[0]}' if able else 'none'} that can be scaled to these budgets"
        expected = f"at least two, of kinds {', '.join(_SCALED_KINDS)}, or a surrogate"
        raise SettingsError([Problem(("designs",), found, expected)])
    if next(benchmark_statistics(study.quantities_of_interest), None) is None:
        raise SettingsError([Problem(("model",), "no output that is a number", "at least one")])
