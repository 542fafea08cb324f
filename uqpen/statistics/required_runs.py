"""Number of independent runs that a precision takes, extrapolated from a pilot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.core.labels import FAILED_RUN, RUN
from uqpen.core.sampling import Sampling
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.precision import Precision
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.running_estimates import RunningEstimates

__all__ = ["RequiredRuns", "required_runs"]

# Bootstrap samples of the pilot, and the probabilities of the quantiles of their numbers of runs.
_SAMPLES, _ENDS = 100, (0.05, 0.95)


class RequiredRuns(NamedTuple):
    """Number of runs that a target takes, with its 90 % bootstrap interval.

    Parameters
    ----------
    target : str
        The target in words.
    runs, lower, upper : float
        NaN where the pilot gives no interval of the statistic.
    """

    target: str
    runs: float
    lower: float
    upper: float


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
        Independent runs of one model; failed runs are resampled, too.
    quantities : sequence of QuantityOfInterest
        Of the model.
    rule : Precision
        The targets; those of outputs that the model lacks are left out.
    rng : Generator
        Source of the bootstrap samples.
    """
    size = pilot.sizes[RUN]
    runs = pilot.drop_dims(FAILED_RUN, errors="ignore")
    rows = [np.arange(size), *rng.integers(size, size=(_SAMPLES, size))]
    feedbacks = [_feedback(runs.isel({RUN: chosen}), quantities) for chosen in rows]
    for target in rule.each_target():
        if target.output in runs:
            found = [size * target.excess(each, "") ** 2 for each in feedbacks]
            known = [each for each in found[1:] if math.isfinite(each)]
            ends = np.quantile(known, _ENDS).tolist() if known else [math.nan, math.nan]
            yield RequiredRuns(str(target), found[0], *ends)


def _feedback(runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]) -> Feedback:
    made = {"": runs}
    return Feedback(made, RunningEstimates((made,), Sampling.INDEPENDENT, {"": quantities}))
