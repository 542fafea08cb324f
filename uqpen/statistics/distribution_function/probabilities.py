"""Probabilities: of lying beyond a value, of each category of an output, of a failed run."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import BlockedRuns
from uqpen.core.labels import CATEGORY, LOWER_THRESHOLD, STATUS, THRESHOLD
from uqpen.core.status import Status
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.quantiles import has_enough_runs_around
from uqpen.statistics.estimate import LEVEL, Estimate, NamedArrays
from uqpen.statistics.intervals import clopper_pearson, student_interval
from uqpen.statistics.quantity_of_interest import Acceptable, QuantityOfInterest, Threshold
from uqpen.statistics.reweighting import has_enough_on_both_sides
from uqpen.statistics.run_samples import sample_of_statuses
from uqpen.statistics.sample import Column, ErrorModel, Sample
from uqpen.statistics.standard_errors import probability_error
from uqpen.statistics.weights import (
    effective_sizes,
    runs_on_a_side,
    weighted_probability_interval,
    weighted_share,
)

# With fewer effective runs on one side, the error of weighted runs may be larger than it shows.
_FEWEST_BEYOND = 10


def exceedance_probabilities(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probability that an output exceeds each of the requested thresholds.

    Yields
    ------
    name : str
        ``exceedance``.
    estimate : DataArray
        Along ``threshold`` (as written; the coordinate ``threshold_value`` in SI units) and
        ``bound``.
    """
    if not quantity.thresholds:
        return
    long_name = f"probability that {quantity.output.title} exceeds a value"
    along = threshold_coordinates(quantity)
    found = requested_exceedances(sample, quantity)
    yield "exceedance", _array(found, THRESHOLD, long_name, along, sample.level)


def _array(
    found: Estimate, dimension: str, long_name: str, along: Mapping[str, Any], level: float
) -> xr.DataArray:
    return found.to_array(dimension, units="1", long_name=long_name, coordinates=along, level=level)


def requested_exceedances(sample: Sample, quantity: QuantityOfInterest) -> Estimate:
    """Return the probabilities to exceed the requested thresholds, along a last axis."""
    return _event_probabilities(
        sample, (sample.event(operator.gt, each.value) for each in quantity.thresholds)
    )


