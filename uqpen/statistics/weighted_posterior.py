"""Posterior of a dear model, from weighted runs at draws of a surrogate's posterior."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray, IntArray, rows_by_weight
from uqpen.core.labels import (
    IMPORTANCE_WEIGHT,
    PREDICTED_LOG_LIKELIHOOD,
    SEARCH_ROUND,
    VARIANCE_SCALE,
    WEIGHTED_POSTERIOR,
)
from uqpen.core.status import MANY_FAILED
from uqpen.core.streams import Stream
from uqpen.designs.posterior import error_stds, log_likelihoods
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.measurements.experiments import Experiments
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate, NamedArrays
from uqpen.statistics.intervals import student_interval
from uqpen.statistics.posterior import (
    CHAINS,
    PROBABILITIES,
    arviz_groups,
    described_statistics,
    failed_shares,
    no_posterior,
    predicted_rows,
    unknown_values,
    unknowns_dataset,
)
from uqpen.statistics.weights import (
    effective_sizes,
    weighted_mean,
    weighted_mean_error,
    weighted_quantile,
)
from uqpen.surrogates.surrogate_posterior import RESULT, importance_weights

# Share of the draws of the result that have to be effective, so that the model confirms them.
_CONFIRMED = 1 / 3
# Rounding of a number of draws that equal weights give.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class WeightedPosterior:
    """Independent draws of a surrogate's posterior, and how the model weights them.

    Where the model does not confirm them, all weights are the same: it is the surrogate's.
    """

    names: tuple[str, ...]  # of the unknowns
    values: FloatArray  # (draw, unknown)
    log_likelihood: FloatArray  # (draw,): NaN where a run failed
    predicted: FloatArray  # (draw,): the same by the surrogate
    level: float = LEVEL  # confidence level

    @cached_property
    def model_weights(self) -> FloatArray:
        """Weights by the model, shape (draw,)."""
        return importance_weights(self.log_likelihood, self.predicted)

    @property
    def effective_draws(self) -> float:
        """Number of independent draws of the posterior that they are worth, by the model."""
        return float(effective_sizes(self.model_weights))

    @property
    def is_confirmed(self) -> bool:
        """True if the weights by the model are the result."""
        return self.effective_draws >= _CONFIRMED * len(self.values)

    def of_surrogate(self) -> WeightedPosterior:
        """Return the draws as the surrogate alone weights them."""
        return WeightedPosterior(
            self.names, self.values, self.predicted, self.predicted, self.level
        )

    @property
    def failed_share(self) -> float:
        """Share of failed runs, which have the weight 0."""
        return float(np.isnan(self.log_likelihood).mean())

    @property
    def note(self) -> str:
        """Text on weights by the model that are no result, and on failed runs; mostly empty."""
        found = []
        if not self.is_confirmed:
            numbers = {"size": self.effective_draws, "draws": len(self.values)}
            found.append(texts.NOT_CONFIRMED.format(**numbers))
        if self.failed_share > MANY_FAILED:
            found.append(texts.FAILED_AT_POSTERIOR.format(share=self.failed_share))
        return "; ".join(found)

    @cached_property
    def weights(self) -> FloatArray:
        """Weights of the result, shape (draw,)."""
        size = len(self.values)
        return self.model_weights if self.is_confirmed else np.full(size, 1 / size)

    @property
    def mean(self) -> Estimate:
        """Means of the unknowns."""
        return self._estimate(weighted_mean(self.values.T, self.weights), self.values.T)

    @property
    def std(self) -> Estimate:
        """Standard deviations of the unknowns."""
        size = float(effective_sizes(self.weights))
        squares = (self.values.T - self.mean.value[:, np.newaxis]) ** 2
        spread = np.sqrt(weighted_mean(squares, self.weights) * size / (size - 1))
        return self._estimate(spread, squares / (2 * spread[:, np.newaxis]))

    def quantile(self, probability: float) -> FloatArray:
        """Return the quantiles of the unknowns at a probability.

        They are as far out as ranks of the effective number n of draws by n + 1, so that a further
        draw lies below them with this probability.
        """
        further = (probability - 0.5) / float(effective_sizes(self.weights))
        return weighted_quantile(self.values.T, self.weights, [probability + further])[:, 0]

    def _estimate(self, value: FloatArray, influence: FloatArray) -> Estimate:
        error = weighted_mean_error(influence, self.weights)
        freedom = float(effective_sizes(self.weights)) - 1
        bounds = student_interval(value, error, freedom, self.level)
        return Estimate(value, *bounds, texts.STUDENT_OVER_WEIGHTED_DRAWS, "nominal")


# The statistics of an archive.


def _weighted_posterior(
    measured: Experiments, runs: xr.Dataset, level: float
) -> tuple[WeightedPosterior, IntArray, FloatArray]:
    """Return the weighted draws, their numbers, and the log-likelihoods of all draws."""
    names, values = unknown_values(measured, runs)
    number, predicted = (
        runs[name].values[:: measured.count] for name in (SEARCH_ROUND, PREDICTED_LOG_LIKELIHOOD)
    )
    last = np.flatnonzero(number == RESULT)
    found = log_likelihoods(measured, runs)
    return WeightedPosterior(names, values[last], found[last], predicted[last], level), last, found


def weighted_statistics(measured: Experiments, runs: xr.Dataset, level: float) -> NamedArrays:
    """Yield what the runs of a posterior by a surrogate say, by the names of the catalogue."""
    posterior, last, found = _weighted_posterior(measured, runs, level)
    _, values = unknown_values(measured, runs)
    of_prior = runs[SEARCH_ROUND].values[:: measured.count] == 0
    failed = float(np.isnan(found[of_prior]).mean())
    if not len(last):
        reason = texts.NO_SURROGATE.format(share=1 - failed, draws=len(values))
        yield from no_posterior(measured, reason, level)
        return
    used = posterior.weights * np.isfinite(posterior.log_likelihood)
    if np.count_nonzero(used) > 1:
        at, shares = last[used > 0], used[used > 0] / used.sum()
        results, stds = measured.predicted(runs)[at], error_stds(measured, runs)[at]
        yield from predicted_rows(measured, results, stds, shares)
    alone = posterior.of_surrogate()
    ends = [posterior.quantile(each) for each in PROBABILITIES]
    size = float(effective_sizes(posterior.weights))
    estimates = {
        "posterior_mean": posterior.mean.with_note(posterior.note),
        "posterior_std": posterior.std,
        "posterior_quantile": Estimate.without_bounds(
            np.column_stack(ends), texts.RANKS_OF_WEIGHTED_DRAWS.format(size=size)
        ),
        "surrogate_mean": alone.mean,
        "surrogate_std": alone.std,
    }
    prior_std = values[of_prior].std(axis=0, ddof=1)
    numbers: dict[str, FloatArray | float] = {
        "prior_std": prior_std,
        "learnt": 1 - posterior.std.value / prior_std,
        "confirmed": float(posterior.is_confirmed),
        "effective_number": posterior.effective_draws,
        "prior_failed_share": failed,
        "posterior_failed_share": posterior.failed_share,
        "variance_scale": float(runs[VARIANCE_SCALE].values[:: measured.count][last[0]]),
    }
    yield from described_statistics(measured, estimates, numbers, level)
    yield failed_shares(measured, runs, last)


def weighted_groups(
    joint: JointDistribution, measured: Experiments, runs: xr.Dataset, stream: Stream
) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the weighted draws that the model confirms, then the groups of `arviz_groups`.

    These have draws of equal weight: what reads them weights all alike, and takes them to be
    independent. They are as many as the largest weight allows with none of them twice.
    """
    posterior, last, found = _weighted_posterior(measured, runs, LEVEL)
    if not (len(last) and posterior.is_confirmed):
        return
    taken = np.flatnonzero(posterior.weights)
    weights = posterior.weights[taken]
    draws = unknowns_dataset(measured, runs, posterior.values[np.newaxis, taken])
    beside = {IMPORTANCE_WEIGHT: weights, "draw_number": last[taken]}
    yield WEIGHTED_POSTERIOR, draws.assign({key: (CHAINS, [each]) for key, each in beside.items()})
    size = math.floor(1 / weights.max() + _ROUNDING)
    places = np.arange(size) + stream.generator("equal weights").random()
    equal = last[taken[rows_by_weight(weights, places / size)]]
    prior = np.flatnonzero(runs[SEARCH_ROUND].values[:: measured.count] == 0)
    _, values = unknown_values(measured, runs)
    groups = {"posterior": (equal[np.newaxis], values), "prior": (prior[np.newaxis], values)}
    yield from arviz_groups(joint, measured, runs, groups, found, stream)
