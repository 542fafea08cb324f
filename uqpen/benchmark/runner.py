"""Runs for the methods of a benchmark: the study's model at its inputs, as in the study itself."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import xarray as xr

from uqpen.benchmark.statistics import COMPARED_ANALYSES, Estimates
from uqpen.core.labels import BOUND, BOUNDS
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.rounds import first_round
from uqpen.execution import EvaluationOptions, Evaluator, Map, Progress, evaluate
from uqpen.execution.checkpoint import Checkpoint
from uqpen.statistics.analyze import analyze
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ONLY_MODEL, ValidatedStudy
from uqpen.surrogates.fitted_surrogate import FittedSurrogate
from uqpen.workflow import run_design

__all__ = ["BenchmarkRunner"]

# Numbers of runs to measure the duration of one: for a vectorized model, and for another.
_TIMED_VECTORIZED, _TIMED = 4096, 1


@dataclass(frozen=True)
class BenchmarkRunner:
    """Runs and analyses of the single model of a study.

    The map makes batches of runs. The checkpoint has the runs of a round until they are analysed.
    """

    study: ValidatedStudy
    map: Map
    progress: Progress
    checkpoint: Checkpoint

    @property
    def quantities(self) -> tuple[QuantityOfInterest, ...]:
        """The quantities of interest; all benchmarks have the same confidence level."""
        asked = self.study.quantities_of_interest
        return tuple(replace(quantity, confidence_level=LEVEL) for quantity in asked)

    def run_design(self, design: Design, stream: Stream) -> xr.Dataset:
        """Make the runs of a design, in all its rounds."""
        runs = run_design(
            self.study,
            design,
            stream,
            map=self.map,
            progress=self.progress,
            round_checkpoint=lambda model, number: self.checkpoint,
        )
        return runs[ONLY_MODEL]

    def estimates(self, runs: xr.Dataset) -> Estimates:
        """Return the estimates from runs, by output and statistic."""
        return analyze(runs, self.quantities, only=COMPARED_ANALYSES)

    def surrogate_estimates(self, fitted: FittedSurrogate, stream: Stream) -> Estimates:
        """Return the estimates of a fitted surrogate, without bounds.

        Its own bounds are of sampling it, not of the fit.
        """
        study = self.study
        given = study.models[ONLY_MODEL].given
        draws = SurrogateDraws(fitted, study.joint, study.constraints, given, stream)
        found = surrogate_statistics(draws, self.quantities, only=COMPARED_ANALYSES).outputs
        return {
            output: {name: each.where(each[BOUND] == BOUNDS[0]) for name, each in arrays.items()}
            for output, arrays in found.items()
        }

    def seconds_per_run(self) -> float:
        """Measure the duration of a run; no estimate depends on it."""
        count = _TIMED_VECTORIZED if self.study.model.vectorized else _TIMED
        evaluator = Evaluator(self.study.model, self.study.constraints)
        stream = Stream(self.study.seed, "head_to_head", "timing")
        # In memory, as the time is that of runs alone.
        points = points_in_memory(first_round(MonteCarlo(count), self.study.joint, stream))
        options = EvaluationOptions(map=self.map)
        # The first time, the model may have to be loaded where it runs.
        evaluate(evaluator, points, {}, options)
        began = time.perf_counter()
        evaluate(evaluator, points, {}, options)
        return (time.perf_counter() - began) / count
