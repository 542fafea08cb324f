"""Bounds over intervals of probabilities, means and quantiles, from runs at what was found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.core.labels import (
    BOUND_END,
    BOUND_SEARCH,
    BOUNDED_EVENT,
    BOUNDED_QUANTITY,
    INTERVAL_ENDS,
    PREDICTED_DISTANCE,
    PROBABILITY,
    RUN,
    SAMPLING,
    STATUS,
)
from uqpen.core.sampling import Sampling
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import event_probability
from uqpen.statistics.distribution_function.quantiles import quantiles_at
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.moments.sample_moments import mean_estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of
from uqpen.surrogates.interval_bounds import (
    LOWER,
    UPPER,
    BoundedQuantity,
    bounded_in,
    dispersion,
    output_deviations,
)

# Largest mean square of what the polynomial does not predict of the runs at its optimum, as a share
# of the output's variance. It was above for a peak of 4 % of the box in every repetition, and below
# for functions that a polynomial follows in every one.
_MOST_UNPREDICTED = 0.05

_ENDS = {"lower": LOWER, "upper": UPPER}


def event_bounds(runs: xr.Dataset, level: float) -> dict[str, xr.DataArray]:
    """Estimate the bounds of the probabilities of events over the intervals.

    The interval of each is that of the probability where it was found, so both ends of a range from
    the lower limit of the lower bound to the upper limit of the upper one are one-sided, at
    (1 + level) / 2.

    Parameters
    ----------
    runs : Dataset
        Runs of a design for bounds.
    level : float
        Confidence level of the intervals.

    Returns
    -------
    dict of str to DataArray
        ``lower_probability`` and ``upper_probability`` along ``bounded_event`` and ``bound``; empty
        where the design has no events.
    """
    quantities = bounded_in(runs.attrs)
    events = [place for place, each in enumerate(quantities) if each.event is not None]
    if not events:
        return {}
    gap = dispersion(runs)
    names = np.array([str(quantities[place].event) for place in events], dtype=object)
    return {
        f"{end}_probability": Estimate.stack(
            [
                _at_bound(runs, quantities[place], place, sign, gap, partial(_probability, level))
                for place in events
            ],
            BOUNDED_EVENT,
            units="1",
            long_name=f"{end} bound of the probability of an event over the intervals",
            coordinates={BOUNDED_EVENT: (BOUNDED_EVENT, names, {"long_name": "event"})},
            level=level,
        )
        for end, sign in _ENDS.items()
    }


def output_bounds(
    runs: xr.Dataset, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Estimate the bounds of the mean and of quantiles of an output over the intervals.

    Yields
    ------
    name : str
        ``lower_mean``, ``upper_mean``, ``lower_quantile``, ``upper_quantile``.
    estimate : DataArray
        Along ``bound``, those of quantiles along ``probability`` before it.
    """
    output, level = quantity.output, quantity.confidence_level
    own = [
        (place, each)
        for place, each in enumerate(bounded_in(runs.attrs))
        if each.event is None and each.outputs == (output.name,)
    ]
    gap = dispersion(runs) if own else 1.0

    def estimate(at_bound: xr.Dataset, bounded: BoundedQuantity) -> Estimate:
        sample = replace(sample_of(at_bound, output.name), level=level)
        if bounded.probability is None:
            return mean_estimate(sample, quantity)
        return quantiles_at(sample, [bounded.probability])[0]

    for end, sign in _ENDS.items():
        found = [_at_bound(runs, each, place, sign, gap, estimate) for place, each in own]
        probabilities = [each.probability for _, each in own]
        of_intervals = f"of {output.title} over the intervals"
        for of_mean in (each for each, p in zip(found, probabilities, strict=True) if p is None):
            long_name = f"{end} bound of the mean {of_intervals}"
            array = of_mean.to_array(units=output.unit, long_name=long_name, level=level)
            yield f"{end}_mean", array
        if known := [p for p in probabilities if p is not None]:
            described = {"units": "1", "long_name": "probability of lying below the quantile"}
            array = Estimate.stack(
                [each for each, p in zip(found, probabilities, strict=True) if p is not None],
                PROBABILITY,
                units=output.unit,
                long_name=f"{end} bound of quantiles {of_intervals}",
                coordinates={PROBABILITY: (PROBABILITY, np.array(known), described)},
                level=level,
            )
            yield f"{end}_quantile", array


def _probability(level: float, own: xr.Dataset, quantity: BoundedQuantity) -> Estimate:
    assert quantity.event is not None
    sample = replace(sample_of(own, STATUS), level=level)
    return event_probability(sample, quantity.event.outcomes(own).occurs[sample.used])


def _at_bound(
    runs: xr.Dataset,
    quantity: BoundedQuantity,
    place: int,
    end: int,
    gap: float,
    estimate: Callable[[xr.Dataset, BoundedQuantity], Estimate],
) -> Estimate:
    """Return an estimate from the runs at a bound, or the reason why there is none."""
    search, number = runs[BOUND_SEARCH].values, runs[BOUNDED_QUANTITY].values
    is_last = (search == search.max()) & (search > 0) & (number == place)
    if not is_last.any():
        return Estimate.without_bounds(math.nan, texts.NO_POLYNOMIAL_OF_BOX)
    deviations = output_deviations(runs, quantity.outputs)
    # Where it fails at one end, the search does not know the function: the other is as doubtful.
    unpredicted = _unpredicted(runs.isel({RUN: is_last}), quantity, deviations)
    if not unpredicted <= _MOST_UNPREDICTED:
        reason = texts.UNPREDICTED_BOUND.format(
            share=100 * unpredicted, most=100 * _MOST_UNPREDICTED, gap=100 * gap
        )
        return Estimate.without_bounds(math.nan, reason)
    own = runs.isel({RUN: is_last & (runs[BOUND_END].values == end)})
    found = estimate(own.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)}), quantity)
    which = "largest" if end == UPPER else "least"
    at = ", ".join(_places(own))
    return found.with_note(
        texts.FOUND_BOUND.format(which=which, at=at), texts.PEAK_BETWEEN_RUNS.format(gap=100 * gap)
    )


def _unpredicted(
    runs: xr.Dataset, quantity: BoundedQuantity, deviations: dict[str, float]
) -> float:
    """Return the mean square that the polynomial leaves at the worse of both ends, in variances."""
    error = quantity.distances(runs, deviations) - runs[PREDICTED_DISTANCE].values
    found = []
    for end in _ENDS.values():
        squares = error[(runs[BOUND_END].values == end) & np.isfinite(error)] ** 2
        found.append(float(squares.mean()) if len(squares) else math.inf)
    return max(found)


def _places(runs: xr.Dataset) -> Iterator[str]:
    """Yield the value of each interval input, which all of these runs have."""
    for name, variable in runs.data_vars.items():
        if INTERVAL_ENDS in variable.attrs:
            unit = str(variable.attrs.get("display_units", DIMENSIONLESS))
            value: npt.NDArray[np.float64] = scale(unit).from_si(variable.values[:1])
            yield f"{name} = {value[0]:.4g}{'' if unit == DIMENSIONLESS else f' {unit}'}"
