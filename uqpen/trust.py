"""The trust gate: which of a surrogate's figures independent runs bear out.

A surrogate may fit well as a whole and yet be wrong in the one figure that is asked: a good Q²
says little of a standard deviation that hangs on the tail. So each figure is judged by itself,
against the interval that independent runs give the same figure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.interval_metadata import (
    interval_metadata,
    metadata_coordinates,
    metadata_prefix,
    select_variable,
)
from uqpen.core.labels import (
    BOUND,
    CDFS,
    CHECKED,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    MISSING,
    NOTE,
    QUANTILES,
    RANK,
    REFUSED,
    SENSITIVITY,
    UNCHECKED,
)
from uqpen.statistics.surrogate.surrogate_statistics import TrainingRange

__all__ = ["ValidationRuns", "validate_surrogate"]

FloatArray = npt.NDArray[np.float64]
Groups = Mapping[str, xr.Dataset]

# A spread that no runs vouch for is extrapolated where more than this share of the variance comes
# from values beyond all outputs that the surrogate was fitted to.
_MOST_VARIANCE_BEYOND = 0.05

_SPREADS = ("std", "skewness", "kurtosis")


class ValidationRuns(NamedTuple):
    """Independent runs that a surrogate is held against.

    Attributes
    ----------
    name : str
        The design's.
    groups : mapping of str to Dataset
        What they tell, group by group.
    """

    name: str
    groups: Groups


class _Validation(NamedTuple):
    label: str
    note: str


def validate_surrogate(
    groups: Groups,
    validation_runs: Sequence[ValidationRuns],
    training_ranges: Mapping[str, TrainingRange],
) -> dict[str, xr.Dataset]:
    """A surrogate's figures, each with what independent runs say of it in place of an interval.

    Parameters
    ----------
    groups : mapping of str to Dataset
        The surrogate's figures, group by group as designs have them.
    validation_runs : sequence of ValidationRuns
        The first that has an interval for a figure decides on it.
    training_ranges : mapping of str to TrainingRange
        By output.

    Returns
    -------
    dict of str to Dataset
        The same figures without bounds, labelled ``checked`` (inside the runs' interval),
        ``refused`` (outside, or extrapolated) or ``unchecked`` (nothing to hold it against).
    """
    found = {}
    for group, dataset in groups.items():
        validation = _GroupValidation(group, validation_runs, training_ranges)
        kept = {
            str(name): validation.validate_array(
                str(name), select_variable(dataset, str(name)), dataset
            )
            for name in dataset.data_vars
        }
        found[group] = xr.Dataset(kept, attrs=dataset.attrs)
    return found


@dataclass(frozen=True)
class _GroupValidation:
    """Judges the figures of one group."""

    group: str
    validation_runs: Sequence[ValidationRuns]
    training_ranges: Mapping[str, TrainingRange]

    def validate_array(self, name: str, array: xr.DataArray, dataset: xr.Dataset) -> xr.DataArray:
        """An array without its bounds and with the verdicts on its figures."""
        if BOUND not in array.dims:
            return array
        if self.group == CDFS:
            return _with_validations(name, array, {(): self._validate_curve(name, dataset)})
        places = list(np.ndindex(array.shape[:-1]))
        return _with_validations(
            name, array, {at: self._validation(name, array[at]) for at in places}
        )

    def _validation(self, name: str, estimate: xr.DataArray) -> _Validation:
        value, note = float(estimate.values[0]), interval_metadata(estimate, NOTE)
        if math.isnan(value):
            return _Validation("none", note)
        verdict = self._validate_estimate(name, estimate, value)
        if self.group != SENSITIVITY or not note:
            return verdict  # what is said of moments and quantiles is of their intervals
        return verdict._replace(note=f"{verdict.note}; {note}")

    def _validate_estimate(self, name: str, estimate: xr.DataArray, value: float) -> _Validation:
        if self._is_extrapolated(name, estimate, value):
            return _Validation(REFUSED, "beyond all outputs that the surrogate was fitted to")
        for validation in self.validation_runs:
            same = _same_estimate(validation.groups.get(self.group, xr.Dataset()), name, estimate)
            if same is None or np.isnan(same[1:]).any():
                continue
            interval = f"the interval that {validation.name} gives it"
            if MISSING in validation.groups[self.group].attrs:
                interval += " of the runs that came back"
            # What sampling the surrogate leaves open is no fault of the surrogate's.
            low, high = np.nan_to_num(estimate.values[1:], nan=value)
            is_inside = low <= same[2] and high >= same[1]
            if is_inside:
                return _Validation(CHECKED, f"inside {interval}")
            return _Validation(REFUSED, f"outside {interval}")
        return self._unvalidated(name)

    @property
    def _unvalidated_reason(self) -> str:
        if not self.validation_runs:
            return "no independent runs to hold it against"
        return "no independent runs have an interval for it"

    def _is_extrapolated(self, name: str, estimate: xr.DataArray, value: float) -> bool:
        """Whether a figure is of a place that the training runs did not reach."""
        output, training_range = self._training_range(name)
        threshold = estimate.coords.get(f"{output}_threshold_value")
        if training_range is None or (threshold is None and self.group != QUANTILES):
            return False
        return not training_range.contains(value if threshold is None else float(threshold))

    def _unvalidated(self, name: str) -> _Validation:
        """On a figure that no runs have an interval for."""
        output, training_range = self._training_range(name)
        is_spread = name.removeprefix(f"{output}_") in _SPREADS
        if (
            training_range is None
            or not is_spread
            or training_range.variance_beyond <= _MOST_VARIANCE_BEYOND
        ):
            return _Validation(UNCHECKED, self._unvalidated_reason)
        share = f"{100 * training_range.variance_beyond:.0f} % of the variance"
        return _Validation(
            REFUSED,
            f"{share} lies beyond all outputs that the surrogate was fitted to, and "
            f"{self._unvalidated_reason}",
        )

    def _training_range(self, name: str) -> tuple[str, TrainingRange | None]:
        """The output that a variable is of: the longest that its name begins with."""
        known = [
            each for each in self.training_ranges if name == each or name.startswith(f"{each}_")
        ]
        output = max(known, key=len, default="")
        return output, self.training_ranges.get(output)

    def _validate_curve(self, name: str, dataset: xr.Dataset) -> _Validation:
        """On a distribution function as a whole: it must stay in the runs' simultaneous band."""
        output = name.removesuffix("_probability").removesuffix("_band")
        values, ranks = dataset[output].values, dataset[RANK].values
        for validation in self.validation_runs:
            curves = validation.groups.get(CDFS, xr.Dataset())
            if f"{output}_band" not in curves:
                continue
            _, lower, upper = curves[f"{output}_band"].values.T
            if np.isnan(lower).any():
                continue
            at = curves[output].values
            # The band is a step: between two of its values the lower end is that of the left one.
            left = np.searchsorted(at, values, side="right") - 1
            low = np.where(left >= 0, lower[np.maximum(left, 0)], 0.0)
            right = np.searchsorted(at, values, side="left")
            high = np.where(right < len(at), upper[np.minimum(right, len(at) - 1)], 1.0)
            outside = (ranks < low) | (ranks > high)
            if not outside.any():
                return _Validation(CHECKED, f"inside the simultaneous band of {validation.name}")
            ends = ranks[outside]
            where = f"from {ends.min():.3g} to {ends.max():.3g}"
            return _Validation(
                REFUSED, f"outside the simultaneous band of {validation.name} {where}"
            )
        return _Validation(UNCHECKED, self._unvalidated_reason)


def _same_estimate(dataset: xr.Dataset, name: str, estimate: xr.DataArray) -> FloatArray | None:
    """The bounds that another source gives the same figure."""
    if name not in dataset:
        return None
    array = dataset[name]
    for dimension in array.dims[:-1]:
        called = array[dimension].values.tolist()
        wanted = estimate.coords[dimension].item()
        if wanted not in called:
            return None
        array = array[{dimension: called.index(wanted)}]
    bounds: FloatArray = array.values
    return bounds


def _with_validations(
    name: str, array: xr.DataArray, verdicts: Mapping[tuple[int, ...], _Validation]
) -> xr.DataArray:
    """An array without bounds and with a verdict on each of its figures, or one on all."""
    marked = array.copy()
    marked[{BOUND: slice(1, None)}] = np.nan
    shape = {str(key): size for key, size in array.sizes.items() if key != BOUND}
    prefix = metadata_prefix(name, list(shape), array.coords)
    if () in verdicts or not prefix:
        (verdict,) = verdicts.values()
        marked.attrs.pop(INTERVAL_LEVEL, None)
        marked.attrs |= {INTERVAL: "none", INTERVAL_LABEL: verdict.label, NOTE: verdict.note}
        return marked
    texts = {
        INTERVAL: ["none"] * len(verdicts),
        INTERVAL_LABEL: [verdict.label for verdict in verdicts.values()],
        NOTE: [verdict.note for verdict in verdicts.values()],
    }
    return marked.assign_coords(metadata_coordinates(prefix, shape, texts))
