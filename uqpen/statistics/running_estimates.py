"""Estimates from the rounds of a design so far."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import FAILED_RUN, RUN, SAMPLING
from uqpen.core.lookup import choices
from uqpen.core.sampling import Sampling
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.precision import Precision
from uqpen.execution import first_repeats, join_rounds
from uqpen.statistics import ANALYSES, ANALYSES_OF_DESIGNS
from uqpen.statistics.analyze import OutputStatistics, analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.user_defined_analysis import UserDefinedAnalysis


@dataclass(frozen=True)
class RunningEstimates:
    """Estimates of a design's outputs, as if it had ended with its last round.

    It is a `uqpen.designs.feedback.Estimates`.
    """

    rounds: tuple[Mapping[str, xr.Dataset], ...]  # the runs of each round, by model
    sampling: Sampling  # of the design
    quantities: Mapping[str, Sequence[QuantityOfInterest]]  # by model
    user_defined: Sequence[UserDefinedAnalysis] = ()  # user-defined analyses

    def __call__(
        self, model: str, output: str, *, only: Collection[str] | None = None
    ) -> OutputStatistics:
        """Return the estimate arrays of an output by statistic."""
        if model not in self.quantities:
            raise UnknownNameError(f"no model {model!r}; {choices(model, self.quantities)}")
        asked = {quantity.output.name: quantity for quantity in self.quantities[model]}
        if output not in asked:
            raise UnknownNameError(f"no output {output!r}; {choices(output, asked)}")
        known = {*ANALYSES, *ANALYSES_OF_DESIGNS.get(self.sampling, {})}
        for name in only or ():
            if name not in known:
                raise UnknownNameError(f"no analysis {name!r}; {choices(name, sorted(known))}")
        user_defined = self.user_defined if only is None else ()
        return analyze(self._joined(model), [asked[output]], only=only, user_defined=user_defined)[
            output
        ]

    def _joined(self, model: str) -> xr.Dataset:
        """Return the runs of a model in all rounds."""
        if model not in self._joined_by_model:
            runs = join_rounds([each[model] for each in self.rounds if model in each])
            self._joined_by_model[model] = first_repeats(runs).assign_attrs(
                {SAMPLING: str(self.sampling)}
            )
        return self._joined_by_model[model]

    @cached_property
    def _joined_by_model(self) -> dict[str, xr.Dataset]:
        """Runs that were joined before, as a design may ask for several outputs."""
        return {}


# Number of independent runs that a precision takes, extrapolated from a pilot.

# Bootstrap samples of the pilot, and the probabilities of the quantiles of their numbers of runs.
_SAMPLES, _ENDS = 100, (0.05, 0.95)


class RequiredRuns(NamedTuple):
    """Number of runs that a target takes, with its 90 % bootstrap interval."""

    target: str  # the target in words
    runs: float  # NaN, as its ends, where the pilot gives no interval
    lower: float  # end of the interval
    upper: float  # end of the interval


def required_runs(
    pilot: xr.Dataset,
    quantities: Sequence[QuantityOfInterest],
    rule: Precision,
    rng: np.random.Generator,
) -> Iterator[RequiredRuns]:
    """Yield the number of independent runs that each target takes.

    Half the width of an interval goes with one over the root of the number of runs. How wide it is
    in the pilot is uncertain; bootstrap samples of the pilot show by how much.

    Parameters
    ----------
    pilot : Dataset
        Independent runs of one model; failed runs are resampled, too. Of several runs at each point
        it takes the first.
    rule : Precision
        The targets; those of outputs that the model lacks are left out.
    """
    pilot = first_repeats(pilot)
    size = pilot.sizes[RUN]
    runs = pilot.drop_dims(FAILED_RUN, errors="ignore")
    rows = [np.arange(size), *rng.integers(size, size=(_SAMPLES, size))]
    feedbacks = []
    for chosen in rows:
        made = {"": runs.isel({RUN: chosen})}
        estimates = RunningEstimates((made,), Sampling.INDEPENDENT, {"": quantities})
        feedbacks.append(Feedback(made, estimates))
    for target in rule.each_target():
        if target.output in runs:
            found = [size * target.excess(each, "") ** 2 for each in feedbacks]
            known = [each for each in found[1:] if math.isfinite(each)]
            ends = np.quantile(known, _ENDS).tolist() if known else [math.nan, math.nan]
            yield RequiredRuns(str(target), found[0], *ends)
