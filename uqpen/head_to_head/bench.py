"""Where methods are tried: the study's model on the study's inputs, as a study itself runs it."""

from __future__ import annotations

import time
from dataclasses import dataclass

import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.analyses.of_surrogate import told_by_surrogate
from uqpen.analyses.surrogate_draws import SurrogateDraws
from uqpen.designs.design import Design
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.evaluation import Evaluator, Map, Progress, evaluate
from uqpen.head_to_head.statistics import GROUPS
from uqpen.labels import BOUND, BOUNDS
from uqpen.streams import Stream
from uqpen.study.study import ONLY_MODEL, Study
from uqpen.surrogates.surrogate import FittedSurrogate
from uqpen.workflow import runs_of_design

__all__ = ["Bench"]

# Runs that tell how long one takes: of a model that takes many at a time, and of one that does not.
_TIMED_VECTORIZED, _TIMED = 4096, 1


@dataclass(frozen=True)
class Bench:
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

    def runs(self, design: Design, stream: Stream) -> xr.Dataset:
        """The runs of a design, all rounds of them."""
        made = runs_of_design(self.study, design, stream, map=self.map, progress=self.progress)
        return made[ONLY_MODEL]

    def answers(self, runs: xr.Dataset) -> dict[str, xr.Dataset]:
        """What runs tell of the statistics that are compared, by group."""
        return analyze(runs, self.study.questions, only=GROUPS)

    def answers_of_surrogate(
        self, fitted: FittedSurrogate, stream: Stream
    ) -> dict[str, xr.Dataset]:
        """What a fitted surrogate tells of them, without bounds.

        Those that it has by itself are of sampling it, not of the fit.
        """
        study = self.study
        given = study.models[ONLY_MODEL].given
        draws = SurrogateDraws(fitted, study.law, study.constraints, given, stream)
        told = told_by_surrogate(draws, study.questions, only=GROUPS).groups
        return {
            group: answers.where(answers[BOUND] == BOUNDS[0]) for group, answers in told.items()
        }

    def seconds_per_run(self) -> float:
        """How long a run takes, measured; no number depends on it."""
        count = _TIMED_VECTORIZED if self.study.model.vectorized else _TIMED
        evaluator = Evaluator(self.study.model, self.study.constraints)
        stream = Stream(self.study.seed, "head_to_head", "timing")
        points = next(MonteCarlo(count).rounds(self.study.law, stream))
        # The first time, the model may have to be loaded where it runs.
        evaluate(evaluator, points, {}, map=self.map)
        began = time.perf_counter()
        evaluate(evaluator, points, {}, map=self.map)
        return (time.perf_counter() - began) / count
