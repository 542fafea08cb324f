"""Where methods are tried: the study's model on the study's inputs, as a study itself runs it."""

from __future__ import annotations

import time
from dataclasses import dataclass

import xarray as xr

from uqpen.benchmark.statistics import GROUPS
from uqpen.core.labels import BOUND, BOUNDS
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.execution import Evaluator, Map, Progress, evaluate
from uqpen.statistics.analyze import analyze
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ONLY_MODEL, Study
from uqpen.surrogates.surrogate import FittedSurrogate
from uqpen.workflow import run_design

__all__ = ["BenchmarkRunner"]

# Runs that tell how long one takes: of a model that takes many at a time, and of one that does not.
_TIMED_VECTORIZED, _TIMED = 4096, 1


@dataclass(frozen=True)
class BenchmarkRunner:
    """Runs and analyses of a study's model.

    Parameters
    ----------
    study : Study
        With a single model.
    map : callable
        Where batches of runs are made.
    progress : Progress
        Told how far it is.
    """

    study: Study
    map: Map
    progress: Progress

    def run_design(self, design: Design, stream: Stream) -> xr.Dataset:
        """The runs of a design, all rounds of them."""
        runs = run_design(self.study, design, stream, map=self.map, progress=self.progress)
        return runs[ONLY_MODEL]

    def estimates(self, runs: xr.Dataset) -> dict[str, xr.Dataset]:
        """What runs tell of the statistics that are compared, by group."""
        return analyze(runs, self.study.quantities_of_interest, only=GROUPS)

    def surrogate_estimates(self, fitted: FittedSurrogate, stream: Stream) -> dict[str, xr.Dataset]:
        """What a fitted surrogate tells of them, without bounds.

        Those that it has by itself are of sampling it, not of the fit.
        """
        study = self.study
        given = study.models[ONLY_MODEL].given
        draws = SurrogateDraws(fitted, study.joint, study.constraints, given, stream)
        statistics = surrogate_statistics(draws, study.quantities_of_interest, only=GROUPS).groups
        return {
            group: answers.where(answers[BOUND] == BOUNDS[0])
            for group, answers in statistics.items()
        }

    def seconds_per_run(self) -> float:
        """How long a run takes, measured; no number depends on it."""
        count = _TIMED_VECTORIZED if self.study.model.vectorized else _TIMED
        evaluator = Evaluator(self.study.model, self.study.constraints)
        stream = Stream(self.study.seed, "head_to_head", "timing")
        points = next(MonteCarlo(count).rounds(self.study.joint, stream))
        # The first time, the model may have to be loaded where it runs.
        evaluate(evaluator, points, {}, map=self.map)
        began = time.perf_counter()
        evaluate(evaluator, points, {}, map=self.map)
        return (time.perf_counter() - began) / count
