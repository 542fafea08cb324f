"""What a surrogate tells of the model that it stands for.

From its coefficients where those are all that is needed; else by sampling it over admissible draws.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from uqpen.core.labels import CDFS, ESTIMATOR, EXCEEDANCE, MOMENTS, QUANTILES, SENSITIVITY
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.surrogate_draws import FROM_COEFFICIENTS, SurrogateDraws
from uqpen.statistics.surrogate.surrogate_indices import surrogate_indices
from uqpen.surrogates.closed_forms import mean, standard_deviation

__all__ = ["SurrogateStatistics", "TrainingRange", "surrogate_statistics"]

_SAMPLED = (MOMENTS, QUANTILES, EXCEEDANCE, CDFS)


@dataclass(frozen=True)
class TrainingRange:
    """How far the runs reach that an output's surrogate was fitted to.

    Parameters
    ----------
    lowest, highest : float
        Of the outputs in those runs, in SI units.
    variance_beyond : float
        The share of the surrogate's variance that comes from values outside.
    """

    lowest: float
    highest: float
    variance_beyond: float

    def contains(self, value: float) -> bool:
        """Whether a value of the output was reached."""
        return self.lowest <= value <= self.highest


@dataclass(frozen=True)
class SurrogateStatistics:
    """What a surrogate tells, before anything vouches for it.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Figures, group by group as designs have them.
    training_ranges : mapping of str to TrainingRange
        By output.
    """

    groups: Mapping[str, xr.Dataset]
    training_ranges: Mapping[str, TrainingRange]


def surrogate_statistics(
    draws: SurrogateDraws,
    quantities: Sequence[QuantityOfInterest],
    *,
    only: Collection[str] | None = None,
) -> SurrogateStatistics:
    """All that a fitted surrogate tells.

    Parameters
    ----------
    draws : SurrogateDraws
        The surrogate under the law of its inputs.
    quantities : sequence of QuantityOfInterest
        Those to outputs that it has no expansion of are passed over.
    only : collection of str, optional
        The groups that are wanted, where not all are.
    """
    requested = [
        replace(quantity, tolerance_contents=())
        for quantity in quantities
        if quantity.output.name in draws.model.expansions
    ]
    if not requested:
        return SurrogateStatistics({}, {})
    training_ranges = {
        quantity.output.name: _training_range(draws, quantity.output.name) for quantity in requested
    }
    return SurrogateStatistics(dict(_groups(draws, requested, only)), training_ranges)


def _groups(
    draws: SurrogateDraws, quantities: Sequence[QuantityOfInterest], only: Collection[str] | None
) -> Iterator[tuple[str, xr.Dataset]]:
    sampled = [group for group in _SAMPLED if only is None or group in only]
    for group, dataset in analyze(draws.runs, quantities, only=sampled).items():
        marked = {
            name: array.assign_attrs({ESTIMATOR: draws.sampling_estimator})
            for name, array in dataset.data_vars.items()
        }
        if group == MOMENTS:
            marked |= dict(_closed_forms(draws, quantities, dataset))
        yield group, dataset.assign(marked)
    if only is not None and SENSITIVITY not in only:
        return
    indices = {
        name: array for quantity in quantities for name, array in surrogate_indices(draws, quantity)
    }
    yield SENSITIVITY, xr.Dataset(indices, attrs={"estimand": draws.estimand})


def _closed_forms(
    draws: SurrogateDraws, quantities: Sequence[QuantityOfInterest], moments: xr.Dataset
) -> Iterator[tuple[str, xr.DataArray]]:
    """The exact mean and standard deviation of each expansion where they are the output's."""
    for quantity in quantities:
        name = quantity.output.name
        if draws.has_closed_form(name):
            expansion = draws.model.expansions[name]
            terms = expansion.indices, expansion.coefficients
            for statistic, value in (("mean", mean(*terms)), ("std", standard_deviation(*terms))):
                array = moments[f"{name}_{statistic}"]
                exact = array.copy(data=[value, math.nan, math.nan])
                yield f"{name}_{statistic}", exact.assign_attrs({ESTIMATOR: FROM_COEFFICIENTS})


def _training_range(draws: SurrogateDraws, output: str) -> TrainingRange:
    expansion = draws.model.expansions[output]
    values = draws.runs[output].values
    values = values[np.isfinite(values)]
    squares = (values - values.mean()) ** 2 if values.size else values
    outside = (values < expansion.smallest) | (values > expansion.largest)
    whole = float(squares.sum())
    beyond = float(squares[outside].sum()) / whole if whole > 0 else 0.0
    return TrainingRange(expansion.smallest, expansion.largest, beyond)
