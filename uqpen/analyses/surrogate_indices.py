"""Sobol' indices and Shapley effects of a model, as its surrogate tells them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.estimate import Estimate
from uqpen.analyses.given_inputs import INCLUDES_CORRELATION, along_inputs
from uqpen.analyses.probabilities import threshold_coordinates
from uqpen.analyses.question import Question
from uqpen.analyses.shared_draws import MOST_INPUTS_FOR_ALL_SETS
from uqpen.analyses.surrogate_draws import FROM_COEFFICIENTS, SurrogateDraws
from uqpen.labels import ESTIMATOR, INPUT
from uqpen.surrogates.closed_forms import shapley_effects, sobol_indices

__all__ = ["surrogate_indices"]

FloatArray = npt.NDArray[np.float64]
# An index and the standard error that sampling the surrogate leaves it; NaN where it is exact.
Index = tuple[float, float]
# First-order, total-order indices and Shapley effects, each along the inputs; None for none.
Indices = list[list[Index] | None]

# How their names end, in that order.
_ORDERS = {
    "first_order": "first-order Sobol' indices",
    "total_order": "total-order Sobol' indices",
    "shapley": "Shapley effects",
}


def surrogate_indices(
    draws: SurrogateDraws, question: Question
) -> Iterator[tuple[str, xr.DataArray]]:
    """Indices of an output, of its logarithm where that was fitted, of its exceeding a value.

    Yields
    ------
    name : str
        ``<output>_first_order``, ``_total_order``, ``_shapley``; ``<output>_log_first_order`` and
        so on; ``<output>_exceedance_first_order`` and so on.
    estimate : DataArray
        Along ``input`` and ``bound``; before them ``<output>_threshold`` for exceedance.
    """
    yield from _Indices(draws, question).all()


@dataclass(frozen=True)
class _Indices:
    """Asks a surrogate for the indices of one output."""

    draws: SurrogateDraws
    question: Question

    def all(self) -> Iterator[tuple[str, xr.DataArray]]:
        """Of all that is asked."""
        name, title = self.question.output.name, self.question.output.title
        if self.draws.has_closed_form(name):
            yield from self._stacked(name, title, self._closed(), FROM_COEFFICIENTS)
        else:
            indices = self._sampled(lambda values: values)
            yield from self._stacked(name, title, indices, self.draws.by_pairs)
        if self.draws.model.expansions[name].is_logarithm:
            yield from self._of_logarithm(name, title)
        if self.question.exceeds:
            yield from self._of_exceedance(name, title)

    def _of_logarithm(self, name: str, title: str) -> Iterator[tuple[str, xr.DataArray]]:
        is_closed = self.draws.all_are_admissible and self.draws.law.is_independent
        indices = self._closed() if is_closed else self._sampled(np.log)
        how = FROM_COEFFICIENTS if is_closed else self.draws.by_pairs
        yield from self._stacked(f"{name}_log", f"the logarithm of {title}", indices, how)

    def _of_exceedance(self, name: str, title: str) -> Iterator[tuple[str, xr.DataArray]]:
        coordinates = threshold_coordinates(self.question)
        thresholds = self.question.exceeds
        rows = [self._sampled(_exceeding(threshold.value)) for threshold in thresholds]
        for position, (ending, adjective) in enumerate(_ORDERS.items()):
            variable = f"{name}_exceedance_{ending}"
            array = Estimate.table(
                [self._estimates(row[position], ending) for row in rows],
                (next(iter(coordinates)), INPUT),
                units="1",
                long_name=f"{adjective} of whether {title} exceeds a value",
                name=variable,
            )
            described = array.assign_coords({**coordinates, **self._inputs})
            yield variable, described.assign_attrs({ESTIMATOR: self.draws.by_pairs})

    def _closed(self) -> Indices:
        expansion = self.draws.model.expansions[self.question.output.name]
        terms = expansion.indices, expansion.coefficients
        indices = sobol_indices(*terms)
        exact = indices.first, indices.total, shapley_effects(*terms)
        return [[(float(value), math.nan) for value in values] for values in exact]

    def _sampled(self, function: Callable[[FloatArray], FloatArray]) -> Indices:
        shares = self.draws.pairs.shares(self.question.output.name, function)
        if shares is None:
            return [None, None, None]
        found: Indices = []
        for measure in _ORDERS:
            values = getattr(shares, measure)
            # With dependent inputs, what the others leave is no part of the variance.
            if values is None or (measure == "total_order" and not self.draws.law.is_independent):
                found.append(None)
            else:
                found.append(list(zip(values, shares.errors(measure), strict=True)))
        return found

    def _stacked(
        self, stem: str, title: str, indices: Indices, estimator: str
    ) -> Iterator[tuple[str, xr.DataArray]]:
        for (ending, adjective), values in zip(_ORDERS.items(), indices, strict=True):
            variable = f"{stem}_{ending}"
            array = Estimate.stack(
                self._estimates(values, ending),
                INPUT,
                units="1",
                long_name=f"{adjective} of {title}",
                name=variable,
            )
            yield variable, array.assign_coords(self._inputs).assign_attrs({ESTIMATOR: estimator})

    def _estimates(self, values: list[Index] | None, ending: str) -> list[Estimate]:
        if values is None:
            reason = self._reason_for_none(ending)
            return [Estimate.without_bounds(math.nan, reason) for _ in self.draws.law.random]
        is_correlated = ending == "first_order" and not self.draws.law.is_independent
        note = INCLUDES_CORRELATION if is_correlated else ""
        return [_with_noise(*value, note) for value in values]

    def _reason_for_none(self, ending: str) -> str:
        inputs = len(self.draws.law.random)
        if ending == "shapley" and inputs > MOST_INPUTS_FOR_ALL_SETS:
            return f"it takes all sets of inputs, too many with {inputs} of them"
        if ending == "total_order" and not self.draws.law.is_independent:
            return "the random inputs depend on each other"
        return "it is the same at all draws"

    @property
    def _inputs(self) -> dict[str, Any]:
        return along_inputs([entry.variable.name for entry in self.draws.law.random])


def _with_noise(value: float, error: float, note: str) -> Estimate:
    """An index with what sampling leaves it; how far the surrogate is off is another matter."""
    if math.isnan(error):
        return Estimate.without_bounds(value, note)
    half = 2 * error
    return Estimate(value, value - half, value + half, "sampling of the surrogate", "nominal", note)


def _exceeding(value: float) -> Callable[[FloatArray], FloatArray]:
    """Whether an output exceeds a value; of one that is not a number, nothing."""

    def event(values: FloatArray) -> FloatArray:
        return np.where(np.isnan(values), np.nan, values > value)

    return event
