"""First-order indices from any sample of the joint distribution."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import OF_CATEGORY, OF_EXCEEDANCE, OF_LOGARITHM
from uqpen.statistics import texts
from uqpen.statistics.distribution_function.probabilities import (
    category_coordinates,
    threshold_coordinates,
)
from uqpen.statistics.estimate import Estimate
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.sample_shape import SampleShape
from uqpen.statistics.sensitivity.explained_variance import LocalRegressions
from uqpen.statistics.sensitivity.input_measures import event_array, input_array
from uqpen.statistics.sensitivity.sampled_variable import SampledVariable

__all__ = ["event_first_order", "first_order", "indices_name"]


def first_order(sample: Sample, quantity: QuantityOfInterest) -> Iterator[tuple[str, xr.DataArray]]:
    """First-order indices: share of an output's variance that an input explains by itself.

    Yields
    ------
    name : str
        ``first_order``; ``log_first_order``, of the logarithm, where all values are positive;
        ``exceedance_first_order``, of the event that a threshold is exceeded, where thresholds are
        requested. For a categorical output, ``category_first_order`` alone.
    estimate : DataArray
        Along ``input`` and ``bound``; ``exceedance_first_order`` first along ``threshold``,
        ``category_first_order`` first along ``category``.
    """
    if not sample.inputs:
        return
    title = quantity.output.title
    neighbours = _Indices(sample)
    if kinds := quantity.output.categories:
        events = (sample.values == kind for kind in range(len(kinds)))
        coordinates = category_coordinates(quantity)
        yield neighbours.event_indices(events, coordinates, OF_CATEGORY, f"the kind of {title}")
        return
    yield neighbours.variable_indices(sample.values, "", title)
    if sample.size and sample.values.min() > 0:
        logarithm = np.log(sample.values)
        yield neighbours.variable_indices(logarithm, OF_LOGARITHM, f"the logarithm of {title}")
    if quantity.thresholds:
        events = (sample.values > threshold.value for threshold in quantity.thresholds)
        coordinates = threshold_coordinates(quantity)
        what = f"whether {title} exceeds a value"
        yield neighbours.event_indices(events, coordinates, OF_EXCEEDANCE, what)


def event_first_order(sample: Sample, occurs: BoolArray) -> list[Estimate]:
    """Return the first-order index of each input, of whether an event occurs in the runs.

    Parameters
    ----------
    sample : Sample
        The runs in which the event is known.
    occurs : ndarray of bool, shape (run,)
    """
    if sample.weights is not None:
        return [Estimate.without_bounds(math.nan, texts.NOT_WEIGHTED) for _ in sample.inputs]
    if not sample.size:
        reason = sample.reason_without_intervals or texts.NO_RUN
        return [Estimate.without_bounds(math.nan, reason) for _ in sample.inputs]
    own = replace(sample, values=occurs.astype(np.float64))
    return LocalRegressions(own).indices(SampledVariable(own, is_event=True)).each()


@dataclass(frozen=True)
class _Indices:
    """First-order indices of an output and of functions of it, as estimate arrays."""

    sample: Sample

    @cached_property
    def regressions(self) -> LocalRegressions:
        """The runs, put together by each of their inputs."""
        return LocalRegressions(self.sample)

    def variable_indices(
        self, values: FloatArray, prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of a variable over the runs, along ``input``."""
        has_doubtful_source = bool(SampleShape(self.sample).is_doubtful)
        is_own = values is self.sample.values
        sample = self.sample if is_own else replace(self.sample, values=values)
        variable = SampledVariable(sample, has_doubtful_source)
        estimates = self.regressions.indices(variable).each()
        name = indices_name(title, self.sample)
        array = input_array(estimates, self.sample.inputs, name, level=self.sample.level)
        return f"{prefix}first_order", array

    def event_indices(
        self, events: Iterable[BoolArray], coordinates: Mapping[str, Any], prefix: str, title: str
    ) -> tuple[str, xr.DataArray]:
        """Indices of events, given the runs in which each event occurs."""
        rows = []
        for event in events:  # of many thresholds, the runs are in memory once
            sample = replace(self.sample, values=event.astype(np.float64))
            rows.append(self.regressions.indices(SampledVariable(sample, is_event=True)).each())
        inputs, name = self.sample.inputs, indices_name(title, self.sample)
        array = event_array(rows, coordinates, inputs, name, self.sample.level)
        return f"{prefix}first_order", array


def indices_name(title: str, sample: Sample) -> str:
    """Return the meaning of the first-order indices of a variable over a sample."""
    name = f"first-order Sobol' indices of {title}"
    return f"{name}, {texts.INCLUDES_CORRELATION}" if sample.dependence else name
