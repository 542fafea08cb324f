"""Surrogate validation: the estimates of a surrogate that independent runs confirm.

A surrogate may fit well as a whole and yet be wrong in the one estimate that is requested: a good
Q² says little about a standard deviation that depends on the tail. So each estimate is validated by
itself, against the interval of the same estimate from independent runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import estimate_array, interval_text
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, LOWER_THRESHOLD, THRESHOLD
from uqpen.core.labels import (
    BOUND,
    CHECKED,
    INTERVAL,
    INTERVAL_LABEL,
    MISSING,
    NOTE,
    RANK,
    REFUSED,
    UNCHECKED,
)
from uqpen.statistics.surrogate.surrogate_statistics import TrainingRange

__all__ = ["ValidationRuns", "validate_surrogate"]

# Notes on validated estimates; as in `uqpen.statistics.texts`.
INSIDE = "inside the interval of {design}"
OUTSIDE = "outside the interval of {design}"
INSIDE_COMPLETED = "inside the interval of {design} (completed runs only)"
OUTSIDE_COMPLETED = "outside the interval of {design} (completed runs only)"
INSIDE_BAND = "inside the simultaneous band of {design}"
OUTSIDE_BAND = (
    "outside the simultaneous band of {design} between probabilities {lowest:.3g} and {highest:.3g}"
)
EXTRAPOLATED = "outside the training range of the surrogate"
VARIANCE_BEYOND = "{share:.0f} % of the variance is outside the training range of the surrogate"
NO_VALIDATION_RUNS = "no independent runs to compare with"
NO_VALIDATION_INTERVAL = "no independent runs give an interval for it"

Outputs = Mapping[str, Mapping[str, xr.DataArray]]

# A spread without validation runs is extrapolated where more than this share of the variance comes
# from values outside the training range.
_MOST_VARIANCE_BEYOND = 0.05

_SPREADS = ("std", "skewness", "kurtosis")


class ValidationRuns(NamedTuple):
    """A design's runs that a surrogate is compared with, by their estimate arrays."""

    name: str
    outputs: Outputs


class _Validation(NamedTuple):
    label: str
    note: str


def validate_surrogate(
    outputs: Outputs,
    validation_runs: Sequence[ValidationRuns],
    training_ranges: Mapping[str, TrainingRange],
) -> dict[str, dict[str, xr.DataArray]]:
    """Label each estimate of a surrogate by comparison with independent runs.

    The result has the same estimates without bounds, labelled ``checked`` (inside the runs'
    interval), ``refused`` (outside, or extrapolated) or ``unchecked`` (nothing to compare it with).

    Parameters
    ----------
    outputs : mapping of str to mapping of str to DataArray
        The surrogate's estimate arrays by output and statistic.
    validation_runs : sequence of ValidationRuns
        The first that has an interval for an estimate decides on it.
    training_ranges : mapping of str to TrainingRange
        By output.
    """
    found: dict[str, dict[str, xr.DataArray]] = {}
    for output, statistics in outputs.items():
        others = {runs.name: runs.outputs.get(output, {}) for runs in validation_runs}
        validation = _OutputValidation(statistics, others, training_ranges.get(output))
        found[output] = {name: validation.validate_array(name) for name in statistics}
    return found


