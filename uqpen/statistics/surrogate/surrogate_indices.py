"""Sobol' indices and Shapley effects of a model, estimated from its surrogate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import ESTIMATOR, OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import threshold_coordinates
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.input_measures import event_array, input_array
from uqpen.statistics.surrogate.surrogate_draws import MOST_INPUTS_FOR_ALL_SETS, SurrogateDraws
from uqpen.surrogates.fitted_surrogate import ClosedForms

__all__ = ["surrogate_indices"]

Function = Callable[[FloatArray], FloatArray]
# An index and the standard error that sampling the surrogate leaves it; NaN where it is exact.
Index = tuple[float, float]
# First-order, total-order indices and Shapley effects, each along the inputs; None for none.
Indices = list[list[Index] | None]

# The endings of their names, in that order.
_ORDERS = {
    "first_order": "first-order Sobol' indices",
    "total_order": "total-order Sobol' indices",
    "shapley": "Shapley effects",
}


def surrogate_indices(
    draws: SurrogateDraws, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Indices of an output, of its logarithm if that was fitted, and of exceedance of thresholds.

    Yields
    ------
    name : str
        ``first_order``, ``total_order``, ``shapley``; ``log_first_order``, ``log_total_order``,
        ``log_shapley``; ``exceedance_first_order``, ``exceedance_total_order``,
        ``exceedance_shapley``.
    estimate : DataArray
        Along ``input`` and ``bound``; the indices of exceedance first along ``threshold``.
    """
    indices = _SurrogateIndices(draws, quantity)
    name, title = quantity.output.name, quantity.output.title
    forms = draws.closed_forms_of_output(name)
    yield from indices.of_variable("", title, lambda values: values, forms)
    if name in draws.model.logarithms:
        forms = draws.closed_forms_of_logarithm()
        yield from indices.of_variable(OF_LOGARITHM, f"the logarithm of {title}", np.log, forms)
    if quantity.thresholds:
        yield from indices.of_exceedance(title)


@dataclass(frozen=True)
class _SurrogateIndices:
    """Indices of one output of a surrogate."""

    draws: SurrogateDraws
    quantity: QuantityOfInterest

    def of_exceedance(self, title: str) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield the indices of whether the output exceeds each threshold."""
        coordinates = threshold_coordinates(self.quantity)
        thresholds = self.quantity.thresholds
        rows = [
            self._sampled_indices(_exceedance_event(threshold.value)) for threshold in thresholds
        ]
        for position, (ending, adjective) in enumerate(_ORDERS.items()):
            estimates = [self._estimates(row[position], ending) for row in rows]
            long_name = f"{adjective} of whether {title} exceeds a value"
            array = event_array(estimates, coordinates, self._inputs, long_name)
            estimator = {ESTIMATOR: self.draws.pairs_estimator}
            yield f"{OF_EXCEEDANCE}{ending}", array.assign_attrs(estimator)

    def _closed_form_indices(self, forms: ClosedForms) -> Indices:
        shares = forms.closed_form_indices(self.quantity.output.name)
        exact = shares.first, shares.total, shares.shapley
        return [[(float(value), math.nan) for value in values] for values in exact]

    def _sampled_indices(self, function: Function) -> Indices:
        if self.draws.joint.conditional_reason:
            return [None, None, None]
        shares = self.draws.pairs.variance_shares(self.quantity.output.name, function)
        if shares is None:
            return [None, None, None]
        found: Indices = []
        for measure in _ORDERS:
            values = getattr(shares, measure)
            # With dependent inputs, the rest beyond the others is no part of the variance.
            if values is None or (measure == "total_order" and not self.draws.joint.is_independent):
                found.append(None)
            else:
                found.append(list(zip(values, shares.errors(measure), strict=True)))
        return found

    def of_variable(
        self, prefix: str, title: str, function: Function, forms: ClosedForms | None
    ) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield the indices of a function of the output, in closed form or from pairs."""
        indices = self._closed_form_indices(forms) if forms else self._sampled_indices(function)
        estimator = forms.estimator if forms else self.draws.pairs_estimator
        for (ending, adjective), values in zip(_ORDERS.items(), indices, strict=True):
            estimates = self._estimates(values, ending)
            array = input_array(estimates, self._inputs, f"{adjective} of {title}")
            yield f"{prefix}{ending}", array.assign_attrs({ESTIMATOR: estimator})

    def _estimates(self, values: list[Index] | None, ending: str) -> list[Estimate]:
        if values is None:
            reason = self._reason_without_indices(ending)
            return [Estimate.without_bounds(math.nan, reason) for _ in self.draws.joint.random]
        is_correlated = ending == "first_order" and not self.draws.joint.is_independent
        note = texts.INCLUDES_CORRELATION if is_correlated else ""
        return [_estimate_with_noise(*value, note) for value in values]

    def _reason_without_indices(self, ending: str) -> str:
        if reason := self.draws.joint.conditional_reason:
            return reason
        inputs = len(self.draws.joint.random)
        if ending == "shapley" and inputs > MOST_INPUTS_FOR_ALL_SETS:
            return texts.TOO_MANY_SUBSETS.format(inputs=inputs)
        if ending == "total_order" and not self.draws.joint.is_independent:
            return texts.DEPENDENT_INPUTS
        return texts.CONSTANT_AT_DRAWS

    @property
    def _inputs(self) -> list[str]:
        return [entry.variable.name for entry in self.draws.joint.random]


def _estimate_with_noise(value: float, error: float, note: str) -> Estimate:
    """An index with its sampling error, which does not include the surrogate's own error."""
    if math.isnan(error):
        return Estimate.without_bounds(value, note)
    half = 2 * error
    return Estimate(value, value - half, value + half, texts.SURROGATE_SAMPLING, "nominal", note)


def _exceedance_event(value: float) -> Function:
    """Return a function for the event that an output exceeds a value; NaN for an output of NaN."""
    return lambda outputs: np.where(np.isnan(outputs), np.nan, outputs > value)