def below_probabilities(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probability that an output lies below each of the requested thresholds.

    A value at the threshold is neither below it nor exceeds it.

    Yields
    ------
    name : str
        ``below``.
    estimate : DataArray
        Along ``lower_threshold`` (as written; the coordinate ``lower_threshold_value`` in SI units)
        and ``bound``.
    """
    if not quantity.lower_thresholds:
        return
    long_name = f"probability that {quantity.output.title} lies below a value"
    along = lower_threshold_coordinates(quantity)
    found = requested_below(sample, quantity)
    yield "below", _array(found, LOWER_THRESHOLD, long_name, along, sample.level)


def requested_below(sample: Sample, quantity: QuantityOfInterest) -> Estimate:
    """Return the probabilities to lie below the requested thresholds, along a last axis."""
    return _event_probabilities(
        sample, (sample.event(operator.lt, each.value) for each in quantity.lower_thresholds)
    )


def threshold_coordinates(quantity: QuantityOfInterest) -> dict[str, Any]:
    """Return the coordinates along ``threshold``: the thresholds as written and in SI units."""
    return _coordinates(quantity.thresholds, THRESHOLD, "value exceeded", quantity.output.unit)


def lower_threshold_coordinates(quantity: QuantityOfInterest) -> dict[str, Any]:
    """Return the coordinates along ``lower_threshold``."""
    unit = quantity.output.unit
    return _coordinates(quantity.lower_thresholds, LOWER_THRESHOLD, "value to lie below", unit)


def _coordinates(
    thresholds: Sequence[Threshold], dimension: str, long_name: str, unit: str
) -> dict[str, Any]:
    """Return the coordinates along a dimension of thresholds: as written and in SI units.

    Acceptance limits are there only where the study has some; NaN for none.
    """
    written = np.array([threshold.text for threshold in thresholds], dtype=object)
    values = np.array([threshold.value for threshold in thresholds])
    described = {"units": unit, "long_name": long_name}
    return {
        dimension: (dimension, written, {"long_name": f"{long_name}, as written"}),
        f"{dimension}_value": (dimension, values, described),
        **dict(acceptance_coordinates(thresholds, dimension)),
    }


def acceptance_coordinates(
    requested: Sequence[Acceptable], dimension: str
) -> Iterator[tuple[str, Any]]:
    """Yield the coordinates of those acceptance limits that at least one request has."""
    for name, long_name in (("at_most", "largest"), ("at_least", "smallest")):
        limits = [getattr(each.accepted, name) for each in requested]
        if any(limit is not None for limit in limits):
            values = np.array([np.nan if limit is None else limit for limit in limits])
            described = {"units": "1", "long_name": f"{long_name} accepted probability"}
            yield f"{dimension}_{name}", (dimension, values, described)


def category_probabilities(sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
    """Probability of each category of a categorical output.

    Yields
    ------
    name : str
        ``share``.
    estimate : DataArray
        Along ``category`` and ``bound``.
    """
    if not quantity.output.categories:
        return
    long_name = f"share of {quantity.output.title}"
    along = category_coordinates(quantity)
    found = category_shares(sample, quantity)
    yield "share", _array(found, CATEGORY, long_name, along, sample.level)


def category_shares(sample: Sample, quantity: QuantityOfInterest) -> Estimate:
    """Return the probabilities of the categories of an output, along a last axis."""
    return _event_probabilities(
        sample, (sample.event(operator.eq, kind) for kind in range(len(quantity.output.categories)))
    )


def category_coordinates(quantity: QuantityOfInterest) -> dict[str, Any]:
    """Return the coordinates along ``category``: the flags and the labels of the categories."""
    flags = np.array([category.flag for category in quantity.output.categories], dtype=object)
    labels = np.array([category.label for category in quantity.output.categories], dtype=object)
    return {
        CATEGORY: (CATEGORY, flags, {"long_name": "kind"}),
        f"{CATEGORY}_label": (CATEGORY, labels, {"long_name": "kind, to be read"}),
    }


def status_probabilities(runs: xr.Dataset | BlockedRuns, level: float = LEVEL) -> xr.DataArray:
    """Estimate the probability of each status but ok, along ``status`` and ``bound``."""
    return probabilities_of_statuses(sample_of_statuses(runs, level))


def probabilities_of_statuses(sample: Sample) -> xr.DataArray:
    """Estimate the same from the sample of the statuses."""
    ends = [status for status in Status if status is not Status.OK]
    estimates = [_probability(sample, sample.event(operator.eq, status)) for status in ends]
    long_name = "probability that a run ends so"
    names = np.array([status.meaning for status in ends], dtype=object)
    along = {STATUS: (STATUS, names, {"long_name": "end of a run"})}
    return _array(Estimate.stacked(estimates), STATUS, long_name, along, sample.level)


def _probability(sample: Sample, events: Column) -> Estimate:
    """Probability of an event over the runs of a sample."""
    if sample.run_weights is not None and sample.size:
        return _weighted_probability(sample, sample.run_weights, events)
    count = events.sum(axis=-1)
    value = count / sample.size if sample.size else np.full(events.shape[:-1], np.nan)
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(value, reason)
    bounds = clopper_pearson(count, sample.size, sample.level)
    label = "discrete" if sample.error_model is ErrorModel.INDEPENDENT else "conservative"
    found = Estimate(value, *bounds, texts.CLOPPER_PEARSON, label)
    has_scatter = has_enough_runs_around(sample, count)
    if sample.error_model is ErrorModel.INDEPENDENT or not has_scatter.any():
        return found
    return found.replace_at(has_scatter, _probability_by_scatter(sample, events, value))


def _probability_by_scatter(sample: Sample, events: Column, value: FloatArray) -> Estimate:
    """Probability of an event with the error that the scatter of stratified runs shows."""
    error, freedom, is_rounded = probability_error(sample, events)
    ends = student_interval(value, error, freedom, sample.level, lowest=0.0, highest=1.0)
    if sample.error_model is ErrorModel.SINGLE_STRATIFIED_SET:
        return Estimate(value, *ends, sample.residual_method, "conservative")
    label = np.where(is_rounded, "discrete", "nominal")
    return Estimate(value, *ends, texts.STUDENT_OVER_REPLICATES, label)


def _weighted_probability(sample: Sample, weights: FloatArray, events: Column) -> Estimate:
    """Probability of an event over weighted runs."""
    assert isinstance(events, np.ndarray)  # they are analysed in memory
    value, error = weighted_share(events, weights)
    if reason := sample.reason_without_intervals:
        return Estimate.without_bounds(value, reason)
    ends = weighted_probability_interval(value, error, weights, sample.level)
    is_doubtful = runs_on_a_side(weights, events) < _FEWEST_BEYOND
    note = np.where(is_doubtful, texts.DOUBTFUL_AS.format(reason=texts.FEW_WEIGHTED_BEYOND), "")
    if sample.is_reweighted:
        sizes = {"on": effective_sizes(weights * events), "off": effective_sizes(weights * ~events)}
        note = np.array("" if sample.is_at_places else texts.SIZES_OF_EVENT.format(**sizes))
    found = Estimate(value, *ends, texts.CLOPPER_PEARSON_WEIGHTED, "nominal", note)
    if sample.is_reweighted:
        is_few = ~has_enough_on_both_sides(weights, events)
        found = found.remove_bounds_at(is_few, texts.FEW_ON_A_SIDE)
    return found.remove_bounds_at((value <= 0) | (value >= 1), texts.CONSTANT_EVENT)


def _event_probabilities(sample: Sample, events: Iterable[Column]) -> Estimate:
    return Estimate.stacked([event_probability(sample, event) for event in events])


def event_probability(sample: Sample, events: Column) -> Estimate:
    """Probability of an event, its interval widened for any outcome of the missing runs.

    Parameters
    ----------
    sample : Sample
        The runs.
    events : ndarray of bool, shape (..., run), or Tally
        Whether the event happened, at any places.
    """
    found = _probability(sample, events)
    if not sample.missing.size:
        return found
    whole = sample.with_missing()
    as_none, as_all = (
        _probability(whole, sample.events_with_missing(events, happened=happened))
        for happened in (False, True)
    )
    note = texts.MISSING_RUNS.format(runs=sample.missing.size)
    widened = replace(
        found.with_method(texts.FOR_ANY_OUTCOME),
        lower=as_none.lower,
        upper=as_all.upper,
        label="conservative",
        note=found.with_note(note).note if sample.is_reweighted else note,
    )
    return found.replace_at(found.has_bounds, widened)
