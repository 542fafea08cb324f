"""Bounds over intervals of probabilities, means and quantiles, from runs at what was found."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
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
from uqpen.distributions.measurements import value_text
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import event_probability
from uqpen.statistics.distribution_function.quantiles import quantiles_at
from uqpen.statistics.estimate import Estimate, NamedArrays
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
    quantities = enumerate(bounded_in(runs.attrs))
    events = {place: each for place, each in quantities if each.event is not None}
    if not events:
        return {}
    names = np.array([str(each.event) for each in events.values()], dtype=object)

    def estimate(own: xr.Dataset, bounded: BoundedQuantity) -> Estimate:
        assert bounded.event is not None
        sample = replace(sample_of(own, STATUS), level=level)
        return event_probability(sample, bounded.event.outcomes(own).occurs[sample.used])

    return {
        f"{end}_probability": Estimate.stack(
            found,
            BOUNDED_EVENT,
            units="1",
            long_name=f"{end} bound of the probability of an event over the intervals",
            coordinates={BOUNDED_EVENT: (BOUNDED_EVENT, names, {"long_name": "event"})},
            level=level,
        )
        for end, found in _at_bounds(runs, events, estimate)
    }


def output_bounds(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Estimate the bounds of the mean and of quantiles of an output over the intervals.

    Yields
    ------
    name : str
        ``lower_mean``, ``upper_mean``, ``lower_quantile``, ``upper_quantile``.
    estimate : DataArray
        Along ``bound``, those of quantiles along ``probability`` before it.
    """
    output, level = quantity.output, quantity.confidence_level
    own = {
        place: each
        for place, each in enumerate(bounded_in(runs.attrs))
        if each.event is None and each.outputs == (output.name,)
    }
    if not own:
        return

    def estimate(at_bound: xr.Dataset, bounded: BoundedQuantity) -> Estimate:
        sample = replace(sample_of(at_bound, output.name), level=level)
        if bounded.probability is None:
            return mean_estimate(sample, quantity)
        return quantiles_at(sample, [bounded.probability])[0]

    of_intervals = f"of {output.title} over the intervals"
    for end, found in _at_bounds(runs, own, estimate):
        quantiles: dict[float, Estimate] = {}
        for bounded, each in zip(own.values(), found, strict=True):
            if bounded.probability is None:
                long_name = f"{end} bound of the mean {of_intervals}"
                array = each.to_array(units=output.unit, long_name=long_name, level=level)
                yield f"{end}_mean", array
            else:
                quantiles[bounded.probability] = each
        if quantiles:
            described = {"units": "1", "long_name": "probability of lying below the quantile"}
            array = Estimate.stack(
                [*quantiles.values()],
                PROBABILITY,
                units=output.unit,
                long_name=f"{end} bound of quantiles {of_intervals}",
                coordinates={PROBABILITY: (PROBABILITY, np.array([*quantiles]), described)},
                level=level,
            )
            yield f"{end}_quantile", array


def _at_bounds(
    runs: xr.Dataset,
    quantities: Mapping[int, BoundedQuantity],
    estimate: Callable[[xr.Dataset, BoundedQuantity], Estimate],
) -> Iterator[tuple[str, list[Estimate]]]:
    """Yield each end with the estimates from the runs at the bounds, or why there are none."""
    gap = 100 * dispersion(runs)
    search, number = runs[BOUND_SEARCH].values, runs[BOUNDED_QUANTITY].values
    for end, (sign, which) in {"lower": (LOWER, "least"), "upper": (UPPER, "largest")}.items():
        found = []
        for place, quantity in quantities.items():
            is_last = (search == search.max()) & (search > 0) & (number == place)
            if not is_last.any():
                found.append(Estimate.without_bounds(math.nan, texts.NO_POLYNOMIAL_OF_BOX))
                continue
            # Where it fails at one end, the search does not know the function: the other is as
            # doubtful.
            deviations = output_deviations(runs, quantity.outputs)
            unpredicted = _unpredicted(runs.isel({RUN: is_last}), quantity, deviations)
            if not unpredicted <= _MOST_UNPREDICTED:
                reason = texts.UNPREDICTED_BOUND.format(
                    share=100 * unpredicted, most=100 * _MOST_UNPREDICTED, gap=gap
                )
                found.append(Estimate.without_bounds(math.nan, reason))
                continue
            own = runs.isel({RUN: is_last & (runs[BOUND_END].values == sign)})
            each = estimate(own.assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)}), quantity)
            # All of these runs have the same values of the intervals.
            at = ", ".join(
                f"{name} = {value_text(column.values[0], column.attrs['display_units'])}"
                for name, column in own.data_vars.items()
                if INTERVAL_ENDS in column.attrs
            )
            found_bound = texts.FOUND_BOUND.format(which=which, at=at)
            found.append(each.with_note(found_bound, texts.PEAK_BETWEEN_RUNS.format(gap=gap)))
        yield end, found


def _unpredicted(
    runs: xr.Dataset, quantity: BoundedQuantity, deviations: dict[str, float]
) -> float:
    """Return the mean square that the polynomial leaves at the worse of both ends, in variances."""
    error = quantity.distances(runs, deviations) - runs[PREDICTED_DISTANCE].values
    found = []
    for end in (LOWER, UPPER):
        squares = error[(runs[BOUND_END].values == end) & np.isfinite(error)] ** 2
        found.append(float(squares.mean()) if len(squares) else math.inf)
    return max(found)
