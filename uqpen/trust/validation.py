"""Surrogate validation: the estimates of a surrogate that independent runs confirm.

A surrogate may fit well as a whole and yet be wrong in the one estimate that is requested: a good
Q² says little about a standard deviation that depends on the tail. So each estimate is validated by
itself, against the intervals of the same estimate from independent runs. Only runs contradict it:
that it depends on values outside the training range is no error yet, as an exact linear surrogate
of a normal output has 6 % of its variance outside the range of 200 runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import estimate_array, interval_text
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE, LOWER_THRESHOLD, THRESHOLD, Statistic, UnitRule
from uqpen.core.labels import (
    BOUND,
    CHECKED,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    MISSING,
    NOTE,
    RANK,
    REFUSED,
    UNCHECKED,
)
from uqpen.statistics.estimate import LEVEL
from uqpen.statistics.surrogate.surrogate_statistics import TrainingRange
from uqpen.trust import verdict_texts as texts
from uqpen.trust.curve_validation import validate_curve
from uqpen.trust.validation_interval import ValidationInterval, jointly_widened
from uqpen.trust.verdict import EstimateVerdict, designs_text, undecided

__all__ = ["VALIDATION_RULE", "ValidationRuns", "validate_surrogate"]

# Stands in archives, so that verdicts of another rule are known as such.
VALIDATION_RULE = "all designs at one joint level"

Outputs = Mapping[str, Mapping[str, xr.DataArray]]

# An unchecked spread is noted to be extrapolated where more than this share of the variance comes
# from values outside the training range.
_MOST_VARIANCE_BEYOND = 0.05

_SPREADS = ("std", "skewness", "kurtosis")

# Shares of a variance are read to two decimals, so differences below half a unit of the second
# contradict nothing: 0.001 against 9e-6 says of both inputs that they do not matter.
_NEGLIGIBLE_SHARE = 0.005

# Error of a probability from the draws of a surrogate that is told, as a share of it.
_TOLD_SHARE_OF_PROBABILITY = 0.05


class ValidationRuns(NamedTuple):
    """A design's runs that a surrogate is compared with, by their estimate arrays."""

    name: str
    outputs: Outputs


