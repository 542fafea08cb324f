"""Posterior of a dear model, from weighted runs at draws of a surrogate's posterior."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import PREDICTED_LOG_LIKELIHOOD, SEARCH_ROUND, VARIANCE_SCALE
from uqpen.designs.posterior import error_stds
from uqpen.measurements import Experiments
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate
from uqpen.statistics.intervals import student_interval
from uqpen.statistics.posterior import (
    MANY_FAILED,
    PROBABILITIES,
    described_statistics,
    failed_shares,
    no_posterior,
    predicted_rows,
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


def weighted_statistics(
    measured: Experiments, runs: xr.Dataset, level: float
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield what the runs of a posterior by a surrogate say, by the names of the catalogue."""
    names = (*measured.unknown, *(each.name for each in measured.sizes))
    stds = error_stds(measured, runs)
    values = np.column_stack([*(measured.drawn(runs, name) for name in measured.unknown), stds])
    results = measured.predicted(runs)
    found = measured.log_likelihood(results, stds)
    number, predicted, scales = (
        runs[name].values[:: measured.count]
        for name in (SEARCH_ROUND, PREDICTED_LOG_LIKELIHOOD, VARIANCE_SCALE)
    )
    last, of_prior = number == RESULT, number == 0
    failed = float(np.isnan(found[of_prior]).mean())
    if not last.any():
        reason = texts.NO_SURROGATE.format(share=1 - failed, draws=len(found))
        yield from no_posterior(measured, reason, level)
        return
    posterior = WeightedPosterior(names, values[last], found[last], predicted[last], level)
    used = posterior.weights * np.isfinite(posterior.log_likelihood)
    if np.count_nonzero(used) > 1:
        at = np.flatnonzero(last)[used > 0]
        yield from predicted_rows(measured, results[at], stds[at], used[used > 0] / used.sum())
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
        "variance_scale": float(scales[last][0]),
    }
    yield from described_statistics(measured, estimates, numbers, level)
    yield failed_shares(measured, runs, last)
