"""Real runs of an output with predictions of a surrogate that has not seen them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.labels import (
    MISSING_BEYOND,
    MISSING_HIGHEST,
    MISSING_LOWEST,
    MISSING_PREDICTED,
    MISSING_SHARES,
    RUN,
    STATUS,
)
from uqpen.core.status import Status
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitted_surrogate import FittedSurrogate


@dataclass(frozen=True, eq=False)
class CorrectionRuns:
    """Real runs of one output, and what the fits that have not seen them predict.

    A fold is a set of runs with the same fit: training runs with the fit to the other ones, check
    runs with the fit to all training runs.
    """

    values: FloatArray  # (run,): the output by the model, in its SI unit
    predictions: FloatArray  # (run,): the same by the fit of the run's fold
    fold: IntArray  # (run,): the fold of each run, from 0
    # (fold, draw): the predictions of each fold's fit at draws of the input distribution given
    # admissible.
    draws: FloatArray
    draw_replicate: IntArray  # (draw,): the set of quasi-random points that each draw is of, from 0
    # (missing,): predictions at the inputs of the runs that are missing.
    missing_predictions: FloatArray
    missing_fold: IntArray  # (missing,): the fold of each missing run
    # (fold, 2): mean and standard deviation of each fold's fit, where they are known without draws.
    exact_moments: FloatArray | None = None
    level: float = LEVEL  # confidence level of the intervals
    # Density of the input distribution over that by which runs were placed; None where all are 1.
    weights: FloatArray | None = None  # (run,)
    missing_weights: FloatArray | None = None  # (missing,)
    # (run, repeat): all runs at each point of a design that repeats them, NaN where one has failed.
    # A run of `values` is then the first of its point.
    repeats: FloatArray | None = None

    def of(self, function: Callable[[FloatArray], FloatArray]) -> CorrectionRuns:
        """Return the runs of a function of the output."""
        return replace(
            self,
            values=function(self.values),
            predictions=function(self.predictions),
            draws=function(self.draws),
            missing_predictions=function(self.missing_predictions),
            exact_moments=None,
            repeats=None if self.repeats is None else function(self.repeats),
        )

    @property
    def every(self) -> FloatArray:
        """The values of all runs."""
        return self.values if self.repeats is None else self.repeats[~np.isnan(self.repeats)]

    def means(self, function: Callable[[FloatArray], FloatArray] = lambda y: y) -> FloatArray:
        """Return the mean of a function of the output over the runs at each point, shape (run,)."""
        if self.repeats is None:
            return function(self.values)
        return np.asarray(np.nanmean(function(self.repeats), axis=1))

    @cached_property
    def noise(self) -> FloatArray:
        """Variance of the runs at each point, shape (run,); 0 where none is repeated."""
        if self.repeats is None:
            return np.zeros(self.size)
        return np.asarray(np.nanvar(self.repeats, axis=1, ddof=1))

    @cached_property
    def noise_of_means(self) -> FloatArray:
        """Variance of the noise in the mean of the runs at each point, shape (run,)."""
        return self.noise / (1 if self.repeats is None else (~np.isnan(self.repeats)).sum(axis=1))

    @property
    def size(self) -> int:
        """Number of real runs."""
        return len(self.values)

    @property
    def missing(self) -> int:
        """Number of missing runs."""
        return len(self.missing_predictions)

    @property
    def placed(self) -> int:
        """Number of real runs that were not placed as the inputs are distributed."""
        return 0 if self.weights is None else int((self.weights != 1).sum())

    @property
    def share_missing(self) -> float:
        """Share of the runs, or of their weights, that are missing."""
        if self.weights is None or self.missing_weights is None:
            return self.missing / (self.missing + self.size)
        missing = float(self.missing_weights.sum())
        return missing / (missing + float(self.weights.sum()))

    @cached_property
    def shares(self) -> FloatArray:
        """Share of each fold in the runs, shape (fold,)."""
        return np.bincount(self.fold, minlength=len(self.draws)) / self.size

    @property
    def draw_replicates(self) -> int:
        """Number of sets of quasi-random points."""
        return int(self.draw_replicate.max(initial=-1)) + 1

    def pooled(self, draws: FloatArray) -> FloatArray:
        """Return the mean over the folds of something at the draws, shape (draw,)."""
        return np.asarray(self.shares @ draws)

    @cached_property
    def q2(self) -> float:
        """Share of the variance that the predictions explain; 0 where there is none."""
        return _explained(self.values, self.predictions, 0.0)

    @cached_property
    def q2_of_mean(self) -> float:
        """Explained share of the variance of the mean given the inputs, without noise."""
        return _explained(self.means(), self.predictions, float(self.noise_of_means.mean()))


def _explained(values: FloatArray, predictions: FloatArray, noise: float) -> float:
    """Return the share of the variance without noise that predictions explain."""
    errors, variance = values - predictions, float(values.var()) - noise
    return 1 - (float((errors**2).mean()) - noise) / variance if variance > 0 else 0.0


# Predictions of a surrogate at the inputs of failed runs: results that they may have given.


def missing_run_predictions(
    model: FittedSurrogate, runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]
) -> dict[str, dict[str, Any]]:
    """Summarise what a surrogate predicts at the inputs of missing runs, as attributes by output.

    They are the number of predictions and their range and, of an output with thresholds, the shares
    beyond these, by texts that start with ``>`` or ``<``. Inadmissible runs are not missing.
    """
    fit = FoldFit.of(model, runs)
    predicted = fit.predictions(fit.missing) if fit.missing.sizes[RUN] else {}
    found: dict[str, dict[str, Any]] = {}
    for quantity in quantities:
        name = quantity.output.name
        if name not in predicted or quantity.output.dims:
            continue
        values = predicted[name][np.isfinite(predicted[name])]
        if not values.size:
            continue
        found[name] = {
            MISSING_PREDICTED: values.size,
            MISSING_LOWEST: float(values.min()),
            MISSING_HIGHEST: float(values.max()),
        }
        shares = {f"> {each.text}": values > each.value for each in quantity.thresholds}
        shares |= {f"< {each.text}": values < each.value for each in quantity.lower_thresholds}
        if shares:
            found[name][MISSING_BEYOND] = list(shares)
            found[name][MISSING_SHARES] = [float(each.mean()) for each in shares.values()]
    return found


# Fit of a surrogate with the runs that it has not seen.


@dataclass(frozen=True, eq=False)
class FoldFit:
    """Fit, and the completed and the missing runs that it has not seen."""

    model: FittedSurrogate  # of scalar outputs
    completed: xr.Dataset  # runs with a result
    missing: xr.Dataset  # runs without one, but for inadmissible ones

    @classmethod
    def of(cls, model: FittedSurrogate, runs: xr.Dataset) -> FoldFit:
        """Divide runs into completed and missing ones."""
        status = runs[STATUS].values
        is_missing = (status != Status.OK) & (status != Status.INADMISSIBLE)
        return cls(
            model.scalars if isinstance(model, FieldSurrogate) else model,
            runs.isel({RUN: np.flatnonzero(status == Status.OK)}),
            runs.isel({RUN: np.flatnonzero(is_missing)}),
        )

    @property
    def size(self) -> int:
        """Number of completed runs."""
        return int(self.completed.sizes[RUN])

    def inputs(self, runs: xr.Dataset) -> dict[str, FloatArray]:
        """Return the random inputs of some runs."""
        size, names = runs.sizes[RUN], self.model.random_inputs
        return {name: np.broadcast_to(runs[name].values, size) for name in names}

    def predictions(self, runs: xr.Dataset) -> Mapping[str, FloatArray]:
        """Return predictions at some runs, by output."""
        if not self.model.outputs:
            return {}
        found = self.model.evaluate(self.inputs(runs)).outputs
        return {name: np.asarray(each, dtype=np.float64) for name, each in found.items()}
