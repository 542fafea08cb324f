"""Sobol' indices and Shapley effects of a model, estimated from its surrogate."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import ESTIMATOR, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.input_measures import function_array, output_functions
from uqpen.statistics.surrogate.surrogate_draws import MOST_INPUTS_FOR_ALL_SETS, SurrogateDraws

# The endings of their names, with what they are.
_ORDERS = {
    "first_order": "first-order Sobol' indices",
    "total_order": "total-order Sobol' indices",
    "shapley": "Shapley effects",
}


def surrogate_indices(draws: SurrogateDraws, quantity: QuantityOfInterest) -> NamedArrays:
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
    name, inputs = quantity.output.name, [each.variable.name for each in draws.joint.random]
    forms_of = {
        "": draws.closed_forms_of_output(name),
        OF_LOGARITHM: draws.closed_forms_of_logarithm(),
    }
    has_logarithm = name in draws.model.logarithms
    for function in output_functions(quantity, has_logarithm=has_logarithm):
        forms = forms_of.get(function.prefix)
        if forms:
            shares = forms.closed_form_indices(name)
            values = {
                "first_order": shares.first,
                "total_order": shares.total,
                "shapley": shares.shapley,
            }
            rows = [{order: Estimate.without_bounds(each) for order, each in values.items()}]
        else:
            rows = [_sampled_indices(draws, name, row) for row in function.rows]
        estimator = forms.estimator if forms else draws.pairs_estimator
        for order, adjective in _ORDERS.items():
            long_name = f"{adjective} of {function.title}"
            array = function_array([row[order] for row in rows], function, inputs, long_name)
            yield f"{function.prefix}{order}", array.assign_attrs({ESTIMATOR: estimator})


def _sampled_indices(
    draws: SurrogateDraws, output: str, function: Callable[[FloatArray], FloatArray]
) -> dict[str, Estimate]:
    """Return the indices of a function of an output from pairs of draws, or why there are none."""
    joint, reason = draws.joint, draws.joint.conditional_reason
    shares = None if reason else draws.pairs.variance_shares(output, function)
    found = {}
    for order in _ORDERS:
        values = getattr(shares, order, None)
        # With dependent inputs, the rest beyond the others is no part of the variance.
        is_meaningless = order == "total_order" and not joint.is_independent
        if values is None or is_meaningless:
            why = reason or texts.CONSTANT_AT_DRAWS
            if order == "shapley" and len(joint.random) > MOST_INPUTS_FOR_ALL_SETS:
                why = reason or texts.TOO_MANY_SUBSETS.format(inputs=len(joint.random))
            elif is_meaningless:
                why = reason or texts.DEPENDENT_INPUTS
            found[order] = Estimate.without_bounds(np.full(len(joint.random), np.nan), why)
            continue
        assert shares is not None
        # Twice the error of sampling the surrogate, which does not include the surrogate's own.
        value, half = np.array(values), 2 * np.array(shares.errors(order))
        is_correlated = order == "first_order" and not joint.is_independent
        note = texts.INCLUDES_CORRELATION if is_correlated else ""
        sampled = texts.SURROGATE_SAMPLING
        estimate = Estimate(value, value - half, value + half, sampled, "nominal", note)
        # Without pairs in some replicates there is no error.
        if np.isnan(half).any():
            estimate = estimate.remove_bounds_at(np.isnan(half), note)
        found[order] = estimate
    return found