@dataclass(frozen=True)
class _OutputValidation:
    """The estimates of one output, and those by each of the validation runs."""

    statistics: Mapping[str, xr.DataArray]
    validation_runs: Mapping[str, Mapping[str, xr.DataArray]]
    training_range: TrainingRange | None

    def validate_array(self, name: str) -> xr.DataArray:
        """Return an estimate array without its bounds, each estimate marked."""
        array = self.statistics[name]
        if BOUND not in array.dims:
            return array
        if RANK in array.dims:
            validation = self._validate_curve()
            return _with_validations(array, [validation] * array.sizes[RANK])
        places = np.ndindex(array.shape[:-1])
        return _with_validations(array, [self._validation(name, array[at]) for at in places])

    def _validation(self, name: str, estimate: xr.DataArray) -> _Validation:
        value, note = float(estimate.values[0]), interval_text(estimate, NOTE)
        if math.isnan(value):
            return _Validation("none", note)
        verdict = self._validate_estimate(name, estimate, value)
        is_of_estimate = name in CATALOGUE and CATALOGUE[name].note_is_of_estimate
        if not is_of_estimate or not note:
            return verdict  # other notes are of the interval, which is gone
        return verdict._replace(note=f"{verdict.note}; {note}")

    def _validate_estimate(self, name: str, estimate: xr.DataArray, value: float) -> _Validation:
        if self._is_extrapolated(name, estimate, value):
            return _Validation(REFUSED, EXTRAPOLATED)
        for design, statistics in self.validation_runs.items():
            other = statistics.get(name)
            same = None if other is None else _same_estimate(other, estimate)
            if other is None or same is None or np.isnan(same[1:]).any():
                continue
            # What sampling the surrogate leaves open is no fault of the surrogate's.
            low, high = np.nan_to_num(estimate.values[1:], nan=value)
            is_inside = low <= same[2] and high >= same[1]
            if MISSING in other.attrs:
                note = INSIDE_COMPLETED if is_inside else OUTSIDE_COMPLETED
            else:
                note = INSIDE if is_inside else OUTSIDE
            label = CHECKED if is_inside else REFUSED
            return _Validation(label, note.format(design=design))
        return self._unvalidated(name)

    @property
    def _unvalidated_reason(self) -> str:
        return NO_VALIDATION_INTERVAL if self.validation_runs else NO_VALIDATION_RUNS

    def _is_extrapolated(self, name: str, estimate: xr.DataArray, value: float) -> bool:
        """Return True if an estimate is at a value outside the training range."""
        values = (estimate.coords.get(f"{of}_value") for of in (THRESHOLD, LOWER_THRESHOLD))
        threshold = next((value for value in values if value is not None), None)
        if self.training_range is None or (threshold is None and name != "quantile"):
            return False
        return not self.training_range.contains(value if threshold is None else float(threshold))

    def _unvalidated(self, name: str) -> _Validation:
        """Return the label and note of an estimate for which no runs have an interval."""
        training_range = self.training_range
        if (
            training_range is None
            or name not in _SPREADS
            or training_range.variance_beyond <= _MOST_VARIANCE_BEYOND
        ):
            return _Validation(UNCHECKED, self._unvalidated_reason)
        beyond = VARIANCE_BEYOND.format(share=100 * training_range.variance_beyond)
        return _Validation(REFUSED, f"{beyond}; {self._unvalidated_reason}")

    def _validate_curve(self) -> _Validation:
        """Compare a distribution function as a whole with the runs' simultaneous band."""
        curve = self.statistics["cdf_value"]
        values, ranks = curve.values, curve[RANK].values
        for design, statistics in self.validation_runs.items():
            if "cdf_band" not in statistics:
                continue
            _, lower, upper = statistics["cdf_band"].values.T
            if np.isnan(lower).any():
                continue
            at = statistics["cdf_value"].values
            # The band is a step: between two of its values the lower end is that of the left one.
            left = np.searchsorted(at, values, side="right") - 1
            low = np.where(left >= 0, lower[np.maximum(left, 0)], 0.0)
            right = np.searchsorted(at, values, side="left")
            high = np.where(right < len(at), upper[np.minimum(right, len(at) - 1)], 1.0)
            outside = (ranks < low) | (ranks > high)
            if not outside.any():
                return _Validation(CHECKED, INSIDE_BAND.format(design=design))
            lowest, highest = ranks[outside].min(), ranks[outside].max()
            note = OUTSIDE_BAND.format(design=design, lowest=lowest, highest=highest)
            return _Validation(REFUSED, note)
        return _Validation(UNCHECKED, self._unvalidated_reason)


def _same_estimate(array: xr.DataArray, estimate: xr.DataArray) -> FloatArray | None:
    """Return the entry of an estimate array with the coordinates of an estimate; None for none."""
    for dimension in array.dims[:-1]:
        called = array[dimension].values.tolist()
        wanted = estimate.coords[dimension].item()
        if wanted not in called:
            return None
        array = array[{dimension: called.index(wanted)}]
    return array.values


def _with_validations(array: xr.DataArray, validations: Sequence[_Validation]) -> xr.DataArray:
    """Return an estimate array without bounds, with what was said of each of its estimates."""
    dims = {str(dim): size for dim, size in array.sizes.items() if dim != BOUND}
    texts = {
        INTERVAL: ["none"] * len(validations),
        INTERVAL_LABEL: [validation.label for validation in validations],
        NOTE: [validation.note for validation in validations],
    }
    values = array.values.copy()
    values[..., 1:] = np.nan
    own = {key: each.variable for key, each in array.coords.items() if key not in texts}
    marked = estimate_array(values, dims, texts, units="", long_name="", coordinates=own)
    marked.attrs = dict(array.attrs)
    return marked
