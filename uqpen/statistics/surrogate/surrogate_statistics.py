"""Statistics of a model, estimated from its surrogate.

They follow from the closed forms of the surrogate where it has them, else from a sample of
admissible draws.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import xarray as xr

from uqpen.core.catalogue import CATALOGUE, REQUESTED
from uqpen.core.labels import (
    ESTIMATOR,
    RUN,
    SENSITIVITY,
    TAILS,
)
from uqpen.statistics import texts
from uqpen.statistics.analyze import OutputStatistics, analyze, in_catalogue_order
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.field_statistics import field_statistics
from uqpen.statistics.surrogate.refutation import missing_estimates
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_indices import surrogate_indices
from uqpen.surrogates.field_surrogate import FieldSurrogate

__all__ = ["SurrogateStatistics", "surrogate_statistics"]

_SAMPLED = [*dict.fromkeys(each.group for each in CATALOGUE.values() if each.is_of_surrogates)]


@dataclass(frozen=True)
class SurrogateStatistics:
    """Estimate arrays of a surrogate by output and statistic, before runs correct them.

    Parameters
    ----------
    outputs : mapping of str to mapping of str to DataArray
        Of scalar outputs.
    fields : mapping of str to mapping of str to DataArray
        Of fields, which runs do not correct: each says what the surrogate leaves.
    """

    outputs: Mapping[str, OutputStatistics]
    fields: Mapping[str, OutputStatistics] = field(default_factory=dict)


def surrogate_statistics(
    draws: SurrogateDraws,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
) -> SurrogateStatistics:
    """Estimate all statistics of a fitted surrogate.

    Parameters
    ----------
    draws : SurrogateDraws
    quantities : sequence of QuantityOfInterest
        Those of outputs that could not be fitted are left out.
    only : collection of str, optional
        The requested groups; all by default.
    """
    fitted = {output.name for output in draws.model.outputs}
    requested = [
        quantity.without(CATALOGUE["tolerance_limit"])
        for quantity in quantities
        if quantity.output.name in fitted
    ]
    if not requested:
        return SurrogateStatistics({})
    scalars = [quantity for quantity in requested if not quantity.output.dims]
    fields: dict[str, OutputStatistics] = {}
    if isinstance(draws.model, FieldSurrogate):
        fits = draws.model.fields
        draws = replace(draws, model=draws.model.scalars)
        for quantity in (each for each in requested if each.output.dims):
            found = field_statistics(draws, fits[quantity.output.name], quantity, only)
            fields[quantity.output.name] = in_catalogue_order(dict(found))
    return SurrogateStatistics(_by_output(draws, scalars, only), fields)


def _by_output(
    draws: SurrogateDraws, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
) -> dict[str, OutputStatistics]:
    """Return the statistics of each output: sampled, in closed form, and its indices."""
    sampled = [name for name in _SAMPLED if only is None or name in only]
    not_sampled = [each for each in REQUESTED if not each.is_of_surrogates]
    found = analyze(draws.runs, [each.without(*not_sampled) for each in quantities], only=sampled)
    if TAILS in sampled:
        no_runs = draws.runs.isel({RUN: slice(0)})
        for output, arrays in analyze(no_runs, quantities, only=[TAILS]).items():
            for name in arrays.keys() - found[output].keys():
                found[output][name] = missing_estimates(arrays[name], texts.NO_TAIL_OF_SURROGATE)
    for quantity in quantities:
        statistics = found[quantity.output.name]
        for name, array in statistics.items():
            statistics[name] = array.assign_attrs({ESTIMATOR: draws.sampling_estimator})
        statistics.update(_closed_forms(draws, quantity.output.name, statistics))
        if only is None or SENSITIVITY in only:
            for name, array in surrogate_indices(draws, quantity):
                statistics[name] = array.assign_attrs({"estimand": draws.estimand})
        found[quantity.output.name] = in_catalogue_order(statistics)
    return found


def _closed_forms(
    draws: SurrogateDraws, output: str, statistics: OutputStatistics
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the exact mean and standard deviation of a surrogate where they are the output's."""
    forms = draws.closed_forms_of_output(output)
    if forms is None or "mean" not in statistics:
        return
    moments = forms.closed_form_moments(output)
    for name, value in zip(("mean", "std"), moments, strict=True):
        exact = statistics[name].copy(data=[value, math.nan, math.nan])
        yield name, exact.assign_attrs({ESTIMATOR: forms.estimator})