def validate_surrogate(
    outputs: Outputs,
    validation_runs: Sequence[ValidationRuns],
    training_ranges: Mapping[str, TrainingRange],
) -> dict[str, dict[str, xr.DataArray]]:
    """Label each estimate of a surrogate by comparison with independent runs.

    The result has the same estimates without bounds. They are labelled ``checked`` (inside the
    intervals of all runs, which are widened to hold jointly), ``refused`` (outside one of them),
    ``not comparable`` (the runs lack the failed ones) or ``unchecked`` (no runs decide).

    Parameters
    ----------
    outputs : mapping of str to mapping of str to DataArray
        The surrogate's estimate arrays by output and statistic.
    validation_runs : sequence of ValidationRuns
        Independent samples of the study; all that have an interval for an estimate count.
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
            verdict = validate_curve(self.statistics["cdf_value"], self.validation_runs)
            return _with_verdicts(array, [verdict] * array.sizes[RANK])
        known = CATALOGUE.get(name, Statistic(name, name))
        places = np.ndindex(array.shape[:-1])
        return _with_verdicts(array, [self._verdict(known, array[at]) for at in places])

    def _verdict(self, statistic: Statistic, estimate: xr.DataArray) -> EstimateVerdict:
        value, note = float(estimate.values[0]), interval_text(estimate, NOTE)
        if math.isnan(value):
            return EstimateVerdict("none", note)
        verdict = self._verdict_of_number(statistic, estimate, value)
        verdict = verdict.with_note(_sampling_note(statistic, estimate))
        # Other notes are of the interval, which is gone.
        return verdict.with_note(note if statistic.note_is_of_estimate else "")

    def _verdict_of_number(
        self, statistic: Statistic, estimate: xr.DataArray, value: float
    ) -> EstimateVerdict:
        found = list(self._intervals(statistic, estimate))
        intervals = jointly_widened([each for each in found if each.is_of_all_inputs])
        range_note = self._range_note(statistic, estimate, value)
        if not intervals:
            lacking = [each.design for each in found]
            verdict = undecided(lacking, has_runs=bool(self.validation_runs))
            return EstimateVerdict(verdict.label, range_note).with_note(verdict.note)
        # What sampling the surrogate leaves open is no fault of the surrogate's.
        low, high = np.nan_to_num(estimate.values[1:], nan=value)
        slack = _NEGLIGIBLE_SHARE if statistic.is_share_of_variance else 0.0
        outside = [each for each in intervals if not each.overlaps(low - slack, high + slack)]
        if outside:
            return EstimateVerdict(REFUSED, _outside_note(outside, len(intervals)))
        is_of_event = _threshold(estimate) is not None
        if range_note and is_of_event and not any(map(_has_event, intervals)):
            return EstimateVerdict(UNCHECKED, range_note).with_note(texts.NOT_REACHED)
        designs = [each.design for each in intervals]
        inside = texts.INSIDE if len(designs) == 1 else texts.INSIDE_JOINTLY
        note = inside.format(design=designs[0], designs=designs_text(designs))
        is_spread = statistic.name in _SPREADS
        return EstimateVerdict(CHECKED, note).with_note("" if is_spread else range_note)

    def _intervals(
        self, statistic: Statistic, estimate: xr.DataArray
    ) -> Iterator[ValidationInterval]:
        """Yield the intervals of an estimate by the validation runs."""
        for design, statistics in self.validation_runs.items():
            other = statistics.get(statistic.name)
            same = None if other is None else _same_estimate(other, estimate)
            if other is None or same is None or np.isnan(same[1:]).any():
                continue
            level = float(other.attrs.get(INTERVAL_LEVEL, LEVEL))
            is_of_all_inputs = MISSING not in other.attrs or statistic.counts_missing_runs
            at, lower, upper = map(float, same)
            yield ValidationInterval(design, at, lower, upper, level, is_of_all_inputs)

    def _range_note(self, statistic: Statistic, estimate: xr.DataArray, value: float) -> str:
        """Return the note on an estimate that depends on values outside the training range."""
        training_range = self.training_range
        if training_range is None:
            return ""
        if statistic.name in _SPREADS and training_range.variance_beyond > _MOST_VARIANCE_BEYOND:
            return texts.VARIANCE_BEYOND.format(share=100 * training_range.variance_beyond)
        threshold = _threshold(estimate)
        if threshold is None and statistic.name != "quantile":
            return ""
        at = value if threshold is None else threshold
        return "" if training_range.contains(at) else texts.EXTRAPOLATED


def _threshold(estimate: xr.DataArray) -> float | None:
    """Return the value that a probability is of; None of another statistic."""
    for dimension in (THRESHOLD, LOWER_THRESHOLD):
        if f"{dimension}_value" in estimate.coords:
            return float(estimate.coords[f"{dimension}_value"])
    return None


def _has_event(interval: ValidationInterval) -> bool:
    """Return True if the event of a probability has occurred in some runs, not in all."""
    return interval.lower > 0 and interval.upper < 1


def _outside_note(outside: Sequence[ValidationInterval], count: int) -> str:
    names = [each.design for each in outside]
    text = texts.OUTSIDE if count == 1 else texts.OUTSIDE_JOINTLY
    return text.format(design=names[0], designs=designs_text(names), count=count)


def _sampling_note(statistic: Statistic, estimate: xr.DataArray) -> str:
    """Return the note on the error of a plain number from the surrogate's draws, if it is large."""
    value, low, high = map(float, estimate.values)
    if statistic.unit is not UnitRule.NONE or math.isnan(low) or math.isnan(high):
        return ""
    told = _TOLD_SHARE_OF_PROBABILITY * min(value, 1 - value)
    if statistic.is_share_of_variance:
        told = _NEGLIGIBLE_SHARE
    is_large = max(high - value, value - low) > told
    return texts.SAMPLING_ERROR.format(lower=low, upper=high) if is_large else ""


def _same_estimate(array: xr.DataArray, estimate: xr.DataArray) -> FloatArray | None:
    """Return the entry of an estimate array with the coordinates of an estimate; None for none."""
    for dimension in array.dims[:-1]:
        called = array[dimension].values.tolist()
        wanted = estimate.coords[dimension].item()
        if wanted not in called:
            return None
        array = array[{dimension: called.index(wanted)}]
    return array.values


def _with_verdicts(array: xr.DataArray, verdicts: Sequence[EstimateVerdict]) -> xr.DataArray:
    """Return an estimate array without bounds, with what was said of each of its estimates."""
    dims = {str(dim): size for dim, size in array.sizes.items() if dim != BOUND}
    texts = {
        INTERVAL: ["none"] * len(verdicts),
        INTERVAL_LABEL: [verdict.label for verdict in verdicts],
        NOTE: [verdict.note for verdict in verdicts],
    }
    values = array.values.copy()
    values[..., 1:] = np.nan
    own = {key: each.variable for key, each in array.coords.items() if key not in texts}
    marked = estimate_array(values, dims, texts, units="", long_name="", coordinates=own)
    marked.attrs = dict(array.attrs)
    return marked
